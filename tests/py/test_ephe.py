"""EPHE to the last digit, on an example worked by hand."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ivl.learners.ephe import EPHE, RobustEPHE

THETA = [[4.0, 5.0], [5.0, 8.0], [3.0, 4.0], [6.0, 7.0]]
REWARDS = [10.0, 30.0, 5.0, 20.0]


def told(cls: type[EPHE] = EPHE, **options: object) -> EPHE:
    learner = cls([4.0, 5.0], [1.5, 1.5], n_rollouts=4, **options)
    learner.tell(THETA, REWARDS)
    return learner


def by_hand(best: list[int], weights: list[int], about_new: bool) -> tuple[list[float], list[float]]:
    """Equations (1) and (2) in exact fractions; only the square root rounds."""
    mu, sigma = [], []
    for i, old in enumerate((4, 5)):
        values = [Fraction(THETA[n][i]) for n in best]
        mean = sum(w * v for w, v in zip(weights, values, strict=True)) / sum(weights)
        center = mean if about_new else Fraction(old)
        variance = sum(w * (v - center) ** 2 for w, v in zip(weights, values, strict=True)) / sum(weights)
        mu.append(float(mean))
        sigma.append(float(variance) ** 0.5)
    return mu, sigma


@pytest.mark.parametrize("sigma_ref", ["new", "old"])
@pytest.mark.parametrize(("n_best", "best"), [(1, [1]), (2, [1, 3]), (3, [1, 3, 0]), (None, [0, 1, 2, 3])])
def test_update_equals_the_published_equations(sigma_ref: str, n_best: int | None, best: list[int]) -> None:
    learner = told(n_best=n_best, sigma_ref=sigma_ref)
    mu, sigma = by_hand(best, [int(REWARDS[n]) for n in best], sigma_ref == "new")
    assert learner.result.mu == pytest.approx(mu, abs=1e-12, rel=1e-12)
    assert learner.result.sigma == pytest.approx(sigma, abs=1e-12, rel=1e-12)
    assert (learner.result.recommended == learner.result.mu).all()


def test_worked_example_in_numbers() -> None:
    learner = told(n_best=2, sigma_ref="old")
    # mu' = (30 [5 8] + 20 [6 7]) / 50; sigma'^2 = (30 [1 9] + 20 [4 4]) / 50
    assert learner.result.mu == pytest.approx([5.4, 7.6], abs=1e-12)
    assert learner.result.sigma == pytest.approx([2.2**0.5, 7.0**0.5], abs=1e-12)


def test_above_mean_weights_use_the_mean_of_all_rollouts() -> None:
    learner = told(n_best=None, weight="above_mean")
    mean = Fraction(65, 4)
    mu, _ = by_hand([1, 3], [30 - mean, 20 - mean], False)  # type: ignore[list-item]
    assert learner.result.mu == pytest.approx(mu, abs=1e-12)


def test_robust_mode_limits_how_fast_sigma_shrinks() -> None:
    learner = RobustEPHE([4.0, 5.0], [1.5, 1.5])
    learner.tell([[4.0, 5.0], [1.0, 1.0]], [100.0, 0.0])
    assert learner.result.sigma == pytest.approx([0.85 * 1.5] * 2, abs=1e-12)
    assert learner.result.mu == pytest.approx([4.0, 5.0], abs=1e-12)


def test_robust_mode_lets_sigma_grow_freely_and_keeps_it_above_the_floor() -> None:
    learner = RobustEPHE([4.0, 5.0], [0.05, 0.05])
    learner.tell([[6.0, 5.0], [1.0, 1.0]], [100.0, 0.0])
    assert learner.result.sigma == pytest.approx([2.0, 0.05], abs=1e-12)


def test_all_returns_zero_change_nothing() -> None:
    learner = EPHE([4.0, 5.0], [1.5, 1.5])
    learner.tell(THETA, [0.0] * 4)
    assert learner.result.mu.tolist() == [4.0, 5.0]
    assert learner.result.sigma.tolist() == [1.5, 1.5]


@pytest.mark.parametrize("n", [4, 6, 7])
@pytest.mark.parametrize("reward", [7.0, 0.1, 1e-3 / 3])
def test_equal_returns_change_nothing_with_above_mean_weights(n: int, reward: float) -> None:
    learner = RobustEPHE([4.0, 5.0], [1.5, 1.5])
    learner.tell((THETA + THETA)[:n], [reward] * n)
    assert learner.result.mu.tolist() == [4.0, 5.0]


def test_fewer_rollouts_than_k_all_count() -> None:
    learner = EPHE([4.0, 5.0], [1.5, 1.5], n_best=3)
    learner.tell(THETA[:2], REWARDS[:2])
    assert learner.result.mu == pytest.approx([(40 + 150) / 40, (50 + 240) / 40], abs=1e-12)


@given(st.permutations(range(4)))
def test_the_order_of_the_rollouts_does_not_matter(order: list[int]) -> None:
    learner = EPHE([4.0, 5.0], [1.5, 1.5])
    learner.tell(np.array(THETA)[order], np.array(REWARDS)[order])
    assert learner.result.mu == pytest.approx(told().result.mu, abs=1e-12)


@given(
    st.lists(
        st.tuples(st.floats(0, 7), st.floats(0, 10), st.floats(0, 180, allow_subnormal=False)), min_size=1, max_size=12
    )
)
def test_the_mean_stays_within_what_was_flown_and_sigma_within_the_box(rows: list[tuple[float, float, float]]) -> None:
    data = np.array(rows)
    for cls in (EPHE, RobustEPHE):
        learner = cls([4.0, 5.0], [1.5, 1.5], bounds=[[0, 7], [0, 10]])
        learner.tell(data[:, :2], data[:, 2])
        result = learner.result
        lowest, highest = (np.minimum(data[:, :2].min(0), [4, 5]), np.maximum(data[:, :2].max(0), [4, 5]))
        assert (result.mu >= lowest - 1e-9).all()
        assert (result.mu <= highest + 1e-9).all()
        assert (result.sigma <= [7, 10]).all()
        assert np.isfinite(learner.ask()).all()
