"""What the subcommands share: the vehicle that the flights are held against, and how they name it."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ivl import model
from ivl.errors import ConfigError, IvlError
from ivl.settings import parse_setting

Folder = Annotated[Path, typer.Argument(metavar="FLIGHTS", help="Folder of flights; `ivl flight import` makes one.")]
Vehicle = Annotated[str, typer.Option(help="Vehicle; see `ivl list vehicles`, or a YAML file.")]
Gear = Annotated[str, typer.Option(help="Landing gear that was flown; see `ivl list gears`.")]
GearSet = Annotated[str, typer.Option(help="Set of landing gears.")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="A.B=C", help="Change a parameter of the vehicle and hold it.")
]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0)]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]

DEFAULT_VEHICLE, DEFAULT_GEAR, DEFAULT_GEAR_SET = "crazyflie21", "wide_short", model.DEFAULT_GEAR_SET


def overrides(settings: list[str] | None) -> dict[str, float]:
    """The parameters of `--set`, checked."""
    pairs = [parse_setting(text) for text in settings or []]
    return {name: model.check_override(name, value) for name, value in pairs}


def flight_package() -> Any:
    """The modules that need the extra packages.

    Raises:
        IvlError: One of them is not installed.
    """
    try:
        from ivl.flight import compare, identify, store
    except ModuleNotFoundError as error:
        raise IvlError(f"{error.name} is not installed: pip install 'ivl[flight]'") from error
    return compare, identify, store


def policies(texts: list[str] | None) -> list[tuple[float, float]]:
    """Policies given as RREV_C,M_YD."""
    result = []
    for text in texts or []:
        words = text.split(",")
        try:
            rrev, moment = (float(word) for word in words)
        except ValueError as error:
            raise ConfigError(f"--policy {text}: expected RREV_C,M_YD in 1/s and N mm, for example 4.0,8.12") from error
        result.append((rrev, moment))
    return result


def check_parent(option: str, path: Path) -> None:
    """Refuse a file in a folder that does not exist before any work is done.

    Raises:
        ConfigError: The folder is missing.
    """
    if not path.parent.is_dir():
        raise ConfigError(f"{option} {path}: the folder {path.parent} does not exist")
