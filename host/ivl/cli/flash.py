"""`ivl flash`."""

from pathlib import Path
from typing import Annotated

import typer

from ivl import flash as flasher
from ivl.cli import console
from ivl.errors import ConfigError

HELP = """Write a firmware IMAGE into a Crazyflie over radio.

IMAGE is the .bin that `make -C firmware` leaves in firmware/build.  The vehicle restarts in its bootloader, is written,
and restarts in the new firmware; settings that are stored on it stay.

Examples:

  ivl flash --uri radio://0/80/2M/E7E7E7E7E7 firmware/build/cf2.bin

  ivl flash --uri radio://0/80/2M/E7E7E7E7E7 --any stock.bin    back to the stock firmware
"""


def flash(
    image: Annotated[Path, typer.Argument(metavar="IMAGE", help="Firmware image (.bin).")],
    uri: Annotated[str, typer.Option(help="Radio link of the vehicle.")],
    any_image: Annotated[bool, typer.Option("--any", help="Accept an image without the app of this project.")] = False,
) -> None:
    """Write a firmware image; HELP is the text that people see."""
    flasher.check_uri(uri)
    checked = flasher.check_image(image)
    if not (checked.has_app or any_image):
        raise ConfigError(f"{image}: the inverted-landing app is not in this image (--any flashes it all the same)")
    console.err.print(f"flashing {image}, {checked.n_bytes} bytes, to {uri}")
    flasher.flash(uri, checked, _show)
    console.err.print("flashed; the vehicle restarts")


def _show(what: str, percent: int) -> None:
    console.err.print(f"{percent:3d} %  {what}")
