"""The command line, one module a command.

Exit codes: 0 success, 1 the work failed, 2 wrong usage or configuration, 130 interrupted.
"""

import errno
import os
import sqlite3
import sys
from contextlib import suppress
from typing import Annotated

import typer

from ivl import __version__, files, memory, optional
from ivl.cli import (
    amend,
    bench,
    camera,
    can_gateway,
    console,
    doctor,
    estimate,
    export,
    family,
    figs,
    flash,
    flight,
    fly,
    init,
    learn,
    listing,
    mocap,
    policy,
    report,
    rollout,
    sil,
    site,
    stop,
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


def _tell_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"ivl {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Print the version, and stop.")
    ] = False,
) -> None:
    del version


app.command("learn", help=learn.HELP, short_help="Learn to land, and judge what was learned.")(learn.learn)
app.command("rollout", help=rollout.HELP)(rollout.rollout)
app.command("sweep", help=sweep.HELP, short_help="Learn over a grid of approaches and landing gears.")(sweep.sweep)
app.command("map", help=sweep.MAP_HELP, short_help="Fly a grid of flips without learning.")(sweep.map_)
app.command("report", help=report.HELP, short_help="Write the page of a run, to explore and to mail.")(report.report)
app.command("figs", help=figs.HELP, short_help="Draw the paper's figures 4 to 9 from a campaign.")(figs.figs)
app.command("export", help=export.HELP, short_help="Write a landing as MCAP, CSV or .rrd.")(export.export)
app.command("estimate", help=estimate.HELP, short_help="Show how well the core knows its distance.")(estimate.estimate)
app.command("list", help=listing.HELP)(listing.list_)
app.command("init", help=init.HELP, short_help="Write a new experiment with comments.")(init.init)
app.command("schema", help=init.SCHEMA_HELP, short_help="Print the schema of a kind of file, for editors.")(init.schema)
app.command("bench", help=bench.HELP)(bench.bench)
app.command("sil", help=sil.HELP)(sil.sil)
app.command("fly", help=fly.HELP, short_help="Fly one landing with a vehicle.")(fly.fly)
app.command("doctor", help=doctor.HELP, short_help="Check a vehicle before it flies.")(doctor.doctor)
app.command("mocap", help=mocap.HELP, short_help="Watch a motion-capture system.")(mocap.mocap)
app.command("can-gateway", help=can_gateway.HELP, short_help="Carry the link of a vehicle over a CAN bus.")(
    can_gateway.can_gateway
)
app.command("flash", help=flash.HELP)(flash.flash)
app.command("stop", help=stop.HELP, short_help="Stop a vehicle that flies now.")(stop.stop)
app.add_typer(site.app, name="site", short_help="Describe the room in which a drone flies.")
app.add_typer(camera.app, name="camera", short_help="Show how well the onboard camera sees a surface.")
app.add_typer(amend.app, name="run", short_help="Amend the outcome of a flown landing.")
app.add_typer(family.app, name="family", short_help="Show the vehicles that a task may be flown with.")
app.add_typer(policy.app, name="policy", short_help="Learn, show and judge policies for every approach.")
app.add_typer(flight.app, name="flight", short_help="Import, replay, compare and identify recorded flights.")


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
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "ivl"
        return _fail(f"{error.format_message().replace('Value error, ', '')} (try `{command} --help`)", 2)
    except (KeyboardInterrupt, typer.Abort):
        return 130
    except (ImportError, LookupError, RuntimeError, SystemError) as error:
        advice = _advice(error)
        if advice is None:
            raise
        return _fail(advice, 1)
    except BrokenPipeError:
        return 1  # whoever read the output has gone, as `head` does: nobody is left to tell
    except OSError as error:
        return _fail(f"{error.filename or 'output'}: {files.reason(error)}", 1)
    except MemoryError:
        return _fail("there is not enough memory for this: ask for less at once, or raise the limit (ulimit -v)", 1)
    except sqlite3.Error as error:
        return _fail(f"a database failed: {error}", 1)


def main() -> None:
    """Entry point of the `ivl` program."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # a terminal without ± or Greek letters shows their codes
    code = run()
    sys.exit(_flush(code))


def _flush(code: int) -> int:
    """Bring out what was printed; whoever cannot be told in words is told by the exit code."""
    if sys.stdout is None:
        return code
    try:
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python would try again at its end
        return 1 if error.errno == errno.EPIPE else _fail(f"output: {files.reason(error)}", 1)
    return code


def _advice(error: Exception) -> str | None:
    """What helps against something that could not be loaded; None for a fault of the program."""
    missing = optional.hint(error) if isinstance(error, ModuleNotFoundError) else None
    return missing or memory.explain(error)


def _fail(message: str, code: int) -> int:
    with suppress(OSError):
        console.err.print(f"ivl: {' '.join(message.splitlines())}", style="red")
    return code
