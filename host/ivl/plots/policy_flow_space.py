"""Approaches through the flow space (RREV, OF_y, d) to a policy's surface: the space of the paper's Fig. 7."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ivl.plots import spaces, style
from ivl.policy.region import PLANE
from ivl.policy.shape import FloatArray, General
from ivl.policy.survey import Path as FlownPath
from ivl.policy.survey import Survey

NAME = "policy_flow_space"
_COLUMNS = ("of_y_radps", "rrev_per_s", "d_ceil_m")
_N_LINES = 25
_OUTER = 99.0
"""Per cent of the landings of the grid that the axes hold."""
_COLORS = {"landed": style.BLUE, "failed": style.VERMILION, "no flip": style.GREY}


@style.drawing
def draw(found: Survey, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw the space on the left, two plane views on the right.

    Args:
        found: The flights.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.
    """
    figure = style.new_figure(8.2, 4.6)
    space, place = spaces.space_and_planes(figure, 0.56)
    place.remove()
    good = found.best.landable()[:, [1, 0, 2]]
    limits = _limits(good, surface(found.general, found.theta))
    mesh = _inside(surface(found.general, found.theta), limits)
    space.plot_surface(*np.moveaxis(mesh, -1, 0), color=style.GREEN, alpha=0.35, linewidth=0, shade=False)
    inner = _inside(good, limits)
    space.scatter(*inner.T, s=1.5, color=style.ORANGE, alpha=0.25, linewidths=0, depthshade=False)
    for path in found.paths:
        points = _inside(_points(path), limits)
        space.plot(*points.T, color=_COLORS[_kind(path)], linewidth=0.8)
        space.scatter(*points[-1:].T, s=9, color=_COLORS[_kind(path)], depthshade=False)
    spaces.label_3d(space, _COLUMNS)
    for name, (low, high) in zip("xyz", limits, strict=True):
        getattr(space, f"set_{name}lim")(low, high)
    space.view_init(elev=20, azim=-60)
    for axis, (i, j) in zip(figure.subplots(2, 1), ((0, 1), (2, 1)), strict=True):
        _draw_plane(axis, found, mesh, good, limits, i, j)
    figure.legend(handles=_handles(), loc="lower left", ncols=2, fontsize=style.SMALL, frameon=False)
    seen = [path for path in found.paths if len(path.d_ceil_m)]
    near = f", {len(found.paths) - len(seen)} more begin too near for a cue" if len(seen) < len(found.paths) else ""
    figure.suptitle(
        f"{found.general.form.name}: {len(seen)} fresh approaches, as sensed, up to the trigger{near}",
        fontsize=style.NORMAL,
    )
    return style.save(figure, paths, dpi)


def surface(general: General, theta: FloatArray) -> FloatArray:
    """Points OF_y, RREV, d at which the core begins to flip, over speeds and angles of the plane, shape (n, n, 3)."""
    (v_lo, v_hi), (a_lo, a_hi) = PLANE.speeds_mps, PLANE.angles_deg
    angles = np.deg2rad(np.linspace(a_lo, a_hi, _N_LINES))
    speed, angle = np.meshgrid(np.linspace(v_lo, v_hi, _N_LINES), angles, indexing="ij")
    vx, vz = speed * np.cos(angle), speed * np.sin(angle)
    rrev = general.thresholds(theta, vx, vz)
    d_m = vz / rrev
    return np.stack([-vx / d_m, rrev, d_m], axis=-1)


def _draw_plane(
    axis: Axes, found: Survey, mesh: FloatArray, good: FloatArray, limits: FloatArray, i: int, j: int
) -> None:
    axis.scatter(good[:, i], good[:, j], s=2, color=style.ORANGE, alpha=0.25, linewidths=0, rasterized=True)
    for path in found.paths:
        points, color = _points(path), _COLORS[_kind(path)]
        axis.plot(points[:, i], points[:, j], color=color, linewidth=0.6)
        axis.plot(points[-1:, i], points[-1:, j], ".", color=color, markersize=4)
    for line in mesh[:: _N_LINES // 4]:  # lines of equal speed on the surface
        axis.plot(line[:, i], line[:, j], color=style.GREEN, linewidth=1.0, zorder=3)
    axis.set_xlim(*limits[i])
    axis.set_ylim(*limits[j])
    spaces.label_2d(axis, _COLUMNS[i], _COLUMNS[j])


def _points(path: FlownPath) -> FloatArray:
    return np.column_stack([path.of_y_radps, path.rrev_per_s, path.d_ceil_m])


def _kind(path: FlownPath) -> str:
    return "landed" if path.landed else "failed" if path.triggered else "no flip"


def _limits(good: FloatArray, mesh: FloatArray) -> FloatArray:
    """Ranges of the axes, shape (3, 2): what the surface spans, and nearly all landings of the grid."""
    found = [mesh.reshape(-1, 3)]
    if len(good):
        found.append(np.percentile(good, [100.0 - _OUTER, _OUTER], axis=0))
    points = np.concatenate(found)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * (high - low)
    return np.column_stack([low - margin, high + margin])


def _inside(points: FloatArray, limits: FloatArray) -> FloatArray:
    """The points, NaN where they lie outside: a view in space does not cut at its limits."""
    outside = np.any((points < limits[:, 0]) | (points > limits[:, 1]), axis=-1, keepdims=True)
    return np.where(outside, np.nan, points)


def _handles() -> list[Any]:
    lines = [Line2D([], [], color=color, marker=".", label=f"approach, {kind}") for kind, color in _COLORS.items()]
    region = Line2D([], [], color=style.ORANGE, marker=".", linestyle="none", label="flips of the grid that land")
    own = Line2D([], [], color=style.GREEN, linewidth=2, label="surface R*; lines: equal speed")
    return [*lines, region, own]
