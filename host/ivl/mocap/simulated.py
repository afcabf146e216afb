"""The software vehicle in a room with cameras: its true pose, from its own log, through a small OptiTrack server.

The host then tracks it as it would track a vehicle: the same client in the same child process, the same checks, and the
external poses fly it (parameter sil.pose_source = 1). For real time; in lock-step time is not that of cameras.
"""

import contextlib
import struct
import threading
from typing import Any, Protocol, Self

import numpy as np

from ivl.errors import LinkError
from ivl.mocap.config import MocapConfig
from ivl.mocap.natnet import NatNetServer

_PORT_LOG, _CONTROL, _DATA = 5, 1, 2
_CREATE, _START = 6, 3
_BLOCK = 250
"""Number of our log block, far from those that a session counts up from 1."""
_PERIOD_10MS = 1
_FLOAT, _HALF = 0x7, 0x8
_POSITION, _ATTITUDE = ("simTruth.x", "simTruth.y", "simTruth.z"), ("qx", "qy", "qz", "qw")
_LAYOUT = struct.Struct("<3f4e")
_HEAD = 4


class Link(Protocol):
    """What is needed of `ivl.links.tables.Session`."""

    uri: str
    cf: Any

    def has_log(self, name: str) -> bool:
        """Whether the vehicle has this log variable."""
        ...

    def write(self, values: dict[str, float]) -> None:
        """Write parameters."""
        ...

    def ask(self, port: int, channel: int, data: bytes, answer: bytes, what: str) -> bytes:
        """Send until an answer comes that begins with `answer`."""
        ...

    def listen(self, port: int, channel: int, listener: Any) -> None:
        """Call `listener` with the data of each packet."""
        ...


class SimulatedRoom:
    """Cameras around a software vehicle. Faults are attributes that can be set at any time."""

    def __init__(self, link: Link, body: str, noise_m: float = 1e-4, seed: int = 0) -> None:
        """Begin to track.

        Args:
            link: Open session with a software vehicle.
            body: Name of the rigid body.
            noise_m: Standard deviation of each coordinate, as cameras have it; poses never repeat to the last bit.
            seed: Of the noise.

        Raises:
            LinkError: The vehicle tells no true pose; it is no software vehicle.
        """
        if not link.has_log(_POSITION[0]):
            raise LinkError(f"{link.uri}: system simulator: the vehicle has no log variable {_POSITION[0]}")
        self.server = NatNetServer([body])
        self.frozen = False
        """The cameras repeat their last frame."""
        self.occluded = False
        """They do not see the body."""
        self.silent = False
        """They send nothing."""
        self.shift_m = (0.0, 0.0, 0.0)
        """They take something else for the body, so far away."""
        self._body, self._noise_m, self._rng = body, noise_m, np.random.default_rng(seed)
        self._last: list[float] | None = None
        self._closing = threading.Event()
        link.listen(_PORT_LOG, _DATA, self._on_data)
        self._start_log(link)

    def request(self, config: MocapConfig) -> dict[str, Any]:
        """What the process of a `Mocap` is told, to connect to these cameras."""
        return {"system": "optitrack", "options": self.server.options, "connect_s": config.connect_s}

    def close(self) -> None:
        """Switch the cameras off."""
        self._closing.set()
        self.server.close()

    def __enter__(self) -> Self:
        """The room itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def _start_log(self, link: Link) -> None:
        toc = link.cf.log.toc.toc["simTruth"]
        items = [(_FLOAT | _FLOAT << 4, toc[name.partition(".")[2]].ident) for name in _POSITION]
        items += [(_HALF | _FLOAT << 4, toc[name].ident) for name in _ATTITUDE]
        create = bytes((_CREATE, _BLOCK)) + b"".join(struct.pack("<BH", *item) for item in items)
        for data in (create, bytes((_START, _BLOCK, _PERIOD_10MS))):
            link.ask(_PORT_LOG, _CONTROL, data, data[:2], "log block of the true pose")

    def _on_data(self, data: bytes) -> None:
        """In the link's thread: a row of the true pose."""
        if len(data) != _HEAD + _LAYOUT.size or data[0] != _BLOCK or self.silent or self._closing.is_set():
            return
        if self._last is None or not self.frozen:
            values = _LAYOUT.unpack(data[_HEAD:])
            noise = self._rng.normal(0.0, self._noise_m, 3)
            self._last = [v + float(n) + s for v, n, s in zip(values, noise, self.shift_m, strict=False)]
            self._last += list(values[3:])
        with contextlib.suppress(OSError):  # closed in this moment
            self.server.send({self._body: None if self.occluded else self._last})
