"""A landing as a file for tools that people use: MCAP (Foxglove, PlotJuggler), Bitcraze's CSV, Rerun's .rrd."""

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path

from ivl import files
from ivl.errors import ConfigError
from ivl.export.flight import Flight

LAYOUTS_DIR = Path(__file__).parent / "layouts"


class Format(StrEnum):
    """What a landing can be exported to."""

    MCAP = "mcap"
    CSV = "csv"
    RRD = "rrd"


def write(flight: Flight, path: Path, kind: Format) -> None:
    """Write a landing to a file.

    Raises:
        ConfigError: The file cannot be written.
        IvlError: The package that the format needs is not installed.
    """
    try:
        _writer(kind)(flight, path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {files.reason(error)}") from error


def copy_layouts(folder: Path) -> list[Path]:
    """Copy the layout files of Foxglove and PlotJuggler for an MCAP file into a folder.

    Raises:
        ConfigError: A file cannot be written.
    """
    try:
        for path in sorted(LAYOUTS_DIR.iterdir()):
            files.write(folder / path.name, path.read_bytes())
        return [folder / path.name for path in sorted(LAYOUTS_DIR.iterdir())]
    except OSError as error:
        raise ConfigError(f"{folder}: the layouts cannot be written: {files.reason(error)}") from error


def _writer(kind: Format) -> Callable[[Flight, Path], None]:
    """Each format is loaded when it is asked for: none needs the packages of another."""
    if kind is Format.MCAP:
        from ivl.export import mcap_file

        return mcap_file.write
    if kind is Format.RRD:
        from ivl.export import rrd_file

        return rrd_file.write
    from ivl.export import csv_file

    return csv_file.write
