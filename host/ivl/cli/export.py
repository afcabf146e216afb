"""`ivl export`."""

from pathlib import Path
from typing import Annotated

import typer

from ivl.cli import console
from ivl.errors import IvlError
from ivl.export import Format, copy_layouts, write
from ivl.export.source import Choice, resolve

HELP = """Write a LANDING as a file for other tools: MCAP (Foxglove, PlotJuggler), Bitcraze's CSV, Rerun's .rrd.

LANDING is a run folder, a specification (.yaml with the options of `ivl rollout`), a trace of `ivl rollout --trace`
or the table of a flight recorder (.csv, .npz). Landings of simulated runs and specifications are flown again, bit for
bit; of a run that a vehicle has flown its recordings are written.

\b
Examples:
  ivl export runs/paper_vertical-bo-seed0 --layouts
      the run's best landing as MCAP, with layouts for Foxglove and PlotJuggler
  ivl export runs/paper_vertical-bo-seed0 --rollout 12 --format csv
      another rollout, as Bitcraze's client would have logged it
  ivl export runs/paper --gear wide_long --speed 2.5 --angle 60 --format rrd
      the best landing of a cell of a sweep, for Rerun
  ivl export flight.csv --vehicle crazyflie21
      a recorded landing; the vehicle says what to draw
"""


def export(
    landing: Annotated[Path, typer.Argument(metavar="LANDING", help="Run folder, .yaml, .csv or .npz.")],
    kind: Annotated[Format, typer.Option("--format", help="Kind of file.")] = Format.MCAP,
    out: Annotated[Path | None, typer.Option(help="File to write; default: in the folder of LANDING.")] = None,
    trial: Annotated[int | None, typer.Option(help="Trial of a run.", min=0)] = None,
    rollout: Annotated[int | None, typer.Option(help="Rollout of a trial of `ivl learn`; default: the best.", min=0)] =
        None,
    gear: Annotated[str | None, typer.Option(help="Gear of a sweep's cell, or of a recorded vehicle.")] = None,
    gear_set: Annotated[str | None, typer.Option(help="Set of gears of a recorded vehicle.")] = None,
    vehicle: Annotated[str | None, typer.Option(help="Recorded vehicle; see `ivl list vehicles`.")] = None,
    speed: Annotated[float | None, typer.Option(help="Approach speed of a sweep's cell, m/s.")] = None,
    angle: Annotated[float | None, typer.Option(help="Approach angle of a sweep's cell, degrees.")] = None,
    simulated: Annotated[
        bool, typer.Option("--simulated", help="Of a flown rollout its simulated counterpart, not its recording.")
    ] = False,
    layouts: Annotated[bool, typer.Option("--layouts", help="Also write the layouts for Foxglove and PlotJuggler.")] =
        False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:  # fmt: skip
    """Export a landing; HELP is the text that people see."""
    path = out or _default_path(landing, kind)
    try:
        flight = resolve(landing, Choice(trial, rollout, gear, gear_set, vehicle, speed, angle, simulated or None))
        write(flight, path, kind)
    except ModuleNotFoundError as error:
        raise IvlError(f"{error.name} is not installed: pip install 'ivl[report,sweep]'") from error
    files = [path, *(copy_layouts(path.parent) if layouts else [])]
    if as_json:
        console.print_json({"title": flight.title, "rows": len(flight), "files": [str(file) for file in files]})
        return
    console.out.print(f"{flight.title}: {len(flight)} rows")
    for file in files:
        console.out.print(str(file))


def _default_path(landing: Path, kind: Format) -> Path:
    """`landing.mcap` in a run folder; beside a file under its name, told apart from a .csv that was read."""
    if landing.is_dir():
        return landing / f"landing.{kind.value}"
    path = landing.with_suffix(f".{kind.value}")
    return path if path != landing else landing.with_name(f"{landing.stem}_bitcraze.csv")
