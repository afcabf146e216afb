"""A small OptiTrack server: enough of NatNet 3.0, unicast, for one client that follows rigid bodies.

Not for a real client of another kind: marker sets, skeletons and devices are always empty.
"""

import socket
import struct
import threading
import time
from collections.abc import Mapping, Sequence

_CONNECT, _SERVER_INFO, _ASK_MODEL, _MODEL, _FRAME = 0, 1, 4, 5, 7
_VERSION = bytes((3, 0, 0, 0))
_CLOCK_HZ = 1_000_000
_RIGID_BODY = 1
_POLL_S = 0.05

PoseValues = Sequence[float]
"""x, y, z (m), qx, qy, qz, qw."""


class NatNetServer(threading.Thread):
    """Answers questions in a thread; frames are sent by whoever calls `send`."""

    def __init__(self, names: Sequence[str], address: str = "127.0.0.1") -> None:
        """Serve bodies of these names on free ports."""
        super().__init__(name="ivl-natnet", daemon=True)
        self._names = list(names)
        self._command = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._command.bind((address, 0))
        self._command.settimeout(_POLL_S)
        self._data = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._target = (address, _free_port(address))
        self._ended = threading.Event()
        self._n_frames = 0
        self.start()

    @property
    def options(self) -> dict[str, str]:
        """What the client of `motioncapture` needs to find this server."""
        host, port = self._command.getsockname()
        return {"hostname": host, "interface_ip": host, "port_command": str(port)}

    def send(self, bodies: Mapping[str, PoseValues | None]) -> None:
        """Send one frame; None stands for a body that is not seen."""
        self._n_frames += 1
        now = int(time.monotonic() * _CLOCK_HZ)
        rigid = b"".join(
            struct.pack("<i8fh", self._names.index(name), *(values or (0.0,) * 7), 0.0, values is not None)
            for name, values in bodies.items()
        )
        body = struct.pack("<4i", self._n_frames, 0, 0, len(bodies)) + rigid
        # skeletons, labelled markers, force plates, devices; time code; time stamps; flags; end
        body += struct.pack("<4i2Id3Qhi", 0, 0, 0, 0, 0, 0, now / _CLOCK_HZ, now, now, now, 0, 0)
        self._data.sendto(struct.pack("<2H", _FRAME, len(body)) + body, self._target)

    def run(self) -> None:
        """Answer questions until closed."""
        while not self._ended.is_set():
            try:
                question, client = self._command.recvfrom(64)
            except TimeoutError:
                continue
            if len(question) >= 4:
                answer = self._answer(struct.unpack_from("<H", question)[0])
                if answer:
                    self._command.sendto(answer, client)

    def close(self) -> None:
        """End the thread."""
        self._ended.set()
        self.join()
        self._command.close()
        self._data.close()

    def _answer(self, question: int) -> bytes:
        if question == _CONNECT:
            info = b"ivl".ljust(256, b"\0") + _VERSION + _VERSION
            info += struct.pack("<QH?4sx", _CLOCK_HZ, self._target[1], False, bytes(4))
            return struct.pack("<2H", _SERVER_INFO, len(info)) + info
        if question == _ASK_MODEL:
            rows = [
                struct.pack("<i", _RIGID_BODY) + name.encode() + b"\0" + struct.pack("<2i3fi", i, -1, 0.0, 0.0, 0.0, 0)
                for i, name in enumerate(self._names)
            ]
            model = struct.pack("<i", len(rows)) + b"".join(rows)
            return struct.pack("<2H", _MODEL, len(model)) + model
        return b""


def _free_port(address: str) -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((address, 0))
        return int(probe.getsockname()[1])
