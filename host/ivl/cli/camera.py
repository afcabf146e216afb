"""`ivl camera`."""

from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Table

from ivl.camera import study
from ivl.cli import console

app = typer.Typer(no_args_is_help=True, help="The onboard camera: how well it sees a surface.")

TABLE_HELP = """Render approaches to several surfaces, estimate RREV and OF_y from them, and print how wrong they are.

Readings with a true RREV of 2 to 6 1/s at 60 pictures a second; speed 1.5 to 3.5 m/s, 30 to 90 degrees, with 10 mrad
of attitude error. Exit code 1 if a figure is beyond what it must show. docs/CAMERA.md explains each row.

\b
Examples:
  ivl camera table
  ivl camera table --approaches 400 --json
"""


@app.command("table", help=TABLE_HELP, short_help="Print how wrong the cues of rendered pictures are.")
def table(
    approaches: Annotated[int, typer.Option(help="Approaches of each row.", min=2)] = 60,
    seed: Annotated[int, typer.Option(help="Seed of approaches and noise.", min=0)] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> int:
    """Print the table; TABLE_HELP is the text that people see."""
    rows = study.table(approaches, seed)
    if as_json:
        console.print_json({"approaches": approaches, "seed": seed, "rows": [asdict(row) for row in rows]})
    else:
        console.out.print(_drawn(rows))
    return 1 if any(row.failed for row in rows) else 0


def _drawn(rows: list[study.Figures]) -> Table:
    drawn = Table(
        "surface", "valid", "bias", "sigma", "off > 25 %", "OF_y rad/s", "within 2 sigma", "ratio", "beyond", box=None
    )
    for row in rows:
        numbers = (
            (
                f"{100 * row.bias:+.2f} %",
                f"{100 * row.sigma:.2f} %",
                f"{100 * row.outliers:.2f} %",
                f"{row.of_y:.3f}",
                f"{100 * row.within:.1f} %",
            )
            if row.valid > 0.0
            else ("-",) * 5
        )
        ratio = f"{row.ratio:.2f}" if row.ratio else ""
        drawn.add_row(row.name, f"{100 * row.valid:.1f} %", *numbers, ratio, ", ".join(row.failed))
    return drawn
