"""A vehicle of the bench: as much of CRTP as cflib needs, with a memory of every packet that came."""

import socket
import struct
import threading
import time

PARAMS = [("bench", f"p{i:02d}", "<f", 0x06) for i in range(20)] + [("bench", "ro", "<B", 0x48)]
LOGS = (
    [("stateEstimate", "z", 7), ("stateEstimate", "vz", 7), ("pm", "vbat", 7), ("ivl", "phase", 1), ("ivl", "rule", 1)]
    + [("ivl", "cause", 1), ("ivl", "rrev", 7), ("ivl", "d_ceil", 7)]
    + [("bench", f"u{i:02d}", 1) for i in range(26)]
)
VALUES = {"z": 1.25, "vz": -0.5, "vbat": 3.9, "phase": 2, "rule": 0, "cause": 7, "rrev": 4.5, "d_ceil": 0.75}
SIZES = {1: "<B", 7: "<f"}


def value_of(name: str) -> float:
    return VALUES[name] if name in VALUES else int(name[1:]) + 100


class Vehicle(threading.Thread):
    """Serves one client at a time, on a free port of the loopback."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.002)
        self.port = self.socket.getsockname()[1]
        self.received: list[bytes] = []
        self.blocks: dict[int, list[int]] = {}
        self.running: dict[int, float] = {}
        self.values = [0.0] * len(PARAMS)
        self.armed = False
        self._client: tuple[str, int] | None = None
        self._t_log_s = 0.0
        self._ended = threading.Event()
        self.start()

    def stop(self) -> None:
        self._ended.set()
        self.join()
        self.socket.close()

    def say(self, packet: bytes) -> None:
        if self._client is not None:
            self.socket.sendto(packet, self._client)

    def of(self, port: int, channel: int) -> list[bytes]:
        """Payloads that came for a port and channel."""
        return [p[1:] for p in list(self.received) if (p[0] >> 4, p[0] & 3) == (port, channel)]

    def run(self) -> None:
        while not self._ended.is_set():
            try:
                packet, address = self.socket.recvfrom(64)
            except (TimeoutError, ConnectionError):
                packet = b""
            if packet == b"\xff":
                self.socket.sendto(packet, address)
            elif packet:
                self._client = address
                self.received.append(packet)
                self._handle(packet)
            self._log()

    def _handle(self, packet: bytes) -> None:
        payload = packet[1:]
        handler = {
            (15, 1): lambda _: b"Bitcraze Crazyflie".ljust(30, b"\0"),
            (15, 0): lambda p: p,
            (13, 1): lambda p: p[:1] + struct.pack("<I", 12),
            (4, 0): lambda p: p[:1] + b"\0",
            (2, 0): lambda p: self._table(p, [(g, n, t) for g, n, _, t in PARAMS], 0x1234),
            (5, 0): lambda p: self._table(p, LOGS, 0x5678),
            (2, 1): self._read,
            (2, 2): self._write,
            (5, 1): self._log_control,
            (9, 1): self._supervisor,
        }.get((packet[0] >> 4, packet[0] & 3))
        if handler is not None and payload:
            self.say(packet[:1] + handler(payload))

    @staticmethod
    def _table(payload: bytes, rows: list, crc: int) -> bytes:
        if payload[0] == 3:
            return struct.pack("<BHIBB", 3, len(rows), crc, 16, 128)
        number = struct.unpack("<H", payload[1:3])[0]
        group, name, kind = rows[number]
        return payload[:3] + bytes([kind]) + group.encode() + b"\0" + name.encode() + b"\0"

    def _read(self, payload: bytes) -> bytes:
        number = struct.unpack("<H", payload[:2])[0]
        value = self.values[number]
        return payload[:2] + b"\0" + (struct.pack("<f", value) if PARAMS[number][3] == 0x06 else bytes([int(value)]))

    def _write(self, payload: bytes) -> bytes:
        number = struct.unpack("<H", payload[:2])[0]
        self.values[number] = struct.unpack(PARAMS[number][2], payload[2:])[0]
        return payload

    def _supervisor(self, payload: bytes) -> bytes:
        self.armed = payload[:2] == b"\x01\x01"
        return bytes([0x81, 1, self.armed])

    def _log_control(self, payload: bytes) -> bytes:
        command, block = payload[0], payload[1] if len(payload) > 1 else 0
        ids = [struct.unpack("<H", payload[i + 1 : i + 3])[0] for i in range(2, len(payload) - 2, 3)]
        error = 0
        if command == 5:
            self.blocks, self.running = {}, {}
        elif command == 6:
            error = 17 if block in self.blocks else 0
            self.blocks.setdefault(block, ids)
        elif command == 7:
            error = 0 if block in self.blocks else 2
            self.blocks.get(block, []).extend(ids)
        elif command == 3:
            self.running[block] = payload[2] * 0.01
        elif command in (2, 4):
            self.running.pop(block, None)
        return bytes([command, block, error])

    def _log(self) -> None:
        now_s = time.monotonic()
        if now_s - self._t_log_s < 0.01:
            return
        self._t_log_s = now_s
        for block in list(self.running):
            rows = [LOGS[i] for i in self.blocks.get(block, [])]
            data = b"".join(struct.pack(SIZES[kind], value_of(name)) for _, name, kind in rows)
            if len(data) <= 26:
                self.say(b"\x52" + bytes([block, 0, 0, 0]) + data)
