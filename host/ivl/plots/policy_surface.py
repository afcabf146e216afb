"""The surface R*(v_x, v_z) of a policy for every approach, and its probability of a landing, asked of the core."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from ivl.plots import style
from ivl.plots.spaces import RATE_MAP
from ivl.policy.region import BOX, PLANE, Region
from ivl.policy.shape import FloatArray, General

NAME = "policy_surface"
_STEP_MPS = 0.05
_VX_MPS = np.arange(0.0, 4.2 + 0.5 * _STEP_MPS, _STEP_MPS)
_VZ_MPS = np.arange(0.1, 4.2 + 0.5 * _STEP_MPS, _STEP_MPS)
_OUTLINES = ((BOX, "box", "-"), (PLANE, "plane", "--"))
_ON_ANY_GROUND = [withStroke(linewidth=2.6, foreground="black")]


@style.drawing
def draw(general: General, theta: FloatArray, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw threshold and probability over the sensed velocities, with the commanded regions.

    Args:
        general: The form.
        theta: The policy's numbers.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.
    """
    figure = style.new_figure(7.5, 3.9)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    vx, vz = np.meshgrid(_VX_MPS, _VZ_MPS)
    _field(figure, left, general.thresholds(theta, vx, vz), "viridis", (None, None), "threshold $R^*$ of RREV (1/s)")
    p = general.probabilities(theta, vx, vz)
    _field(figure, right, p, RATE_MAP, (0.0, 1.0), "estimated probability of a landing")
    p_min = float(theta[general.go_p_min])
    if p.min() < p_min < p.max():
        lines = right.contour(vx, vz, p, levels=[p_min], colors=[style.VERMILION], linewidths=1.6)
        right.clabel(lines, fmt={p_min: f"$P_{{min}}$ = {p_min:g}"}, fontsize=style.SMALL)
    for axis in (left, right):
        for region, name, dashes in _OUTLINES:
            axis.plot(*outline(region).T, dashes, color="white", linewidth=1.3, label=name, path_effects=_ON_ANY_GROUND)
        axis.set_xlabel("sensed $v_x$ along the ceiling (m/s)")
        axis.set_xlim(_VX_MPS[0], _VX_MPS[-1])
        axis.set_ylim(_VZ_MPS[0], _VZ_MPS[-1])
        style.finish(axis)
    left.set_ylabel("sensed closing speed $v_z$ (m/s)")
    legend = left.legend(loc="upper right", fontsize=style.SMALL, framealpha=0.5, title="commanded $(V, \\varphi)$")
    legend.get_title().set_fontsize(style.SMALL)
    moments = general.moments(theta, vx, vz)
    low, high = moments.min(), moments.max()
    told = f"{low:.2f}" if np.isclose(low, high) else f"{low:.2f} to {high:.2f}"
    figure.suptitle(f"form {general.form.name}; moment {told} N mm", fontsize=style.NORMAL)
    return style.save(figure, paths, dpi)


def outline(region: Region) -> FloatArray:
    """Velocities along the edge of a region of commanded speeds and angles: v_x, v_z, shape (n, 2)."""
    (v_lo, v_hi), (a_lo, a_hi) = region.speeds_mps, region.angles_deg
    angles = np.deg2rad(np.linspace(a_lo, a_hi, 61))
    speed = np.concatenate([np.full(angles.size, v_lo), np.full(angles.size, v_hi), [v_lo]])
    angle = np.concatenate([angles, angles[::-1], angles[:1]])
    return np.column_stack([speed * np.cos(angle), speed * np.sin(angle)])


def _field(
    figure: Figure,
    axis: Axes,
    values: FloatArray,
    color_map: str,
    limits: tuple[float | None, float | None],
    label: str,
) -> None:
    image = axis.pcolormesh(
        _VX_MPS, _VZ_MPS, values, cmap=color_map, vmin=limits[0], vmax=limits[1], shading="nearest", rasterized=True
    )
    bar = figure.colorbar(image, ax=axis, location="bottom", shrink=0.85, aspect=30)
    bar.set_label(label, fontsize=style.NORMAL)
    bar.ax.tick_params(labelsize=style.SMALL)
