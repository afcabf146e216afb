import json

import cmaes
import numpy as np
import pytest

from ivl.errors import LearnerError
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


CORNERS = [(1.0, 1.0), (1.0, -1.0), (-1.0, 0.3), (0.0, -1.0)]


@pytest.mark.parametrize("lr_adapt", [False, True])
@pytest.mark.parametrize("slope", CORNERS)
def test_a_best_policy_at_a_bound_is_found_with_a_spread_within_the_box(
    slope: tuple[float, float], lr_adapt: bool
) -> None:
    lo, hi = np.array([1.0, 0.0]), np.array([8.0, 10.0])

    def linear(theta: np.ndarray) -> np.ndarray:
        return np.asarray(200.0 + (theta - lo) / (hi - lo) @ (100.0 * np.array(slope)))

    ends = [linear(np.array([[a, b]]))[0] for a in (lo[0], hi[0]) for b in (lo[1], hi[1])]
    for seed in range(3):
        learner = CMALearner([4.0, 5.0], [1.5, 1.5], bounds=np.stack([lo, hi], 1), seed=seed, lr_adapt=lr_adapt)
        for _ in range(70):
            theta = learner.ask()
            learner.tell(theta, linear(theta))
            assert (learner.result.sigma <= (hi - lo) * (1.0 + 1e-9)).all()
        found = linear(learner.result.recommended[None])[0]
        assert (found - min(ends)) / (max(ends) - min(ends)) >= 0.95


@pytest.mark.parametrize("lr_adapt", [False, True])
def test_the_state_does_not_grow_and_a_loaded_search_goes_on_bit_for_bit(lr_adapt: bool) -> None:
    learner = CMALearner([4.0, 5.0], [1.5, 1.5], bounds=[[1, 8], [0, 10]], n_rollouts=5, seed=4, lr_adapt=lr_adapt)
    sizes = []
    for episode in range(60):
        theta = learner.ask()
        learner.tell(theta[:3], returns(theta[:3]))
        if episode % 20 == 0:
            text = json.dumps(learner.state_dict(), allow_nan=False)
            sizes.append(len(text))
            again = CMALearner(
                [4.0, 5.0], [1.5, 1.5], bounds=[[1, 8], [0, 10]], n_rollouts=5, seed=4, lr_adapt=lr_adapt
            )
            again.load_state_dict(json.loads(text))
            for _ in range(6):
                a, b = learner.ask(), again.ask()
                assert a.tobytes() == b.tobytes()
                learner.tell(a, returns(a))
                again.tell(b, returns(b))
            assert json.dumps(again.state_dict()) == json.dumps(learner.state_dict())
    assert max(sizes) < 1.1 * min(sizes) + 500


def test_what_leaves_no_distribution_is_refused_and_changes_nothing() -> None:
    learner = CMALearner([4.0, 5.0], [1.5, 1.5], n_rollouts=8, seed=1, lr_adapt=True)
    before = json.dumps(learner.state_dict())
    with pytest.raises(LearnerError, match="no distribution that it could draw from"):
        learner.tell([[4.0, 5.0]] * 8, [1.0] * 8)
    assert json.dumps(learner.state_dict()) == before
    assert np.isfinite(learner.ask()).all()


def test_a_state_of_another_version_of_the_package_is_refused_by_name() -> None:
    learner = CMALearner([4.0, 5.0], [1.5, 1.5], seed=1)
    state = learner.state_dict()
    state["search"]["cma"]["_new"] = 1.0
    with pytest.raises(LearnerError, match="another version of cmaes has _new"):
        learner.load_state_dict(state)
