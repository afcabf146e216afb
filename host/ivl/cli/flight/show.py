"""`ivl flight show`."""

import math
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from ivl.cli import console
from ivl.errors import IvlError

HELP = """Show what a FOLDER of flights holds: a row for each flight, and what is known about all of them.

\b
Examples:
  ivl flight show flights/july
      policy, approach, outcome and who judged it, flight by flight
  ivl flight show flights/july --json
      the same for a script
"""


def show(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of flights.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Show a folder; HELP is the text that people see."""
    try:
        from ivl.flight import store
    except ModuleNotFoundError as error:
        raise IvlError(f"{error.name} is not installed: pip install 'ivl[flight]'") from error
    flights = store.read(folder)
    rows = [_row(flight.info, len(flight), float(flight["t_s"][-1])) for flight in flights]
    manifest = flights.manifest
    if as_json:
        known = ("format", "source", "licence", "frames", "clock", "absent", "notes")
        console.print_json({"folder": str(folder), **{k: getattr(manifest, k) for k in known}, "flights": rows})
        return
    for source, group in groupby(rows, key=lambda row: str(row["source"])):
        if len(manifest.source) > 1:
            console.out.print(source)
        console.out.print(_table(list(group)), soft_wrap=False)
    for row in rows:
        text = ("" if row["usable"] else "NOT USABLE: ") + row["note"]
        if text:
            console.out.print(f"{row['label']}: {text}")
    usable = flights.usable()
    judged = [int(f.info["n_legs"]) for f in usable if math.isfinite(f.info["n_legs"])]
    outcomes = ", ".join(f"{judged.count(n)} on {n}" for n in sorted(set(judged), reverse=True)) or "none judged"
    facts = {
        "flights": f"{len(flights)}, {len(usable)} usable; feet at the end of the usable ones: {outcomes}",
        "format": manifest.format,
        "source": ", ".join(str(source.get("file")) for source in manifest.source),
        "licence": manifest.licence,
        "frames": manifest.frames,
        "clock": manifest.clock,
        "absent": ", ".join(manifest.absent) or "nothing",
    }
    for name, text in facts.items():
        console.out.print(f"{name + ':':9s}{text}", soft_wrap=False)
    for note in manifest.notes:
        console.out.print(f"note:    {note}", soft_wrap=False)


def _row(info: Any, n: int, duration_s: float) -> dict[str, Any]:
    """A flight's row of the table, with None where nothing is known."""
    known = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in info.items()}
    return {**known, "n_samples": n, "duration_s": duration_s}


def _table(rows: list[dict[str, Any]]) -> Table:
    """For 80 columns: names are wrapped where they do not fit, and numbers stay whole."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("flight", overflow="fold")
    for name in ("RREV_c", "M_yd", "m/s", "deg", "samples", "s", "legs"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("judged by", overflow="fold")
    for row in rows:
        table.add_row(
            row["label"],
            console.number(row["threshold_per_s"]),
            console.number(row["moment_Nmm"]),
            console.number(row["speed_mps"], 1),
            console.number(row["angle_deg"], 0),
            str(row["n_samples"]),
            console.number(row["duration_s"], 1),
            console.number(row["n_legs"], 0),
            row["judged_by"] or "-",
            style=None if row["usable"] else "yellow",
        )
    return table
