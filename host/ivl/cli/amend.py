"""`ivl run`: what can be done with a run folder afterwards."""

import getpass
from pathlib import Path
from typing import Annotated

import typer

from ivl.cli import console
from ivl.learning import amend as amending

HELP = """A run folder, afterwards.

\b
Examples:
  ivl run amend runs/cage 17 --legs 2 --why "the video shows two legs"
      correct what came of rollout 17 of a flown run; what was said before is kept, with who and when
  ivl run amend runs/cage 17 --discard --why "the net had touched the vehicle"
      it does not count, and is not learned from
  ivl run amend runs/cage
      all that was corrected so far
"""

app = typer.Typer(help=HELP, rich_markup_mode=None, no_args_is_help=True)


@app.callback()
def _only() -> None:
    """Keep `amend` a command of its own."""


@app.command("amend")
def amend(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder of a flown run.")],
    number: Annotated[int | None, typer.Argument(metavar="[ROLLOUT]", help="Its number, as announced; from 1.")] = None,
    legs: Annotated[int | None, typer.Option(help="Legs that held on, 0 .. 4.")] = None,
    touched: Annotated[
        bool | None, typer.Option("--touched/--clean", help="Whether body or rotors touched the ceiling.")
    ] = None,
    discard: Annotated[
        bool | None, typer.Option("--discard/--count", help="Whether it does not count, or does after all.")
    ] = None,
    why: Annotated[str, typer.Option(help="Why.")] = "",
    who: Annotated[str, typer.Option(help="By whom; default: the user of this computer.")] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Correct the outcome of a flown rollout, or list what was corrected."""
    if number is not None:
        change = amending.Change(legs, touched, None if discard is None else not discard)
        amending.amend(folder, number, change, who or getpass.getuser(), why)
    made = amending.listed(folder)
    if as_json:
        console.print_json({"amendments": made})
        return
    for one in made:
        text = f"{one['utc']} {one['who']}: rollout {one['rollout']}: {one['before']} -> {one['after']} ({one['why']})"
        console.out.print(text)
    if number is not None:
        console.out.print(f"judge again with: ivl learn --resume --out {folder}")
