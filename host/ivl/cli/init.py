"""`ivl init` and `ivl schema`."""

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ivl import template
from ivl.cli import console

HELP = """Write a new experiment FILE with comments, to be changed.

\b
Examples:
  ivl init my.yaml
      the paper's vertical landing as a beginning; then: ivl learn my.yaml
  ivl init my.yaml --like paper_flight
      another one (see: ivl list experiments)
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
    like: Annotated[str, typer.Option(metavar="EXPERIMENT", help="Experiment to begin with.")] = "paper_vertical",
) -> None:
    """Write a new experiment; HELP is the text that people see."""
    template.write_experiment(file, like)
    console.out.print(f"{file}: change it, then: ivl learn {file}")


def schema(kind: Annotated[Kind, typer.Argument(metavar="KIND", help="Kind of file.")]) -> None:
    """Print a schema; SCHEMA_HELP is the text that people see."""
    print(json.dumps(template.schema(kind.value), indent=2))
