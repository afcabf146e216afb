"""Images of a Crazyflie's firmware: what can be checked of one before it replaces what a vehicle has.

An image is the .bin that the SDK's build leaves, or a release of Bitcraze: a zip with a manifest. `ivl.bootloader`
writes it.
"""

import json
import re
import struct
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ivl.errors import ConfigError

FLASH_BASE, FLASH_START = 0x0800_0000, 0x0800_4000
"""First address of the flash, and of the firmware: the bootloader lies between them."""
FLASH_SIZE = 1_032_192
"""Bytes of flash that are left for the firmware, as the SDK's linker script has it."""
RAM = ((0x2000_0000, 0x2002_0000), (0x1000_0000, 0x1001_0000))
"""Where a stack may begin: ends of main and core-coupled memory included."""
VECTORS = 98
"""Words at the begin of an image: the stack, and where the chip's exceptions and interrupts go."""
DEVICES = (
    "Crazyflie 2.0", "Crazyflie 2.1", "Crazyflie 2.1 Brushless", "Crazyflie Bolt", "Crazyflie Bolt 1.1",
    "Roadrunner 1.0", "Flapper (CF 2.1)", "Flapper (Bolt 1.0)", "Flapper (Bolt 1.1)",
)  # fmt: skip
"""What vehicles of the SDK's platforms call themselves; an image holds the names of those that it starts on."""

_BUILD = re.compile(rb"Inverted landing ready, build 0x([0-9a-f]{8})\n")  # the app prints it when it starts
_URI = re.compile(r"radio://\d+/(?P<channel>\d{1,3})/(250K|1M|2M)(/[0-9A-Fa-f]{10})?")
_CHANNEL_MAX = 125
_MANIFEST, _MANIFEST_VERSION_MAX, _MANIFEST_BYTES_MAX = "manifest.json", 2, 100_000
_LOAD, _NO_BITS, _ALLOCATED = 1, 8, 2  # of ELF: kind of a segment, kind of a section, its flag


@dataclass(frozen=True)
class Image:
    """A firmware image that has passed the checks.

    Attributes:
        path: File.
        content: What is written from FLASH_START on.
        devices: Names of the vehicles that it starts on.
        build: Number of the app's build, None if the app of this project is not in it.
    """

    path: Path
    content: bytes
    devices: tuple[str, ...]
    build: int | None


def check_uri(uri: str) -> str:
    """Return the URI if it names a Crazyflie on a radio.

    Raises:
        ConfigError: It does not.
    """
    match = _URI.fullmatch(uri)
    if match is None or int(match["channel"]) > _CHANNEL_MAX:
        raise ConfigError(
            f"--uri: value {uri!r} is no radio link (expected radio://DONGLE/CHANNEL/RATE/ADDRESS with channel 0 .. "
            f"{_CHANNEL_MAX}, rate 250K, 1M or 2M, such as radio://0/80/2M/E7E7E7E7E7)"
        )
    return uri


def check_image(path: Path) -> Image:
    """Look at an image before it replaces the vehicle's firmware.

    Raises:
        ConfigError: The file cannot be read, does not fit, is not whole, or is no firmware of a Crazyflie.
    """
    content = _read(path)
    if not 4 * VECTORS <= len(content) <= FLASH_SIZE or len(content) % 4:
        raise ConfigError(
            f"{path}: size {len(content)} bytes is out of range (allowed {4 * VECTORS} .. {FLASH_SIZE}, "
            "a multiple of 4)"
        )
    _check_vectors(path, content)
    _check_beside(path, content)
    devices = tuple(name for name in DEVICES if re.search(rb"(?<![ -~])" + re.escape(name.encode()) + rb"\0", content))
    if not devices:
        raise ConfigError(f"{path}: names no vehicle that it starts on (expected one of: {', '.join(DEVICES)})")
    build = _BUILD.search(content)
    return Image(path, content, devices, int(build[1], 16) if build else None)


def _read(path: Path) -> bytes:
    try:
        if zipfile.is_zipfile(path):
            return _read_release(path)
        if path.stat().st_size > FLASH_SIZE:
            raise ConfigError(f"{path}: size {path.stat().st_size} bytes is out of range (allowed up to {FLASH_SIZE})")
        content = path.read_bytes()
    except (OSError, zipfile.BadZipFile) as error:
        raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if content.startswith(b"\x7fELF"):
        raise ConfigError(f"{path}: is an ELF file (expected the .bin beside it)")
    return content


def _read_release(path: Path) -> bytes:
    """The firmware of the main processor in a release; the radio's is left alone."""
    with zipfile.ZipFile(path) as release:
        names = [name for name, entry in _manifest(path, release) if _is_firmware(entry)]
        if len(names) != 1:
            raise ConfigError(f"{path}: {_MANIFEST}: {len(names)} files are firmware of the stm32 (allowed: 1)")
        return _member(path, release, names[0], FLASH_SIZE)


