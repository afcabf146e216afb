"""Starts, reads and ends the process that talks to the tracking system."""

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ivl.errors import LinkError
from ivl.mocap.config import MocapConfig

_CHILD = Path(__file__).parent / "child.py"
_READ_BYTES = 65536
_END_S = 2.0
_LINE_BYTES_MAX = 1 << 20


@dataclass(frozen=True)
class Frame:
    """What a tracking system saw at once.

    Attributes:
        t_s: When the frame came, monotonic clock.
        bodies: Name -> x, y, z (m), qx, qy, qz, qw, in the axes of the tracking system.
    """

    t_s: float
    bodies: Mapping[str, list[float]]


def request_of(config: MocapConfig) -> dict[str, Any]:
    """What the process is told.

    Raises:
        LinkError: The name of a computer cannot be resolved.
    """
    host = config.host
    if config.system == "optitrack":  # its client takes addresses only
        try:
            host = socket.gethostbyname(host)
        except OSError as error:
            raise LinkError(f"motion capture: host: value {host!r} cannot be found: {error.strerror}") from error
    options = {**({"hostname": host} if host else {}), **config.options}
    return {"system": config.system, "options": options, "connect_s": config.connect_s}


class Tracker:
    """The process and its frames; all methods are for one thread."""

    def __init__(self, request: Mapping[str, Any]) -> None:
        """Start it.

        Args:
            request: See `request_of`.
        """
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (lives as long as the process)
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(_CHILD)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._out = self._process.stdout
        os.set_blocking(self._out.fileno(), False)
        self._process.stdin.write(json.dumps(request).encode() + b"\n")
        self._process.stdin.flush()
        self._rest = b""
        self._connect_s = float(request["connect_s"])
        self.n_strange = 0
        """Lines that were no event: a client printed where it must not, or is damaged."""
        self.failure = ""
        """Why there will be no more frames; empty while there may be."""

    def poll(self, timeout_s: float) -> list[Frame]:
        """Frames that have come; waits for the first at most so long."""
        if self.failure:
            time.sleep(timeout_s)
            return []
        ready, _, _ = select.select([self._out], [], [], timeout_s)
        if not ready:
            return []
        data = self._out.read(_READ_BYTES)
        if data == b"":
            self._explain_end()
            return []
        *lines, self._rest = (self._rest + (data or b"")).split(b"\n")
        if len(self._rest) > _LINE_BYTES_MAX:
            self.n_strange, self._rest = self.n_strange + 1, b""
        return [frame for line in lines if (frame := self._frame(line)) is not None]

    def close(self) -> None:
        """End the process, whatever it does."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        try:
            self._process.wait(timeout=0.1)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(timeout=_END_S)
        self._out.close()
        self._errors.close()

    def _frame(self, line: bytes) -> Frame | None:
        """The frame of a line; None if it is another event, or nothing that the process would say."""
        try:
            event = dict(json.loads(line))
            if "error" in event:
                self.failure = str(event["error"])
            if "bodies" not in event:
                return None
            bodies = {str(name): [_number(v) for v in values] for name, values in event["bodies"].items()}
            return Frame(_time(event["t_s"]), bodies)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError):
            self.n_strange += 1
            return None

    def _explain_end(self) -> None:
        code = self._process.wait(timeout=_END_S)
        if code == -signal.SIGALRM:
            self.failure = f"no frame within {self._connect_s:g} s"
            return
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip().splitlines()
        what = f"signal {-code}" if code < 0 else f"exit code {code}"
        self.failure = self.failure or f"its client ended with {what}" + (f": {said[-1]}" if said else "")


def _number(value: Any) -> float:
    """A number as the process writes it, which may be none (NaN): a pose of such numbers is unusable.

    Raises:
        TypeError: It is something else.
        OverflowError: It has too many digits.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError
    return float(value)


def _time(value: Any) -> float:
    """When a frame came: a frame of the future would count as fresh for as long as that is away.

    Raises:
        TypeError, OverflowError: See `_number`.
        ValueError: No such time has been.
    """
    t_s = _number(value)
    if not 0.0 <= t_s <= time.monotonic():
        raise ValueError
    return t_s
