"""A Crazyflie on a radio that is not there: firmware, bootloader and restarts, behind cflib's interface of a link."""

import struct
from collections import deque

from cflib.crtp.crtpstack import CRTPPacket

from ivl import flash
from ivl.errors import LinkError

URI = "radio://0/80/2M/E7E7E7E7E7"
BOOT_URI = "radio://0/0/2M/E7E7E7E7E7"
STACK, ENTRY = 0x2002_0000, 0x0800_4101
PAGE, BUFFERS, PAGES, FIRST = 1024, 10, 1024, 16
BUILD = 0x12AB34CD


def image(
    stack: int = STACK, entry: int = ENTRY, size: int = 4096, build: int | None = BUILD, device: str = "Crazyflie 2.1"
) -> bytes:
    """An image as the SDK would make it, filled with bytes that differ from page to page."""
    content = struct.pack("<II", stack, entry) + struct.pack("<I", ENTRY) * 50 + bytes(4 * (flash.VECTORS - 52))
    content += b"\x01\x00" + device.encode() + b"\0"
    if build is not None:
        content += f"Inverted landing ready, build 0x{build:08x}\n\0".encode()
    n = max(0, size - len(content))
    return content + bytes((i * 7 + i // PAGE) % 251 for i in range(n))


class Crazyflie:
    """What is switched on at the other end; a test sets what is to go wrong."""

    def __init__(self, device: str = "Crazyflie 2.1", is_waiting: bool = False) -> None:
        self.device = device
        self.in_bootloader = is_waiting
        self.flash = bytearray(b"\xff" * PAGE * PAGES)
        self.buffer = bytearray(PAGE * BUFFERS)
        self.first_page = FIRST
        self.spoils_page = -1  # a bit of it flips when it is written
        self.refuses_page = -1
        self.is_deaf_to_restart = False
        self.starts = True
        self.n_written = 0

    def firmware(self) -> bytes:
        return bytes(self.flash[PAGE * FIRST :])

    def answers(self, packet: CRTPPacket, at_bootloader: bool) -> list[CRTPPacket]:
        data = bytes(packet.data)
        if packet.header == 0xFF:
            if at_bootloader != self.in_bootloader:
                # the radio's processor restarts the vehicle in either state
                return [] if at_bootloader else self._restart(data)
            return (self._restart(data) or self._load(data)) if at_bootloader else self._restart(data)
        if self.in_bootloader or at_bootloader or not self.starts:
            return []
        if (packet.port, packet.channel, data) == (13, 1, b"\x02"):
            return [CRTPPacket(13 << 4 | 1, [2, *self.device.encode(), 0])]
        return []

    def _restart(self, data: bytes) -> list[CRTPPacket]:
        if data == b"\xfe\xff" and not (self.in_bootloader and self.is_deaf_to_restart):
            return [CRTPPacket(0xFF, [0xFE, 0xFF, 1, 2, 3, 4])]
        if data[:2] == b"\xfe\xf0":
            self.in_bootloader = data[2] == 0
        return []

    def _load(self, data: bytes) -> list[CRTPPacket]:
        if data == b"\xff\x10":
            told = struct.pack("<BBHHHH", 0xFF, 0x10, PAGE, BUFFERS, PAGES, self.first_page) + bytes(12) + b"\x10"
            return [CRTPPacket(0xFF, list(told))]
        if data[:2] == b"\xff\x14":
            page, address = struct.unpack("<HH", data[2:6])
            self.buffer[PAGE * page + address : PAGE * page + address + len(data) - 6] = data[6:]
        if data[:2] == b"\xff\x18":
            return [CRTPPacket(0xFF, [0xFF, 0x18, *self._write(*struct.unpack("<HHH", data[2:8]))])]
        if data[:2] == b"\xff\x1c":
            page, address = struct.unpack("<HH", data[2:6])
            return [CRTPPacket(0xFF, list(data[:6] + self.flash[PAGE * page + address :][:25]))]
        return []

    def _write(self, buffer: int, page: int, n: int) -> tuple[int, int]:
        assert page >= FIRST, "the bootloader itself"
        if page <= self.refuses_page < page + n:
            return 0, 3
        self.flash[PAGE * page : PAGE * (page + n)] = self.buffer[PAGE * buffer : PAGE * (buffer + n)]
        self.n_written += n
        if page <= self.spoils_page < page + n:
            self.flash[PAGE * self.spoils_page + 77] ^= 4
        return 1, 0

    def build(self) -> int | None:
        """What the firmware says that it is, as it lies in flash."""
        if self.in_bootloader or not self.starts:
            raise LinkError("nobody answers")
        found = flash._BUILD.search(self.firmware())
        return int(found[1], 16) if found else None


class Link:
    """One connection over the radio."""

    def __init__(self, uri: str, vehicle: Crazyflie) -> None:
        self.uri, self.vehicle = uri, vehicle
        self.at_bootloader = uri.startswith("radio://0/0/2M")
        self.waiting: deque[CRTPPacket] = deque()

    def send_packet(self, packet: CRTPPacket) -> None:
        self.waiting.extend(self.vehicle.answers(packet, self.at_bootloader))

    def receive_packet(self, _wait: float = 0) -> CRTPPacket | None:
        return self.waiting.popleft() if self.waiting else None

    def scan_selected(self, uris: tuple[str, ...]) -> tuple[str, ...]:
        return (BOOT_URI,) if self.vehicle.in_bootloader and BOOT_URI in uris else ()

    def close(self) -> None:
        pass
