"""A campaign in which the paper's claims hold by construction, and campaigns in which one of them is made to fail."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from ivl.analysis.claims import NO, NOT_MEASURED, PARTLY, YES, Claim, evaluate
from ivl.plots.fig09_gears import ORDER

Trials = Callable[..., pd.DataFrame]
SPEEDS, ANGLES = tuple(np.arange(0.5, 4.01, 0.5)), tuple(np.arange(20.0, 91.0, 10.0))


def ideal(trials: Trials) -> pd.DataFrame:
    """All nine hold: a fast enough approach lands, long legs from 1 m/s and short ones from 1.5 m/s on."""
    frame = pd.concat([gear_that_lands(trials, gear) for gear in ORDER], ignore_index=True)
    v = frame["speed_mps"]
    frame["trigger_rrev_per_s"] = frame["recommended_rrev_c_per_s"] = 4.6 + 0.002 * frame["trial"]
    frame["trigger_d_ceil_m"] = frame["trigger_vz_mps"] / frame["trigger_rrev_per_s"]
    frame["trigger_of_y_radps"] = -frame["trigger_vx_mps"] / frame["trigger_d_ceil_m"]
    frame["recommended_moment_y_Nmm"] = np.where(frame["angle_deg"].between(40, 70), 5.0, 8.1)
    return frame.assign(rollouts_to_rate=np.where(v > 2, 72.0, np.nan))


def gear_that_lands(trials: Trials, gear: str) -> pd.DataFrame:
    slowest = 1.0 if gear.endswith("long") else 1.5

    def rate(c: pd.DataFrame) -> np.ndarray:
        worse = {"wide_long": c.phi / 900, "narrow_short": np.abs(c.phi - 60) / 500}.get(gear, 0.05)
        return np.where(c.v >= slowest, 0.94 + 0.01 * c.v + 0.001 * c.k - worse, 0.02 * c.k).clip(0, 1)

    return trials(SPEEDS, ANGLES, rate=rate, gear=gear)


def claim(frame: pd.DataFrame, number: int) -> Claim:
    (found,) = evaluate(frame, [number])
    return found


def test_every_claim_holds_where_it_was_built_in(trials: Trials) -> None:
    found = evaluate(ideal(trials))
    assert [c.number for c in found] == list(range(1, 10))
    assert {c.number: c.verdict for c in found if c.number != 3} == dict.fromkeys((1, 2, 4, 5, 6, 7, 8, 9), YES)
    assert found[2].verdict in (YES, PARTLY)
    assert all(c.command.startswith("ivl sweep") and c.finding.endswith(".") for c in found)


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        ({"recommended_rrev_c_per_s": 6.0}, PARTLY),
        ({"rollouts_to_rate": 112.0}, PARTLY),
        ({"rollouts_to_rate": np.nan}, PARTLY),
        ({"landing_rate_four_leg_norm": 0.85}, NO),
    ],
)
def test_convergence_needs_rate_speed_and_policy(trials: Trials, change: dict[str, float], verdict: str) -> None:
    assert claim(ideal(trials).assign(**change), 1).verdict == verdict


def test_successes_here_and_there_are_no_region(trials: Trials) -> None:
    frame = ideal(trials)
    coin = np.random.default_rng(0).random((len(SPEEDS), len(ANGLES))) < 0.3
    place = coin[np.searchsorted(SPEEDS, frame["speed_mps"]), np.searchsorted(ANGLES, frame["angle_deg"])]
    frame["landing_rate_four_leg_norm"] = np.where(place, 0.9, 0.1)
    assert claim(frame, 2).verdict == NO
    assert claim(frame, 4).verdict == NO


def test_if_flow_alone_tells_them_apart_they_do_not_overlap(trials: Trials) -> None:
    frame = ideal(trials)
    frame["landing_rate_four_leg_norm"] = np.where(frame["angle_deg"] > 45, 0.9, 0.1)
    assert claim(frame, 3).verdict == NO


def test_a_plane_of_moments_is_not_nonlinear(trials: Trials) -> None:
    frame = ideal(trials)
    frame["recommended_moment_y_Nmm"] = 4 + 3 * frame["trigger_d_ceil_m"]
    assert claim(frame, 5).verdict == NO


def test_one_gear_that_prefers_slow_approaches_spoils_a_claim_about_all(trials: Trials) -> None:
    frame = ideal(trials)
    rate = frame["landing_rate_four_leg_norm"]
    frame["landing_rate_four_leg_norm"] = rate.where(frame["gear"] != "narrow_long", 1 - frame["speed_mps"] / 4)
    found = claim(frame, 6)
    assert found.verdict == PARTLY
    assert "Narrow-Long" in found.finding


def test_short_legs_that_land_as_often_spoil_the_advantage_of_long_ones(trials: Trials) -> None:
    frame = ideal(trials)
    short = frame[frame["gear"].str.endswith("short")]
    twins = short.assign(gear=short["gear"].str.replace("short", "long"))
    assert claim(pd.concat([short, twins]), 7).verdict == NO


def test_a_narrow_gear_that_peaks_elsewhere_leaves_half_of_the_claim(trials: Trials) -> None:
    frame = ideal(trials)
    best = (frame["gear"] == "narrow_short") & (frame["angle_deg"] == 30)
    frame.loc[best, "landing_rate_four_leg_norm"] = 1.0
    assert claim(frame, 8).verdict == PARTLY


def test_hind_legs_that_do_not_follow_or_touch_first_spoil_the_swing(trials: Trials) -> None:
    frame = ideal(trials)
    assert claim(frame.assign(swing_completed_norm=0.5), 9).verdict == NO
    assert claim(frame.assign(fore_legs_first_norm=0.5), 9).verdict == NO
    one = frame["fore_legs_first_norm"].where(frame["gear"] != "wide_long", 0.8)
    assert claim(frame.assign(fore_legs_first_norm=one), 9).verdict == PARTLY


def test_what_was_not_flown_is_not_measured(trials: Trials) -> None:
    lone = trials((3.0,), (60.0,), rate=lambda c: np.zeros(len(c)), gear="narrow_long")
    assert {c.verdict for c in evaluate(lone)} == {NOT_MEASURED}


def test_two_learners_are_not_one_campaign(trials: Trials) -> None:
    with pytest.raises(ValueError, match="more than one learner"):
        evaluate(pd.concat([trials(), trials(learner="ephe")]))
