"""A vehicle of a hundred lines for tests of the link alone: it answers, and does wrong things on demand.

The software vehicle (`ivl sil`) never sends a malformed or a wrong answer; this one can. It knows nothing of flying.
"""

import random
import socket
import struct
import threading
import zlib
from collections.abc import Callable
from typing import Any

PARAM_CODE = {"<B": 0x08, "<H": 0x09, "<L": 0x0A, "<f": 0x06, "<d": 0x07}
LOG_CODE = {"<B": 1, "<H": 2, "<L": 3, "<f": 7}
Reply = tuple[int, int, bytes]


class FakeVehicle:
    """Serves parameters, log variables, memories and an app on a UDP port of this machine."""

    def __init__(self, params: dict[str, tuple[str, float]], logs: dict[str, str] | None = None) -> None:
        self.params = {name: list(item) for name, item in params.items()}
        self.logs = logs or {"sil.time_ms": "<L"}
        self.memories: dict[int, bytes] = {}
        self.app: Callable[[bytes], list[bytes]] = lambda _: []
        self.loss = 0.0
        self.duplicate = False
        self.muted = False
        self.version = 12
        self.change: Callable[[Reply], list[Reply]] = lambda reply: [reply]
        self.n_received: dict[tuple[int, int], int] = {}
        self._random = random.Random(1)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.02)
        self._client: Any = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    @property
    def uri(self) -> str:
        return f"udp://127.0.0.1:{self._socket.getsockname()[1]}"

    def __enter__(self) -> "FakeVehicle":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._socket.close()

    def tell(self, port: int, channel: int, data: bytes) -> None:
        """Send to the last client, unless it is lost."""
        for out_port, out_channel, out in self.change((port, channel, data)):
            for _ in range(2 if self.duplicate else 1):
                if self._random.random() >= self.loss:
                    self._socket.sendto(bytes((out_port << 4 | out_channel,)) + out, self._client)

    def _serve(self) -> None:
        while not self._stop.is_set():
            try:
                packet, self._client = self._socket.recvfrom(64)
            except TimeoutError:
                continue
            if self.muted or self._random.random() < self.loss:
                continue
            port, channel, data = packet[0] >> 4, packet[0] & 3, packet[1:]
            self.n_received[port, channel] = self.n_received.get((port, channel), 0) + 1
            for reply in self._answer(port, channel, data):
                self.tell(port, channel, reply)

    def _answer(self, port: int, channel: int, data: bytes) -> list[bytes]:
        if (port, channel) == (15, 1):
            return [b"Bitcraze Crazyflie".ljust(30, b"\0")]
        if (port, channel) == (15, 0):
            return [data]
        if (port, channel) == (13, 1):
            return [struct.pack("<BL", 0, self.version)]
        if (port, channel) == (13, 2):
            return self.app(data)
        if port == 5 and channel == 1:
            return [data[:2].ljust(2, b"\0") + b"\0"]
        if port in (2, 5) and channel == 0:
            return [self._toc(port, data)]
        if port == 4:
            return [self._memory(channel, data)]
        return self._param(channel, data) if port == 2 else []

    def _toc(self, port: int, data: bytes) -> bytes:
        table = {n: LOG_CODE[f] for n, f in self.logs.items()} if port == 5 else {
            n: PARAM_CODE[f] for n, (f, _) in self.params.items()
        }  # fmt: skip
        rows = [bytes((code,)) + name.replace(".", "\0").encode() + b"\0" for name, code in table.items()]
        if data[0] == 3:
            return struct.pack("<BHLBB", 3, len(rows), zlib.crc32(b"".join(rows) + bytes((port,))), 16, 128)
        return data[:3] + rows[struct.unpack("<H", data[1:3])[0]]

    def _param(self, channel: int, data: bytes) -> list[bytes]:
        name = list(self.params)[struct.unpack("<H", data[:2])[0]]
        form, value = self.params[name]
        if channel == 1:
            return [data[:2] + b"\0" + struct.pack(form, value)]
        self.params[name][1] = struct.unpack(form, data[2:])[0]
        return [data]

    def _memory(self, channel: int, data: bytes) -> bytes:
        kinds = list(self.memories)
        if channel == 0:
            if data[0] == 1:
                return bytes((1, len(kinds)))
            kind = kinds[data[1]]
            return struct.pack("<BBBL8x", 2, data[1], kind, len(self.memories[kind]))
        number, address, size = struct.unpack("<BLB", data)
        return data[:5] + b"\0" + self.memories[kinds[number]][address : address + size]
