"""Flashing a Crazyflie over radio: what can be checked before, and the bootloader of cflib.

cflib is optional (`pip install 'ivl[link]'`) and imported only here, when a flash begins.
"""

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ivl.errors import ConfigError, LinkError

FLASH_START = 0x0800_4000
"""First address of the firmware: the bootloader lies below."""
FLASH_SIZE = 1_032_192
"""Bytes of flash that are left for the firmware, as the SDK's linker script has it."""
RAM = ((0x2000_0000, 0x2002_0000), (0x1000_0000, 0x1001_0000))
"""Where a stack may begin: ends of main and core-coupled memory included."""
MARK = b"Inverted landing ready"
"""Text that the app prints when it starts, and by which its image is known."""

_URI = re.compile(r"radio://\d+/(?P<channel>\d{1,3})/(250K|1M|2M)(/[0-9A-Fa-f]{10})?")
_CHANNEL_MAX = 125

Progress = Callable[[str, int], None]
"""Called with what is being done and how much of it, percent."""


@dataclass(frozen=True)
class Image:
    """A firmware image that has passed the checks.

    Attributes:
        path: File.
        n_bytes: Size.
        has_app: The app of this project is in it.
    """

    path: Path
    n_bytes: int
    has_app: bool


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
        ConfigError: The file cannot be read, does not fit, or does not begin like a program for this chip.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    if content.startswith(b"\x7fELF"):
        raise ConfigError(f"{path}: is an ELF file (expected the .bin beside it)")
    if not 8 <= len(content) <= FLASH_SIZE:
        raise ConfigError(f"{path}: size {len(content)} bytes is out of range (allowed 8 .. {FLASH_SIZE})")
    stack, entry = struct.unpack_from("<II", content)
    stack_good = any(low < stack <= high for low, high in RAM)
    entry_good = entry % 2 == 1 and FLASH_START <= entry < FLASH_START + len(content)
    if not (stack_good and entry_good):
        raise ConfigError(
            f"{path}: is no firmware of a Crazyflie: it begins with stack 0x{stack:08x} and entry 0x{entry:08x} "
            f"(expected a stack in RAM, and a Thumb entry inside the image from 0x{FLASH_START:08x} on)"
        )
    return Image(path, len(content), MARK in content)


def flash(uri: str, image: Image, progress: Progress) -> None:
    """Restart the vehicle in its bootloader, write and verify the image, and restart it in the new firmware.

    Args:
        uri: Radio link, checked by `check_uri`.
        image: Checked by `check_image`.
        progress: Called while it works.

    Raises:
        LinkError: cflib or the radio is missing, no vehicle answers, or the write failed.
    """
    try:
        import cflib.crtp  # type: ignore[import-not-found,import-untyped,unused-ignore]
        from cflib.bootloader import Bootloader, Target  # type: ignore[import-not-found,import-untyped,unused-ignore]
    except ImportError as error:
        raise LinkError(f"flashing needs cflib: pip install 'ivl[link]' ({error})") from error
    cflib.crtp.init_drivers()
    target = Target("cf2", "stm32", "fw", [], [])
    try:
        loader = Bootloader(uri)
        try:
            loader.flash_full(filename=str(image.path), warm=True, targets=(target,), progress_cb=progress)
        finally:
            loader.close()
    except Exception as error:
        what = str(error) or "the write was not confirmed"
        raise LinkError(f"{uri}: {what} (is a Crazyradio plugged in, and the vehicle switched on and near?)") from error
