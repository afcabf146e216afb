import numpy as np
import pytest

from ivl.errors import LearnerError
from ivl.learners.bo import BOLearner

BOUNDS = [[0.0, 7.0], [0.0, 10.0]]


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


def test_the_search_spreads_over_the_box_until_a_return_reaches_the_aim() -> None:
    # a shelf that pays a little, and no more anywhere
    widths = []
    for aim in (75.0, 20.0):
        learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=1, aim=aim)
        for _ in range(12):
            theta = learner.ask()
            learner.tell(theta, np.where(theta[:, 0] > 5.0, 25.0, 5.0))
        last = learner.ask()
        widths.append((last[:, 0] < 5.0).sum())
    assert widths[0] >= 2
    assert widths[1] == 0


def test_farthest_points_keep_away_from_what_is_known_and_from_each_other() -> None:
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=1)
    low, width = learner._box[0], learner._box[1] - learner._box[0]
    taken, random = (learner._uniform(n, np.random.default_rng(0)) for n in (30, 6))

    def least_gap(points: np.ndarray) -> float:
        everything = np.vstack([taken, points]) / width
        gaps = np.linalg.norm(everything[:, None] - everything, axis=-1)
        np.fill_diagonal(gaps, np.inf)
        return float(gaps[len(taken) :].min())

    far = learner._farthest(6, taken)
    assert ((far >= low) & (far <= low + width)).all()
    assert least_gap(far) > 2.0 * least_gap(random)
    assert learner._farthest(0, taken).shape == (0, 2)
