"""`ivl mocap`."""

import contextlib
import math
import time
from collections.abc import Iterator
from typing import Annotated

import typer
from rich.live import Live
from rich.table import Table
from rich.text import Text

from ivl.cli import console
from ivl.errors import ConfigError, LinkError
from ivl.mocap import config as configs
from ivl.mocap.config import MocapConfig
from ivl.mocap.stream import Mocap, MocapState
from ivl.mocap.watch import Status

HELP = """Watch a motion-capture system: rate, jitter, pose, and whether a vehicle could be flown with it.

CONFIG is a YAML file, or one of the examples that `ivl mocap --list` names. With --uri poses are also sent to the
vehicle, as in a flight. Ctrl-C ends it. docs/MOCAP.md has the fields and what each status means.

\b
Examples:
  ivl mocap --config lab.yaml
      a live view
  ivl mocap --config lab.yaml --seconds 5 --json
      one report for a script; exit code 1 if it is not good enough to fly
  ivl mocap --config simulator --uri udp://127.0.0.1:19850
      the software vehicle (`make sil`), tracked like a vehicle in a room
"""
_REFRESH_HZ = 10
_COLOURS = {Status.GOOD: "green", Status.SETTLING: "yellow", Status.CONNECTING: "yellow"}


def mocap(
    config: Annotated[str | None, typer.Option(help="Configuration file, or the name of an example.")] = None,
    uri: Annotated[str | None, typer.Option(help="Vehicle that gets the poses.")] = None,
    seconds: Annotated[float | None, typer.Option(help="End after so many seconds (with --json: 3).", min=0.1)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object at the end.")] = False,
    list_: Annotated[bool, typer.Option("--list", help="Name the examples in the package and exit.")] = False,
) -> int:
    """Watch a tracking system; HELP is the text that people see."""
    if list_:
        for name in configs.list_configs():
            print(f"{name:12s} {configs.load(name).doc}")
        return 0
    if config is None:
        raise ConfigError(f"--config is needed: a file, or one of {', '.join(configs.list_configs())}")
    checked = configs.load(config)
    with _tracked(checked, uri) as tracking:
        with contextlib.suppress(KeyboardInterrupt):
            _watch(tracking, seconds if seconds is not None or not as_json else 3.0, quiet=as_json)
        state, problems = tracking.state(), tracking.problems()
    if as_json:
        console.print_json({**state.to_json(), "problems": problems})
    else:
        for problem in problems:
            console.err.print(problem, style="red")
    return 1 if problems else 0


@contextlib.contextmanager
def _tracked(config: MocapConfig, uri: str | None) -> Iterator[Mocap]:
    """Motion capture as configured, with the link to a vehicle if one is asked for."""
    if uri is None:
        if config.system == "simulator":
            raise ConfigError("--uri is needed: system simulator tracks a software vehicle over its link")
        with Mocap(config) as tracking:
            yield tracking
        return
    try:
        from ivl.links.tables import Session
        from ivl.mocap.simulated import SimulatedRoom
    except ImportError as error:
        raise LinkError(f"a link needs cflib: pip install 'ivl[link]' ({error})") from error
    with contextlib.ExitStack() as stack:
        session = stack.enter_context(Session(uri))
        request = None
        if config.system == "simulator":
            room = stack.enter_context(SimulatedRoom(session, config.body))
            stack.callback(session.write, session.read(["sil.pose_source"]))
            session.write({"sil.pose_source": 1})
            request = room.request(config)
        session.write(config.vehicle_params())
        yield stack.enter_context(Mocap(config, session.cf.extpos, request))


def _watch(tracking: Mocap, seconds: float | None, quiet: bool) -> None:
    ends_s = math.inf if seconds is None else time.monotonic() + seconds
    view = contextlib.nullcontext() if quiet else Live(console=console.err, auto_refresh=False)
    with view as live:
        while time.monotonic() < ends_s:
            if live is not None:
                live.update(_table(tracking.config, tracking.state()), refresh=True)
            time.sleep(1.0 / _REFRESH_HZ)


def _table(config: MocapConfig, state: MocapState) -> Table:
    table = Table(show_header=False, box=None)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    rates, counts, number = state.rates, state.counts, console.number
    table.add_row("system", f"{config.system} {config.host}".rstrip())
    table.add_row("status", Text.assemble((state.status, _COLOURS.get(state.status, "red")), f"  {state.text}"))
    table.add_row("position", _vector(state.pose.p_W_m if state.pose else None, "m", 3))
    table.add_row("roll, pitch, yaw", _vector(_euler_deg(state), "deg, nose down positive", 1))
    table.add_row("age", f"{number(1e3 * state.age_s, 0)} ms")
    table.add_row("rate", f"{number(rates.rate_hz, 1)} Hz   (needed {config.rate_hz_min:g})")
    table.add_row(
        "intervals",
        f"{number(rates.interval_p50_ms, 1)} median, {number(rates.interval_p99_ms, 1)} p99, "
        f"{number(rates.interval_ms_max, 1)} max ms   (p99 allowed {config.jitter_ms_max:g})",
    )
    table.add_row(
        "frames",
        f"{counts.n_frames}, without {config.body} {counts.n_absent}, unusable {counts.n_unusable}, "
        f"freezes {counts.n_frozen}, jumps {counts.n_jumps}",
    )
    table.add_row("sent", f"{state.n_sent}   connections {1 + state.n_restarts}   {state.sink_error}")
    if state.n_strange:
        table.add_row("strange lines", f"{state.n_strange} of the tracking client")
    table.add_row("bodies", ", ".join(state.bodies) or "-")
    return table


def _vector(values: tuple[float, ...] | None, unit: str, digits: int) -> str:
    return "-" if values is None else "  ".join(f"{value:+.{digits}f}" for value in values) + f"  {unit}"


def _euler_deg(state: MocapState) -> tuple[float, ...] | None:
    if state.pose is None:
        return None
    x, y, z, w = state.pose.q_WB
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return tuple(math.degrees(angle) for angle in (roll, pitch, yaw))
