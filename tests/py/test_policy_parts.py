"""The parts of learning a policy for every approach: what is asked of the core, what is drawn, what is fitted."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ivl import forms, native
from ivl.errors import ConfigError
from ivl.policy import go, polish, start
from ivl.policy.flying import Place, PolicyTask, fly, objective
from ivl.policy.go import Decided
from ivl.policy.region import BOX, PLANE, Region, Series
from ivl.policy.search import Iteration
from ivl.policy.shape import GO, General, features, is_general
from ivl.policy.start import Best
from ivl.seeds import Purpose
from ivl.task import settings_of

FORMS = ("polynomial2", "polynomial3", "bilinear")


def xz(vx_mps: np.ndarray, vz_mps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The coordinates of the core, as its header says them."""
    return (vx_mps - 1.4) / 2.0, (vz_mps - 1.6) / 2.0


def velocities(seed: int, n: int = 200) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(0.0, 4.5, n), rng.uniform(0.1, 4.5, n)


@pytest.mark.parametrize("name", ["polynomial2", "polynomial3"])
def test_the_threshold_of_the_core_is_the_polynomial_that_its_header_says(name: str) -> None:
    general = General(name)
    rng = np.random.default_rng(3)
    theta = general.level(6.0, 8.0)
    theta[1 : general.n_threshold] = rng.uniform(-0.3, 0.3, general.n_threshold - 1)
    vx, vz = velocities(1)
    wanted = features(*xz(vx, vz))[:, : general.n_threshold] @ theta[general.threshold]
    assert general.thresholds(theta, vx, vz) == pytest.approx(np.clip(wanted, 0.5, 20.0), rel=2e-6)


def test_the_threshold_of_the_table_is_its_node_and_the_mean_between_two() -> None:
    general = General("bilinear")
    theta = general.level(5.0, 8.0)
    theta[general.form.names.index("r_23_per_s")] = 9.0  # vx = 2, vz = 2.4 m/s
    found = general.thresholds(theta, np.array([2.0, 1.5, 2.0, 3.0]), np.array([2.4, 2.4, 2.0, 2.4]))
    assert found == pytest.approx([9.0, 7.0, 7.0, 5.0], rel=1e-5)


@pytest.mark.parametrize("name", FORMS)
def test_a_level_policy_is_level_and_always_goes(name: str) -> None:
    general = General(name)
    vx, vz = velocities(2)
    theta = general.level(np.array([3.0, 7.0]), 6.0)
    assert theta.shape == (2, general.form.n)
    for policy, wanted in zip(theta, (3.0, 7.0), strict=True):
        assert general.thresholds(policy, vx, vz) == pytest.approx(np.full(200, wanted), rel=1e-6)
        assert general.moments(policy, vx, vz) == pytest.approx(np.full(200, 6.0), rel=1e-6)
        assert policy[general.go_p_min] == 0.0


@pytest.mark.parametrize("name", FORMS)
def test_the_probability_of_the_core_is_the_logistic_of_the_features(name: str) -> None:
    general = General(name)
    theta = general.level(5.0, 8.0)
    theta[general.go] = np.random.default_rng(4).uniform(-2.0, 2.0, len(GO))
    vx, vz = velocities(5)
    wanted = 1.0 / (1.0 + np.exp(-features(*xz(vx, vz)) @ theta[general.go]))
    assert general.probabilities(theta, vx, vz) == pytest.approx(wanted, abs=2e-6)


@pytest.mark.parametrize("name", FORMS)
def test_what_tells_the_point_of_decision_tells_it(name: str) -> None:
    general = General(name)
    theta = general.level(5.0, 8.0)
    theta[general.go_p_min], theta[general.go] = 0.9, 3.0
    vx, vz = velocities(6)
    for axis, wanted in enumerate(xz(vx, vz)):
        told = general.telling(theta, axis)
        p = general.probabilities(told, vx, vz)
        assert np.log(p / (1 - p)) == pytest.approx(wanted, abs=1e-5)
        assert told[general.go_p_min] == 0.0
        assert (told[general.searched] == theta[general.searched]).all()


def test_a_form_for_one_approach_is_refused() -> None:
    assert [name for name in forms.forms() if is_general(name)] == list(FORMS)
    with pytest.raises(
        ConfigError, match=r"form constant: is not for every approach \(allowed polynomial2, .*bilinear"
    ):
        General("constant")


