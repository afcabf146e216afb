"""What Bayesian optimisation asks for after it was told this or that: through `ask` and `tell` alone."""

from collections.abc import Callable

import numpy as np
import pytest

from ivl.errors import LearnerError
from ivl.learners.bo import BOLearner

BOUNDS = np.array([[0.0, 7.0], [0.0, 10.0]])
WIDTH = np.ptp(BOUNDS, axis=1)
Land = Callable[[np.ndarray], np.ndarray]


def returns(theta: np.ndarray) -> np.ndarray:
    return 150.0 * np.exp(-(((theta - [5.0, 7.5]) / [0.4, 1.5]) ** 2).sum(axis=1))


def test_the_first_episode_comes_from_the_start_distribution() -> None:
    theta = BOLearner([4.0, 5.0], [0.1, 0.1], bounds=BOUNDS).ask(500)
    assert theta.mean(axis=0) == pytest.approx([4.0, 5.0], abs=0.02)
    assert theta.std(axis=0) == pytest.approx([0.1, 0.1], abs=0.02)


def test_a_narrow_peak_is_found_within_ten_episodes() -> None:
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=4)
    for _ in range(10):
        theta = learner.ask()
        learner.tell(theta, returns(theta))
    assert returns(learner.result.recommended[None]) > 135


def test_bounds_are_needed() -> None:
    with pytest.raises(LearnerError, match="bounds: this learner needs"):
        BOLearner([4.0, 5.0], [1.5, 1.5])


def test_caution_prefers_what_is_known() -> None:
    bold = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, caution=0.0)
    careful = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, caution=10.0)
    theta = bold.ask(12)
    for learner in (bold, careful):
        learner.tell(theta, returns(theta))
    nearest = [np.abs(theta - learner.result.recommended).sum(axis=1).min() for learner in (bold, careful)]
    assert nearest[1] <= nearest[0]


@pytest.mark.parametrize(("lands", "low", "high"), [(False, 2, 8), (True, 0, 0)])
def test_the_search_spreads_over_the_box_until_rollouts_land(lands: bool, low: int, high: int) -> None:
    # a shelf that pays a little, and no more anywhere: whether it is the target is not for the returns to say
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=1)
    for _ in range(12):
        theta = learner.ask()
        shelf = theta[:, 0] > 5.0
        learner.tell(theta, np.where(shelf, 25.0, 5.0), {"landed": shelf & lands})
    assert low <= (learner.ask()[:, 0] < 5.0).sum() <= high


def test_without_word_of_landings_the_upper_half_of_the_returns_counts_as_success() -> None:
    told, guessing = (BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=2) for _ in range(2))
    for _ in range(6):
        theta = told.ask()
        assert (guessing.ask() == theta).all()
        rewards = np.where(theta[:, 0] > 4.5, 170.0, 60.0) - theta[:, 1]
        told.tell(theta, rewards, {"landed": theta[:, 0] > 4.5})
        guessing.tell(theta, rewards)


def spread_out(episode: int) -> np.ndarray:
    """An episode of policies from all over the box."""
    return np.random.default_rng(episode).uniform(*BOUNDS.T, (8, 2))


def told(returns: Land, lands: Land, seed: int = 1, **options: float) -> BOLearner:
    """A learner that was told six episodes of policies from all over the box."""
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=seed, **options)
    for episode in range(6):
        theta = spread_out(episode)
        learner.tell(theta, returns(theta), {"landed": lands(theta)})
    return learner


def nowhere(theta: np.ndarray) -> np.ndarray:
    return np.zeros(len(theta), dtype=bool)


def test_exploring_where_all_returns_agree_keeps_away_from_what_is_known_and_from_itself() -> None:
    learner = told(lambda theta: np.full(len(theta), 3.0), nowhere, spread=1.0)
    known = np.vstack([spread_out(episode) for episode in range(6)])

    def least_gap(points: np.ndarray) -> float:
        everything = np.vstack([known, points]) / WIDTH
        gaps = np.linalg.norm(everything[:, None] - everything, axis=-1)
        np.fill_diagonal(gaps, np.inf)
        return float(gaps[len(known) :].min())

    random = [least_gap(np.random.default_rng(seed).uniform(*BOUNDS.T, (6, 2))) for seed in range(20)]
    assert least_gap(learner.ask(6)) > max(random)


def test_exploring_goes_to_the_step_between_too_early_and_too_late() -> None:
    learner = told(lambda theta: np.where(theta[:, 0] > 4.0, 25.0, 15.0), nowhere, spread=1.0)
    near = np.abs(learner.ask()[:, 0] - 4.0) < 1.0
    assert near.mean() >= 0.75  # two sevenths of the box


def test_exploring_reaches_the_bounds() -> None:
    learner = told(lambda theta: np.full(len(theta), 3.0), nowhere, spread=1.0)
    asked = learner.ask(12)
    assert (np.isclose(asked, BOUNDS[:, 0]) | np.isclose(asked, BOUNDS[:, 1])).any(axis=1).sum() >= 4


def far_asks(n_landings: int, seed: int = 1, **options: float) -> int:
    """Policies asked for far from an episode that was flown in one place; some of it landed."""
    learner = BOLearner([4.0, 5.0], [0.1, 0.1], bounds=BOUNDS, seed=seed, **options)
    landed = np.arange(8) < n_landings
    learner.tell(learner.ask(), np.where(landed, 170.0, 5.0), {"landed": landed})
    return int((np.abs((learner.ask() - [4.0, 5.0]) / WIDTH) > 0.2).any(axis=1).sum())


def test_after_success_only_a_share_of_an_episode_seeks_the_whole_box() -> None:
    counts = {roam: [far_asks(5, seed, roam=roam) for seed in range(8)] for roam in (0.0, 0.25, 1.0)}
    assert max(counts[0.0]) == 0
    assert 0 < max(counts[0.25]) <= 2
    assert min(counts[1.0]) > 2


@pytest.mark.parametrize(("n_landings", "explores"), [(0, True), (1, True), (3, True), (4, False), (8, False)])
def test_lone_landings_do_not_end_the_exploration(n_landings: int, explores: bool) -> None:
    n_far = far_asks(n_landings, spread=0.75, roam=0.0)
    assert n_far >= 6 if explores else n_far == 0


def recommended_beside_two_landings(seed: int) -> float:
    """Distance, in widths of the box, from two landings in one place that came after five episodes without any."""
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=seed)
    place = np.random.default_rng(seed).uniform(*BOUNDS.T)
    for episode in range(7):
        theta = np.random.default_rng(100 * seed + episode).uniform(*BOUNDS.T, (8, 2))
        rewards, landed = np.where(theta[:, 0] > 3.0, 30.0, 20.0), np.zeros(8, dtype=bool)
        if episode >= 5:  # by then a fit only follows the one before, whose lengths are as wide as the step
            theta[0], rewards[0], landed[0] = place, 170.0, True
        learner.tell(theta, rewards, {"landed": landed})
    return float(np.abs((learner.result.recommended - place) / WIDTH).max())


def test_landings_that_the_model_does_not_expect_make_it_search_again() -> None:
    assert sum(recommended_beside_two_landings(seed) < 0.025 for seed in range(8)) >= 5
