"""A belief over vehicles while it learns: its parameters after each flight, the last flip as expected and as flown.

parameters    quantiles of those that changed most, before the first flight and after each: what is believed, and
              no measurement: many vehicles move alike
last flip     pitch, rate and fall: the belief's mean and two standard deviations before that flight, and what it
              recorded
landings      expected landing rate of the recommendation, with and without margin; each flight; and the failures
              that are expected in the flights that are left
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from ivl.belief import recording
from ivl.belief.changes import most_changed
from ivl.experiment import Experiment
from ivl.learning.recorder import SCORED, EpisodeRow, RolloutRows
from ivl.outcome import four_leg
from ivl.plots import style
from ivl.run import RunResult

TITLE = "Belief over vehicles: its parameters after each flight, the last flip as expected and as flown, landings"
_LABELS = {"pitch": "pitch (deg)", "rate": "rate (rad/s)", "fall": "fall (m)"}

FloatArray = npt.NDArray[np.float64]


def draw_run(result: RunResult) -> list[Path]:
    """Draw trial 0 of a finished run into its folder, as PNG and SVG; nothing if its learner has no belief."""
    history = [row for row in result.history if row.trial == 0]
    if not has_picture(history):
        return []
    paths = [result.folder / f"belief{suffix}" for suffix in (".png", ".svg")]
    return draw(result.experiment, history, result.rollouts.of_trial(0), paths)


def has_picture(history: Sequence[EpisodeRow]) -> bool:
    """Whether there is a belief to draw."""
    return bool(history) and bool((history[-1].insight or {}).get("belief"))


@style.drawing
def draw(
    experiment: Experiment, history: Sequence[EpisodeRow], rollouts: RolloutRows, paths: Sequence[Path]
) -> list[Path]:
    """Draw one trial.

    Args:
        experiment: What was run.
        history: Episodes of the trial, in order, of a learner that has a belief.
        rollouts: Rollouts of the trial.
        paths: Files to write.
    """
    figure = style.new_figure(8.5, 8.0)
    grid = figure.add_gridspec(4, 3)
    axes = [figure.add_subplot(grid[row, column]) for row in range(3) for column in range(3)]
    insights = [row.insight or {} for row in history]
    flights = np.concatenate([[0], np.cumsum([row.n_scored for row in history])])
    _draw_parameters(axes[:6], insights, flights)
    _draw_flip(axes[6:], insights[-1], history[-1].episode, rollouts)
    _draw_landings(figure.add_subplot(grid[3, :]), experiment, insights, flights, rollouts)
    for axis in figure.axes:
        style.finish(axis)
    figure.suptitle(
        f"{experiment.name}: what {experiment.learner.name} believes (no measurement)", fontsize=style.NORMAL
    )
    return style.save(figure, paths)


def _draw_parameters(axes: Sequence[Axes], insights: Sequence[dict[str, Any]], flights: FloatArray) -> None:
    """Quantiles of the parameters that changed most."""
    first = insights[0]["belief"]
    levels = np.array([first["prior"], *(insight["belief"]["quantiles"] for insight in insights)])
    for axis, i in zip(axes, most_changed(levels), strict=False):
        low, quarter, middle, three, high = levels[:, i].T
        axis.fill_between(flights, low, high, color=style.BLUE, alpha=0.15, linewidth=0)
        axis.fill_between(flights, quarter, three, color=style.BLUE, alpha=0.3, linewidth=0)
        axis.plot(flights, middle, color=style.BLUE, linewidth=1.2)
        unit = "" if first["units"][i] == "1" else f" ({first['units'][i]})"
        axis.set_title(f"{first['names'][i]}{unit}", fontsize=style.SMALL)
        axis.set_xlim(0, flights[-1])
    for axis in axes[levels.shape[1] :]:
        axis.remove()


def _draw_flip(axes: Sequence[Axes], insight: dict[str, Any], episode: int, rollouts: RolloutRows) -> None:
    """The first flight of the last episode: expected, and recorded."""
    predicted = insight["predicted"]
    own = (rollouts.episode == episode) & (rollouts.idx == 0)
    flown = None if rollouts.recordings is None or not own.any() else rollouts.recordings[own][0]
    for axis, (signal, label) in zip(axes, _LABELS.items(), strict=True):
        names = [name for name in predicted["names"] if name.startswith(f"{signal}_")]
        at = [predicted["names"].index(name) for name in names]
        mean, sd = (np.array(predicted[key])[at] for key in ("mean", "sd"))
        time_s = np.array([int(name.rpartition("_")[2]) / 1000.0 for name in names])
        axis.fill_between(time_s, mean - 2 * sd, mean + 2 * sd, color=style.BLUE, alpha=0.15, linewidth=0)
        axis.plot(time_s, mean, color=style.BLUE, linewidth=1.2, label="expected, two standard deviations")
        if flown is not None:
            values = [flown[recording.NAMES.index(f"{signal}_{round(1000 * t):03d}")] for t in recording.TIMES_S]
            axis.plot(recording.TIMES_S, values, "o", color=style.VERMILION, markersize=3, label="flown")
        axis.set_ylabel(label)
        axis.set_xlabel("time after the trigger (s)")
    axes[0].legend(fontsize=style.SMALL, frameon=False)


def _draw_landings(
    axis: Axes, experiment: Experiment, insights: Sequence[dict[str, Any]], flights: FloatArray, rollouts: RolloutRows
) -> None:
    """What is expected of landings, and what came."""
    expected = np.array([insight["expected_rate"] for insight in insights])
    axis.plot(flights[1:], expected, color=style.BLUE, label="expected landing rate")
    margin = [insight["margin_rate"] for insight in insights]
    axis.plot(flights[1:], margin, color=style.BLUE, linestyle="--", label="with margin")
    scored = rollouts.status == SCORED
    landed = four_leg(rollouts.outcomes[scored])
    number = np.arange(1, landed.size + 1)
    axis.plot(number[landed], np.ones(landed.sum()), "o", color=style.GREEN, markersize=4, label="landed")
    axis.plot(number[~landed], np.zeros((~landed).sum()), "x", color=style.VERMILION, markersize=4, label="failed")
    axis.set_ylim(-0.05, 1.05)
    axis.set_xlim(0, experiment.budget)
    axis.set_xlabel("flight")
    axis.set_ylabel("landing rate")
    left = axis.twinx()
    left.plot(flights[1:], expected_failures(expected, flights[1:], experiment.budget), color=style.ORANGE)
    left.set_ylabel("failures expected\nfrom here on", color=style.ORANGE)
    left.set_ylim(bottom=0.0)
    axis.legend(fontsize=style.SMALL, frameon=False, ncols=4, loc="lower right")


def expected_failures(rate: FloatArray, n_flown: FloatArray, budget: int) -> FloatArray:
    """Failures expected in the flights that are left, if each flies the recommendation; all of shape (n,)."""
    return np.asarray((1.0 - rate) * np.maximum(budget - n_flown, 0))
