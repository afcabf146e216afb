"""Recorded flights over simulated ones: pitch, height and rate after the trigger, and the landing window."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from ivl.flight import compare, motion
from ivl.flight.compare import Comparison, Row, Window
from ivl.flight.store import FloatArray
from ivl.plots import style
from ivl.world import World

_SIGNALS = (
    ("pitch, nose up (deg)", "pitch_deg"),
    ("sensed height (m)", "height_m"),
    ("rate, nose up (rad/s)", "rate_radps"),
)
_COLOURS = {4: style.GREEN, 2: style.ORANGE, 0: style.VERMILION}
_ENDINGS = {4: "three or four feet", 2: "one or two", 0: "none"}
_BAND_ROLLOUTS = 40
_SPAN_S = (-0.02, 0.42)


@style.drawing
def draw(comparison: Comparison, world_of_row: Sequence[World], paths: Sequence[Path], title: str) -> list[Path]:
    """Draw a comparison.

    Args:
        comparison: Of `ivl.flight.compare`.
        world_of_row: The world of each row, in the flight's room, with the scatter that it has.
        paths: Files to write.
        title: Above the figure.
    """
    chosen = _largest_group(comparison)
    figure = style.new_figure(9.0, 7.5)
    axes = figure.subplots(2, 2)
    parts = [compare.bands(world_of_row[i], comparison.rows[i].flip, _BAND_ROLLOUTS, i, compare.Uncertainty())
             for i in chosen]  # fmt: skip
    for axis, (label, name), k in zip(axes.ravel(), _SIGNALS, range(3), strict=False):
        _draw_signal(axis, [comparison.rows[i] for i in chosen], name, [(t, bands[k]) for t, bands in parts])
        axis.set_ylabel(label)
        axis.set_xlabel("time since the trigger (s)")
        style.finish(axis)
    _draw_windows(axes[1, 1], comparison.windows, comparison.at_policies)
    moment = np.median([comparison.rows[i].flip.moment_Nmm for i in chosen])
    figure.suptitle(f"{title}: {len(chosen)} of {len(comparison.rows)} flights, M_yd about {moment:.2f} N mm",
                    fontsize=style.NORMAL)  # fmt: skip
    handles = [axes[0, 0].plot([], [], color=_COLOURS[c], label=f"flown, {_ENDINGS[c]}")[0] for c in compare.CLASSES]
    handles.append(axes[0, 0].fill_between([], [], [], color=style.BLUE, alpha=0.3, label="simulated, 10 to 90 %"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=style.SMALL, frameon=False)
    return style.save(figure, paths)


def _largest_group(comparison: Comparison) -> list[int]:
    """Rows of the moment that most flights have; all where no group is large."""
    if not comparison.windows:
        return list(range(len(comparison.rows)))
    window = comparison.windows[0]
    return [i for i, row in enumerate(comparison.rows) if window.has(row.flip)]


def _draw_signal(axis: Axes, rows: Sequence[Row], name: str, bands: Sequence[tuple[FloatArray, FloatArray]]) -> None:
    """Recorded lines over the envelope of the simulated bands."""
    times = bands[0][0]
    middle = np.median([band[1] for _, band in bands], axis=0)
    low = np.percentile([band[0] for _, band in bands], 20, axis=0)
    high = np.percentile([band[2] for _, band in bands], 80, axis=0)
    axis.fill_between(times, low, high, color=style.BLUE, alpha=0.3, linewidth=0)
    axis.plot(times, middle, color=style.BLUE, linewidth=1.5)
    for row in rows:
        colour = style.GREY if row.n_legs_flown is None else _COLOURS[row.n_legs_flown]
        values = getattr(row.flip, name)
        shown = motion.clip_rate(values) if name == "rate_radps" else values
        axis.plot(row.flip.t_s, shown, color=colour, linewidth=0.6, alpha=0.8)
    axis.axvline(motion.MOTION_S, color=style.GREY, linewidth=0.8, linestyle=":")
    axis.set_xlim(*_SPAN_S)
    if name == "pitch_deg":
        axis.set_ylim(-20, 300)
    if name == "height_m":
        axis.set_ylim(float(low[0]) - 0.3, float(high.max()) + 0.1)


def _draw_windows(axis: Axes, windows: Sequence[Window], policies: Sequence[tuple[float, float, float]]) -> None:
    for window, colour in zip(windows, (style.BLUE, style.PURPLE, style.SKY, style.GREY), strict=False):
        axis.plot(window.threshold_per_s, window.rate, color=colour, linewidth=1.5,
                  label=f"simulated, {window.moment_Nmm:.2f} N mm")  # fmt: skip
        for rrev, legs in window.flown:
            place = {4: 1.04, 2: -0.04, 0: -0.09}[legs]
            axis.plot(rrev, place, "|", color=_COLOURS[legs], markersize=7)
    for rrev, moment, rate in policies:
        axis.plot(rrev, rate, "o", color=style.DIM, markersize=4)
        axis.annotate(f"{moment:g}", (rrev, rate), fontsize=6, xytext=(3, 3), textcoords="offset points")
    axis.set_ylim(-0.13, 1.1)
    axis.set_xlabel("RREV$_c$ (1/s)")
    axis.set_ylabel("landing rate from hover")
    if windows or policies:
        axis.legend(fontsize=6, frameon=False)
    else:
        axis.text(0.5, 0.5, "no window: fewer than three flights alike", transform=axis.transAxes, ha="center")
    style.finish(axis)
