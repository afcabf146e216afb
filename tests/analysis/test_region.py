from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from ivl.analysis.contact import contact_order
from ivl.analysis.moment import explained
from ivl.analysis.region import AUGMENTED, STATE, components, grid_components, map_states, near_region, trial_points

Trials = Callable[..., pd.DataFrame]


def make_map(lands: Callable[..., np.ndarray]) -> pd.DataFrame:
    """A policy map whose landing share is a function of (V, d, M); two speeds, three distances, five moments."""
    v, d, m = (a.ravel() for a in np.meshgrid([1.0, 2.0], [0.2, 0.3, 0.4], [2.0, 4.0, 6.0, 8.0, 10.0], indexing="ij"))
    vx, vz = 0 * v, v
    return pd.DataFrame(
        {"speed_mps": v, "angle_deg": 90.0, "d_ceil_m": d, "moment_Nmm": m, "vx_mps": vx, "vz_mps": vz}
        | {"rrev_per_s": vz / d, "of_y_radps": -vx / d, "n": 10, "n_four_leg": 10 * lands(v, d, m)}
    ).assign(vehicle="habas2021", gear_set="table1", gear="wide_short")


def test_a_trial_is_a_point_where_it_flips(trials: Trials) -> None:
    frame = trials(rate=lambda c: np.where(c.v > 1.5, 0.8, 0.79))
    frame.loc[0, "n_triggered"] = 0
    points = trial_points(frame)
    assert len(points) == len(frame) - 1
    assert points["success"].tolist() == (points["speed_mps"] > 1.5).tolist()
    assert points["condition"].nunique() == 9
    assert points[list(STATE)].to_numpy() == pytest.approx(
        frame.loc[1:, ["trigger_vx_mps", "trigger_vz_mps", "trigger_d_ceil_m"]].to_numpy()
    )
    assert np.isfinite(points[list(AUGMENTED)]).all(axis=None)


def test_a_state_lands_if_some_moment_does_and_knows_the_longest_run_of_them() -> None:
    def lands(v: np.ndarray, d: np.ndarray, m: np.ndarray) -> np.ndarray:
        slow = (d == 0.3) & np.isin(m, [2.0, 6.0, 8.0])
        return np.where(v == 1.0, slow, (d == 0.4) & (m == 10.0)) * 0.9

    states = map_states(make_map(lands).sample(frac=1, random_state=0)).set_index(["speed_mps", "d_ceil_m"])
    assert len(states) == 6
    assert states["success"].sum() == 2
    chosen = states.loc[(1.0, 0.3)]
    assert (chosen["n_moments"], chosen["n_landing"]) == (5, 3)
    assert (chosen["moment_low_Nmm"], chosen["moment_high_Nmm"], chosen["moment_Nmm"]) == (6.0, 8.0, 7.0)
    assert states.loc[(2.0, 0.4), "moment_Nmm"] == 10.0
    assert np.isnan(states.loc[(2.0, 0.2), "moment_Nmm"])


def test_a_moment_that_lands_too_rarely_does_not_count() -> None:
    assert not map_states(make_map(lambda v, *_: np.full(v.shape, 0.7)))["success"].any()


def test_near_misses_are_kept_and_hopeless_states_dropped() -> None:
    states = pd.DataFrame({"rrev_per_s": np.arange(1.0, 11.0), "success": [False] * 4 + [True] * 3 + [False] * 3})
    assert states.loc[near_region(states, 0.5), "rrev_per_s"].tolist() == [4.0, 5.0, 6.0, 7.0, 8.0]
    assert not near_region(states.assign(success=False)).any()


def test_components_of_known_grids() -> None:
    ring = np.ones((5, 5), dtype=bool)
    ring[1:4, 1:4] = False
    found = grid_components(ring)
    assert (found.n, found.largest_share, found.n_holes, found.n_points) == (1, 1.0, 9, 16)
    two = np.zeros((4, 4), dtype=bool)
    two[0, :3], two[3, 3] = True, True
    found = grid_components(two)
    assert (found.n, found.largest_share, found.n_holes) == (2, 0.75, 0)
    assert grid_components(np.eye(3, dtype=bool)).n == 1
    assert np.isnan(grid_components(np.zeros((2, 2), dtype=bool)).largest_share)


def test_components_of_a_table_use_the_order_of_its_axes() -> None:
    frame = pd.DataFrame({"speed_mps": [0.5, 1.0, 4.0, 4.0], "angle_deg": [20.0, 20.0, 20.0, 90.0]})
    frame["success"] = [True, True, True, False]
    assert components(frame, ["speed_mps", "angle_deg"]).n == 1
    frame["success"] = [True, False, True, False]
    assert components(frame, ["speed_mps", "angle_deg"]).n == 2


def cues_and_conditions() -> tuple[np.ndarray, np.ndarray]:
    x = np.random.default_rng(0).uniform(-1, 1, size=(600, 3))
    return x, np.repeat(np.arange(120), 5)


def test_a_plane_explains_a_plane_and_a_forest_adds_nothing() -> None:
    x, condition = cues_and_conditions()
    result = explained(x, 6 + x @ [2.0, -1.0, 0.5], condition)
    assert result.linear.value == pytest.approx(1.0)
    assert result.gain.high < 0


def test_a_curved_map_needs_more_than_a_plane() -> None:
    x, condition = cues_and_conditions()
    result = explained(x, 6 + 3 * x[:, 0] ** 2 - x[:, 1] ** 2, condition)
    assert result.linear.value < 0.1
    assert result.nonlinear.low > 0.8
    assert result.gain.low > 0.7


def test_noise_is_not_explained_nor_is_a_constant() -> None:
    x, condition = cues_and_conditions()
    noise = explained(x, np.random.default_rng(1).normal(size=600), condition)
    assert noise.nonlinear.value < 0.05
    assert np.isnan(explained(x, np.full(600, 8.0), condition).linear.value)
    with pytest.raises(ValueError, match="shapes"):
        explained(x, np.ones(599), condition)


def test_a_moment_that_belongs_to_the_condition_cannot_be_remembered() -> None:
    rng, (_, condition) = np.random.default_rng(2), cues_and_conditions()
    x = rng.normal(size=(120, 2))[condition] + 1e-3 * rng.normal(size=(600, 2))
    assert explained(x, rng.normal(size=120)[condition], condition).nonlinear.value < 0.1


def test_contact_order_weighs_conditions_and_skips_what_never_touched(trials: Trials) -> None:
    frame = trials((1.0, 2.0), (90.0,), n_trials=2)
    frame["fore_legs_first_norm"] = [1.0, 0.8, 0.5, np.nan]
    frame["n_attached"] = [10, 10, 10, 0]
    result = contact_order(frame)
    assert result.fore_first.value == pytest.approx((0.9 + 0.5) / 2)
    assert result.swing_completed.value == pytest.approx(0.9)
    assert result.n_rollouts == 30
    assert 0 <= result.fore_first.low <= result.fore_first.high <= 1
