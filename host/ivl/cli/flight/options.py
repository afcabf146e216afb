"""What the subcommands share: the vehicle that the flights are held against, and how they name it."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ivl.cli.task_options import task_options
from ivl.errors import ConfigError, IvlError

Folder = Annotated[Path, typer.Argument(metavar="FLIGHTS", help="Folder of flights; `ivl flight import` makes one.")]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0)]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]

FLOWN = ("vehicle", "gear", "gear_set")
"""Fields of the task that a recorded flight does not say itself; `world_options` are the options for them."""
world_options = task_options(*FLOWN, vehicle="crazyflie21")


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
