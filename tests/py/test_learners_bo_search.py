"""Bayesian optimisation on a landing-like surface, and the changes of units and returns that must not matter to it."""

import numpy as np
import pytest

from ivl.errors import LearnerError
from ivl.learners.bo import BOLearner
from ivl.learners.gp import GaussianProcess, Hyper

BOUNDS = np.array([[0.0, 7.0], [0.0, 10.65]])
UNIT = np.array([4.0, 1.0 / 1024.0])  # powers of two: the scaled search must agree to the last bit


def shelf_beside_target(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A narrow four-leg wedge that opens towards large moments, inside a shelf of two-leg landings that reaches lower.

    Returns:
        The returns, and which rollouts were four-leg landings.
    """
    off = theta[:, 0] - (4.6 + 0.04 * (theta[:, 1] - 6.0))
    four = (np.abs(off) < 0.05 * (theta[:, 1] - 5.5)) & (np.abs(off) < 0.2)
    two = np.abs(off) < 0.15 + 0.08 * np.maximum(theta[:, 1] - 2.5, -1.5)
    slammed = off > 0
    return np.where(four, 170.0, np.where(two, 60.0, np.where(slammed, 20.0, 3.0))), four


def learn(learner: BOLearner, episodes: int, unit: np.ndarray) -> list[np.ndarray]:
    asked = []
    for _ in range(episodes):
        theta = learner.ask()
        asked.append(theta / unit)
        returns, landed = shelf_beside_target(theta / unit)
        learner.tell(theta, returns, {"landed": landed})
    return asked


def searched(unit: np.ndarray, seed: int = 3) -> list[np.ndarray]:
    mu0, sigma0 = np.array([4.0, 5.0]) * unit, np.array([1.5, 1.5]) * unit
    return learn(BOLearner(mu0, sigma0, bounds=BOUNDS * unit[:, None], seed=seed), 4, unit)


def test_the_target_beside_the_shelf_is_found_in_nine_of_ten_seeds() -> None:
    solved = 0
    for seed in range(10):
        learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=seed)
        learn(learner, 20, np.ones(2))
        solved += bool(shelf_beside_target(learner.result.recommended[None])[1][0])
    assert solved >= 9


def test_the_units_of_the_policy_do_not_matter() -> None:
    for plain, scaled in zip(searched(np.ones(2)), searched(UNIT), strict=True):
        assert (plain == scaled).all()


def test_only_the_latest_rollouts_are_remembered() -> None:
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, memory=16)
    learn(learner, 5, np.ones(2))
    assert len(learner.state_dict()["search"]["rewards"]) == 16
    assert learner.result.n_told == 40


def test_the_recommendation_may_lie_on_a_bound() -> None:
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=1)
    for _ in range(8):
        theta = learner.ask()
        learner.tell(theta, theta[:, 1])
    assert learner.result.recommended[1] == pytest.approx(10.65, abs=0.2)


def test_repeated_success_beside_a_failure_does_not_shorten_the_kernel_without_end() -> None:
    rng = np.random.default_rng(5)
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS)
    for _ in range(6):
        theta = [4.8, 8.0] + [0.2, 1.0] * rng.standard_normal((16, 2))
        learner.tell(theta, np.where(theta[:, 0] > 4.8, 170.0, 60.0))
    assert learner.state_dict()["search"]["noise"] >= 0.05


def test_a_noise_floor_above_the_prior_is_refused() -> None:
    with pytest.raises(LearnerError, match=r"noise_min 0\.5 must not be above noise 0\.2"):
        BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, noise_min=0.5)


def test_one_observation_gives_the_posterior_worked_out_by_hand() -> None:
    """K = 1, g = 1, y = 2: s^2 = 4 / 2, mean k / 2 * 2, variance s^2 (1 - k^2 / 2), k = exp(-1/2) one length away."""
    gp = GaussianProcess(np.zeros((1, 2)), np.array([2.0]), Hyper(np.array([0.5, 3.0]), 1.0))
    mean, sd = gp.predict(np.array([[0.0, 0.0], [0.5, 0.0], [0.0, -3.0]]))
    k = np.exp(-0.5)
    assert gp.signal_variance == pytest.approx(2.0, rel=1e-7)
    assert mean == pytest.approx([1.0, k, k], rel=1e-7)
    assert sd**2 == pytest.approx([1.0, 2.0 - k**2, 2.0 - k**2], rel=1e-7)
