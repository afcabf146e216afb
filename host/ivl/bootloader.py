"""Writing an image into a Crazyflie over radio: which vehicle it is, write, read back, restart, ask what it runs.

cflib is optional (`pip install 'ivl[link]'`) and imported only when a flash begins. Its `Cloader` speaks the
bootloader's protocol.
"""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ivl.errors import ConfigError, LinkError
from ivl.flash import FLASH_BASE, FLASH_START, Image

Progress = Callable[[str, int], None]
"""Called with what is being done and how much of it, percent."""

STM32, NRF51 = 0xFF, 0xFE
"""Addresses of the two processors in the bootloader's protocol."""
_PLATFORM, _VERSION, _DEVICE_NAME = 13, 1, 2
_ANSWER_S, _RESTART_S, _PACKET_S, _PAUSE_S = 3.0, 30.0, 0.2, 0.5


@dataclass(frozen=True)
class Running:
    """What a vehicle says of the firmware that it runs.

    Attributes:
        device: What it calls itself, one of `ivl.flash.DEVICES`.
        build: Number of the app's build, None if it does not run the app.
    """

    device: str
    build: int | None


def flash(uri: str, image: Image, progress: Progress, *, device: str | None = None) -> Running:
    """Write an image, compare every byte that the vehicle then has with it, restart the vehicle, and ask what it runs.

    Args:
        uri: Radio link, checked by `ivl.flash.check_uri`.
        image: Checked by `ivl.flash.check_image`.
        progress: Called while it works.
        device: What the vehicle is. Then it is one that waits in its bootloader, since it was switched on with its
            button held, and cannot be asked. None: a vehicle that runs.

    Raises:
        ConfigError: The image is for another vehicle.
        LinkError: cflib or the radio is missing, no vehicle answers, it has another flash, what it reads back is not
            the image, or it does not run the image after the restart.
    """
    with _radio(uri):
        found = device if device is not None else device_name(uri)
        if found not in image.devices:
            raise ConfigError(f"{image.path}: is for {' or '.join(image.devices)}; the vehicle at {uri} is a {found}")
        with _bootloader(uri, is_waiting=device is not None) as loader:
            _write(uri, loader, image, progress)
            _compare(uri, loader, image, progress)
            progress("restarting", 100)
            if not loader.reset_to_firmware(NRF51):
                raise LinkError(f"{uri}: the image is written, but the restart was not confirmed: switch it off and on")
        return confirm(uri, image)


@contextlib.contextmanager
def _radio(uri: str) -> Iterator[None]:
    """Cflib's faults as LinkError; what it prints goes to standard error."""
    try:
        import cflib.crtp  # type: ignore[import-not-found,import-untyped,unused-ignore]
    except ImportError as error:
        raise LinkError(f"flashing needs cflib: pip install 'ivl[link]' ({error})") from error
    try:
        with contextlib.redirect_stdout(sys.stderr):
            cflib.crtp.init_drivers()
            yield
    except (ConfigError, LinkError):
        raise
    except Exception as error:  # cflib and the USB library raise what they like
        what = str(error) or type(error).__name__
        raise LinkError(f"{uri}: {what} (is a Crazyradio plugged in, and the vehicle switched on and near?)") from error


def device_name(uri: str, deadline_s: float = _ANSWER_S) -> str:
    """What the vehicle at a link calls itself; any version of the firmware answers.

    Raises:
        LinkError: Nobody answers in time.
    """
    import cflib.crtp
    from cflib.crtp.crtpstack import CRTPPacket  # type: ignore[import-not-found,import-untyped,unused-ignore]

    question = CRTPPacket()
    question.set_header(_PLATFORM, _VERSION)
    question.data = (_DEVICE_NAME,)
    link = cflib.crtp.get_link_driver(uri)
    if link is None:
        raise LinkError(f"{uri}: there is no driver for this link")
    end_s = time.monotonic() + deadline_s
    try:
        while time.monotonic() < end_s:
            link.send_packet(question)
            answer = link.receive_packet(_PACKET_S)
            if answer is not None and (answer.port, answer.channel) == (_PLATFORM, _VERSION):
                data = bytes(answer.data)
                if data[:1] == bytes([_DEVICE_NAME]):
                    return data[1:].split(b"\0")[0].decode("ascii", "replace")
    finally:
        link.close()
    raise LinkError(f"{uri}: no vehicle answers (one whose firmware does not start: `ivl flash --cold`)")


