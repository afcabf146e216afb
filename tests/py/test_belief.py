"""The belief over simulated vehicles: recordings, bank, emulators, posterior, decision, and the learner on it."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import expit, logit

from ivl import experiment, family, run
from ivl.belief import bank, correction, decide, emulator, posterior, recording
from ivl.belief.changes import most_changed
from ivl.belief.posterior import Belief, Evidence, Trust
from ivl.belief.recording import Flight
from ivl.belief.simulator import Simulator
from ivl.family import Family, FamilyChoice, Spread
from ivl.learners import EpheBelief, make_learner
from ivl.learners.base import LANDED, RECORDING
from ivl.learners.ephe import imagine
from ivl.outcome import four_leg
from ivl.plots import belief as belief_picture
from ivl.report import learn_page
from ivl.world import World

BOUNDS = np.array([[0.0, 7.0], [0.0, 10.65]])
FLIGHT = Flight(2.5, 90.0, "constant", "imparted", BOUNDS)
CHOICE = FamilyChoice(
    parameters={
        "body.mass": Spread(share=0.05, source="test"),
        "rotor.thrust_gain": Spread(share=0.05, source="test"),
        "leg.stiffness": Spread(share=0.2, source="test"),
    }
)
N_USED = len(emulator.USED)


@pytest.fixture(scope="module")
def kin() -> Family:
    return family.of(World("habas2021", "wide_short", "as_simulated"), CHOICE)


@pytest.fixture(scope="module")
def simulator(kin: Family, tmp_path_factory: pytest.TempPathFactory) -> Simulator:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        return Simulator.of(kin, FLIGHT, n_members=80)


def belief_of(
    recordings: emulator.RecordingEmulator, kin: Family, seed: int = 1, n: int = 400, **trust: float
) -> Belief:
    """A belief over recordings alone: landings are as likely as not, whatever is flown."""
    landings = emulator.LandingEmulator(recordings, np.zeros(N_USED), np.ones(N_USED), [])
    rng = np.random.Generator(np.random.PCG64(seed))
    return Belief(recordings, landings, kin, n, rng, Trust(**trust))


class Even(emulator.LandingEmulator):
    """A landing emulator that knows nothing."""

    def rate(
        self,
        z: np.ndarray,
        theta: np.ndarray,  # noqa: ARG002
        conditions: np.ndarray,  # noqa: ARG002
        recorded: np.ndarray | None = None,  # noqa: ARG002
    ) -> np.ndarray:
        return np.full(len(z), 0.5)


# ---- recordings


def test_a_recording_is_the_motion_after_the_trigger_up_to_the_contact(kin: Family) -> None:
    features, outcome = recording.simulated(kin.world, FLIGHT, np.array([4.5, 8.0]), seed=3, stream=0)
    trace = kin.world.trace(2.5, 90.0, 4.5, 8.0, seed=3, stream=0, period_s=0.005)
    contact_s = float(outcome["t_impact_s"][0] - outcome["t_trigger_s"][0])
    told = recording.table(features)
    assert told["contact_time"] == pytest.approx(contact_s, abs=0.008)
    for ms in (50, 90):
        true = np.interp(outcome["t_trigger_s"][0] + ms / 1000, trace.rows["t_s"], trace.rows["pitch_deg"])
        assert told[f"pitch_{ms:03d}"] == pytest.approx(true, abs=1.5)
    assert told["closing"] == pytest.approx(2.5, abs=0.1)
    late = [name for name in recording.NAMES if name.endswith("_230")] if contact_s < 0.23 else ["hanging"]
    assert contact_s < 0.25
    assert not any(name in told for name in late)
    assert "battery" not in told  # this vehicle has none
    again, _ = recording.simulated(kin.world, FLIGHT, np.array([4.5, 8.0]), seed=3, stream=0)
    assert np.array_equal(features, again, equal_nan=True)


def test_only_the_swing_after_the_contact_tells_soft_legs_from_stiff_ones(kin: Family) -> None:
    soft, stiff = (kin.world.changed(**{"leg.stiffness": factor * 0.08}) for factor in (0.7, 1.3))
    means = [
        np.mean(
            [recording.simulated(world, FLIGHT, np.array([4.5, 8.0]), seed=3, stream=k)[0] for k in range(8)], axis=0
        )
        for world in (soft, stiff)
    ]
    apart = dict(zip(recording.NAMES, np.abs(means[0] - means[1]), strict=True))
    assert apart["swing_rate_020"] > 4.0  # rad/s; equal flights scatter by 3
    before = [apart[name] for name in apart if name.startswith(recording.SIGNALS) and np.isfinite(apart[name])]
    assert len(before) > 20
    assert max(before) < 0.05  # degrees, rad/s, m


def test_a_flight_without_a_trigger_records_nothing(kin: Family) -> None:
    never = Flight(0.5, 20.0, "constant", "imparted", BOUNDS)
    features, outcome = recording.simulated(kin.world, never, np.array([20.0, 5.0]), seed=3, stream=0)
    assert not outcome["triggered"][0]
    assert np.isnan(features).all()


def test_a_flight_of_many_approaches_names_its_own(kin: Family) -> None:
    many = replace(FLIGHT, approaches=np.array([[1.5, 3.5], [30.0, 90.0]]))
    assert many.box.shape == (4, 2)
    own, outcome = recording.simulated(kin.world, many, np.array([4.5, 8.0, 2.0, 60.0]), seed=3, stream=0)
    one = replace(FLIGHT, speed_mps=2.0, angle_deg=60.0)
    same, expected = recording.simulated(kin.world, one, np.array([4.5, 8.0]), seed=3, stream=0)
    assert np.array_equal(own, same, equal_nan=True)
    assert outcome.tobytes() == expected.tobytes()
    flown = bank.make(kin, many, 6, 3, seed=5)
    assert flown.theta.shape == (6, 3, 4)
    assert (np.ptp(flown.theta.reshape(-1, 4), axis=0) > 0.3 * np.ptp(many.box, axis=1)).all()


def test_the_gyro_clips_what_is_recorded(kin: Family) -> None:
    rates = [name.startswith("rate") for name in recording.NAMES]
    features, _ = recording.simulated(kin.world, FLIGHT, np.array([3.0, 10.65]), seed=1, stream=0)
    assert np.nanmax(np.abs(features[rates])) <= 0.93 * 34.9 + 1e-9


# ---- bank


def test_a_bank_depends_on_its_seed_alone_not_on_threads(kin: Family) -> None:
    one, two = (bank.make(kin, FLIGHT, 10, 4, seed=5, threads=threads) for threads in (1, 2))
    assert np.array_equal(one.features, two.features, equal_nan=True)
    assert (one.landed == two.landed).all()
    assert (one.theta == two.theta).all()
    other = bank.make(kin, FLIGHT, 10, 4, seed=6, threads=2)
    assert (one.z != other.z).all()


def test_later_members_fly_near_landings_of_earlier_ones(kin: Family) -> None:
    made = bank.make(kin, FLIGHT, 60, 16, seed=7)
    assert made.landed[15:].mean() > 1.5 * made.landed[:15].mean()
    assert (made.theta >= BOUNDS[:, 0]).all()
    assert (made.theta <= BOUNDS[:, 1]).all()


def test_a_bank_is_flown_once_and_its_name_says_what_it_depends_on(
    kin: Family, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    flown: list[int] = []
    first = Simulator.of(kin, FLIGHT, n_members=8, progress=lambda done, _: flown.append(done))
    assert flown == list(range(1, 9))
    second = Simulator.of(kin, FLIGHT, n_members=8, progress=lambda done, _: flown.append(done))
    assert len(flown) == 8
    assert (first.recordings.weights == second.recordings.weights).all()
    wider = family.of(kin.world, CHOICE.model_copy(update={"scale": 2.0}))
    Simulator.of(wider, FLIGHT, n_members=8)
    Simulator.of(kin, Flight(2.6, 90.0, "constant", "imparted", BOUNDS), n_members=8)
    assert len(list((tmp_path / "ivl").iterdir())) == 3


# ---- emulators


def test_the_emulators_predict_members_that_they_have_not_seen(kin: Family, simulator: Simulator) -> None:
    fresh = bank.make(kin, FLIGHT, 24, 12, seed=99)
    n = fresh.landed.size
    flights = np.repeat(fresh.z, 12, axis=0), fresh.theta.reshape(n, -1), np.full((n, 2), np.nan)
    seen = emulator.used(fresh.features).reshape(n, -1)
    error = seen - simulator.recordings.mean(*flights)
    pitch = emulator.USED.index("pitch_090")
    assert np.nanstd(error[:, pitch]) < 0.25 * np.nanstd(seen[:, pitch])
    expected = np.sqrt(simulator.recordings.within[pitch, pitch] + simulator.recordings.between[pitch, pitch])
    assert 0.5 < np.nanstd(error[:, pitch]) / expected < 2.0
    p, y = simulator.landings.rate(*flights), fresh.landed.ravel()
    assert p[y].mean() > 4.0 * p[~y].mean()
    assert abs(p.mean() - y.mean()) < 0.06


def test_the_network_of_the_recordings_finds_what_the_terms_leave(simulator: Simulator, kin: Family) -> None:
    fresh = bank.make(kin, FLIGHT, 24, 12, seed=98)
    n = fresh.landed.size
    conditions = fresh.features[..., recording.CONDITIONS].reshape(n, -1)
    flights = np.repeat(fresh.z, 12, axis=0), fresh.theta.reshape(n, -1), conditions
    seen = emulator.used(fresh.features).reshape(n, -1)
    fitted = simulator.recordings
    with_net, without = (
        np.nanmedian(np.abs(seen - r.mean(*flights)), axis=0) for r in (fitted, replace(fitted, net=[]))
    )
    at = [emulator.USED.index(name) for name in ("rate_050", "rate_090", "pitch_130")]
    assert (with_net[at] < 0.9 * without[at]).all()


def test_one_wild_recording_does_not_set_the_size_of_a_feature() -> None:
    rng = np.random.default_rng(2)
    residual = rng.normal(0.0, 2.0, (400, 1))
    residual[7], residual[8] = 1e6, np.nan
    assert emulator._typical(residual) == pytest.approx(2.0, rel=0.15)
    assert emulator._typical(np.full((4, 1), np.nan)) == 1.0


def test_samples_about_a_contact_are_no_part_of_a_recording() -> None:
    t_s = np.arange(0.0, 0.3, 0.005)
    flat = np.zeros(len(t_s))
    found = recording._features(t_s, flat, flat, flat, flat, 0.115, (np.nan, np.nan))
    named = dict(zip(recording.NAMES, found, strict=True))
    assert np.isfinite([named["pitch_090"], named["contact_time"]]).all()
    assert np.isnan([named["pitch_110"], named["rate_110"], named["fall_130"]]).all()


def test_covariances_are_found_from_residuals_with_gaps() -> None:
    rng = np.random.default_rng(1)
    within, between = np.diag([1.0, 4.0, 0.25]), np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.5]])
    b = rng.multivariate_normal(np.zeros(3), between, 4000)
    residual = b[:, None] + rng.multivariate_normal(np.zeros(3), within, (4000, 6))
    residual[:, :2, 2] = np.nan  # a gap
    found_within, found_between = emulator._covariances(residual)
    assert np.allclose(found_within, within, atol=0.15)
    assert np.allclose(found_between, between, atol=0.2)


# ---- posterior


def linear(kin: Family, rng: np.random.Generator) -> emulator.RecordingEmulator:
    """Features that are linear in z, with known noise, whatever is flown."""
    scale = emulator.Scale(BOUNDS[:, 0], BOUNDS[:, 1], np.zeros(2), np.ones(2))
    n_terms = emulator._terms(np.zeros((1, len(kin.dimensions) + 4)), 2).shape[1]
    weights = np.zeros((n_terms, N_USED))
    weights[1 : 1 + len(kin.dimensions)] = rng.normal(size=(len(kin.dimensions), N_USED))
    return emulator.RecordingEmulator(scale, weights, [], np.ones(N_USED), 4.0 * np.eye(N_USED), 0.5 * np.eye(N_USED))


def evidence_of(emulated: emulator.RecordingEmulator, z: np.ndarray, n: int, rng: np.random.Generator) -> Evidence:
    """Recordings of a member of a linear family, with errors as the emulator says; half of them with a gap."""
    theta = rng.uniform(BOUNDS[:, 0], BOUNDS[:, 1], (n, 2))
    mean = emulated.mean(np.tile(z, (n, 1)), theta, np.full((n, 2), np.nan))
    shared = rng.multivariate_normal(np.zeros(N_USED), emulated.between)
    features = mean + shared + rng.multivariate_normal(np.zeros(N_USED), emulated.within, n)
    features[::2, -3:] = np.nan
    return Evidence(theta, features, rng.random(n) < 0.5, np.full((n, 2), np.nan))


def exact(emulated: emulator.RecordingEmulator, evidence: Evidence, n_z: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the Gaussian posterior of a linear family, all flights as one long vector."""
    n = len(evidence.theta)
    design = np.tile(emulated.weights[1 : 1 + n_z].T, (n, 1))
    noise = np.kron(np.eye(n), emulated.within) + np.kron(np.ones((n, n)), emulated.between)
    seen = np.isfinite(evidence.features).ravel()
    a, y, s = design[seen], evidence.features.ravel()[seen], noise[np.ix_(seen, seen)]
    covariance = np.linalg.inv(np.eye(n_z) + a.T @ np.linalg.solve(s, a))
    return covariance @ a.T @ np.linalg.solve(s, y), covariance


