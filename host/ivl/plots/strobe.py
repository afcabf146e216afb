"""A landing as a strobe picture: side view of body, legs, propellers and surface at equal time steps.

The view is along the surface, from the surface's own frame: of a level ceiling, x and z of the world. Left the approach
and the flip, until touch-down; right the touch-down and the swing, enlarged and with finer steps. Of a flight that its
policy called off: left until the decision and the rise to the closest point, right how it levels out from there.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ivl.flown import landings
from ivl.learning.recorder import SCORED
from ivl.outcome import four_leg, verdict
from ivl.plots import style
from ivl.run import RunResult
from ivl.seeds import Purpose, derive
from ivl.world import Trace, World, rotation

N_GHOSTS = 8
_BEFORE_TRIGGER_S, _SWING_S = 0.03, 0.14
_LEVEL_OUT_S = 0.4
# legs 1 front-right, 2 rear-right, 3 rear-left, 4 front-left
_LEG_SIGNS = np.array([[1, -1], [-1, -1], [-1, 1], [1, 1]])

FloatArray = npt.NDArray[np.float64]


def draw_last_landing(result: RunResult) -> list[Path]:
    """Fly the last four-leg landing of a run (or its last rollout) again and draw it into the run's folder.

    Of a run that a vehicle has flown the recording is drawn, and beside it the simulated counterpart.
    """
    if "flown" in result.summary:
        return _draw_last_flown(result)
    scored = np.flatnonzero(result.rollouts.status == SCORED)
    landed = scored[four_leg(result.rollouts.outcomes[scored])]
    row = int(landed[-1] if landed.size else scored[-1])
    chosen, theta = result.experiment, result.rollouts.theta[row]
    trace = result.world.trace(
        chosen.speed_mps,
        chosen.angle_deg,
        *theta.tolist(),
        form=chosen.policy.form,
        seed=derive(chosen.seed + int(result.rollouts.trial[row]), Purpose.WORLD),
        stream=int(result.rollouts.stream[row]),
        start=chosen.start,
        period_s=0.001,
    )
    return draw(result.world, trace, [result.folder / f"last_landing{suffix}" for suffix in (".png", ".svg")])


def _draw_last_flown(result: RunResult) -> list[Path]:
    """The last recording of a landing on three or four legs, or the last one at all; none, if no flip was recorded."""
    found = landings(result.folder, result.experiment, result.world, result.rollouts)
    flips = [(each, each.recorded) for each in found if each.recorded is not None]
    landed = [(each, trace) for each, trace in flips if four_leg(result.rollouts.outcomes[[each.row]])[0]]
    if not flips:
        return []
    each, recorded = (landed or flips)[-1]
    drawn = []
    for name, trace, told in (
        ("last_landing", recorded, "RECORDED (legs as in flight)"),
        ("last_landing_simulated", each.simulated, "SIMULATED counterpart"),
    ):
        paths = [result.folder / f"{name}{suffix}" for suffix in (".png", ".svg")]
        drawn += draw(result.world, trace, paths, f"rollout {each.number}, {told}")
    return drawn


@style.drawing
def draw(world: World, trace: Trace, paths: Sequence[Path], what: str = "") -> list[Path]:
    """Draw one landing; trigger and touch-down in colours of their own, the ghosts coloured by time.

    Args:
        world: Gives the shapes.
        trace: The landing.
        paths: Files to write.
        what: What it is, before the title; empty: a simulated one.
    """
    figure = style.new_figure(7.5, 5.0)
    left, right = figure.subplots(1, 2)
    first_s, touch_s, last_s = _window(world, trace)
    titles = (
        ("approach and rise", "level-out") if trace.outcome.no_go else ("approach and flip", "touch-down and swing")
    )
    _draw_panel(figure, left, world, trace, first_s, touch_s, titles[0])
    _draw_panel(figure, right, world, trace, touch_s, last_s, titles[1])
    left.set_ylabel(_labels(world)[1])
    figure.suptitle(f"{what}: {_title(world, trace)}" if what else _title(world, trace), fontsize=style.NORMAL)
    events = _events(world, trace)
    for label, time_s, color in events:
        left.plot([], [], color=color, linewidth=2.2, label=f"{label}, t = {time_s:.3f} s")
    if events:
        figure.legend(loc="outside lower center", ncols=2, fontsize=style.SMALL, frameon=False)
    return style.save(figure, paths)


def _draw_panel(
    figure: Figure, axis: Axes, world: World, trace: Trace, first_s: float, last_s: float, title: str
) -> None:
    """Ghosts at equal steps from `first_s` to `last_s`, and the events that lie between."""
    rows, color_map, scale = trace.rows, mpl.colormaps["viridis"], Normalize(first_s, last_s)
    times = np.linspace(first_s, last_s, N_GHOSTS)
    for time_s in times:
        _draw_vehicle(axis, world, _row_at(rows, time_s), color_map(scale(time_s)), 1.0)
    for _, time_s, color in _events(world, trace):
        if first_s <= time_s <= last_s:
            _draw_vehicle(axis, world, _row_at(rows, time_s), color, 2.0)
    path = (rows.t_s >= first_s) & (rows.t_s <= last_s)
    flown = _side(world, rows.p_WB_m[path], rows.t_s[path])
    axis.plot(*flown.T, color=style.GREY, linewidth=0.6, linestyle="--", zorder=0)
    axis.axhline(0.0, color="black", linewidth=1.5)
    if not world.surface.is_level:
        _draw_gravity(axis, world)
    bar = figure.colorbar(ScalarMappable(scale, color_map), ax=axis, location="bottom", shrink=0.8)
    bar.set_label(f"time (s), a ghost every {1000 * (times[1] - times[0]):.0f} ms", fontsize=style.SMALL)
    bar.ax.tick_params(labelsize=style.SMALL)
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel(_labels(world)[0])
    axis.set_title(title, fontsize=style.NORMAL)
    style.finish(axis)


def _window(world: World, trace: Trace) -> tuple[float, float, float]:
    """Start of the picture, touch-down (closest approach if there was none), and end."""
    rows, outcome = trace.rows, trace.outcome
    touch_s = float(outcome.t_impact_s)
    if not np.isfinite(touch_s):
        touch_s = _closest_s(trace)
    if outcome.no_go:
        return (
            max(0.0, world.called_off_s(trace) - _BEFORE_TRIGGER_S),
            touch_s,
            min(touch_s + _LEVEL_OUT_S, rows.t_s[-1]),
        )
    trigger_s = float(outcome.t_trigger_s) if np.isfinite(outcome.t_trigger_s) else touch_s - 0.2
    first_s = max(0.0, min(trigger_s - _BEFORE_TRIGGER_S, touch_s - _BEFORE_TRIGGER_S))
    return first_s, touch_s, touch_s + _SWING_S


def _closest_s(trace: Trace) -> float:
    return float(trace.rows.t_s[int(np.argmin(trace.rows.d_ceil_m))])


def _events(world: World, trace: Trace) -> list[tuple[str, float, str]]:
    outcome = trace.outcome
    found = [("trigger", outcome.t_trigger_s, style.VERMILION), ("touch-down", outcome.t_impact_s, style.PURPLE)]
    if outcome.no_go:
        found = [("no-go", world.called_off_s(trace), style.VERMILION), ("closest", _closest_s(trace), style.PURPLE)]
    return [(label, float(time_s), color) for label, time_s, color in found if np.isfinite(time_s)]


def _row_at(rows: Any, time_s: float) -> Any:
    return rows[min(int(np.searchsorted(rows.t_s, time_s)), len(rows) - 1)]


def _draw_vehicle(axis: Axes, world: World, row: Any, color: Any, width: float) -> None:
    """Propeller plate thick, base plate thinner, the post between them, and four legs from hip to foot."""
    values, to_world = world.params.values, rotation(row.q_WB)
    top, bottom = values["prop_plate.center_z"], values["base_plate.center_z"]
    shapes_B = (
        ([[-values["prop_plate.size_x"] / 2, 0, top], [values["prop_plate.size_x"] / 2, 0, top]], 2.0),
        ([[-values["base_plate.size_x"] / 2, 0, bottom], [values["base_plate.size_x"] / 2, 0, bottom]], 1.2),
        ([[0, 0, bottom], [0, 0, top]], 1.2),
    )
    for points_B, line_width in shapes_B:
        points = _side(world, row.p_WB_m + np.array(points_B) @ to_world.T, row.t_s)
        axis.plot(*points.T, color=color, linewidth=line_width * width, solid_capstyle="round")
    feet = row.foot_W_m.reshape(4, 3)
    hips_B = np.column_stack([values["leg.hip_xy"] * _LEG_SIGNS, np.full(4, values["leg.hip_z"])])
    for leg in np.stack([row.p_WB_m + hips_B @ to_world.T, feet], axis=1):
        axis.plot(*_side(world, leg, row.t_s).T, color=color, linewidth=0.8 * width)
    side = _side(world, feet, row.t_s)
    axis.scatter(side[:, 0], side[:, 1], s=5 * width, color=[color], zorder=3)


def _side(world: World, points_W_m: FloatArray, t_s: npt.ArrayLike) -> FloatArray:
    """Place along the surface, and height above it, shape (n, 2)."""
    return world.surface.seen(points_W_m, t_s)[..., [0, 2]]


def _labels(world: World) -> tuple[str, str]:
    if world.surface.is_level:
        return "x (m)", "z above the ceiling's surface (m)"
    return "along the surface (m)", "above the surface (m)"


def _draw_gravity(axis: Axes, world: World) -> None:
    """An arrow in the direction in which things fall; shorter as far as it points into the picture."""
    along, _, above = world.surface.axes_W @ [0.0, 0.0, -1.0]
    axis.annotate(
        "", (0.12 + 0.1 * along, 0.12 + 0.1 * above), (0.12, 0.12), xycoords="axes fraction",
        arrowprops={"arrowstyle": "->", "color": style.GREY},
    )  # fmt: skip
    axis.text(0.12, 0.12, "g", transform=axis.transAxes, fontsize=style.SMALL, color=style.GREY)


def _title(world: World, trace: Trace) -> str:
    return f"{world.vehicle}, {world.gear_set}/{world.gear}: {verdict(trace.outcome)}"
