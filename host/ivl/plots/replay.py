"""Recorded flights and their replay: RREV over time, and when each triggered."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ivl.flight.agreement import Replayed
from ivl.plots import style

N_FLIGHTS = 6
_AFTER_S = 0.06  # shown after the later trigger
_LEGEND = (
    Line2D([], [], color="black", marker=".", linestyle="none", label="RREV, logged"),
    Line2D([], [], color=style.BLUE, label="RREV, replayed"),
    Line2D([], [], color=style.GREY, linestyle="--", label="RREV_c of the policy"),
    Line2D([], [], color="black", linestyle=":", label="trigger, logged"),
    Line2D([], [], color=style.VERMILION, label="trigger, replayed"),
)


def choose(replayed: Sequence[Replayed], n: int = N_FLIGHTS) -> list[Replayed]:
    """The two flights whose triggers are furthest apart, and others evenly from all; in the order flown."""
    order = sorted(range(len(replayed)), key=lambda i: -_apart_s(replayed[i]))
    rest = sorted(order[2:])
    steps = min(n - 2, len(rest))
    evenly = [rest[round(k * (len(rest) - 1) / max(steps - 1, 1))] for k in range(steps)]
    return [replayed[i] for i in sorted([*order[:2], *evenly])]


@style.drawing
def draw(replayed: Sequence[Replayed], paths: Sequence[Path]) -> list[Path]:
    """Draw some of the flights, one panel each.

    Args:
        replayed: Flights to choose from.
        paths: Files to write.
    """
    chosen = choose(replayed)
    n_columns = min(3, len(chosen))
    n_rows = -(-len(chosen) // n_columns)
    figure = style.new_figure(2.6 * n_columns + 0.6, 2.2 * n_rows + 0.6)
    axes = figure.subplots(n_rows, n_columns, squeeze=False).ravel()
    for axis, r in zip(axes, chosen, strict=False):
        _panel(axis, r)
    for axis in axes[len(chosen) :]:
        axis.set_axis_off()
    figure.supxlabel("time on the flight's clock (s)", fontsize=style.NORMAL)
    figure.supylabel("RREV (1/s)", fontsize=style.NORMAL)
    figure.legend(
        handles=list(_LEGEND), loc="outside upper center", ncols=n_columns, fontsize=style.SMALL, frameon=False
    )
    return style.save(figure, paths)


def _apart_s(r: Replayed) -> float:
    """How far the triggers are apart; one that is missing is far."""
    logged_s, replayed_s = r.logged_trigger_s, r.trigger_s
    if logged_s is None and replayed_s is None:
        return 0.0
    return np.inf if logged_s is None or replayed_s is None else abs(replayed_s - logged_s)


def _panel(axis: Axes, r: Replayed) -> None:
    t_s, begins = r.flight["t_s"], min(r.ticks.begins, len(r.flight) - 1)
    triggers = [t for t in (r.logged_trigger_s, r.trigger_s) if t is not None]
    until_s = max(triggers) + _AFTER_S if triggers else t_s[-1]
    tick_s = t_s[0] + r.tick_s * np.arange(len(r.rows))
    ticks = (tick_s >= t_s[begins]) & (tick_s <= until_s)
    samples = (t_s >= t_s[begins]) & (t_s <= until_s)
    seen = np.where(r.rows["cue_valid"] != 0, r.rows["rrev_per_s"], np.nan)
    axis.plot(tick_s[ticks], seen[ticks], color=style.BLUE, linewidth=1.0)
    axis.plot(t_s[samples], r.flight["rrev_per_s"][samples], color="black", marker=".", markersize=3, linestyle="none")
    if np.isfinite(r.flight.info["threshold_per_s"]):
        axis.axhline(r.flight.info["threshold_per_s"], color=style.GREY, linestyle="--", linewidth=0.8)
    if r.logged_trigger_s is not None:
        axis.axvline(r.logged_trigger_s, color="black", linestyle=":", linewidth=1.2)
    if r.trigger_s is not None:
        axis.axvline(r.trigger_s, color=style.VERMILION, linewidth=0.8)
    axis.set_title(r.flight.label, fontsize=style.SMALL)
    style.finish(axis)