def test_the_posterior_of_a_linear_family_is_the_known_one(kin: Family) -> None:
    rng = np.random.default_rng(3)
    emulated, n_z = linear(kin, rng), len(kin.dimensions)
    believed = belief_of(emulated, kin, n=3000, nu=1e9, n_full=1e9, discrepancy=0.0)
    believed._landings = Even(emulated, np.zeros(N_USED), np.ones(N_USED), [])
    whole = evidence_of(emulated, np.array([0.8, -1.1, 0.4]), 5, rng)
    for n in (2, 5):  # flight by flight, as it is used
        part = Evidence(whole.theta[:n], whole.features[:n], whole.landed[:n], whole.conditions[:n])
        believed.update(part)
    mean, covariance = exact(emulated, whole, n_z)
    assert np.allclose(believed.z.mean(axis=0), mean, atol=0.12)
    assert np.allclose(np.cov(believed.z.T), covariance, atol=0.1)


def test_a_narrow_posterior_in_a_slanted_direction_keeps_its_width(kin: Family) -> None:
    """Particles that share few ancestors and hardly move would be too sure; differences of others follow a ridge."""
    rng = np.random.default_rng(8)
    emulated, n_z = linear(kin, rng), len(kin.dimensions)
    weights = emulated.weights.copy()
    weights[1 : 1 + n_z] = rng.normal(size=(1, N_USED)) * np.array([[3.0], [-3.0], [0.05]])  # a ridge: z_0 = z_1
    ridge = replace(emulated, weights=weights, within=0.04 * np.eye(N_USED), between=1e-4 * np.eye(N_USED))
    found, known = [], []
    for number in range(6):
        whole = evidence_of(ridge, rng.standard_normal(n_z), 4, rng)
        believed = belief_of(ridge, kin, seed=number, n=256, nu=1e9, n_full=1e9, discrepancy=0.0)
        believed._landings = Even(ridge, np.zeros(N_USED), np.ones(N_USED), [])
        for n in range(1, 5):
            believed.update(Evidence(whole.theta[:n], whole.features[:n], whole.landed[:n], whole.conditions[:n]))
        found.append(believed.z.std(axis=0))
        known.append(np.sqrt(np.diag(exact(ridge, whole, n_z)[1])))
    assert np.allclose(np.mean(found, axis=0), np.mean(known, axis=0), rtol=0.2)


