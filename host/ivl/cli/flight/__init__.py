"""`ivl flight`: recorded flights, one module a subcommand."""

import typer

from ivl.cli.flight import compare, identify, import_, replay, show

HELP = """Work with recorded flights: import a log, replay it, compare it with the simulation, identify the vehicle.

\b
Examples:
  ivl flight import learning.csv --format habas2021 --out flights/july
      a log of another program becomes a folder of flights
  ivl flight replay flights/july
      the flight core sees what was recorded: the same cues, the same trigger?
  ivl flight compare flights/july --vehicle crazyflie21 --gear wide_short
      recorded against simulated motion and outcome, drawn
  ivl flight identify flights/july --vehicle crazyflie21 --fit rotor.tau_down,sense.latency --out my.yaml
      the vehicle that flew, as a vehicle file
"""

app = typer.Typer(help=HELP, rich_markup_mode=None, no_args_is_help=True)
app.command("import", help=import_.HELP, short_help="Turn logs of other programs into flights.")(import_.import_)
app.command("show", help=show.HELP, short_help="Show what a folder of flights holds.")(show.show)
app.command("replay", help=replay.HELP, short_help="Feed recorded states to the flight core.")(replay.replay)
app.command("compare", help=compare.HELP, short_help="Hold flights against the simulation.")(compare.compare)
app.command("identify", help=identify.HELP, short_help="Fit a vehicle to recorded motion.")(identify.identify)
