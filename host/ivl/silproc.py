"""The software vehicle as a process: a CRTP server on UDP that cflib, cfclient and any other CRTP tool can connect to.

`SilProcess` starts the program `ivl_sil` on a free port and stops it again; with its control channel, which no fault of
the link touches, tests and hosts read and write parameters, inject faults and freeze it.

    with SilProcess(World("crazyflie21"), speed=10.0) as sil:
        with SyncCrazyflie(sil.uri) as scf:
            ...
"""

import contextlib
import os
import re
import socket
import subprocess
import tempfile
import threading
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from ivl import native
from ivl.errors import ConfigError, LinkError, NativeError
from ivl.world import World

SERVER_ENV = "IVL_NATIVE_SERVER"  # another build of the program, for example one with sanitizers
DEFAULT_SERVER = Path(native.__file__).parent / "_native" / "ivl_sil"
_STARTED_S, _STOPPED_S, _CONTROL_S = 60.0, 20.0, 20.0  # of use only when something is broken: a busy machine is none
_ANNOUNCED = re.compile(r"vehicle (\d+): (udp://\S+:(\d+)) control (\S+):(\d+)\n")


def server_path() -> Path:
    """The program.

    Raises:
        NativeError: It has not been built.
    """
    path = Path(os.environ.get(SERVER_ENV, DEFAULT_SERVER))
    if not path.is_file():
        raise NativeError(f"{path} is missing: run `make build` in the source tree")
    return path


def model_text(world: World) -> str:
    """The world's parameters as the program reads them: exact, in the library's order, with a check sum.

    Raises:
        ConfigError: The world has a camera that is rendered.
    """
    if world.params.values["camera.rate"] > 0.0:
        raise ConfigError(
            f"sensors {world.sensing}: pictures are rendered in process only; fly a noise model: aideck60_panels"
        )
    lines = ["ivl_sil_model 1"]
    lines += [f"{name} {value.hex()}" for name, value in world.params.values.items()]
    body = "\n".join(lines) + "\n"
    return f"{body}end {len(world.params.values)} {zlib.crc32(body.encode()):08x}\n"


