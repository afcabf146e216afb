import cmaes
import numpy as np
import pytest

from ivl.learners.cma_learner import CMALearner


def returns(theta: np.ndarray) -> np.ndarray:
    return 100.0 * np.exp(-(((theta - [3.0, 7.0]) / [0.5, 1.0]) ** 2).sum(axis=1))


def test_the_adapter_is_the_package_in_scaled_coordinates_with_the_sign_turned() -> None:
    learner = CMALearner([4.0, 5.0], [1.5, 2.0], n_rollouts=6, seed=3)
    reference = cmaes.CMA(mean=np.zeros(2), sigma=1.0, seed=3, population_size=6)
    for _ in range(4):
        z = np.array([reference.ask() for _ in range(6)])
        theta = learner.ask()
        assert theta == pytest.approx(np.array([4.0, 5.0]) + [1.5, 2.0] * z, abs=1e-12)
        learner.tell(theta, returns(theta))
        scaled = (theta - [4.0, 5.0]) / [1.5, 2.0]
        reference.tell([(x, -r) for x, r in zip(scaled, returns(theta), strict=True)])
    assert learner.result.recommended == pytest.approx(np.array([4.0, 5.0]) + [1.5, 2.0] * reference.mean, abs=1e-12)


def test_rollouts_are_collected_until_there_is_a_population() -> None:
    whole, parts = (CMALearner([4.0, 5.0], [1.5, 1.5], n_rollouts=8, seed=1) for _ in range(2))
    theta = whole.ask()
    parts.ask()
    whole.tell(theta, returns(theta))
    for rows in ([0, 1, 2], [3], [4, 5, 6, 7]):
        parts.tell(theta[rows], returns(theta[rows]))
    assert (whole.ask() == parts.ask()).all()


def test_sigma_shrinks_to_the_scale_of_the_peak() -> None:
    learner = CMALearner([4.0, 5.0], [1.5, 1.5], seed=2)
    assert learner.result.sigma == pytest.approx([1.5, 1.5])
    for _ in range(40):
        theta = learner.ask()
        learner.tell(theta, returns(theta))
    assert (learner.result.sigma < 0.1).all()
    assert learner.result.mu == pytest.approx([3.0, 7.0], abs=0.05)


def test_it_stops_when_its_distribution_has_collapsed() -> None:
    learner = CMALearner([4.0, 5.0], [1.5, 1.5], seed=2)
    for _ in range(400):
        if learner.stop():
            return
        theta = learner.ask()
        learner.tell(theta, returns(theta))
    pytest.fail("CMA-ES did not stop on a peak that it had found")


def test_the_population_option_overrides_the_episode_length() -> None:
    learner = CMALearner([4.0, 5.0], [1.5, 1.5], n_rollouts=2, population=4, seed=1)
    before = learner.result.mu
    theta = learner.ask()
    learner.tell(theta, returns(theta))
    assert (learner.result.mu == before).all()
    theta = learner.ask()
    learner.tell(theta, returns(theta))
    assert (learner.result.mu != before).any()
