"""`ivl init` and `ivl schema`."""

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ivl import model, template
from ivl.cli import console
from ivl.errors import ConfigError

LIKE = "paper_vertical"

HELP = """Write a new FILE with comments, to be changed: an experiment, a vehicle, or a set of landing gears.

\b
Examples:
  ivl init my.yaml
      the paper's vertical landing as a beginning; then: ivl learn my.yaml
  ivl init my.yaml --like paper_flight
      another one (see: ivl list experiments)
  ivl init racer.yaml --vehicle crazyflie21
      a vehicle; then: ivl rollout --vehicle racer.yaml --speed 2.5 --angle 90 --rrev 5 --moment 8
  ivl init legs.yaml --gear-set as_simulated
      landing gears; then: ivl rollout --gear-set legs.yaml --gear wide_long --speed 2.5 --angle 90 --rrev 5 --moment 8
"""

SCHEMA_HELP = """Print the JSON schema of a KIND of file, by which editors complete and check it.

\b
Examples:
  ivl schema experiment > experiment.schema.json
      then, as the first line of an experiment: # yaml-language-server: $schema=experiment.schema.json
  ivl schema sweep > sweep.schema.json
      of a sweep
"""


class Kind(StrEnum):
    """Kinds of files."""

    EXPERIMENT = "experiment"
    SWEEP = "sweep"
    MAP = "map"
    LANDING = "landing"
    SITE = "site"


def init(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="YAML file to write.")],
    like: Annotated[
        str | None, typer.Option(metavar="EXPERIMENT", help=f"Experiment to begin with.  [default: {LIKE}]")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(metavar="VEHICLE", help="Write a copy of this vehicle.")] = None,
    gear_set: Annotated[str | None, typer.Option(metavar="SET", help="Write a copy of this set of gears.")] = None,
) -> None:
    """Write a new file; HELP is the text that people see."""
    given = [name for name, value in (("--like", like), ("--vehicle", vehicle), ("--gear-set", gear_set)) if value]
    if len(given) > 1:
        raise ConfigError(f"init: {' and '.join(given)}: give one of them")
    if vehicle:
        template.write_vehicle(file, vehicle)
        then = f"ivl rollout --vehicle {file} --speed 2.5 --angle 90 --rrev 5 --moment 8"
    elif gear_set:
        template.write_gear_set(file, gear_set)
        gear = model.list_gears(str(file))[0]
        then = f"ivl rollout --gear-set {file} --gear {gear} --speed 2.5 --angle 90 --rrev 5 --moment 8"
    else:
        template.write_experiment(file, like or LIKE)
        then = f"ivl learn {file}"
    console.out.print(f"{file}: change it, then: {then}", soft_wrap=True)


def schema(kind: Annotated[Kind, typer.Argument(metavar="KIND", help="Kind of file.")]) -> None:
    """Print a schema; SCHEMA_HELP is the text that people see."""
    print(json.dumps(template.schema(kind.value), indent=2))