# ---- what is drawn


def test_approaches_stay_inside_and_no_purpose_meets_another() -> None:
    seen: set[tuple[int, int]] = set()
    speeds: set[float] = set()
    n = 0
    for purpose in (Purpose.SEARCH, Purpose.SELECT, Purpose.GO, Purpose.HELD_OUT, Purpose.ASSESS):
        series = Series([BOX, PLANE], 7, purpose)
        for _ in range(3):
            batch = series.next(50)
            n += len(batch)
            for region, part in ((BOX, slice(0, 50)), (PLANE, slice(50, 100))):
                for name, values in (("speeds_mps", batch.speed_mps), ("angles_deg", batch.angle_deg)):
                    lo, hi = getattr(region, name)
                    assert lo <= values[part].min() < values[part].max() <= hi
            seen |= {(batch.seed, int(stream)) for stream in batch.stream}
            speeds |= set(batch.speed_mps.tolist())
    assert len(seen) == len(speeds) == n == 1500


def test_a_series_is_a_function_of_its_seed() -> None:
    first, again, other = (Series([PLANE], seed, Purpose.SEARCH).next(20) for seed in (1, 1, 2))
    assert (first.speed_mps == again.speed_mps).all()
    assert first.seed == again.seed != other.seed
    assert (first.speed_mps != other.speed_mps).all()


# ---- the map and its fit


def test_smoothing_prefers_the_wide_ridge_to_the_narrow_one() -> None:
    tau_s = np.linspace(0.1, 0.4, 61)  # steps of 5 ms
    score = np.zeros((61, 2))
    score[10, 0] = 1.0  # 5 ms wide
    score[30:38, 0] = 0.8  # 40 ms wide
    score[20, 1] = 1.0
    smoothed = start.smooth(score, tau_s, 0.01)
    assert 31 <= smoothed[:, 0].argmax() <= 36
    assert smoothed[:, 1].argmax() == 20
    assert start.smooth(np.ones((61, 1)), tau_s, 0.01) == pytest.approx(np.ones((61, 1)))


@pytest.mark.parametrize("name", FORMS)
def test_the_fit_finds_the_policy_that_made_the_best_thresholds(name: str) -> None:
    general = General(name)
    vx, vz = (axis.reshape(-1) for axis in np.meshgrid(np.linspace(0.0, 4.0, 25), np.linspace(0.2, 4.0, 26)))
    known = features(*xz(vx, vz))[:, :6] @ np.array([5.0, 0.3, 1.2, -0.2, 0.3, -0.8])
    theta = start.fit(general, Best(vx, vz, known, np.ones(vx.size), 9.0, 0))
    found = general.thresholds(theta, vx, vz)
    # in the instant of the trigger; a table is bent between its nodes, and all are drawn a little to what is nearby
    assert np.abs(1 / found - 1 / known).max() < 0.012
    assert np.abs(1 / found - 1 / known).mean() < 0.003
    assert theta[general.moment].tolist() == [9.0, 0.0, 0.0]
    assert (theta[general.go_p_min :] == 0.0).all()


def test_cells_without_a_landing_do_not_bend_the_fit() -> None:
    general = General("polynomial2")
    vx, vz = velocities(8)
    known = np.full(200, 5.0)
    theta = start.fit(general, Best(vx, vz, known, np.ones(200), 9.0, 0))
    assert general.thresholds(theta, *velocities(9)) == pytest.approx(np.full(200, 5.0), rel=1e-3)


