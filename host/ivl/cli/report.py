"""`ivl report`."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from ivl.cli import console
from ivl.errors import IvlError

HELP = """Write the page of a RUN: one HTML file to explore, to keep and to mail.

RUN is a run folder of `ivl learn` or `ivl sweep`. The page needs no network and no installation: landing rates, policy
region and convergence to turn and to click, and landings replayed in 3-D, two side by side.

\b
Examples:
  ivl report runs/paper_vertical-bo-seed0
      writes report.html into the run folder
  ivl report runs/paper --out paper.html --open
      another file, and look at it at once
  ivl report runs/paper --landings 200
      fewer landings, a smaller file
  ivl report runs/ephe runs/bo --out both.html
      two or more runs of ivl learn side by side: what each found, and how it went there
"""


def report(
    run: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folder; several: compare them.")],
    out: Annotated[
        Path | None, typer.Option(help="File to write; default: report.html in RUN, comparison.html here for several.")
    ] = None,
    landings: Annotated[int, typer.Option(help="Carry at most this many landings.", min=1, max=100_000)] = 1500,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in the web browser.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object; progress goes to stderr.")] = False,
) -> None:
    """Write a report; HELP is the text that people see."""
    try:
        from ivl import report as reports  # plotly and pandas take a second to load
    except ModuleNotFoundError as error:
        raise IvlError(f"{error.name} is not installed: pip install 'ivl[report,sweep]'") from error
    if len(run) > 1:
        _compare(run, out or Path("comparison.html"), open_, as_json)
        return
    columns = (TextColumn("flying landings again"), BarColumn(), MofNCompleteColumn())
    progress = Progress(*columns, console=console.err, transient=True)
    task = progress.add_task("", total=None)

    def on_landing(done: int, n: int) -> None:
        progress.start()
        progress.update(task, completed=done, total=n)

    try:
        made = reports.write(run[0], out, landings, on_landing)
    finally:
        if progress.live.is_started:
            progress.stop()
    if made.n_different:
        console.err.print(
            f"{made.n_different} of {made.n_landings} landings differ from what the run recorded: "
            "it was flown by another version of the simulator",
            style="yellow",
        )
    if as_json:
        console.print_json(
            {
                "path": str(made.path),
                "size_bytes": made.size_bytes,
                "landings": made.n_landings,
                "landings_that_differ": made.n_different,
            }
        )
    else:
        console.out.print(
            f"{made.path}: {made.size_bytes / 1e6:.1f} MB, {made.n_landings} landings to replay",
        )
    if open_:
        _open(made.path)


def _compare(runs: list[Path], path: Path, open_: bool, as_json: bool) -> None:
    """Write the page of several runs."""
    from ivl.report.comparison import write_comparison

    size = write_comparison(runs, path)
    if as_json:
        console.print_json({"path": str(path), "size_bytes": size, "runs": len(runs)})
    else:
        console.out.print(f"{path}: {size / 1e6:.1f} MB, {len(runs)} runs side by side")
    if open_:
        _open(path)


def _open(path: Path) -> None:
    if not webbrowser.open(path.resolve().as_uri()):
        raise IvlError(f"{path}: no web browser was found to open it with")