class SilProcess:
    """One or more software vehicles in processes of their own, for as long as the context lasts.

    Attributes:
        uris: Address of each vehicle, as cflib takes it.
    """

    def __init__(
        self,
        world: World,
        *,
        speed: float | None = 1.0,
        lockstep: bool = False,
        vehicles: int = 1,
        seed: int = 0,
        port: int = 0,
        bind: str = "127.0.0.1",
        faults: Mapping[str, float] | None = None,
        decks: Sequence[str] = (),
    ) -> None:
        """Say what is to be started.

        Args:
            world: Vehicle, gear and overrides.
            speed: Multiple of real time; None is as fast as possible.
            lockstep: Time stands still until the client asks for more.
            vehicles: How many, each on a port of its own.
            seed: Of the sensors' noise; vehicle n has seed + n.
            port: UDP port of the first vehicle; 0 takes free ones.
            bind: Address to listen on.
            faults: Faults of the link by name, for example `{"loss": 0.05}`.
            decks: Names of the decks on board; none given: that with which the program starts, a flow deck.
        """
        self._model = model_text(world)
        self._vehicles, self._port = vehicles, port
        self._arguments = ["--speed", "max" if speed is None else repr(speed), "--seed", str(seed)]
        self._arguments += ["--bind", bind]
        self._arguments += ["--lockstep"] if lockstep else []
        for name, value in (faults or {}).items():
            self._arguments += ["--fault", f"{name}={value!r}"]
        for deck in decks:
            self._arguments += ["--deck", deck]
        self._process: subprocess.Popen[str] | None = None
        self._errors: IO[str] | None = None
        self._control: dict[int, tuple[str, int]] = {}
        self.uris: list[str] = []

    @property
    def uri(self) -> str:
        """Address of the first vehicle."""
        return self.uris[0]

    @property
    def pid(self) -> int:
        """Process id of the program."""
        return self._running().pid

    def __enter__(self) -> Self:
        """Start."""
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop."""
        self.stop()

    def start(self) -> None:
        """Start the program and wait until it listens; after a `kill` on the same ports as before.

        Raises:
            LinkError: It did not start; the message is its own.
            NativeError: It has not been built.
        """
        if self._process is not None:
            raise LinkError("the software vehicle runs already")
        command = [str(server_path()), "--model", "-", "--control", "0", "--vehicles", str(self._vehicles)]
        command += ["--port", str(self._port), *self._arguments]
        self._errors = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, text=True
        )
        watchdog = threading.Timer(_STARTED_S, self._process.kill)
        watchdog.start()
        try:
            self._read_ports(self._process)
        except BaseException:
            self.kill()
            raise
        finally:
            watchdog.cancel()

    def _read_ports(self, process: subprocess.Popen[str]) -> None:
        if process.stdin is None or process.stdout is None:
            raise LinkError("the software vehicle has no pipes")
        try:
            process.stdin.write(self._model)
            process.stdin.close()
        except BrokenPipeError:
            raise LinkError(self._last_words()) from None
        uris: dict[int, str] = {}
        while len(uris) < self._vehicles:
            line = process.stdout.readline()
            match = _ANNOUNCED.fullmatch(line)
            if match is None:
                raise LinkError(self._last_words() if line == "" else f"ivl_sil said {line!r}")
            uris[int(match[1])] = match[2]
            self._control[int(match[1])] = (match[4], int(match[5]))
            if self._vehicles == 1:
                self._port = int(match[3])
        self.uris = [uris[n] for n in sorted(uris)]

    def _last_words(self) -> str:
        if self._errors is None:
            return "ivl_sil did not start"
        self._errors.seek(0)
        return self._errors.read().strip() or f"ivl_sil did not start within {_STARTED_S:g} s"

    def stop(self) -> None:
        """Ask the program to end, and see to it that it does.

        Raises:
            LinkError: It had ended by itself, or with an error.
        """
        self._end(ask=True)

    def kill(self) -> None:
        """End the program at once, as a crash would; `start` starts it again at the same address."""
        self._end(ask=False)

    def _end(self, ask: bool) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        if ask:
            process.terminate()
        else:
            process.kill()
        try:
            code = process.wait(_STOPPED_S)
        except subprocess.TimeoutExpired:
            process.kill()
            code = process.wait()
        words = self._last_words() if code not in (0, -9) else ""
        for stream in (process.stdin, process.stdout, self._errors):
            if stream is not None:
                with contextlib.suppress(BrokenPipeError):  # what it did not read
                    stream.close()
        self._errors = None
        if ask and code != 0:
            raise LinkError(f"ivl_sil ended with code {code}: {words}")

    def _running(self) -> "subprocess.Popen[str]":
        if self._process is None:
            raise LinkError("the software vehicle does not run")
        return self._process

    def get(self, name: str, vehicle: int = 0) -> float:
        """Value of a parameter or log variable, over the control channel.

        Raises:
            LinkError: There is none of that name, or no answer.
        """
        return float(self._ask(name, vehicle))

    def set(self, name: str, value: float, vehicle: int = 0) -> float:
        """Write a parameter over the control channel; returns what it is afterwards (errors as `get`)."""
        return float(self._ask(f"{name}={value!r}", vehicle))

    def _ask(self, line: str, vehicle: int) -> str:
        self._running()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
            channel.settimeout(_CONTROL_S)
            try:
                channel.connect(self._control[vehicle])
                channel.send(line.encode("ascii"))
                reply = channel.recv(400).decode("ascii")
            except OSError as error:
                raise LinkError(f"control channel of vehicle {vehicle}: {line}: {error}") from error
        _, separator, value = reply.partition("=")
        if reply.startswith("error:") or not separator:
            raise LinkError(f"control channel of vehicle {vehicle}: {reply}")
        return value