def running(uri: str) -> Running:
    """Ask a vehicle what it runs.

    Raises:
        LinkError: Nobody answers.
    """
    return Running(device_name(uri), build(uri))


def build(uri: str) -> int | None:
    """Number of the app's build that a vehicle runs, None if it has no such app.

    Raises:
        LinkError: Nobody answers.
    """
    from ivl.links.tables import Session

    with Session(uri) as session:
        return int(session.read(["ivl.build"])["ivl.build"]) if session.has_param("ivl.build") else None


def confirm(uri: str, image: Image, deadline_s: float = _RESTART_S) -> Running:
    """Wait for the vehicle to come back, and return what it runs.

    Raises:
        LinkError: It does not come back in time, or runs something else.
    """
    end_s = time.monotonic() + deadline_s
    while True:
        try:
            # another firmware than ours may be too old for the rest of the questions
            now = running(uri) if image.build is not None else Running(device_name(uri), None)
            break
        except LinkError as error:
            if time.monotonic() > end_s:
                raise LinkError(f"{uri}: the image is written, but the vehicle did not come back: {error}") from error
            time.sleep(_PAUSE_S)
    if now.device not in image.devices or now.build != image.build:
        raise LinkError(f"{uri}: the image is written, but the vehicle runs {said(now)}, not {said_of(image)}")
    return now


def said(what: Running) -> str:
    """In words."""
    return f"{what.device}, {'without the app' if what.build is None else f'build {what.build:08x}'}"


def said_of(image: Image) -> str:
    """In words."""
    return f"{' or '.join(image.devices)}, {'without the app' if image.build is None else f'build {image.build:08x}'}"


@contextlib.contextmanager
def _bootloader(uri: str, is_waiting: bool) -> Iterator[Any]:
    """Cflib's connection with the bootloader; a vehicle that runs is restarted in it."""
    from cflib.bootloader.cloader import Cloader  # type: ignore[import-not-found,import-untyped,unused-ignore]

    loader = Cloader(uri)
    try:
        if is_waiting:
            found = loader.scan_for_bootloader()
            if found is None:
                raise LinkError(
                    "no bootloader answers: hold the button while the vehicle is switched on, until a blue light blinks"
                )
            loader.open_bootloader_uri(found)
        else:
            loader.open_bootloader_uri(uri)
            if not loader.reset_to_bootloader(NRF51):
                raise LinkError(f"{uri}: the vehicle did not restart in its bootloader")
        if not loader.check_link_and_get_info(STM32):
            raise LinkError(f"{uri}: the bootloader does not answer")
        yield loader
    finally:
        loader.close()


def _pages(loader: Any, image: Image) -> Iterator[tuple[int, bytes]]:
    """Pages of the flash with their numbers; the last one may be shorter."""
    size, first = loader.targets[STM32].page_size, loader.targets[STM32].start_page
    for i, begin in enumerate(range(0, len(image.content), size)):
        yield first + i, image.content[begin : begin + size]


def _write(uri: str, loader: Any, image: Image, progress: Progress) -> None:
    target = loader.targets[STM32]
    starts = FLASH_BASE + target.start_page * target.page_size
    room = (target.flash_pages - target.start_page) * target.page_size
    if starts != FLASH_START or len(image.content) > room or target.buffer_pages < 1:
        raise LinkError(f"{uri}: its flash begins at 0x{starts:08x} and holds {room} bytes: not that of a Crazyflie 2")
    pages = list(_pages(loader, image))
    for i in range(0, len(pages), target.buffer_pages):
        batch = pages[i : i + target.buffer_pages]
        for buffer, (_, content) in enumerate(batch):
            loader.upload_buffer(STM32, buffer, 0, content)
        if not loader.write_flash(STM32, 0, batch[0][0], len(batch)):
            raise LinkError(f"{uri}: page {batch[0][0]} was not written (code {loader.error_code}): flash again")
        progress("writing", 100 * (i + len(batch)) // len(pages))


def _compare(uri: str, loader: Any, image: Image, progress: Progress) -> None:
    pages = list(_pages(loader, image))
    for i, (page, content) in enumerate(pages):
        found = loader.read_flash(STM32, page)
        if found is None:
            raise LinkError(f"{uri}: page {page} could not be read back: flash again")
        if bytes(found[: len(content)]) != content:
            raise LinkError(f"{uri}: page {page} is not what was written: flash again, the old firmware is gone")
        progress("reading back", 100 * (i + 1) // len(pages))
