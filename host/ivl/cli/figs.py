"""`ivl figs`."""

from pathlib import Path
from typing import Annotated

import typer

from ivl.cli import console
from ivl.errors import IvlError

HELP = """Draw the paper's figures 4 to 9 from the RUNs of a campaign.

Each RUN is a run folder of `ivl sweep`; several are drawn as one campaign, for example one per learner. Every figure is
written as PDF and PNG. Fig. 4 shows all learners and Fig. 9 all landing gears; the others one of each.

\b
Examples:
  ivl figs runs/paper-as_simulated-bo
      into the folder figures of the run
  ivl figs runs/paper-table1-bo runs/paper-table1-ephe --out figures
      two learners, side by side in Fig. 4
  ivl figs runs/paper-table1-bo --gear wide_long --only fig07 --only fig08
      two figures, for another landing gear
"""


def figs(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write to; default: figures in the first RUN.")] = None,
    only: Annotated[list[str] | None, typer.Option(help="A figure by name or its start; may be repeated.")] = None,
    vehicle: Annotated[str | None, typer.Option(help="Vehicle, if there are several.")] = None,
    gear_set: Annotated[str | None, typer.Option(help="Set of landing gears, if there are several.")] = None,
    gear: Annotated[str | None, typer.Option(help="Landing gear; default: wide_short.")] = None,
    learner: Annotated[str | None, typer.Option(help="Learner, if there are several; default: bo.")] = None,
    svg: Annotated[bool, typer.Option("--svg", help="SVG instead of PDF.")] = False,
    dpi: Annotated[int, typer.Option(help="Dots per inch of the PNG files.", min=30, max=1200)] = 200,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object; progress goes to stderr.")] = False,
) -> None:
    """Draw the figures; HELP is the text that people see."""
    try:
        from ivl.plots import campaign, paper  # pandas and scikit-learn take a second to load
    except ModuleNotFoundError as error:
        raise IvlError(f"{error.name} is not installed: pip install 'ivl[sweep]'") from error
    data = campaign.load(runs)
    chosen = {"vehicle": vehicle, "gear_set": gear_set, "gear": gear, "learner": learner}
    suffixes = (".svg" if svg else ".pdf", ".png")
    drawn = paper.draw_all(data, out or runs[0] / "figures", chosen, suffixes, only, dpi)
    for name, reason in drawn.left_out.items():
        console.err.print(f"{name}: not drawn: {reason}", style="yellow")
    if as_json:
        console.print_json({"files": [str(path) for path in drawn.files], "left_out": drawn.left_out})
        return
    for path in drawn.files:
        console.out.print(str(path))
