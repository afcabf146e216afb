"""Software vehicles in a room with cameras: their true poses, from their own logs, through a small OptiTrack server.

The host then tracks one as it would track a vehicle: the same client in the same child process, the same checks, and
the external poses fly it (parameter sil.pose_source = 1). Several vehicles are as many rigid bodies in each frame. For
real time; in lock-step time is not that of cameras.

    room = SimulatedRoom(session_1, "cf1")
    room.track(session_2, "cf2")
    first, second = (Mocap(config, s.cf.extpos, room.request(config)) for s, config in ...)
"""

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


class Viewer(Protocol):
    """Whoever gets the frames: a server of a tracking system, or a program that looks itself."""

    def send(self, frame: dict[str, list[float] | None]) -> None:
        """Take a frame: the pose of each body, None if it is not seen."""
        ...

    def close(self) -> None:
        """No frame comes any more."""
        ...


class SimulatedRoom:
    """Cameras around software vehicles. Faults are attributes that can be set at any time."""

    def __init__(self, link: Link, body: str, noise_m: float = 1e-4, seed: int = 0) -> None:
        """Begin to track a vehicle.

        Args:
            link: Open session with a software vehicle.
            body: Name of the rigid body.
            noise_m: Standard deviation of each coordinate, as cameras have it; poses never repeat to the last bit.
            seed: Of the noise.

        Raises:
            LinkError: The vehicle tells no true pose; it is no software vehicle.
        """
        self.frozen = False
        """The cameras repeat their last frame."""
        self.occluded = False
        """They see no body."""
        self.silent = False
        """They send nothing."""
        self.shift_m = (0.0, 0.0, 0.0)
        """They take something else for each body, so far away."""
        self.swapped: tuple[str, str] | None = None
        """They take these two bodies for each other."""
        self._noise_m, self._rng = noise_m, np.random.default_rng(seed)
        self._lock = threading.Lock()
        self._closed = False
        self.time_s = 0.0
        """Time of the first vehicle at its last row, from an arbitrary zero."""
        self._time_ms: int | None = None
        self._viewers: list[Viewer] = []
        self._frame: dict[str, list[float] | None] = {}
        self._last: dict[str, list[float]] = {}
        self.track(link, body)

    def track(self, link: Link, body: str) -> None:
        """Follow a further vehicle; before `request`, since cameras say which bodies they know when they are asked.

        Args:
            link: Open session with that vehicle.
            body: Name of its rigid body.

        Raises:
            LinkError: It is no software vehicle, or the name is another vehicle's.
        """
        if not link.has_log(_POSITION[0]):
            raise LinkError(f"{link.uri}: system simulator: the vehicle has no log variable {_POSITION[0]}")
        if body in self._frame:
            raise LinkError(f"{link.uri}: system simulator: body {body} is another vehicle")
        with self._lock:
            self._frame[body] = None
        link.listen(_PORT_LOG, _DATA, lambda data: self._on_data(body, data))
        self._start_log(link)

    def request(self, config: MocapConfig) -> dict[str, Any]:
        """What the process of a `Mocap` is told, to connect to these cameras; one call for each."""
        server = NatNetServer(tuple(self._frame))
        with self._lock:
            self._viewers.append(server)
        return {"system": "optitrack", "options": server.options, "connect_s": config.connect_s}

    def show(self, viewer: Viewer) -> None:
        """Let somebody in this process see each frame, in the link's thread."""
        with self._lock:
            self._viewers.append(viewer)

    def close(self) -> None:
        """Switch the cameras off."""
        with self._lock:
            self._closed = True
        for viewer in self._viewers:
            viewer.close()

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

    def _on_data(self, body: str, data: bytes) -> None:
        """In the link's thread: a row of the true pose of one vehicle."""
        if len(data) != _HEAD + _LAYOUT.size or data[0] != _BLOCK:
            return
        with self._lock:
            if self._closed:
                return
            if body == next(iter(self._frame)):
                self._note_time(int.from_bytes(data[1:4], "little"))
            if self._frame[body] is not None:  # it is here again before another has come once
                self._send()
            self._frame[body] = self._see(body, _LAYOUT.unpack(data[_HEAD:]))
            if all(pose is not None for pose in self._frame.values()):
                self._send()

    def _note_time(self, now_ms: int) -> None:
        """The stamp of a log packet has 24 bits, and wraps."""
        before_ms = now_ms if self._time_ms is None else self._time_ms
        self.time_s += ((now_ms - before_ms) & 0xFF_FFFF) * 1e-3
        self._time_ms = now_ms

    def _see(self, body: str, truth: tuple[float, ...]) -> list[float]:
        """What the cameras make of a body's pose."""
        if body not in self._last or not self.frozen:
            noise = self._rng.normal(0.0, self._noise_m, 3)
            seen = [v + float(n) + s for v, n, s in zip(truth, noise, self.shift_m, strict=False)]
            self._last[body] = seen + list(truth[3:])
        return self._last[body]

    def _send(self) -> None:
        """One frame with what has come since the last: each pose of each vehicle is in exactly one."""
        frame, self._frame = self._frame, dict.fromkeys(self._frame)
        if self.silent:
            return
        if self.occluded:
            frame = dict.fromkeys(frame)
        if self.swapped is not None:
            a, b = self.swapped
            frame[a], frame[b] = frame[b], frame[a]
        for viewer in self._viewers:
            viewer.send(frame)
