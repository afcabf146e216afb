"""Policies for every approach that learn which vehicle flies."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import expit

from ivl import cli, forms
from ivl.belief import every, recording
from ivl.belief.posterior import Evidence
from ivl.errors import ConfigError
from ivl.learners.ephe import imagine
from ivl.policy import adapt, file
from ivl.policy.flying import Place, PolicyTask
from ivl.policy.region import BOX
from ivl.policy.shape import General

APPROACHES = np.array([BOX.speeds_mps, BOX.angles_deg])
BOUNDS = np.array([[1.0, 9.0], [3.0, 10.0]])
FLIGHTS = np.concatenate([BOUNDS, APPROACHES])


class Window:
    """A belief of vehicles that land where the threshold is near `centre` plus `slope` times the speed."""

    def __init__(self, centre_per_s: float, slope: float) -> None:
        self.centre, self.slope = centre_per_s, slope
        self.told: list[Evidence] = []

    def rate_of_one(self, flights: np.ndarray) -> np.ndarray:
        off = flights[:, 0] - (self.centre + self.slope * (flights[:, 2] - 2.5))
        return np.asarray(expit(4.0 - (off / 0.15) ** 2) * expit((flights[:, 1] - 6.0) * 3.0))

    def rates(self, flights: np.ndarray, n_most: int = 1) -> np.ndarray:  # noqa: ARG002
        return self.rate_of_one(flights)[None]

    def update(self, evidence: Evidence) -> None:
        self.told.append(evidence)


class Known:
    """Simulated vehicles whose belief is a window."""

    def __init__(self, belief: Window) -> None:
        self._belief = belief

    def belief(self, rng: np.random.Generator, n_particles: int, trust: Any) -> Window:  # noqa: ARG002
        return self._belief


def task() -> PolicyTask:
    data = {"vehicle": "crazyflie21", "gear": "wide_short", "gear_set": "table1", "start": "flown"}
    return PolicyTask.model_validate({**data, "estimator": "known_height_predicted"})


def policy(form: str = "polynomial3", threshold_per_s: float = 4.0) -> file.PolicyFile:
    theta = General(form).level(threshold_per_s, 8.0)
    return file.make(forms.by_name(form), theta.tolist(), [task()], None, None)


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Window:
    found = Window(4.6, 0.5)
    monkeypatch.setattr(adapt.Simulator, "of", lambda *_: Known(found))
    return found


@pytest.mark.parametrize("form", ["polynomial2", "polynomial3", "bilinear"])
def test_what_a_form_decides_at_an_approach_is_what_the_core_decides(form: str) -> None:
    general, rng = General(form), np.random.default_rng(1)
    approaches = every.spread(APPROACHES, 32)
    whole = np.asarray(general.level(4.0, 6.0))
    whole[general.threshold] += rng.uniform(-0.2, 0.2, general.n_threshold)
    whole[general.moment] += (0.0, 0.5, -0.5)
    told = adapt.linear(general, approaches).flights(whole[None, general.searched], 10.0)[0]
    speed, angle = approaches[:, 0], np.deg2rad(approaches[:, 1])
    vx, vz = speed * np.cos(angle), speed * np.sin(angle)
    assert told[:, 0] == pytest.approx(general.thresholds(whole, vx, vz), abs=2e-3)
    assert told[:, 1] == pytest.approx(general.moments(whole, vx, vz), abs=2e-3)
    assert np.array_equal(told[:, 2:], approaches)


def test_thresholds_and_moments_stay_within_what_the_core_allows() -> None:
    form = adapt.linear(General("polynomial2"), every.spread(APPROACHES, 16))
    told = form.flights(np.array([[1e3, 0, 0, 0, 0, 0, 50.0, 0, 0], [-1e3, 0, 0, 0, 0, 0, -50.0, 0, 0]]), 10.0)
    assert (told[0, :, 0] == 20.0).all()
    assert (told[1, :, 0] == 0.5).all()
    assert (told[0, :, 1] == 10.0).all()
    assert (told[1, :, 1] == 0.0).all()


def test_approaches_fill_the_region_evenly() -> None:
    points = every.spread(APPROACHES)
    for column, (lo, hi) in zip(points.T, APPROACHES, strict=True):
        counts = np.histogram(column, 8, (lo, hi))[0]
        assert np.ptp(counts) <= 1


def test_ephe_finds_a_window_that_depends_on_the_approach() -> None:
    general, belief = General("polynomial2"), Window(4.6, 0.5)
    form = adapt.linear(general, every.spread(APPROACHES))
    mu = np.asarray(general.level(3.8, 7.0))[general.searched]
    sigma = np.full(len(mu), 0.2)
    bounds = mu[:, None] + 5.0 * np.array([-1.0, 1.0])
    before = every.margin_rate(belief, form, mu[None], FLIGHTS)[0]
    rng = np.random.default_rng(2)
    reward = every.imagined(belief, form, FLIGHTS, rng)
    found, spread = imagine(reward, mu, sigma, bounds, rng, 300, 60, 0.9, 0.02 * sigma)
    assert before < 0.2
    assert every.margin_rate(belief, form, found[None], FLIGHTS)[0] > 0.75
    assert every.rate(belief, form, found[None], FLIGHTS)[0] > 0.9
    assert (spread <= bounds[:, 1] - bounds[:, 0]).all()


def test_an_adaptation_goes_where_its_belief_lands_and_keeps_go(window: Window) -> None:
    begun = policy(threshold_per_s=4.3)
    adaptation = adapt.Adaptation(Place.of(task()), begun, BOX, seed=3)
    for _ in range(3):
        adaptation.tell(2.0, 60.0, np.full(recording.N, np.nan), True)
    assert adaptation.margin_rate > 0.6
    assert adaptation.expected_rate() >= adaptation.margin_rate - 0.05
    assert [len(evidence.theta) for evidence in window.told] == [1, 2, 3]
    flown = window.told[-1]
    assert flown.theta[:, 2:] == pytest.approx(np.tile([2.0, 60.0], (3, 1)))
    assert flown.landed.all()
    general = adaptation.general
    rest = np.ones(general.form.n, dtype=bool)
    rest[general.searched] = False
    assert np.array_equal(adaptation.theta[rest], np.array(begun.values)[rest])


def test_an_adaptation_never_expects_less_than_what_it_began_with(window: Window) -> None:
    begun = policy(threshold_per_s=4.6)
    adaptation = adapt.Adaptation(Place.of(task()), begun, BOX, seed=3)
    general = adaptation.general
    form = adapt.linear(general, every.spread(APPROACHES))
    first = np.array(begun.values)[None, general.searched]
    assert adaptation.margin_rate >= every.margin_rate(window, form, first, adaptation.flight.box)[0]


def test_a_policy_is_adapted_from_the_command_line(
    window: Window, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "g.yaml", tmp_path / "adapted.yaml"
    file.save(policy(threshold_per_s=4.3), path)
    few = ["--vehicles", "1", "--flights", "2", "--fresh", "20"]
    assert cli.run(["policy", "adapt", str(path), *few, "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told["vehicles"]) == 1
    assert len(told["vehicles"][0]["landed"]) == 2
    assert 0.0 <= told["after"]["clean"] <= told["after"]["landed"] <= 1.0
    adapted = file.load(out)
    assert adapted.form == "polynomial3"
    assert adapted.values != file.load(path).values
    assert len(window.told) == 2
    again = [*few, "--json"]
    assert cli.run(["policy", "adapt", str(path), *again]) == 0
    assert json.loads(capsys.readouterr().out)["vehicles"] == told["vehicles"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--vehicles", "2", "--out", "a.yaml"], "--out a.yaml: one vehicle is needed (--vehicles 1)"),
        (["--region", "nowhere"], "--region: value 'nowhere' (allowed box, plane)"),
        (["--set", "gear=none"], "gear"),
    ],
)
def test_what_cannot_be_adapted_is_said(
    arguments: list[str], complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "g.yaml"
    file.save(policy(), path)
    assert cli.run(["policy", "adapt", str(path), *arguments]) == 2
    assert complaint in capsys.readouterr().err


def test_the_papers_form_is_not_for_every_approach() -> None:
    constant = file.make(forms.by_name("constant"), [4.0, 8.0], [task()], None, None)
    with pytest.raises(ConfigError, match="is not for every approach"):
        adapt.Adaptation(Place.of(task()), constant, BOX)