def test_ranks_of_the_true_member_are_uniform(kin: Family) -> None:
    """Simulation-based calibration (Talts et al. 2018): a belief that is too sure, or not sure enough, shows here."""
    rng = np.random.default_rng(4)
    emulated, n_z = linear(kin, rng), len(kin.dimensions)
    ranks = []
    for number in range(60):
        z = rng.standard_normal(n_z)
        believed = belief_of(emulated, kin, seed=number, n=99, nu=1e9, n_full=1e9, discrepancy=0.0)
        believed._landings = Even(emulated, np.zeros(N_USED), np.ones(N_USED), [])
        believed.update(evidence_of(emulated, z, 2, rng))
        ranks.extend(((believed.z < z).sum(axis=0) / 99).tolist())
    counts, _ = np.histogram(ranks, bins=6, range=(0.0, 1.0))
    expected = len(ranks) / 6
    assert ((counts - expected) ** 2 / expected).sum() < 20.5  # chi-square, 5 degrees of freedom: p = 0.001


def test_errors_that_all_flights_share_do_not_add_up_to_certainty(kin: Family) -> None:
    rng = np.random.default_rng(5)
    emulated = linear(kin, rng)
    few, many = (evidence_of(emulated, np.zeros(3), n, np.random.default_rng(6)) for n in (2, 40))
    spread = []
    for evidence in (few, many):
        believed = belief_of(emulated, kin, n=500, nu=1e9, n_full=1e9, discrepancy=0.0)
        believed._landings = Even(emulated, np.zeros(N_USED), np.ones(N_USED), [])
        believed.update(evidence)
        spread.append(believed.z.std(axis=0).mean())
    shared_alone = np.sqrt(np.diag(exact(
        replace(emulated, within=1e-6 * np.eye(N_USED)), few, 3
    )[1])).mean()  # fmt: skip
    assert spread[1] > 0.8 * shared_alone
    assert spread[1] < spread[0]