def two_ridges(vx: np.ndarray, vz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Instants tau of a wide ridge that follows a plane, and of one that is a little better in every other cell."""
    wide = 0.26 - 0.02 * vx - 0.015 * vz
    return wide, wide - 0.09


def ridges_map() -> start.Map:
    """A map that flew nothing: its landings lie on `two_ridges`."""
    edges = np.linspace(1.5, 3.5, 7), np.linspace(30.0, 90.0, 7)
    speed, angle = (axis.reshape(-1) for axis in np.meshgrid(*(0.5 * (e[1:] + e[:-1]) for e in edges), indexing="ij"))
    vx, vz = speed * np.cos(np.radians(angle)), speed * np.sin(np.radians(angle))
    tau_s = np.linspace(0.1, 0.4, 61)
    wide, narrow = two_ridges(vx, vz)
    outcomes = np.zeros((1, tau_s.size, speed.size), dtype=native.library().outcome_dtype)
    outcomes["triggered"] = 1
    outcomes["d_trigger_m"] = vz * tau_s[:, None]
    outcomes["rrev_trigger"] = 1.0 / tau_s[:, None]
    outcomes["of_y_trigger"] = -vx / outcomes["d_trigger_m"]
    legs = np.where(np.abs(tau_s[:, None] - wide) < 0.02, 3, 0)
    legs = np.where((np.abs(tau_s[:, None] - narrow) < 0.008) & (np.arange(speed.size) % 2 == 0), 4, legs)
    outcomes["n_legs"] = legs
    outcomes["body_contact"] = legs == 3
    return start.Map(*edges, tau_s, 0.01, np.array([8.0]), [outcomes])


def test_what_is_looked_up_in_a_map_is_what_its_flights_say() -> None:
    """Of policies with the same threshold everywhere, the map has flown each."""
    general = General("polynomial2")
    flown = ridges_map()
    on_map = polish.OnMap(general, flown, 0.01)
    (smoothed,) = flown.smoothed()
    for i in (5, 22, 40):
        level = general.level(1.0 / flown.tau_s[i] * (1 - 1e-4), 8.0)
        assert on_map(level) == pytest.approx(smoothed[0, i].mean())
    early = general.level(5.0, 8.0)
    early[general.threshold] = [0.6, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert on_map(early) == 0.0, "it would flip before the approach has its speed"


@pytest.mark.parametrize("name", ["polynomial2", "bilinear"])
def test_a_start_from_the_map_does_not_go_between_two_ridges(name: str) -> None:
    general = General(name)
    flown = ridges_map()
    best = start.best_of(flown)
    fitted = start.fit(general, best)
    on_map = polish.OnMap(general, flown, 0.005)
    (found,) = polish.polish(general, flown, best, fitted, 10.0, [0.005], seed=0)
    # every other cell is best on the narrow ridge, and a surface through both misses both
    assert on_map(fitted) < 0.3
    assert on_map(found) > 0.45
    assert (found[general.go_p_min :] == fitted[general.go_p_min :]).all()
    assert (polish.polish(general, flown, best, fitted, 10.0, [0.005], seed=0)[0] == found).all()


def test_policies_on_a_map_of_several_moments_take_the_one_between() -> None:
    general = General("polynomial2")
    flown = ridges_map()
    (outcomes,) = flown.flown
    hopeless = outcomes.copy()
    hopeless["n_legs"] = 0
    both = replace(flown, moments_Nmm=np.array([6.0, 8.0]), flown=[np.concatenate([hopeless, outcomes])])
    on_map = polish.OnMap(general, both, 0.01)
    at = {moment: on_map(general.level(4.6, moment)) for moment in (5.0, 6.0, 7.0, 8.0, 9.0)}
    assert [at[5.0], at[6.0]] == pytest.approx([0.0, 0.0], abs=1e-6)  # a vehicle has single precision
    assert at[7.0] == pytest.approx(0.5 * at[8.0], rel=1e-5)
    assert at[9.0] == pytest.approx(at[8.0], rel=1e-5)
    assert at[8.0] > 0.1


# ---- go / no-go


def drawn(seed: int, n: int, coefficients: np.ndarray) -> Decided:
    rng = np.random.default_rng(seed)
    x, z = rng.uniform(-0.7, 1.5, n), rng.uniform(-0.8, 1.2, n)
    p = 1.0 / (1.0 + np.exp(-features(x, z) @ coefficients))
    landed = rng.random(n) < p
    return Decided(x, z, landed, ~landed & (rng.random(n) < 0.5), n)


KNOWN = np.array([1.0, 0.5, 2.0, -0.5, 0.3, -0.8, 0.2, 0.4, -0.3, 0.5])


def test_the_logistic_fit_finds_the_probabilities_that_drew_the_landings() -> None:
    coefficients = go.fit(drawn(1, 40_000, KNOWN), ridge=0.1)
    fresh = drawn(2, 4000, KNOWN)
    true = 1.0 / (1.0 + np.exp(-features(fresh.x, fresh.z) @ KNOWN))
    found = go.probabilities(coefficients, fresh)
    assert np.abs(found - true).mean() < 0.01
    assert go.calibration_error(found, fresh.landed) < 0.03


def test_the_fit_is_where_its_loss_is_flat() -> None:
    """With a ridge of nearly nothing the residuals are orthogonal to all features."""
    decided = drawn(3, 2000, KNOWN)
    p = go.probabilities(go.fit(decided, ridge=1e-9), decided)
    assert features(decided.x, decided.z).T @ (p - decided.landed) == pytest.approx(np.zeros(10), abs=1e-3)


def test_landings_that_a_line_parts_do_not_drive_the_fit_away() -> None:
    decided = drawn(4, 500, KNOWN)
    parted = Decided(decided.x, decided.z, decided.z > 0.1, decided.z <= 0.1, 500)
    coefficients = go.fit(parted, ridge=1.0)
    assert np.isfinite(coefficients).all()
    assert np.abs(coefficients).max() < 200.0  # what a vehicle accepts
    assert go.auc(go.probabilities(coefficients, parted), parted.landed) > 0.999


@settings(max_examples=50)
@given(st.lists(st.tuples(st.sampled_from([0.0, 0.1, 0.5, 0.5001, 1.0]), st.booleans()), min_size=1, max_size=30))
def test_auc_is_the_share_of_pairs_in_order(pairs: list[tuple[float, bool]]) -> None:
    p, landed = np.array([a for a, _ in pairs]), np.array([b for _, b in pairs])
    good, bad = p[landed], p[~landed]
    found = go.auc(p, landed)
    if not good.size or not bad.size:
        assert np.isnan(found)
        return
    difference = good[:, None] - bad[None, :]
    assert found == pytest.approx(np.mean((difference > 0) + 0.5 * (difference == 0)))


def test_calibration_error_of_a_liar_and_of_an_honest_one() -> None:
    landed = np.arange(1000) % 4 == 0
    assert go.calibration_error(np.full(1000, 0.25), landed) == pytest.approx(0.0)
    assert go.calibration_error(np.full(1000, 0.75), landed) == pytest.approx(0.5)
    assert go.calibration_error(np.array([1.0, 0.0]), np.array([True, False])) == pytest.approx(0.0)
    assert np.isnan(go.calibration_error(np.zeros(0), np.zeros(0, dtype=bool)))


def test_the_least_probability_keeps_both_promises_where_it_can() -> None:
    p = np.linspace(0.0, 1.0, 1001)
    landed = p > 0.4
    decided = Decided(p, p, landed, ~landed, 1001)
    chosen = go.choose_p_min(p, decided, strikes_avoided_min=0.75, refused_good_max=0.04)
    assert 0.3 <= chosen <= 0.44
    assert (p[decided.strike] < chosen).mean() >= 0.75
    # where landings and strikes do not differ, few good ones are refused, whatever becomes of the strikes
    blind = Decided(p, p, np.arange(1001) % 2 == 0, np.arange(1001) % 2 == 1, 1001)
    chosen = go.choose_p_min(p, blind, 0.75, 0.04)
    assert ((p < chosen) & blind.landed).sum() / 1001 <= 0.04
    assert go.choose_p_min(p, blind, 0.75, 0.0) <= 0.02


# ---- flying


def test_all_policies_meet_the_same_approaches() -> None:
    task = PolicyTask(
        vehicle="habas2021", gear="wide_short", gear_set="as_simulated",
        overrides=settings_of({"sense.position_noise": 0.005}, "test"),
    )  # fmt: skip
    general, place = General("polynomial2"), Place.of(task)
    approaches = Series([Region(speeds_mps=[2.0, 3.0], angles_deg=[60.0, 90.0])], 1, Purpose.SEARCH).next(20)
    theta = general.level(np.array([4.8, 3.0, 4.8]), 8.0)
    (outcomes,) = fly([place], "polynomial2", theta, approaches)
    assert outcomes.shape == (3, 20)
    assert outcomes[0].tobytes() == outcomes[2].tobytes() != outcomes[1].tobytes()
    assert objective([outcomes])[0] == objective([outcomes])[2]
    assert objective([outcomes, outcomes]) == pytest.approx(objective([outcomes]))


def test_an_iteration_is_told_with_its_whole_policy() -> None:
    told = Iteration(1, General("polynomial2").level(5.0, 8.0), 0.5, 0.6, 100)
    assert told.theta.shape == (20,)
