from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ivl.errors import LearnerError
from ivl.learners import bo
from ivl.learners.bo import BOLearner
from ivl.learners.gp import GaussianProcess, Hyper, fit

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


def told(rewards: Callable[[np.ndarray], np.ndarray], **options: float) -> BOLearner:
    """A learner that was told six episodes of policies from all over the box."""
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=1, **options)
    for episode in range(6):
        theta = np.random.default_rng(episode).uniform(*np.transpose(BOUNDS), (8, 2))
        learner.ask()
        learner.tell(theta, rewards(theta))
    return learner


def test_exploring_where_all_returns_agree_keeps_away_from_what_is_known_and_from_itself() -> None:
    learner = told(lambda theta: np.full(len(theta), 3.0))
    width = learner._box[1] - learner._box[0]
    chosen = learner._uniform(2, np.random.default_rng(0))
    taken, random = np.vstack([learner._x, chosen]), learner._uniform(6, np.random.default_rng(1))

    def least_gap(points: np.ndarray) -> float:
        everything = np.vstack([taken, points]) / width
        gaps = np.linalg.norm(everything[:, None] - everything, axis=-1)
        np.fill_diagonal(gaps, np.inf)
        return float(gaps[len(taken) :].min())

    far = learner._explore(6, chosen)
    assert ((far >= learner._box[0]) & (far <= learner._box[1])).all()
    assert least_gap(far) > 2.0 * least_gap(random)
    assert learner._explore(0, chosen).shape == (0, 2)


def test_exploring_goes_to_the_step_between_too_early_and_too_late() -> None:
    learner = told(lambda theta: np.where(theta[:, 0] > 4.0, 25.0, 15.0))
    explored = learner._unscale(learner._explore(8, np.empty((0, 2))))
    near = np.abs(explored[:, 0] - 4.0) < 1.0
    assert near.mean() >= 0.75  # two sevenths of the box


@pytest.mark.parametrize(("band", "n_far"), [(0.6, 2), (0.0, 8)])
def test_after_success_only_a_share_of_an_episode_seeks_the_whole_box(
    band: float, n_far: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    learner = told(lambda theta: np.where(np.abs(theta[:, 0] - 4.0) < band, 170.0, 5.0), spread=0.0)
    corners = np.repeat(learner._box, [learner.options.n_uniform, 1], axis=0)
    monkeypatch.setattr(learner, "_candidates", lambda _gp: corners)
    monkeypatch.setattr(
        GaussianProcess, "sample", lambda _gp, x, n, _rng: np.tile(np.linspace(1.0, 0.0, len(x)), (n, 1))
    )
    assert (learner.ask() == learner.lo).all(axis=1).sum() == n_far


@pytest.mark.parametrize(("n_landings", "explores"), [(0, True), (1, True), (3, True), (4, False), (8, False)])
def test_lone_landings_do_not_end_the_exploration(
    n_landings: int, explores: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=1)
    learner.tell(learner.ask(), np.where(np.arange(8) < n_landings, 170.0, 5.0))
    asked: list[int] = []
    explore = BOLearner._explore
    monkeypatch.setattr(BOLearner, "_explore", lambda self, n, chosen: asked.append(n) or explore(self, n, chosen))
    learner.ask()
    assert asked == [6 if explores else 0]


def test_the_model_is_searched_again_while_it_doubts_a_landing(monkeypatch: pytest.MonkeyPatch) -> None:
    followed: list[bool] = []

    def recorded(*args: Any) -> Hyper:
        followed.append(args[-1])
        return fit(*args)

    monkeypatch.setattr(bo, "fit", recorded)
    learner = told(lambda theta: np.full(len(theta), 20.0))
    rewards = np.full(8, 20.0)
    rewards[3] = 170.0
    learner.tell(learner.ask(), rewards)
    assert followed == [False] * 4 + [True, True] + [False]


def test_contrast_is_the_range_of_the_nearest_returns_as_a_share_of_all() -> None:
    learner = BOLearner([4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, n_nearest=2)
    learner.ask()
    theta = np.column_stack([[0.0, 1.0, 3.0, 6.0], np.full(4, 5.0)])
    learner.tell(theta, np.array([0.0, 10.0, 40.0, 20.0]))
    points = learner._scale(np.column_stack([[0.4, 1.9, 4.6], np.full(3, 5.0)]))
    contrast = learner._contrast(learner._square_distances(points, learner._x))
    assert contrast == pytest.approx([10.0 / 40.0, 30.0 / 40.0, 20.0 / 40.0])
