"""`ivl estimate`."""

from collections.abc import Iterable
from typing import Annotated

import typer
from rich.progress import track
from rich.table import Table

from ivl import estimation, model
from ivl.cli import console
from ivl.cli.console import number, percent
from ivl.errors import ConfigError
from ivl.sensing import APPROACHES, ESTIMATORS
from ivl.task import Task

HELP = """Show how well the flight core knows the distance of the ceiling.

Landing gear, speed and angle are those of experiments/paper_vertical.yaml. Landings start from a hover and are judged
at the trigger. Error is |d - true d| / true d; NEES is the mean of (error / sigma)^2, 1 for an honest sigma; cover is
the share of errors within two sigma; valid is the share of the approach with a valid distance.

\\b
Examples:
  ivl estimate --approach accelerate_hold --sensors camera50 --estimator kalman --runs 300 --json
      one combination, for a script
  ivl estimate --sensors camera50_delay20
      every approach and estimator with one sensor set
  ivl estimate --all
      the whole table; `ivl list sensors` says what the sets are
"""

_COLUMNS = ("approach", "sensors", "estimator", "trig", "valid", "median", "p90", "NEES", "cover", "m/s", "4 legs")


def _one_of(names: Iterable[str]) -> str:
    return f"One of {', '.join(names)}"


def estimate(
    approach: Annotated[str | None, typer.Option(help=f"{_one_of(APPROACHES)}; all if omitted.")] = None,
    sensors: Annotated[str | None, typer.Option(help="Sensor set; see `ivl list sensors`.")] = None,
    estimator: Annotated[str | None, typer.Option(help=f"{_one_of(ESTIMATORS)}; all that fit if omitted.")] = None,
    everything: Annotated[bool, typer.Option("--all", help="Every combination that makes sense.")] = False,
    runs: Annotated[int, typer.Option(help="Rollouts of each combination.", min=1, max=1_000_000)] = 300,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.", min=0)] = 0,
    vehicle: Annotated[str, typer.Option(help=f"{Task.model_fields['vehicle'].description}")] = model.DEFAULT_VEHICLE,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Judge the estimated distance; HELP is the text that people see."""
    if everything == (sensors is not None):
        raise ConfigError("--sensors NAME or --all is needed")
    for name, value, allowed in (("approach", approach, APPROACHES), ("estimator", estimator, tuple(ESTIMATORS))):
        if value is not None and value not in allowed:
            raise ConfigError(f"--{name} {value}: unknown (allowed {', '.join(allowed)})")
    approaches = [approach] if approach else list(APPROACHES)
    chosen = list(estimation.all_cells(approaches, None if sensors is None else [sensors]))
    if estimator:
        # an estimator that lacks its sensor may be asked for by name: it never becomes valid
        pairs = dict.fromkeys((a, s) for a, s, _ in chosen) or {(a, str(sensors)): None for a in approaches}
        chosen = [(a, s, estimator) for a, s in pairs]
    flown = track(chosen, description="flying", console=console.err, transient=True)
    cells = [estimation.study(*cell, n=runs, seed=seed, vehicle=vehicle) for cell in flown]
    if as_json:
        console.print_json(
            {"runs": runs, "seed": seed, "vehicle": vehicle, "cells": [cell.as_dict() for cell in cells]}
        )
        return
    console.out.print(_table(cells), soft_wrap=False)


def _table(cells: list[estimation.Cell]) -> Table:
    table = Table(*_COLUMNS, box=None)
    for cell in cells:
        table.add_row(
            cell.approach, cell.sensors, cell.estimator, percent(cell.triggered), percent(cell.valid),
            percent(cell.error_median), percent(cell.error_p90), number(cell.nees), percent(cell.coverage),
            number(cell.speed_mps), percent(cell.four_leg),
        )  # fmt: skip
    return table