def test_landings_tell_of_the_member(simulator: Simulator) -> None:
    """Flights that land where few members do pull the belief towards those."""
    rng = np.random.Generator(np.random.PCG64(7))
    believed = simulator.belief(rng, 300, Trust())
    before = believed.rates(np.array([[4.5, 9.0]])).mean()
    n = 6
    nothing = np.full((n, N_USED), np.nan)
    theta = np.tile([4.5, 9.0], (n, 1))
    for landed in (True, False):
        told = simulator.belief(np.random.Generator(np.random.PCG64(7)), 300, Trust())
        told.update(Evidence(theta, nothing, np.full(n, landed), np.full((n, 2), np.nan)))
        after = told.rates(np.array([[4.5, 9.0]])).mean()
        assert after > before if landed else after < before


def test_the_discrepancy_is_a_covariance_of_the_stated_size() -> None:
    d = posterior.discrepancy(1.0)
    assert np.linalg.eigvalsh(d).min() > 0
    name = emulator.USED.index("pitch_210")
    assert np.sqrt(d[name, name]) == pytest.approx(4.0 * (0.21 / 0.2) ** 2)
    assert np.allclose(posterior.discrepancy(3.0), 9.0 * d)


# ---- a battery that lasts


def test_conditions_are_about_a_battery_that_lasts_and_spread_without_one() -> None:
    scale = emulator.Scale(BOUNDS[:, 0], BOUNDS[:, 1], np.array([3.5, 0.02]), np.array([0.2, 0.01]))
    quantiles = np.stack([np.linspace(0.01, 0.99, 99), np.full(99, 0.5)], axis=1)
    spread, lasting = scale.conditions(quantiles), scale.conditions(quantiles, 3.8)
    assert spread[:, 0].mean() == pytest.approx(3.5)
    assert spread[:, 0].std() > 0.15
    assert lasting[:, 0].mean() == pytest.approx(3.8)
    assert lasting[:, 0].std() < 0.05
    assert np.array_equal(spread[:, 1], lasting[:, 1])
    never = replace(scale, sigma=np.array([0.0, 0.01]))  # no flight of the bank has a battery
    assert np.isnan(never.conditions(quantiles, 3.8)[:, 0]).all()


