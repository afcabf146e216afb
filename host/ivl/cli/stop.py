"""`ivl stop`."""

from pathlib import Path
from typing import Annotated

import typer

from ivl.cli import console
from ivl.errors import StoreError
from ivl.links import stop as stopping

HELP = """Stop a vehicle that flies now, from another terminal. In the terminal of the run any key does the same.

What a stop does is said by the site file (`stop:`): level_out, or motors_off. The flight is not scored.

\b
Examples:
  ivl stop
      every run under runs/ that flies now
  ivl stop cage/day1
      the run in this folder
"""


def stop(
    folder: Annotated[
        Path | None, typer.Argument(metavar="[RUN]", help="Run folder; default: all under runs/.")
    ] = None,
) -> int:
    """Stop; HELP is the text that people see."""
    folders = [folder] if folder is not None else stopping.flying(Path("runs"))
    if not folders:
        raise StoreError("runs: no vehicle flies in a run there now; name the folder: ivl stop RUN")
    answered = [(one, stopping.ask(one)) for one in folders]
    for one, ok in answered:
        console.out.print(f"{one}: {'stopped' if ok else 'asked, but nobody has answered: use Ctrl-C there'}")
    return 0 if all(ok for _, ok in answered) else 1
