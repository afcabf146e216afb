"""The command line: `ivl learn`, `ivl rollout`, `ivl list`, `ivl bench`, `ivl flash`.

Exit codes: 0 success, 1 the work failed, 2 wrong usage or configuration, 130 interrupted.
"""

import sys

import typer

from ivl.cli import (
    bench,
    can_gateway,
    console,
    doctor,
    estimate,
    export,
    figs,
    flash,
    fly,
    learn,
    listing,
    mocap,
    report,
    rollout,
    sil,
    sweep,
)
from ivl.errors import ArgumentError, ConfigError, IvlError, LearnerError

app = typer.Typer(
    name="ivl",
    help="Inverted landing: learn to land a small multicopter on a ceiling.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command("learn", help=learn.HELP)(learn.learn)
app.command("rollout", help=rollout.HELP)(rollout.rollout)
app.command("list", help=listing.HELP)(listing.list_)
app.command("bench", help=bench.HELP)(bench.bench)
app.command("flash", help=flash.HELP)(flash.flash)
app.command("sil", help=sil.HELP)(sil.sil)
app.command("doctor", help=doctor.HELP)(doctor.doctor)
app.command("fly", help=fly.HELP)(fly.fly)
app.command("mocap", help=mocap.HELP)(mocap.mocap)
app.command("can-gateway", help=can_gateway.HELP)(can_gateway.can_gateway)
app.command("sweep", help=sweep.HELP)(sweep.sweep)
app.command("map", help=sweep.MAP_HELP)(sweep.map_)
app.command("report", help=report.HELP)(report.report)
app.command("figs", help=figs.HELP)(figs.figs)
app.command("estimate", help=estimate.HELP)(estimate.estimate)
app.command("export", help=export.HELP)(export.export)


def run(arguments: list[str] | None = None) -> int:
    """Run one command and return its exit code; errors are one line on stderr."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments:
        app(["--help"], standalone_mode=False, prog_name="ivl")
        return 2
    try:
        result = app(arguments, standalone_mode=False, prog_name="ivl")
        return int(result or 0)
    except (ConfigError, ArgumentError, LearnerError) as error:
        return _fail(str(error), 2)
    except IvlError as error:
        return _fail(str(error), 1)
    except typer.TyperException as error:
        return _fail(f"{error.format_message()} (try `ivl --help`)", 2)
    except (KeyboardInterrupt, typer.Abort):
        return 130


def main() -> None:
    """Entry point of the `ivl` program."""
    sys.exit(run())


def _fail(message: str, code: int) -> int:
    console.err.print(f"ivl: {message}", style="red", highlight=False, markup=False, soft_wrap=True)
    return code
