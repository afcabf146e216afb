"""`ivl flash`."""

from pathlib import Path
from typing import Annotated

import typer

from ivl import bootloader
from ivl import flash as flasher
from ivl.cli import console
from ivl.errors import ConfigError

HELP = """Write a firmware IMAGE, read it back, see the vehicle run it.

IMAGE is the .bin that `make -C firmware` leaves in firmware/build, or a release of Bitcraze (.zip), of which the main
processor's firmware is written. It must be for the vehicle that answers. The vehicle restarts in its bootloader, is
written and read back, and restarts in the new firmware; settings that are stored on it stay.

\b
Examples:
  ivl flash --uri radio://0/80/2M/E7E7E7E7E7 firmware/build/cf2.bin
  ivl flash --uri radio://0/80/2M/E7E7E7E7E7 --any firmware-cf2-2026.08.zip
      back to the stock firmware
  ivl flash --uri radio://0/80/2M/E7E7E7E7E7 --cold "Crazyflie 2.1" firmware/build/cf2.bin
      a vehicle whose firmware does not start: switch it on with its button held
"""


def flash(
    image: Annotated[Path, typer.Argument(metavar="IMAGE", help="Firmware image (.bin) or release (.zip).")],
    uri: Annotated[str, typer.Option(help="Radio link of the vehicle when it runs.")],
    any_image: Annotated[bool, typer.Option("--any", help="Accept an image without the app of this project.")] = False,
    cold: Annotated[
        str | None, typer.Option(metavar="DEVICE", help="It waits in its bootloader; what it is, as it calls itself.")
    ] = None,
) -> None:
    """Write a firmware image; HELP is the text that people see."""
    flasher.check_uri(uri)
    if cold is not None and cold not in flasher.DEVICES:
        raise ConfigError(f"--cold: value {cold!r} is no vehicle (allowed: {', '.join(flasher.DEVICES)})")
    checked = flasher.check_image(image)
    if checked.build is None and not any_image:
        raise ConfigError(f"{image}: the inverted-landing app is not in this image (--any flashes it all the same)")
    console.err.print(f"flashing {image}, {len(checked.content)} bytes, {bootloader.said_of(checked)}, to {uri}")
    now = bootloader.flash(uri, checked, _show, device=cold)
    console.err.print(f"flashed and read back; the vehicle runs it: {bootloader.said(now)}")


def _show(what: str, percent: int) -> None:
    console.err.print(f"{percent:3d} %  {what}")
