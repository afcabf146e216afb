"""Optimisers of other libraries as learners: they find landings, continue bit for bit, and survive what flights do."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import ivl
from ivl.adapters.replayed import Replayed
from ivl.adapters.suggest import Suggest
from ivl.errors import LearnerError
from ivl.learners import make_learner

PYCMA, TPE = "ivl.adapters.pycma:PyCMA", "ivl.adapters.optuna_tpe:Tpe"
BOUNDS = [[0.0, 7.0], [0.0, 10.0]]
Fly = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


class Drift(Suggest):
    """Goes on from the best so far, by the random numbers that it is given."""

    def suggest(self, theta: np.ndarray, returns: np.ndarray, n: int, rng: np.random.Generator) -> np.ndarray:
        return theta[np.argmax(returns)] + 0.05 * rng.standard_normal((n, self.dim))


class Flat(Replayed):
    """Gives one number where policies are asked for."""

    def make(self) -> Any:
        return type("Odd", (), {"ask": lambda _self, n: np.zeros(n), "tell": lambda *_: None})()


DRIFT = "ivl_adapters_of_a_user:Drift"
NAMES = [PYCMA, TPE, DRIFT]


@pytest.fixture(autouse=True)
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """The classes of this file in a module that can be imported, as those of a user are."""
    module = ModuleType("ivl_adapters_of_a_user")
    module.__dict__.update({"Drift": Drift, "Flat": Flat})
    monkeypatch.setitem(sys.modules, module.__name__, module)


def new(name: str, seed: int = 1, n_rollouts: int = 8, **options: Any) -> ivl.Learner:
    return make_learner(name, [4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=seed, n_rollouts=n_rollouts, **options)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("asked", [False, True])
def test_a_saved_search_continues_bit_for_bit(name: str, asked: bool, fly: Fly) -> None:
    original = new(name)
    for _ in range(3):
        theta = original.ask()
        original.tell(theta, fly(theta)[0])
    pending = original.ask() if asked else None
    copy = new(name)
    copy.load_state_dict(json.loads(json.dumps(original.state_dict(), allow_nan=False)))
    for _ in range(3):
        theta = original.ask() if pending is None else pending
        assert pending is not None or (copy.ask() == theta).all()
        pending, rewards = None, fly(theta)[0]
        original.tell(theta, rewards)
        copy.tell(theta, rewards)
        assert (original.result.recommended == copy.result.recommended).all()
    assert (theta >= np.array(BOUNDS)[:, 0]).all()
    assert (theta <= np.array(BOUNDS)[:, 1]).all()


@pytest.mark.parametrize("name", NAMES)
def test_flights_that_are_discarded_or_changed_are_survived(name: str, fly: Fly) -> None:
    learner = new(name)
    before = np.random.get_state()[1].tolist()  # noqa: NPY002 - that no adapter touches it is the point
    for episode in range(6):
        theta = learner.ask()
        theta[0] = [3.0 + 0.1 * episode, 6.0]  # an operator had another one flown
        kept = theta[: 8 - episode]
        learner.tell(kept, fly(kept)[0])
    learner.tell(np.zeros((0, 2)), [])
    assert np.isfinite(learner.ask()).all()
    assert learner.result.n_told == 8 + 7 + 6 + 5 + 4 + 3
    assert np.random.get_state()[1].tolist() == before  # noqa: NPY002 - likewise


@pytest.mark.parametrize("name", NAMES)
def test_only_the_order_of_returns_counts(name: str) -> None:
    asked = []
    for factor in (1.0, 2.0**-10):
        learner, rng = new(name), np.random.default_rng(3)
        for _ in range(4):
            theta = learner.ask()
            learner.tell(theta, factor * rng.random(8))
        asked.append(learner.ask())
    assert (asked[0] == asked[1]).all()


@pytest.mark.parametrize("name", [PYCMA, TPE])
def test_the_easy_ridge_is_learned(name: str, fly: Fly) -> None:
    rates = []
    for seed in range(3):
        learner = new(name, seed)
        for _ in range(12):
            theta = learner.ask()
            learner.tell(theta, fly(theta)[0])
        rates.append(fly(np.tile(learner.result.recommended, (200, 1)))[1].mean())
    start = fly(np.tile([4.0, 5.0], (200, 1)))[1].mean()
    assert np.median(rates) > max(0.6, start + 0.2), rates


@pytest.mark.parametrize("n_rollouts", [1, 2, 3])
def test_a_generation_may_be_longer_than_an_episode(n_rollouts: int, fly: Fly) -> None:
    learner = new(PYCMA, n_rollouts=n_rollouts)
    spread = []
    for _ in range(60 // n_rollouts):
        theta = learner.ask()
        learner.tell(theta, fly(theta)[0])
        spread.append(theta)
    assert np.ptp(np.concatenate(spread), axis=0).min() > 0.5


def test_what_an_optimiser_gives_is_checked() -> None:
    with pytest.raises(LearnerError, match=r"Flat: asked for shape \(8, 2\), got \(8,\)"):
        new("ivl_adapters_of_a_user:Flat").ask()


def test_a_library_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(ivl.MissingError, match=r"cma is not installed: pip install 'ivl\[optimisers\]'"):
        new(PYCMA)


def test_the_example_of_a_gaussian_process_learns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small: ivl.Experiment
) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples")
    run = ivl.learn(small, learner="suggest_gp:Ucb", out=tmp_path / "run", **{"learner.options.n_start": 8})
    rollouts = run.rollouts()
    assert len(rollouts) == 16
    assert rollouts["rrev_c_per_s"].between(0.0, 7.0).all()
    assert rollouts["rrev_c_per_s"].nunique() > 12
