"""What every learner must do, whatever its algorithm."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ivl.errors import IvlError, LearnerError
from ivl.learners import LEARNERS, Learner, make_learner
from ivl.learners.base import draw_truncated

BOUNDS = [[0.0, 7.0], [0.0, 10.0]]
NAMES = list(LEARNERS)
SEARCHING = [name for name in NAMES if name != "fixed"]
Fly = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def new(name: str, seed: int = 1, **options: Any) -> Learner:
    return make_learner(name, [4.0, 5.0], [1.5, 1.5], bounds=BOUNDS, seed=seed, **options)


def learn(learner: Learner, fly: Fly, episodes: int) -> None:
    for _ in range(episodes):
        theta = learner.ask()
        learner.tell(theta, fly(theta)[0])


@pytest.mark.parametrize("name", NAMES)
def test_ask_gives_policies_inside_the_bounds(name: str, fly: Fly) -> None:
    learner = new(name)
    for _ in range(6):
        theta = learner.ask()
        assert theta.shape == (8, 2)
        assert (theta >= np.array(BOUNDS)[:, 0]).all()
        assert (theta <= np.array(BOUNDS)[:, 1]).all()
        learner.tell(theta, fly(theta)[0])
    assert learner.ask(3).shape == (3, 2)


@pytest.mark.parametrize("name", SEARCHING)
def test_equal_seeds_give_equal_searches_and_others_do_not(name: str) -> None:
    rewards = np.arange(8.0)
    asked = []
    for seed in (5, 5, 6):
        learner = new(name, seed)
        learner.tell(learner.ask(), rewards)
        asked.append(learner.ask())
    assert (asked[0] == asked[1]).all()
    assert (asked[0] != asked[2]).any()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("episodes", [0, 1, 5])
@pytest.mark.parametrize("asked", [False, True])
def test_a_saved_search_continues_bit_for_bit(name: str, episodes: int, asked: bool, fly: Fly) -> None:
    original = new(name)
    learn(original, fly, episodes)
    pending = original.ask() if asked else None
    copy = new(name)
    copy.load_state_dict(json.loads(json.dumps(original.state_dict(), allow_nan=False)))
    for _ in range(3):
        theta = pending if pending is not None else original.ask()
        if pending is None:
            assert (copy.ask() == theta).all()
        pending, rewards = None, fly(theta)[0]
        original.tell(theta, rewards)
        copy.tell(theta, rewards)
        for field in ("mu", "sigma", "recommended"):
            assert (getattr(original.result, field) == getattr(copy.result, field)).all()
    assert (original.result.n_told, original.result.n_updates) == (copy.result.n_told, copy.result.n_updates)


@pytest.mark.parametrize("name", NAMES)
def test_reading_the_result_or_the_state_does_not_change_the_search(name: str, fly: Fly) -> None:
    quiet, watched = new(name), new(name)
    for _ in range(3):
        theta = quiet.ask()
        watched.ask()
        rewards = fly(theta)[0]
        quiet.tell(theta, rewards)
        watched.tell(theta, rewards)
        watched.result.mu[:] = 0
        watched.result.recommended[:] = 0
        watched.state_dict()
    assert (quiet.ask() == watched.ask()).all()


@pytest.mark.parametrize("name", NAMES)
def test_tell_never_modifies_its_arguments(name: str) -> None:
    learner = new(name)
    theta = learner.ask()
    rewards, legs = np.arange(8.0)[::-1].copy(), np.arange(8)
    before = theta.tobytes(), rewards.tobytes(), legs.tobytes()
    for array in (theta, rewards, legs):
        array.flags.writeable = False
    learner.tell(theta, rewards, {"n_legs": legs})
    assert (theta.tobytes(), rewards.tobytes(), legs.tobytes()) == before


@pytest.mark.parametrize("name", NAMES)
def test_a_later_change_of_told_arrays_has_no_effect(name: str) -> None:
    learner, other = new(name), new(name)
    theta, rewards = learner.ask(), np.arange(8.0)
    other.ask()
    other.tell(theta.copy(), rewards.copy())
    learner.tell(theta, rewards)
    theta[:] = 0
    rewards[:] = 0
    assert (learner.ask() == other.ask()).all()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("theta", "rewards"),
    [
        (np.full((8, 2), 4.0), np.full(8, np.nan)),
        (np.full((8, 2), 4.0), np.array([np.inf] + [1.0] * 7)),
        (np.full((8, 2), 4.0), np.array([-1e-9] + [1.0] * 7)),
        (np.full((8, 2), np.nan), np.ones(8)),
        (np.full((8, 3), 4.0), np.ones(8)),
        (np.full((8, 2), 4.0), np.ones(7)),
        (np.full((8, 2), 4.0), np.ones((8, 1))),
        (np.full(2, 4.0), np.ones(1)),
        (np.full((8, 2), 4.0), np.array(["1"] * 8)),
        ([[1.0, 2.0], [3.0]], [1.0, 2.0]),
    ],
)
def test_tell_refuses_what_cannot_be_learned_from_and_keeps_its_state(name: str, theta: Any, rewards: Any) -> None:
    learner = new(name)
    before = json.dumps(learner.state_dict())
    with pytest.raises(LearnerError):
        learner.tell(theta, rewards)
    assert json.dumps(learner.state_dict()) == before


@pytest.mark.parametrize("name", NAMES)
def test_tell_refuses_meta_of_another_length(name: str) -> None:
    with pytest.raises(LearnerError, match=r"meta\['n_legs'\] has shape \(7,\), expected \(8, \.\.\.\)"):
        new(name).tell(np.full((8, 2), 4.0), np.ones(8), {"n_legs": np.zeros(7)})


@pytest.mark.parametrize("name", NAMES)
def test_discarded_rollouts_may_be_left_out_and_no_rollout_changes_nothing(name: str) -> None:
    learner = new(name)
    theta = learner.ask()
    before = learner.result
    learner.tell(np.empty((0, 2)), np.empty(0))
    assert (learner.result.mu == before.mu).all()
    assert learner.result.n_updates == 0
    learner.tell(theta[:1], [10.0])
    learner.tell(theta[[6, 2, 4]], [30.0, 0.0, 20.0])
    assert learner.result.n_told == 4
    assert np.isfinite(learner.ask()).all()


FAR = [-1e300, -1e6, -3.0, -1e-300, 0.0, 1e-16, 4.0, 4.0 + 1e-15, 10.0, 1e6, 1e9, 1e300]
ODD_RETURNS = [0.0, 5e-324, 1e-31, 1e-30, 1e-3, 1.0, 175.0, 1e30, 1e31, 1.7e308]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25)
@given(
    told=st.lists(
        st.lists(
            st.tuples(st.sampled_from(FAR), st.sampled_from(FAR), st.sampled_from(ODD_RETURNS)), min_size=1, max_size=9
        ),
        min_size=1,
        max_size=4,
    )
)
def test_whatever_is_told_is_learned_from_or_refused_as_a_whole(
    name: str, told: list[list[tuple[float, float, float]]]
) -> None:
    learner = new(name)
    for rows in told:
        table, before = np.array(rows), json.dumps(learner.state_dict(), allow_nan=False)
        try:
            learner.tell(table[:, :2], table[:, 2])
        except LearnerError:
            assert json.dumps(learner.state_dict(), allow_nan=False) == before
            continue
        json.dumps(learner.state_dict(), allow_nan=False)
        result, asked = learner.result, learner.ask(3)
        for array in (result.mu, result.sigma, result.recommended, asked):
            assert np.isfinite(array).all()
        assert ((asked >= learner.lo) & (asked <= learner.hi)).all()
        assert ((result.recommended >= learner.lo) & (result.recommended <= learner.hi)).all()


@pytest.mark.parametrize("name", NAMES)
def test_the_range_of_what_is_told_ends_where_it_says(name: str) -> None:
    for bad in (-5e-324, 1.1e30):
        with pytest.raises(LearnerError, match=r"tell: rewards: value .* is out of range \(allowed 0 \.\. 1e\+30\)"):
            new(name).tell(np.full((1, 2), 4.0), [bad])
    told = [new(name) for _ in range(2)]
    for one, smallest in zip(told, (0.0, 0.9e-30), strict=True):
        one.tell(one.ask(2), [smallest, 1.0])
    assert (told[0].result.mu == told[1].result.mu).all()
    learner = new(name)
    edge = learner.mu0 + np.array([[1e6, 0.0]]) * learner.sigma0
    with pytest.raises(LearnerError, match=r"theta: value .* is more than 1e\+06 \* sigma0 from mu0"):
        learner.tell(1.001 * edge, [1.0])
    learner.tell(np.vstack([0.999 * edge, learner.ask(7)]), np.linspace(1e-30, 1e30, 8))
    assert learner.result.n_told == 8


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("reward", [0.0, 175.0])
def test_equal_returns_are_survived(name: str, reward: float) -> None:
    learner = new(name)
    for _ in range(10):
        theta = learner.ask()
        learner.tell(theta, np.full(8, reward))
    result = learner.result
    for array in (result.mu, result.sigma, result.recommended):
        assert np.isfinite(array).all()


def searched(name: str, seed: int, factor: float, told: bool) -> np.ndarray:
    """All that a learner asks in ten episodes on a shelf beside a ridge, its returns multiplied by a factor.

    The returns have steps and ties, as those of landings have, and a part that varies smoothly.
    """
    learner, asked = new(name, seed), []
    for _ in range(10):
        theta = learner.ask()
        asked.append(theta)
        off = theta[:, 0] - 4.6
        landed = (np.abs(off) < 0.15) & (theta[:, 1] > 5.0)
        steps = np.where(landed, 165.0, np.where(np.abs(off) < 0.8, 60.0, np.where(off > 0, 20.0, 3.0)))
        returns = steps + np.where(landed, np.cos(3 * off), 0.0) + np.where(off < -1.5, theta[:, 1], 0.0)
        learner.tell(theta, factor * returns, {"landed": landed} if told else None)
    return np.array(asked)


@pytest.mark.parametrize("told", [True, False], ids=["landings told", "returns alone"])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", NAMES)
def test_a_factor_on_all_returns_changes_no_ask(name: str, seed: int, told: bool) -> None:
    plain = searched(name, seed, 1.0, told)
    for factor in (2.0**-20, 0.5, 2.0**20):  # exact in binary: not a bit may change
        assert (searched(name, seed, factor, told) == plain).all(), factor
    for factor in (1e-3, 1e3):  # each return is rounded once more
        assert searched(name, seed, factor, told) == pytest.approx(plain, rel=1e-9, abs=1e-9), factor


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("reward", [175.0, 0.1, 1e-3 / 3])
def test_what_equal_returns_amount_to_does_not_change_the_asks(name: str, reward: float) -> None:
    asked = []
    for value in (1.0, reward):
        learner = new(name)
        for _ in range(4):
            theta = learner.ask(7)
            learner.tell(theta, np.full(7, value))
        asked.append(learner.ask())
    assert asked[0] == pytest.approx(asked[1], rel=1e-9)


@pytest.mark.parametrize("name", SEARCHING)
def test_the_easy_ridge_is_learned(name: str, fly: Fly) -> None:
    wins = 0
    for seed in range(5):
        learner = new(name, seed)
        learn(learner, fly, 20)
        wins += fly(np.tile(learner.result.recommended, (200, 1)))[1].mean() > 0.8
    assert wins >= 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"mu0": [4.0, np.nan]}, "mu0: value nan is not finite"),
        ({"mu0": [[4.0, 5.0]]}, "mu0 has shape (1, 2)"),
        ({"mu0": [8.0, 5.0]}, "mu0[0]: value 8.0 is out of range (allowed 0 .. 7)"),
        ({"sigma0": [1.5]}, "sigma0 has shape (1,)"),
        ({"sigma0": [0.0, 1.0]}, "sigma0[0]: value 0.0 is out of range"),
        ({"sigma0": [9.0, 1.0]}, "sigma0[0]: value 9.0 is out of range (allowed > 0 .. 7)"),
        ({"bounds": [[0, 7]]}, "bounds"),
        ({"bounds": [[7, 0], [0, 10]]}, "bounds"),
        ({"n_rollouts": 0}, "n_rollouts: value 0"),
        ({"n_rollouts": 2.0}, "n_rollouts: value 2.0"),
        ({"seed": -1}, "seed: value -1"),
        ({"n_best": 0}, "options of EPHE: n_best: value 0"),
        ({"n_bst": 3}, "options of EPHE: n_bst: unknown key"),
        ({"sigma_ref": "newer"}, "options of EPHE: sigma_ref: value 'newer'"),
    ],
)
def test_a_wrong_start_is_refused_in_one_line(arguments: dict[str, Any], message: str) -> None:
    start: dict[str, Any] = {"mu0": [4.0, 5.0], "sigma0": [1.5, 1.5], "bounds": BOUNDS}
    with pytest.raises(LearnerError) as caught:
        make_learner("ephe", **{**start, **arguments})
    assert message in str(caught.value)


def test_an_unknown_learner_is_refused_with_the_names_that_exist() -> None:
    with pytest.raises(IvlError, match=r"no learner 'sgd' \(allowed ephe, "):
        make_learner("sgd", [1.0], [1.0])


@pytest.mark.parametrize("n", [0, -1, True, 2.0])
def test_ask_refuses_a_number_that_is_none(n: Any) -> None:
    with pytest.raises(LearnerError, match="ask: n"):
        new("ephe").ask(n)


def test_a_state_of_another_algorithm_is_refused() -> None:
    with pytest.raises(LearnerError, match="state of learner 'CMALearner' cannot be loaded into EPHE"):
        new("ephe").load_state_dict(new("cmaes").state_dict())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("key", ["rng", "n_told", "search"])
def test_a_damaged_state_is_refused(name: str, key: str) -> None:
    state = new(name).state_dict()
    for damaged in ({k: v for k, v in state.items() if k != key}, {**state, key: None}):
        with pytest.raises(LearnerError, match="damaged"):
            new(name).load_state_dict(damaged)


@settings(max_examples=50, deadline=None)
@given(
    mu=st.floats(-5, 5),
    sigma=st.floats(0, 1),
    lo=st.floats(-5, 5),
    width=st.floats(0.01, 10),
    seed=st.integers(0, 2**32),
)
def test_truncated_draws_stay_inside_for_any_mean_in_the_box(
    mu: float, sigma: float, lo: float, width: float, seed: int
) -> None:
    low, high = np.array([lo]), np.array([lo + width])
    mean = np.clip([mu], low, high)
    draws = draw_truncated(np.random.default_rng(seed), mean, np.array([sigma * width]), low, high, 50)
    assert ((draws >= low) & (draws <= high)).all()


def test_truncated_draws_have_the_distribution_of_a_truncated_normal() -> None:
    rng = np.random.default_rng(3)
    draws = draw_truncated(rng, np.array([0.0]), np.array([1.0]), np.array([0.0]), np.array([10.0]), 200_000)
    assert draws.mean() == pytest.approx(np.sqrt(2 / np.pi), abs=0.005)  # half normal
    assert draws.std() == pytest.approx(np.sqrt(1 - 2 / np.pi), abs=0.005)