def test_the_next_flight_is_expected_with_the_battery_of_the_last_one_only_if_it_lasts(simulator: Simulator) -> None:
    nothing = np.full((1, recording.N), np.nan)
    told = nothing.copy()
    told[0, recording.CONDITIONS] = 3.71, 0.01
    for lasts in (False, True):
        learner = learner_of(replace(simulator, flight=replace(FLIGHT, battery_lasts=lasts)), n_particles=32)
        for features in (told, nothing):  # a flight that told no voltage changes nothing
            learner.tell(learner.ask()[:1], np.full(1, 10.0), {LANDED: np.zeros(1, dtype=bool), RECORDING: features})
        assert learner._belief is not None
        voltage = learner._belief.battery_V
        assert voltage == 3.71 if lasts else np.isnan(voltage)
        again = learner_of(replace(simulator, flight=replace(FLIGHT, battery_lasts=lasts)), seed=7, n_particles=32)
        again.load_state_dict(json.loads(json.dumps(learner.state_dict(), allow_nan=False)))
        assert np.array_equal(again.ask(), learner.ask())


def test_a_battery_that_is_known_before_a_flight_is_decided_for(
    simulator: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    decided: list[float] = []
    safest = decide.safest

    def noted(belief: posterior.Belief, *others: Any) -> tuple[np.ndarray, float]:
        decided.append(belief.battery_V)
        return safest(belief, *others)

    for lasts in (False, True):
        chosen = replace(simulator, flight=replace(FLIGHT, battery_lasts=lasts))
        learner, other = (learner_of(chosen, n_particles=32) for _ in range(2))
        monkeypatch.setattr(decide, "safest", noted)
        decided.clear()
        for battery_V in (np.nan, 3.7, 3.7 + 0.9 * emulator.BATTERY_CHANGES_V, 3.5):
            learner.take_battery(battery_V)
        monkeypatch.setattr(decide, "safest", safest)
        assert decided == ([3.7, 3.5] if lasts else [])
        chosen_theta = learner.ask()[0]
        assert np.array_equal(learner.rechosen(chosen_theta + 0.1, 3.3), chosen_theta + 0.1), "an operator's stays"
        assert np.array_equal(learner.rechosen(chosen_theta, 3.9), learner.ask()[0])
        learner = learner_of(chosen, n_particles=32)
        learner.take_battery(3.7)
        assert learner._rng.bit_generator.state == other._rng.bit_generator.state, "later numbers stay as they were"


def test_the_hover_of_a_battery_is_as_simulated_flights_record_it() -> None:
    flown = experiment.load("experiments/paper_flight.yaml")
    world = flown.make_world()
    for rest_V in (3.6, 3.9, 4.2):
        own = world.changed(**{"battery.voltage": rest_V, "battery.voltage_scatter": 0.0})
        features, _ = recording.simulated(own, flown.flight, np.array([4.5, 8.0]), seed=3, stream=0)
        told = recording.hover_V(world, flown.flight, rest_V)
        assert told == pytest.approx(features[recording.CONDITIONS[0]], abs=0.05)
        assert told < rest_V
    assert np.isnan(recording.hover_V(world, flown.flight, np.nan))
    assert np.isnan(recording.hover_V(world.changed(**{"battery.voltage": 0.0}), flown.flight, 4.0))


# ---- decision


def test_a_late_trigger_is_a_larger_threshold() -> None:
    moved = decide.perturbed(np.array([4.0, 8.0]), 0.01, 0.1, BOUNDS)
    assert moved == pytest.approx([1.0 / (0.25 - 0.01), 8.8])
    assert decide.perturbed(np.array([6.9, 10.0]), 0.05, 0.1, BOUNDS) == pytest.approx([7.0, 10.65])  # kept in the box


def test_the_margin_is_an_average_over_the_box_of_errors() -> None:
    points, weights = decide.around(np.array([[4.0, 8.0]]), BOUNDS)
    assert weights.sum() == pytest.approx(1.0)
    late = 0.25 - 1.0 / points[:, 0, 0]
    share = points[:, 0, 1] / 8.0 - 1.0
    assert weights @ late == pytest.approx(0.0, abs=1e-12)
    assert weights @ late**2 == pytest.approx(0.01**2 / 3)  # as of a uniform distribution
    assert weights @ share**2 == pytest.approx(0.1**2 / 3)


class Window:
    """A belief of one landing window: lands between two thresholds, better with a larger moment up to 8 N mm."""

    def rates(self, theta: np.ndarray, n_most: int = 1) -> np.ndarray:  # noqa: ARG002
        r, m = theta[:, 0], theta[:, 1]
        inside = expit((r - 3.8) * 40) * expit((4.4 - r) * 40)
        return (inside * np.where(m < 8.0, m / 8.0, 1.0))[None]

    def rate_of_one(self, theta: np.ndarray) -> np.ndarray:
        return self.rates(theta)[0]


NOTHING = correction.fit(np.empty((0, 2)), np.empty(0, dtype=bool), np.empty(0), np.array([0.3, 0.3]), 1.0)


def test_the_safest_policy_lies_inside_the_window() -> None:
    choice, rate = decide.safest(Window(), NOTHING, BOUNDS, np.random.default_rng(1))  # type: ignore[arg-type]
    assert 4.0 < choice[0] < 4.25
    assert choice[1] > 8.0
    assert rate > 0.9


def test_ephe_on_imagined_rollouts_converges_into_the_window() -> None:
    mu, sigma = np.array([5.0, 5.0]), np.array([1.5, 1.5])
    rng, floor = np.random.default_rng(2), np.array([0.05, 0.05])
    reward = decide.imagined(Window(), NOTHING, BOUNDS, rng)  # type: ignore[arg-type]
    for _ in range(4):
        mu, sigma = imagine(reward, mu, sigma, BOUNDS, rng, 300, 10, 0.7, floor)
    assert 3.9 < mu[0] < 4.3
    assert mu[1] > 7.0
    assert sigma[0] < 0.4


# ---- correction


def test_without_flights_the_correction_changes_nothing() -> None:
    theta, rate = np.array([[4.0, 8.0], [5.0, 2.0]]), np.array([0.3, 0.9])
    assert (NOTHING(theta, rate) == rate).all()


def test_the_correction_is_the_mode_of_its_posterior() -> None:
    rng = np.random.default_rng(1)
    theta, landed = rng.uniform(0, 1, (12, 2)), rng.random(12) < 0.5
    rate, lengths, size = rng.uniform(0.1, 0.9, 12), np.array([0.3, 0.5]), 1.5
    kernel = correction._kernel(theta, theta, lengths, size)
    precision = np.linalg.inv(kernel + 1e-10 * np.eye(12))

    def cost(g: np.ndarray) -> float:
        p = expit(logit(rate) + g)
        return float(0.5 * g @ precision @ g - np.where(landed, np.log(p), np.log(1 - p)).sum())

    mode = minimize(cost, np.zeros(12), method="BFGS", options={"gtol": 1e-8}).x
    found = correction.fit(theta, landed, rate, lengths, size)
    assert np.allclose(kernel @ found.weights, mode, atol=1e-3)


def test_failures_where_landings_were_expected_sink_the_rate_there_alone() -> None:
    theta = np.tile([4.0, 8.0], (6, 1))
    found = correction.fit(theta, np.zeros(6, dtype=bool), np.full(6, 0.9), np.array([0.3, 0.3]), 3.0)
    near, far = found(np.array([[4.0, 8.0], [6.0, 3.0]]), np.array([0.9, 0.9]))
    assert near < 0.4
    assert far == pytest.approx(0.9, abs=1e-6)


# ---- learner


def learner_of(simulator: Simulator | None, seed: int = 1, **options: Any) -> EpheBelief:
    learner = make_learner("ephe_belief", [4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, n_rollouts=2, seed=seed, **options)
    assert isinstance(learner, EpheBelief)
    if simulator is not None:
        learner.begin(simulator)
    return learner


def fly(learner: EpheBelief, world: World, n: int, seed: int, first: int = 0) -> list[bool]:
    """Fly and tell n episodes of two flights; whether each flight landed."""
    landings = []
    for episode in range(first, first + n):
        theta = learner.ask()
        flown = [recording.simulated(world, FLIGHT, t, seed, 2 * episode + k) for k, t in enumerate(theta)]
        landed = np.array([bool(four_leg(outcome).all()) for _, outcome in flown])
        features = np.array([features for features, _ in flown])
        learner.tell(theta, np.where(landed, 100.0, 10.0), {LANDED: landed, RECORDING: features})
        landings.extend(landed.tolist())
    return landings


def test_it_lands_vehicles_that_it_never_saw_from_the_first_flights_on(kin: Family, simulator: Simulator) -> None:
    rng = np.random.Generator(np.random.PCG64(123))
    landed, rates = [], []
    for number in range(5):
        _, drone = kin.draw(rng)
        learner = learner_of(simulator, seed=number, n_particles=48)
        landed.append(fly(learner, drone, 3, seed=number))
        recommended = learner.result.recommended
        rates.append(four_leg(drone.rollouts(2.5, 90.0, np.full(60, recommended[0]), recommended[1])).mean())
    assert np.mean(landed) > 0.5
    assert np.mean(rates) > 0.75


def test_the_state_continues_bit_for_bit(kin: Family, simulator: Simulator) -> None:
    one = learner_of(simulator, n_particles=32)
    fly(one, kin.world, 2, seed=5)
    text = json.dumps(one.state_dict(), allow_nan=False)
    two = learner_of(simulator, seed=9, n_particles=32)
    two.load_state_dict(json.loads(text))
    assert (fly(one, kin.world, 2, seed=5, first=2)) == fly(two, kin.world, 2, seed=5, first=2)
    assert json.dumps(one.state_dict()) == json.dumps(two.state_dict())
    assert (one.ask() == two.ask()).all()


def test_an_alarm_comes_when_nothing_lands_that_was_expected_to(simulator: Simulator) -> None:
    learner = learner_of(simulator, n_particles=32)
    assert learner.model_fits
    for _ in range(8):
        theta = learner.ask()
        learner.tell(theta, np.full(2, 10.0), {LANDED: np.zeros(2, dtype=bool)})
    assert not learner.model_fits
    flown = learner._theta
    assert np.ptp(flown[:, 0]) > 0.3  # it has gone elsewhere


def test_without_a_simulator_it_is_ephe_with_a_memory() -> None:
    rng = np.random.default_rng(1)
    one = learner_of(None)
    two = make_learner("ephe_memory", [4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, n_rollouts=2, seed=1)
    for _ in range(4):
        a, b = one.ask(), two.ask()
        assert (a == b).all()
        rewards = rng.uniform(0, 100, 2)
        one.tell(a, rewards)
        two.tell(b, rewards)
    assert one.model_fits is None


# ---- a whole run


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> experiment.Experiment:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("ivl.belief.simulator.MEMBERS", 24)
    coarse = ["check.grid.rrev_c_per_s.step=1.0", "check.grid.moment_y_Nmm.step=4.0", "learner.options.n_particles=32"]
    settings = [*coarse, "n_rollouts=4", "budget=16", "check.effort=0.02", "check.n_fresh=20", "start=imparted"]
    return experiment.load("experiments/paper_flight.yaml", settings, learner="ephe_belief")


def test_a_run_keeps_recordings_and_continues_with_the_same_bits(small: experiment.Experiment, tmp_path: Path) -> None:
    whole = run.run(small, tmp_path / "whole")
    assert whole.rollouts.recordings is not None
    assert whole.rollouts.recordings.shape == (16, recording.N)
    assert np.isfinite(whole.rollouts.recordings).any(axis=1).mean() > 0.5

    class Cut(RuntimeError):
        """The run is cut off."""

    def cut(progress: Any) -> None:
        if progress.episode == 2:
            raise Cut

    with pytest.raises(Cut):
        run.run(small, tmp_path / "cut", hooks=run.Hooks(on_episode=cut))
    resumed = run.run(small, tmp_path / "cut", resume=True)
    assert (resumed.rollouts.theta == whole.rollouts.theta).all()
    assert resumed.history == whole.history
    check_what_is_told(whole)
    earlier = run.run(small.model_copy(update={"budget": 4}), tmp_path / "later", earlier=[whole.folder])
    expected = [row.insight["expected_rate"] for row in (whole.history[-1], earlier.history[0]) if row.insight]
    assert abs(expected[0] - expected[1]) < 0.5
    assert earlier.history[0].insight is not None
    assert earlier.history[0].insight["belief"]["quantiles"] != whole.history[0].insight["belief"]["quantiles"]


def check_what_is_told(whole: run.RunResult) -> None:
    """What a run with a belief says: in its summary, on its page, in its picture."""
    insights = [row.insight or {} for row in whole.history]
    assert whole.summary["model_fits"] is insights[-1]["model_fits"]
    assert all(0.0 <= insight["margin_rate"] <= 1.0 and 0.0 <= insight["expected_rate"] <= 1.0 for insight in insights)
    told = insights[-1]["belief"]
    prior, after = np.array(told["prior"]), np.array(told["quantiles"])
    assert prior.shape == after.shape == (len(told["names"]), 5)
    assert (np.diff(after, axis=1) >= 0.0).all()
    assert np.abs(after - prior).max() > 0.0
    predicted = insights[-1]["predicted"]
    assert predicted["names"] == list(emulator.USED)
    assert (np.array(predicted["sd"]) > 0.0).all()
    assert [path.name for path in belief_picture.draw_run(whole)] == ["belief.png", "belief.svg"]
    data, _ = learn_page.collect(whole.folder, 2, lambda _done, _all: None)
    (picture,) = data["learn"]["pictures"]
    assert picture["source"].startswith("data:image/png;base64,")
    facts = dict(map(tuple, data["facts"]))
    assert facts["Its margin rate"].startswith(f"{100 * whole.summary['margin']['rate']:.1f} %")
    assert facts["Model"]


def test_the_parameters_that_changed_most_are_drawn() -> None:
    before = np.tile([-2.0, -1.0, 0.0, 1.0, 2.0], (9, 1))
    after = before.copy()
    after[3] += 5.0
    after[7] *= 0.1
    assert most_changed(np.array([before, after]))[:2] == [3, 7]
    assert len(most_changed(np.array([before, after]))) == 6


def test_failures_that_are_expected_are_those_of_the_flights_that_are_left() -> None:
    found = belief_picture.expected_failures(np.array([0.5, 0.9, 1.0]), np.array([4, 14, 16]), 24)
    assert found == pytest.approx([10.0, 1.0, 0.0])


def test_a_run_says_why_it_learns_without_simulated_vehicles(small: experiment.Experiment, tmp_path: Path) -> None:
    changed = {"vehicle": "habas2021", "gear_set": "as_simulated", "family": FamilyChoice()}
    bare = small.model_copy(update=changed)
    assert "no parameter of the vehicle has a sigma" in " ".join(run.run(bare, tmp_path / "bare").summary["warnings"])


def test_the_tool_that_judges_transfer_tells_its_figures() -> None:
    tool = Path(__file__).parents[2] / "tools" / "transfer.py"
    options = ["--drones", "2", "--flights", "2", "--learner", "ephe_robust", "--workers", "1"]
    options += ["--set", "check.effort=0.02", "--set", "check.n_fresh=20", "--scale", "2", "--set", "start=imparted"]
    done = subprocess.run([sys.executable, str(tool), *options], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "ephe_robust: 2 drones, best policies land" in done.stdout
    assert "after  2 flights: solved" in done.stdout
    assert "failures in 2 flights" in done.stdout
