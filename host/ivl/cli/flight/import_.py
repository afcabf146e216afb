"""`ivl flight import`."""

from pathlib import Path
from typing import Annotated

import typer

from ivl.cli import console
from ivl.errors import ConfigError, IvlError

HELP = """Turn logs of other programs into a folder of flights, which every other command of `ivl flight` reads.

SOURCE is a log file, or a folder of them where the format has one. The folder that is made holds flights.parquet (one
row a flight), samples.parquet (the time series, units in the names) and manifest.json (source, licence, frames, clock,
what is absent). An option can give what the log does not say. What the log says cannot be changed, except the
outcome. A damaged file is refused with its line and column.

\b
Examples:
  ivl flight import learning.csv --format habas2021 --out flights/july --licence MIT
      the study's CSV: the last attempt of each rollout (--attempts all: the failed ones too)
  ivl flight import runs/paper_vertical-bo-seed0 --format ivl --out flights/mine
      recordings of a run with a vehicle: policy and outcome come from the run
  ivl flight import logdata/20260801T10-10-10 --format cfclient --out flights/today \\
      --rrev 4.8 --moment 8 --speed 2.5 --angle 90 --outcome 4,2,0
      a folder of cfclient: its log blocks on one clock, cut into three flights
  ivl flight import log00 --format usd --out flights/card --map p_z_m=my.height*0.001
      a file of the micro-SD card, with a variable of your own, in millimetres
  ivl flight import landing.npz --format trace --out flights/simulated
      what `ivl rollout --trace landing.npz` wrote
"""


def import_(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE", help="Log files, or folders of them.")],
    format_name: Annotated[
        str,
        typer.Option("--format", help="habas2021, ivl, trace, cfclient, crazyswarm or usd; see docs/FLIGHT_DATA.md."),
    ],
    out: Annotated[Path, typer.Option(help="Folder to make.")],
    licence: Annotated[str, typer.Option(help="Terms under which the data may be passed on.")] = "",
    rrev: Annotated[float | None, typer.Option("--rrev", "--rrev-c", help="Policy: RREV_c, 1/s.")] = None,
    moment: Annotated[float | None, typer.Option(help="Policy: flip moment M_yd, N mm.")] = None,
    speed: Annotated[float | None, typer.Option(help="Approach speed, m/s.")] = None,
    angle: Annotated[float | None, typer.Option(help="Approach angle above the horizontal, degrees.")] = None,
    h_plane: Annotated[float | None, typer.Option(help="Height of the plane that the cues refer to, m.")] = None,
    h_surface: Annotated[float | None, typer.Option(help="Height of the ceiling's surface, m.")] = None,
    outcome: Annotated[
        str, typer.Option(metavar="N,N,...", help="Feet that held in each flight; - where unknown.")
    ] = "",
    judged_by: Annotated[str, typer.Option(help="Who saw the outcomes.")] = "operator",
    attempts: Annotated[str, typer.Option(metavar="last|all", help="Which attempts of a rollout.")] = "last",
    maps: Annotated[
        list[str] | None, typer.Option("--map", metavar="COLUMN=VARIABLE[*FACTOR]", help="The variable of a column.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Import; HELP is the text that people see."""
    try:
        from ivl.flight import importer, log, store
    except ModuleNotFoundError as error:
        raise IvlError(f"{error.name} is not installed: pip install 'ivl[flight]'") from error
    if attempts not in (log.LAST, log.ALL):
        raise ConfigError(f"--attempts {attempts}: unknown (allowed {log.LAST}, {log.ALL})")
    given = log.Given(
        licence, rrev, moment, speed, angle, h_plane, h_surface, _outcomes(outcome), judged_by, attempts,
        [log.parse_rule(text) for text in maps or []],
    )  # fmt: skip
    store.check_new(out)
    flights = importer.run(sources, format_name, given)
    store.write(out, flights)
    counts = {"flights": len(flights), "usable": len(flights.usable()), "samples": sum(len(f) for f in flights)}
    for note in flights.manifest.notes:
        if note.startswith("WARNING"):
            console.err.print(note, style="yellow")
    if as_json:
        console.print_json({"folder": str(out), **counts, "notes": list(flights.manifest.notes)})
        return
    flown = "1 flight" if len(flights) == 1 else f"{len(flights)} flights"
    text = f"{out}: {flown}, {counts['usable']} usable, {counts['samples']} samples"
    console.out.print(text)


def _outcomes(text: str) -> list[int | None]:
    words = [word.strip() for word in text.split(",")] if text else []
    for word in words:
        if word != "-" and not (word.isascii() and word.isdigit()):
            raise ConfigError(f"--outcome {text}: value {word!r} is neither a number of feet nor -")
    return [None if word == "-" else int(word) for word in words]