def _manifest(path: Path, release: zipfile.ZipFile) -> Iterator[tuple[str, dict[str, object]]]:
    try:
        manifest = json.loads(_member(path, release, _MANIFEST, _MANIFEST_BYTES_MAX))
        version, files = manifest["version"], dict(manifest["files"])
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ConfigError(f"{path}: {_MANIFEST}: is no manifest of a release ({error})"[:300]) from error
    if version not in range(1, _MANIFEST_VERSION_MAX + 1):
        raise ConfigError(f"{path}: {_MANIFEST}: version {version!r} (allowed 1 .. {_MANIFEST_VERSION_MAX})"[:300])
    for name, entry in files.items():
        if isinstance(entry, dict):
            yield name, entry


def _is_firmware(entry: dict[str, object]) -> bool:
    targets = entry.get("target")
    return entry.get("type") == "fw" and "stm32" in (targets if isinstance(targets, list) else [targets])


def _member(path: Path, release: zipfile.ZipFile, name: str, n_bytes_max: int) -> bytes:
    try:
        size = release.getinfo(name).file_size
        if size > n_bytes_max:
            raise ConfigError(f"{path}: {name}: size {size} bytes is out of range (allowed up to {n_bytes_max})")
        with release.open(name) as member:
            content = member.read(n_bytes_max + 1)
    except (KeyError, RuntimeError, NotImplementedError) as error:
        raise ConfigError(f"{path}: {name}: cannot be read: {error}"[:300]) from error
    if len(content) > n_bytes_max:
        raise ConfigError(f"{path}: {name}: is larger than it says (allowed up to {n_bytes_max} bytes)")
    return content


def _check_vectors(path: Path, content: bytes) -> None:
    """Each word leads into the image, to Thumb code, or is unused: a shifted or foreign file has others."""
    stack, entry, *others = struct.unpack_from(f"<{VECTORS}I", content)
    inside = range(FLASH_START, FLASH_START + len(content))
    stack_good = any(low < stack <= high for low, high in RAM)
    words = [(1, entry), *((i, word) for i, word in enumerate(others, 2) if word != 0)]
    bad = [(i, word) for i, word in words if not (word % 2 and word in inside)]
    if not stack_good or bad:
        what = "vector {} 0x{:08x}".format(*bad[0]) if stack_good else f"stack 0x{stack:08x}"
        raise ConfigError(
            f"{path}: is no firmware of a Crazyflie: it begins with {what} (expected a stack in RAM, and vectors to "
            f"Thumb code inside the image from 0x{FLASH_START:08x} on)"
        )


def _check_beside(path: Path, content: bytes) -> None:
    """The SDK leaves the program that the .bin was made of beside it: then it must be the same, to the last byte."""
    program = path.with_suffix(".elf")
    if path.suffix != ".bin" or not program.is_file():
        return
    try:
        wanted = loaded(program.read_bytes())
    except (OSError, struct.error, ValueError) as error:
        raise ConfigError(f"{program}: cannot be read: {error}") from error
    if wanted != content:
        raise ConfigError(
            f"{path}: is not what {program.name} beside it holds ({len(content)} and {len(wanted)} bytes): "
            "build it again"
        )


def loaded(program: bytes) -> bytes:
    """What an ELF file of 32 bits, little-endian, puts into flash, from the lowest address on, gaps as zeros.

    As `objcopy -O binary` does it: by sections, since a segment may begin with the headers of the file.

    Raises:
        ValueError: It is no such file.
        struct.error: It is cut off.
    """
    if program[:6] != b"\x7fELF\x01\x01":
        raise ValueError("is no ELF file of 32 bits")
    segments_at, sections_at = struct.unpack_from("<II", program, 28)
    segment_size, n_segments, section_size, n_sections = struct.unpack_from("<4H", program, 42)
    segments = [struct.unpack_from("<5I", program, segments_at + i * segment_size) for i in range(n_segments)]
    parts = []
    for i in range(n_sections):
        _, kind, flags, _, offset, n_bytes = struct.unpack_from("<6I", program, sections_at + i * section_size)
        if flags & _ALLOCATED and kind != _NO_BITS and n_bytes:
            parts.append((_address(segments, offset, n_bytes), program[offset : offset + n_bytes]))
    if not parts:
        raise ValueError("loads nothing")
    first = min(address for address, _ in parts)
    last = max(address + len(part) for address, part in parts)
    if last - first > FLASH_SIZE:
        raise ValueError(f"loads {last - first} bytes (allowed up to {FLASH_SIZE})")
    content = bytearray(last - first)
    for address, part in parts:
        content[address - first : address - first + len(part)] = part
    return bytes(content)


def _address(segments: list[tuple[int, ...]], offset: int, n_bytes: int) -> int:
    """Where the bytes of a file that begin at an offset are loaded from, by the segment that holds them."""
    for kind, begin, _, address, size in segments:
        if kind == _LOAD and begin <= offset and offset + n_bytes <= begin + size:
            return int(address) + offset - begin
    raise ValueError(f"no segment loads the section at {offset}")
