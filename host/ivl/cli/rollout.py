"""`ivl rollout`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ivl import model, outcome, tracefile
from ivl.cli import console
from ivl.errors import ConfigError
from ivl.experiment import parse_setting
from ivl.rewards import TOTAL, RewardChoice
from ivl.world import Trace, World

HELP = """Fly one landing and print its outcome.

\b
Examples:
  ivl rollout --gear wide_short --speed 2.5 --angle 90 --rrev 4.8 --moment 8
      the outcome, field by field
  ivl rollout --gear wide_long --gear-set as_simulated --speed 3 --angle 60 --rrev 4 --moment 7 --plot landing.png
      a strobe picture
  ivl rollout --speed 2.5 --angle 90 --rrev 4.8 --moment 8 --trace landing.csv --json
      the whole time series, and the outcome for a script
  ivl rollout --vehicle crazyflie21 --speed 2.5 --angle 90 --rrev 6 --moment 8 --set sense.latency=0.02
      another vehicle, slower sensing
"""
_TRACE_PERIOD_S = 0.001


class Start(StrEnum):
    """How a rollout starts."""

    IMPARTED = "imparted"
    FLOWN = "flown"
    AT_TRIGGER = "at_trigger"


def rollout(
    speed: Annotated[float, typer.Option(help="Approach speed, m/s.")],
    angle: Annotated[float, typer.Option(help="Approach angle above the horizontal, degrees.")],
    rrev: Annotated[float, typer.Option(help="Trigger threshold RREV_c, 1/s.")],
    moment: Annotated[float, typer.Option(help="Flip moment M_yd, N mm (magnitude, nose up).")],
    gear: Annotated[str, typer.Option(help="Landing gear; see `ivl list gears`.")] = "wide_short",
    gear_set: Annotated[str, typer.Option(help="Set of landing gears.")] = model.DEFAULT_GEAR_SET,
    vehicle: Annotated[str, typer.Option(help="Vehicle; see `ivl list vehicles`.")] = "habas2021",
    sensors: Annotated[
        str | None, typer.Option(help="Sensor set in place of the vehicle's own sensing; see `ivl list sensors`.")
    ] = None,
    start: Annotated[
        Start, typer.Option(help="At the approach velocity, from hover, or at the trigger.")
    ] = Start.IMPARTED,
    distance: Annotated[float | None, typer.Option(help="Distance to the ceiling at the start, m.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.", min=0)] = 0,
    stream: Annotated[int, typer.Option(help="Number of the rollout within the seed.", min=0)] = 0,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="A.B=C", help="Change a parameter of the world.")
    ] = None,
    trace: Annotated[Path | None, typer.Option(help="Write the time series to FILE (.csv or .npz).")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the landing into FILE (.png, .svg or .pdf).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Fly one landing; HELP is the text that people see."""
    if trace:
        tracefile.check_suffix(trace)
    if plot and plot.suffix not in (".png", ".svg", ".pdf"):
        raise ConfigError(f"--plot {plot}: unknown kind of file (allowed .png, .svg, .pdf)")
    overrides = dict(parse_setting(text) for text in settings or [])
    world = World(vehicle, gear, gear_set, sensors, **overrides)
    flight = world.trace(
        speed, angle, rrev, moment, seed, start.value, distance, stream=stream, period_s=_TRACE_PERIOD_S
    )
    if trace:
        tracefile.write(trace, flight.rows)
    if plot:
        _draw(world, flight, plot)
    result = _result(world, flight)
    if as_json:
        console.print_json(result)
    else:
        _report(result)


def _draw(world: World, flight: Trace, path: Path) -> None:
    from ivl.plots import strobe  # matplotlib takes a second to load

    strobe.draw(world, flight, [path])


def _result(world: World, flight: Trace) -> dict[str, Any]:
    """The outcome's fields by name, and what they amount to."""
    record = flight.outcome
    result = outcome.as_dict(record, world.end_reason(record.end_reason))
    batch = np.array([record], dtype=record.dtype)
    result["four_leg"] = bool(outcome.four_leg(batch)[0])
    result["clean"] = bool(outcome.clean(batch)[0])
    result["reward_paper"] = float(RewardChoice(name="paper").score(batch)[TOTAL][0])
    return result


def _report(result: dict[str, Any]) -> None:
    for name, value in result.items():
        text = f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)
        console.out.print(f"{name:24s} {text}", highlight=False, soft_wrap=True)
