"""EPHE with a memory: its update against the equations, written once more in plain numpy, and what it asks for."""

import copy
from typing import Any

import numpy as np
import pytest

from ivl.errors import LearnerError
from ivl.learners.ephe_memory import EpheMemory

BOUNDS = np.array([[0.0, 7.0], [0.0, 10.65]])
MU0, SIGMA0 = np.array([4.0, 5.0]), np.array([1.5, 0.5])


def new(seed: int = 1, **options: Any) -> EpheMemory:
    return EpheMemory(MU0, SIGMA0, bounds=BOUNDS, seed=seed, **options)


def returns(theta: np.ndarray) -> np.ndarray:
    return np.asarray(150.0 * np.exp(-(((theta - [5.0, 7.5]) / [0.4, 1.5]) ** 2).sum(axis=1)))


def expected(z: np.ndarray, search: dict[str, Any], caution: float) -> np.ndarray:
    """Mean less doubt of a Gaussian process of what a saved search remembers, without any trick."""
    known, rewards = np.array(search["z"]), np.array(search["rewards"])
    y = (rewards - rewards.mean()) / rewards.std()

    def correlation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        steps = (a[:, None] - b[None]) / np.array(search["lengths"])
        return np.asarray(np.exp(-0.5 * (steps**2).sum(axis=-1)))

    inverse = np.linalg.inv(correlation(known, known) + (search["noise"] + 1e-8) * np.eye(len(y)))
    cross = correlation(z, known)
    variance = (y @ inverse @ y / len(y)) * (1.0 - np.einsum("ij,jk,ik->i", cross, inverse, cross))
    return np.asarray(cross @ inverse @ y - caution * np.sqrt(np.maximum(variance, 0.0)))


def by_hand(before: dict[str, Any], after: dict[str, Any], best: np.ndarray, options: dict[str, Any]) -> Any:
    """Equations (1) to (4) from the state before an update and the model after it, in units of sigma0."""
    rng = np.random.Generator(np.random.PCG64())
    rng.bit_generator.state = before["rng"]
    box = (BOUNDS.T - MU0) / SIGMA0
    ends = []
    for start in (np.array(before["search"]["mu"]), best):
        wide = np.maximum(before["search"]["sigma"], options["reach"] * np.array(after["search"]["lengths"]))
        mu, sigma = start, np.minimum(wide, box[1] - box[0])
        for _ in range(options["iterations"]):
            theta = np.clip(rng.normal(mu, sigma, (options["n_imagined"], 2)), box[0], box[1])
            f = expected(theta, after["search"], options["caution"])
            w = np.where(f > f.mean(), f - f.mean(), 0.0)
            spread = np.sqrt(np.average((theta - mu) ** 2, axis=0, weights=w))
            mu, sigma = np.average(theta, axis=0, weights=w), np.maximum(spread, options["shrink_min"] * sigma)
        ends.append((expected(mu[None], after["search"], options["caution"])[0], mu, sigma))
    return max(ends, key=lambda end: end[0])[1:]


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"iterations": 1},
        {"shrink_min": 0.95},
        {"caution": 2.0, "reach": 0.4},
        {"n_imagined": 50, "iterations": 3, "shrink_min": 0.01},
    ],
    ids=str,
)
def test_an_update_equals_the_equations(changed: dict[str, Any]) -> None:
    learner = new(**changed)
    for _ in range(3):
        theta = learner.ask()
        before = copy.deepcopy(learner.state_dict())
        learner.tell(theta, returns(theta) + theta[:, 0])
        # the model's best policy is the recommendation of the base class, which tests of its own check
        best = (super(EpheMemory, learner)._recommended() - MU0) / SIGMA0
        mu, sigma = by_hand(before, learner.state_dict(), best, learner.options.model_dump())
        assert learner.result.mu == pytest.approx(MU0 + SIGMA0 * mu, rel=1e-6)
        assert learner.result.sigma == pytest.approx(SIGMA0 * sigma, rel=1e-5)
        assert (learner.result.recommended == learner.result.mu).all()


def test_the_mean_reaches_a_bound_where_the_best_policy_is() -> None:
    learner = new()
    for _ in range(8):
        theta = learner.ask()
        learner.tell(theta, theta[:, 1])
    assert learner.result.recommended[1] == pytest.approx(10.65, abs=0.15)


def far_asks(n_landings: int, **options: float) -> int:
    """How many of 16 policies are not near where eight were flown, of which some landed."""
    learner = EpheMemory([4.0, 5.0], [0.1, 0.1], bounds=BOUNDS, seed=3, **options)
    landed = np.arange(8) < n_landings
    learner.tell(learner.ask(8), np.where(landed, 170.0, 5.0), {"landed": landed})
    return int((np.abs(learner.ask(16) - [4.0, 5.0]) > 1.0).any(axis=1).sum())


def test_after_success_a_share_of_an_episode_seeks_the_whole_box_and_the_rest_is_near_the_mean() -> None:
    assert far_asks(8, roam=0.0) == 0
    assert 0 < far_asks(8, roam=0.25) <= 4
    assert far_asks(8, roam=1.0) > 4


def test_before_success_it_explores() -> None:
    assert far_asks(3, roam=0.0) >= 12


def test_the_wider_an_episode_begins_the_wider_it_flies() -> None:
    spread = {}
    for reach in (0.1, 1.5):
        learner = new(roam=0.0, reach=reach)
        theta = learner.ask()
        learner.tell(theta, returns(theta), {"landed": np.ones(8)})
        spread[reach] = learner.ask(40).std(axis=0)
    assert (2.0 * spread[0.1] < spread[1.5]).all()


def test_a_peak_of_six_parameters_is_found() -> None:
    bounds = np.array([[0.0, 7.0], [-1.0, 1.0], [-1.0, 1.0], [0.0, 10.0], [-1.0, 1.0], [0.0, 10.0]])
    peak = np.array([5.2, 0.2, -0.2, 7.0, 0.1, 8.5])
    width = np.array([1.0, 0.5, 0.5, 3.0, 0.5, 3.0])
    start, spread = np.array([4.8, 0.0, 0.0, 8.0, 0.0, 9.0]), np.array([0.5, 0.2, 0.2, 1.5, 0.2, 1.0])

    def shape(theta: np.ndarray) -> np.ndarray:
        return np.asarray(150.0 * np.exp(-(((theta - peak) / width) ** 2).sum(axis=-1)))

    solved = 0
    for seed in range(5):
        learner = EpheMemory(start, spread, bounds=bounds, seed=seed)
        for _ in range(20):
            theta = learner.ask()
            learner.tell(theta, shape(theta), {"landed": shape(theta) > 120.0})
        solved += bool(shape(learner.result.recommended) > 140.0)
    assert solved >= 4


def test_bounds_are_needed() -> None:
    with pytest.raises(LearnerError, match="bounds: this learner needs"):
        EpheMemory([4.0, 5.0], [1.5, 1.5])


@pytest.mark.parametrize("option", ["n_imagined", "iterations", "shrink_min", "reach"])
def test_an_option_out_of_range_is_refused_in_one_line(option: str) -> None:
    with pytest.raises(LearnerError, match=f"options of EpheMemory: {option}: value 0") as caught:
        new(**{option: 0})
    assert "\n" not in str(caught.value)
