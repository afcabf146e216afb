"""Landing rates of cells, of learners and between gears, from the table of trials.

Columns are those of the sweep's table of trials (`ivl.sweep.schema`). A rate is by default the paper's: the share of
four-leg landings in a trial's last three episodes, the learner's exploration included. `CHECK_RATE` is that of the
recommended policy alone, over fresh rollouts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from ivl.analysis.intervals import Estimate, difference, share_of, stratified_mean, wilson
from ivl.outcome import RECENT_EPISODES, SOLVED_SHARE, solved, stuck
from ivl.sweep.schema import cell_columns

RATE, CLEAN_RATE = "landing_rate_four_leg_norm", "landing_rate_clean_norm"
CHECK_RATE, CHECK_CLEAN_RATE = "check_rate_four_leg_norm", "check_rate_clean_norm"
COUNT = {RATE: "n_recent", CLEAN_RATE: "n_recent", CHECK_RATE: "n_check", CHECK_CLEAN_RATE: "n_check"}
"""Column with the number of rollouts behind each rate."""


@dataclass(frozen=True)
class TrialFailures:
    """Trials that end stuck although the cell can be learned.

    Attributes:
        share: Of the trials in cells that some trial solved, those stuck; Wilson's interval (conservative here: the
            cells are fixed and differ, which only makes the count less variable than a binomial one).
        n_failed: Number of such trials.
        n_trials: All trials, those in cells that no trial solved among them.
    """

    share: Estimate
    n_failed: int
    n_trials: int


def cell_rates(trials: pd.DataFrame, rate: str = RATE) -> pd.DataFrame:
    """Landing rate of each cell: mean over its trials and best of them.

    Args:
        trials: Table of trials.
        rate: Column with the rate of a trial.

    Returns:
        One row per cell, columns that name it (`cell_columns`) and: `n_trials`; `rate_mean_norm` with `rate_low_norm`,
        `rate_high_norm` (Wilson with the trials as observations, see `intervals`); `rate_best_norm` with
        `best_low_norm`, `best_high_norm` (Wilson over the rollouts of that trial alone: to have been chosen as the best
        of several makes it look better than it is, and no interval says by how much); `n_solved`.
    """
    keys = cell_columns(trials)
    known = trials.loc[trials[rate].notna(), [*keys, rate, COUNT[rate]]]
    best = known.sort_values(rate, kind="stable").groupby(keys, observed=True).tail(1).set_index(keys)
    grouped = known.groupby(keys, observed=True)[rate]
    table = pd.DataFrame({"n_trials": grouped.size(), "rate_mean_norm": grouped.mean()})
    table["rate_low_norm"], table["rate_high_norm"] = wilson(table["rate_mean_norm"], table["n_trials"])
    table["rate_best_norm"] = best[rate]
    table["best_low_norm"], table["best_high_norm"] = wilson(
        table["rate_best_norm"], best[COUNT[rate]].reindex(table.index)
    )
    table["n_solved"] = solved(known[rate]).groupby([known[k] for k in keys], observed=True).sum()
    return table.reset_index()


def mean_rate(trials: pd.DataFrame, rate: str = RATE) -> Estimate:
    """Mean landing rate over cells, each with the same weight, whatever its number of trials."""
    known = trials[trials[rate].notna()]
    mean = stratified_mean(known[rate], known.groupby(cell_columns(known), observed=True).ngroup())
    low, high = np.clip([mean.low, mean.high], 0.0, 1.0)
    return Estimate(mean.value, float(low), float(high), mean.n)


def profile(trials: pd.DataFrame, by: str, rate: str = RATE) -> pd.DataFrame:
    """Mean landing rate at each value of a column (`speed_mps`, `angle_deg`, `gear` ...), with its interval.

    Returns:
        Columns `by`, `rate_norm`, `low_norm`, `high_norm`, `n_cells`; sorted by `by`.
    """
    rows = []
    for value, part in trials.groupby(by, observed=True):
        mean = mean_rate(part, rate)
        rows.append((value, mean.value, mean.low, mean.high, mean.n))
    return pd.DataFrame(rows, columns=[by, "rate_norm", "low_norm", "high_norm", "n_cells"])


def compare(
    first: pd.DataFrame,
    second: pd.DataFrame,
    on: Sequence[str] = ("speed_mps", "angle_deg"),
    rate: str = RATE,
) -> Estimate:
    """Difference of the mean landing rates, first - second, over the conditions that both have.

    Args:
        first: Trials of one set-up.
        second: Trials of the other.
        on: Columns that name a condition.
        rate: Column with the rate of a trial.

    Returns:
        The difference, positive if `first` lands more often; `n` is the number of common conditions.
    """
    sides = [part[part[rate].notna()].set_index(list(on))[rate] for part in (first, second)]
    common = sides[0].index.unique().intersection(sides[1].index.unique())
    code = pd.Series(np.arange(len(common)), index=common)
    means = []
    for side in sides:
        kept = side[side.index.isin(common)]
        means.append(stratified_mean(kept, code.reindex(kept.index)))
    return difference(*means)


def single_trial_failures(trials: pd.DataFrame, rate: str = RATE) -> TrialFailures:
    """Share of trials that end stuck where another trial of the same cell solved it."""
    failed = stuck(of_solved_cells(trials, rate)[rate])
    return TrialFailures(share_of(failed), int(failed.sum()), int(trials[rate].notna().sum()))


def of_solved_cells(trials: pd.DataFrame, rate: str = RATE) -> pd.DataFrame:
    """The trials with a rate whose cell some trial solved, itself perhaps: among these, one can be stuck."""
    known = trials[trials[rate].notna()]
    return known[solved(known.groupby(cell_columns(known), observed=True)[rate].transform("max"))]


def rollouts_to_rate(episodes: pd.DataFrame, rate: float = SOLVED_SHARE, window: int = RECENT_EPISODES) -> pd.DataFrame:
    """Rollouts of each trial until its landing rate over `window` episodes reaches `rate` and stays there.

    Args:
        episodes: Table of episodes.
        rate: Landing rate that counts as converged.
        window: Episodes that the rate is taken over.

    Returns:
        Columns that name a cell, `trial` and `rollouts_to_rate`: NaN if it never does.
    """
    keys = [*cell_columns(episodes), "trial"]
    rows = []
    for key, trial in episodes.sort_values("episode").groupby(keys, observed=True):
        n = trial["n_scored"].to_numpy()
        landed = trial[RATE].fillna(0.0).to_numpy() * n
        flown = np.cumsum(n)
        before = np.concatenate([[0], flown])[np.maximum(np.arange(len(n)) - window + 1, 0)]
        landed_before = np.concatenate([[0], np.cumsum(landed)])[np.maximum(np.arange(len(n)) - window + 1, 0)]
        recent = (np.cumsum(landed) - landed_before) / np.maximum(flown - before, 1)
        full = np.arange(len(n)) >= min(window, len(n)) - 1
        missed = np.flatnonzero(~((recent >= rate - 1e-12) & full))
        first = missed[-1] + 1 if missed.size else 0
        rows.append((*key, float(flown[first]) if first < len(n) else np.nan))
    return pd.DataFrame(rows, columns=[*keys, "rollouts_to_rate"])
