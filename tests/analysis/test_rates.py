from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from ivl.analysis.intervals import wilson
from ivl.analysis.rates import (
    CHECK_RATE,
    CLEAN_RATE,
    cell_rates,
    compare,
    mean_rate,
    of_solved_cells,
    profile,
    rollouts_to_rate,
    single_trial_failures,
)
from ivl.sweep.schema import CELL

Trials = Callable[..., pd.DataFrame]
FIVE = np.array([1.0, 0.9, 0.2, 0.8, 0.6])


def test_a_cell_has_the_mean_and_the_best_of_its_trials(trials: Trials) -> None:
    frame = trials((2.5,), (60.0, 90.0), rate=lambda c: np.where(c.phi > 70, FIVE[c.k], 0.0))
    cells = cell_rates(frame).set_index("angle_deg")
    assert cells.loc[90.0, "rate_mean_norm"] == pytest.approx(FIVE.mean())
    assert cells.loc[90.0, "rate_best_norm"] == 1.0
    assert cells.loc[90.0, "n_solved"] == 3
    assert cells.loc[60.0, ["rate_mean_norm", "rate_best_norm", "n_solved"]].tolist() == [0, 0, 0]
    assert tuple(cells.loc[90.0, ["rate_low_norm", "rate_high_norm"]]) == pytest.approx(wilson(FIVE.mean(), 5))
    assert tuple(cells.loc[90.0, ["best_low_norm", "best_high_norm"]]) == pytest.approx(wilson(1.0, 24))
    assert cell_rates(frame, CLEAN_RATE)["rate_best_norm"].max() == 0.5


def test_the_best_of_checked_policies_rests_on_the_check(trials: Trials) -> None:
    frame = trials((2.5,), (90.0,), rate=lambda c: FIVE[c.k])
    cell = cell_rates(frame, CHECK_RATE).iloc[0]
    assert (cell.best_low_norm, cell.best_high_norm) == pytest.approx(wilson(1.0, 100))


def test_a_trial_without_a_rate_does_not_count(trials: Trials) -> None:
    frame = trials((2.5,), (90.0,), rate=lambda c: np.where(c.k == 2, np.nan, FIVE[c.k]))
    cell = cell_rates(frame).iloc[0]
    assert (cell.n_trials, cell.rate_mean_norm) == (4, pytest.approx(np.delete(FIVE, 2).mean()))


def test_setups_are_kept_apart(trials: Trials) -> None:
    frame = pd.concat([trials(learner="bo"), trials(learner="ephe"), trials(gear="wide_long")])
    assert len(cell_rates(frame)) == 27
    assert not cell_rates(frame).duplicated(list(CELL)).any()


def test_mean_rate_weighs_cells_equally(trials: Trials) -> None:
    many = trials((1.0,), n_trials=10, rate=lambda c: np.ones_like(c.phi))
    few = trials((2.0,), n_trials=2, rate=lambda c: np.zeros_like(c.phi))
    assert mean_rate(pd.concat([many, few])).value == 0.5


def test_a_profile_follows_its_column(trials: Trials) -> None:
    frame = trials(rate=lambda c: c.v / 4 + 0.01 * (c.k - 2))
    result = profile(frame, "speed_mps")
    assert result["speed_mps"].tolist() == [1.0, 2.0, 3.0]
    assert result["rate_norm"].tolist() == pytest.approx([0.25, 0.5, 0.75])
    assert (result["n_cells"] == 3).all()
    assert (result["high_norm"] > result["rate_norm"]).all()


def test_gears_are_compared_on_common_conditions_alone(trials: Trials) -> None:
    long = trials((1.0, 2.0), rate=lambda c: np.where(c.v < 1.5, 0.9, 0.6) + 0.01 * (c.k - 2), gear="wide_long")
    short = trials((2.0, 3.0), rate=lambda c: np.where(c.v < 2.5, 0.2, 1.0) - 0.01 * (c.k - 2))
    result = compare(long, short)
    assert (result.value, result.n) == (pytest.approx(0.4), 3)
    # three cells, variance 0.00025 in each of both gears
    assert result.high - result.value == pytest.approx(1.959964 * np.sqrt(2 * 3 * 0.00025 / 5) / 3, rel=1e-6)
    assert compare(short, long).value == pytest.approx(-0.4)
    assert np.isnan(compare(long, trials((3.0,))).value)


def test_a_failed_trial_counts_only_where_another_solved_the_cell(trials: Trials) -> None:
    def rate(c: pd.DataFrame) -> np.ndarray:
        solvable, middling = np.where(c.k == 0, 0.49, 0.8), np.where(c.k == 0, 0.5, 0.9)
        return np.select([c.phi == 30, c.phi == 60], [solvable, np.full(len(c), 0.1)], middling)

    result = single_trial_failures(trials((2.0,), rate=rate))
    assert (result.n_failed, result.share.n, result.n_trials) == (1, 10, 15)
    assert result.share.value == pytest.approx(0.1)
    assert (result.share.low, result.share.high) == pytest.approx(wilson(0.1, 10))
    assert sorted(of_solved_cells(trials((2.0,), rate=rate))["angle_deg"].unique()) == [30.0, 90.0]


def test_another_gear_that_solved_the_condition_does_not_count(trials: Trials) -> None:
    good, bad = (trials(rate=lambda c, r=r: np.full(c.v.shape, r), gear=g) for r, g in ((1.0, "a"), (0.0, "b")))
    assert single_trial_failures(pd.concat([good, bad])).n_failed == 0


@pytest.mark.parametrize(
    ("rates", "expected"),
    [
        ([0, 0, 1, 1, 1, 1], 40),  # the last three episodes reach 0.8 after the fifth
        ([0, 0, 1, 1, 1, 0], np.nan),  # it does not stay
        ([1, 1, 1, 1, 1, 1], 24),  # not before three episodes are flown
        ([1, 1, 1, 0, 1, 1, 1], 56),
        ([0, 0, 0, 0, 0, 0], np.nan),
    ],
)
def test_rollouts_to_a_rate_that_stays(rates: list[float], expected: float) -> None:
    names = {"vehicle": "v", "gear_set": "s", "gear": "g", "learner": "l", "speed_mps": 2.5, "angle_deg": 90.0}
    episodes = pd.DataFrame(
        {
            "trial": 0,
            "episode": range(len(rates)),
            "n_scored": 8,
            "landing_rate_four_leg_norm": [float(r) for r in rates],
        }
    ).assign(**names)
    result = rollouts_to_rate(episodes.sample(frac=1, random_state=0))["rollouts_to_rate"]
    assert result.tolist() == pytest.approx([expected], nan_ok=True)
