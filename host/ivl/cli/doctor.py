"""`ivl doctor`."""

from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from ivl import experiment
from ivl.cli import console
from ivl.errors import LinkError

if TYPE_CHECKING:
    from ivl.links.preflight import Check

HELP = """Check a vehicle before it flies: what was found, what is needed, what to do.

The vehicle stays on the ground. With EXPERIMENT, its policy bounds and the configuration in force are checked too.

\b
Examples:
  ivl doctor --uri radio://0/80/2M/E7E7E7E7E7
      a table of PASS and FAIL; exit code 1 if anything fails
  ivl doctor experiments/paper_vertical.yaml --uri udp://127.0.0.1:19850 --send
      put the experiment's configuration in force first
  ivl doctor --uri udp://127.0.0.1:19850 --json
      for a script
"""


def doctor(
    uri: Annotated[str, typer.Option(help="Link of the vehicle: radio://, usb://, udp://, tcp:// or serial://.")],
    path: Annotated[str | None, typer.Argument(metavar="[EXPERIMENT]", help="YAML file of the experiment.")] = None,
    send: Annotated[bool, typer.Option("--send", help="Put the experiment's configuration in force first.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> int:
    """Check a vehicle; HELP is the text that people see."""
    try:
        from ivl.links import connection, preflight, tables
        from ivl.links.vehicle import Vehicle
    except ImportError as error:
        raise LinkError(f"{uri}: a link needs cflib: pip install 'ivl[link]' ({error})") from error
    chosen = experiment.load(path) if path else None
    connection.check_uri(uri)
    with tables.Session(uri) as session:
        vehicle = Vehicle(session)
        if send and chosen is not None:
            vehicle.configure(chosen.make_world())
        found = list(preflight.checks(vehicle, chosen))
    fit = all(check.ok for check in found)
    if as_json:
        console.print_json({"uri": uri, "fit": fit, "checks": [check.as_dict() for check in found]})
    else:
        _print(found)
    return 0 if fit else 1


def _print(found: list["Check"]) -> None:
    table = Table("", "check", "found", "needed", "what to do", box=None, pad_edge=False)
    for check in found:
        mark = Text("PASS", "green") if check.ok else Text("FAIL", "bold red")
        table.add_row(mark, check.name, check.found, check.needed, "" if check.ok else check.remedy)
    console.out.print(table, soft_wrap=False)
