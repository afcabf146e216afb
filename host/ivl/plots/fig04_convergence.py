"""Fig. 4: convergence of the trials of one cell, mu +- 2 sigma of both parameters and the landing rate.

One column per learner. The paper shows one trial; here all of a cell are shown, one of them (the median by final
landing rate) in colour, so that the spread between trials is seen too.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
from matplotlib.axes import Axes

from ivl.analysis.rates import RATE
from ivl.errors import ConfigError
from ivl.outcome import RECENT_EPISODES
from ivl.plots import style
from ivl.plots.campaign import Campaign

NAME = "fig04_convergence"
SPEED_MPS, ANGLE_DEG = 2.5, 90.0
_ROWS = (
    ("rrev_c_per_s", "RREV$_c$ (1/s)", (0.0, 8.0), 4.64),
    ("moment_y_Nmm", "$M_{yd}$ (N mm)", (0.0, 12.0), 8.09),
)
"""Column, label, limits of the axis (those of the search and a margin), where the paper's simulation ended."""


@style.drawing
def draw(data: Campaign, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw the cell nearest to the paper's experiment (2.5 m/s, 90 degrees).

    Args:
        data: One vehicle, gear set and gear; any number of learners.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.

    Raises:
        ConfigError: The run kept no episodes.
    """
    if data.episodes.empty:
        raise ConfigError("the run kept no episodes: convergence cannot be drawn")
    episodes = _nearest(data.episodes)
    learners = [setup["learner"] for setup in data.setups("learner")]
    figure = style.new_figure(max(4.8, 3.1 * len(learners) + 0.6), 5.4)
    axes = figure.subplots(3, len(learners), sharex=True, sharey="row", squeeze=False, height_ratios=(3, 3, 2))
    for column, learner in zip(axes.T, learners, strict=True):
        own = episodes[episodes["learner"] == learner]
        trials = [part.sort_values("episode") for _, part in own.groupby("trial")]
        median = sorted(range(len(trials)), key=lambda k: _final_rate(trials[k]))[len(trials) // 2]
        for k, trial in enumerate(trials):
            _draw_trial(column, trial, chosen=k == median)
        for axis, (_, _, limits, paper) in zip(column, _ROWS, strict=False):
            axis.axhline(paper, color=style.ORANGE, linewidth=1, linestyle=":", label="the paper's simulation")
            axis.set_ylim(limits)
        _draw_mean_rate(column[2], trials)
        column[0].set_title(f"{learner}, {len(trials)} trials", fontsize=style.NORMAL)
        column[2].set_xlabel("rollout")
    for row, label in zip(axes[:, 0], (*(row[1] for row in _ROWS), "four-leg rate\n(3 episodes)"), strict=True):
        row.set_ylabel(label)
    for axis in axes.flat:
        style.finish(axis)
    cell = episodes.iloc[0]
    figure.suptitle(
        f"{data.title('gear', 'gear_set', 'vehicle')}: {cell.speed_mps:g} m/s at {cell.angle_deg:g}°",
        fontsize=style.NORMAL,
    )
    named = {t: h for axis in axes[[0, 2], 0] for h, t in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(
        list(named.values()), list(named), loc="outside lower center", ncols=3 if len(learners) > 1 else 2,
        fontsize=style.SMALL, frameon=False,
    )  # fmt: skip
    return style.save(figure, paths, dpi)


def _nearest(episodes: pd.DataFrame) -> pd.DataFrame:
    """Episodes of the cell whose approach is nearest to the paper's."""
    off = (episodes["speed_mps"] - SPEED_MPS).abs() + (episodes["angle_deg"] - ANGLE_DEG).abs() / 90
    return episodes[off == off.min()]


def _final_rate(trial: pd.DataFrame) -> float:
    return float(trial[RATE].tail(RECENT_EPISODES).mean())


def _recent(trial: pd.DataFrame) -> pd.Series:
    return trial[RATE].rolling(RECENT_EPISODES, min_periods=1).mean()


def _draw_trial(column: Sequence[Axes], trial: pd.DataFrame, chosen: bool) -> None:
    """One trial: a line each, and for the chosen one the band of two sigma."""
    at = trial["n_scored"].cumsum().to_numpy()
    color, width, order = (style.BLUE, 1.4, 3) if chosen else (style.GREY, 0.7, 2)
    for axis, (name, *_) in zip(column, _ROWS, strict=False):
        mu, sigma = trial[f"mu_{name}"].to_numpy(), trial[f"sigma_{name}"].to_numpy()
        label = "µ of the median trial" if chosen else None
        axis.plot(at, mu, color=color, linewidth=width, zorder=order, label=label)
        if chosen:
            axis.fill_between(
                at, mu - 2 * sigma, mu + 2 * sigma, color=style.BLUE, alpha=0.18, linewidth=0, label="its µ ± 2σ"
            )
            axis.plot([], [], color=style.GREY, linewidth=0.7, label="other trials")
    column[2].plot(at, _recent(trial), color=color, linewidth=width, zorder=order)


def _draw_mean_rate(axis: Axes, trials: Sequence[pd.DataFrame]) -> None:
    """Mean of the trials' landing rates, dashed."""
    longest = max(trials, key=len)
    rates = np.full((len(trials), len(longest)), np.nan)
    for row, trial in zip(rates, trials, strict=True):
        row[: len(trial)] = _recent(trial)
        row[len(trial) :] = row[len(trial) - 1]
    axis.plot(
        longest["n_scored"].cumsum(), rates.mean(axis=0), color=style.VERMILION, linestyle="--", linewidth=1.2,
        label="mean of the trials",
    )  # fmt: skip
    axis.set_ylim(-0.03, 1.05)
