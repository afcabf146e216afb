"""`ivl site`: the file that describes a room."""

from pathlib import Path
from typing import Annotated

import typer

from ivl import experiment, files
from ivl.cli import console
from ivl.rehearsal import script as scripts
from ivl.site import checks
from ivl.site import file as site_file

HELP = """Site files: the room in which a drone flies, as it was measured.

\b
Examples:
  ivl site new lab.yaml
      a file with comments, in which every measured number is a placeholder
  ivl site check lab.yaml
      what is not measured yet, and what does not fit
  ivl site check lab.yaml experiments/paper_flight.yaml
      whether this experiment can be flown there: runway, board, thrust at the battery's voltage
  ivl site script day.yaml
      what goes wrong on a rehearsed day, to be changed
  ivl learn experiments/paper_flight.yaml --site lab.yaml --uri site
      fly it, over the link of the file
"""

app = typer.Typer(help=HELP, rich_markup_mode=None, no_args_is_help=True)
File = Annotated[Path, typer.Argument(metavar="FILE", help="Site file.")]


@app.command("new")
def new(file: File) -> None:
    """Write a commented site file to fill in."""
    files.write_new(file, site_file.TEMPLATE.read_bytes())
    console.out.print(f"{file}: measure what it names under not_measured, then: ivl site check {file}")


@app.command("script")
def script(file: Annotated[Path, typer.Argument(metavar="FILE", help="File to write.")]) -> None:
    """Write the script of a rehearsed day, to be changed: what goes wrong, and in which rollout."""
    files.write_new(file, scripts.TEMPLATE.read_bytes())
    console.out.print(f"{file}: ivl learn EXPERIMENT --site SITE --rehearse --script {file}")


@app.command("check")
def check(
    file: File,
    path: Annotated[str | None, typer.Argument(metavar="[EXPERIMENT]", help="YAML file of the experiment.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> int:
    """Check a site file, alone or with what is to be flown there; exit code 1 if anything fails."""
    site = site_file.load(str(file))
    chosen = experiment.load(path, site=str(file)) if path else None
    found = list(checks.checks(site, chosen))
    fit = all(one.ok for one in found)
    if as_json:
        console.print_json({"site": site.name, "fit": fit, "checks": [one.as_dict() for one in found]})
    else:
        console.print_checks(found)
    return 0 if fit else 1
