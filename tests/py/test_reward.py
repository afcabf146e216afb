import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ivl import native, reward
from ivl.errors import ConfigError
from ivl.reward import RewardOptions

OPTIONS = RewardOptions()


def outcome(n_legs: int, body: int = 0, d_min_m: float = 0.1, theta_deg: float = np.nan) -> np.ndarray:
    record = np.zeros(1, dtype=native.library().outcome_dtype)
    record["n_legs"], record["body_contact"] = n_legs, body
    record["d_min_m"], record["theta_impact_deg"] = d_min_m, theta_deg
    return record


@pytest.mark.parametrize(
    ("n_legs", "body", "legs"),
    [(0, 0, 0), (1, 0, 50), (2, 0, 50), (3, 0, 150), (4, 0, 150), (4, 1, 75), (2, 1, 25), (0, 1, 0)],
)
def test_paper_pays_for_legs_and_halves_on_body_contact(n_legs: int, body: int, legs: float) -> None:
    assert reward.paper(outcome(n_legs, body), OPTIONS).legs == legs


@pytest.mark.parametrize(
    ("n_legs", "body", "legs"),
    [(0, 0, 0), (1, 0, 10), (2, 0, 50), (3, 0, 150), (4, 0, 150), (4, 1, 100), (2, 1, 25), (1, 1, 10)],
)
def test_authors_code_pays_by_its_own_table(n_legs: int, body: int, legs: float) -> None:
    assert reward.authors_code(outcome(n_legs, body), OPTIONS).legs == legs


def test_paper_pays_the_inverse_of_the_closest_distance_down_to_the_floor() -> None:
    assert reward.paper(outcome(0, d_min_m=0.25), OPTIONS).distance == 4
    assert reward.paper(outcome(0, d_min_m=0.001), OPTIONS).distance == 20
    assert reward.paper(outcome(0, d_min_m=-0.01), OPTIONS).distance == 20


def test_authors_code_pays_the_height_of_the_closest_approach() -> None:
    assert reward.authors_code(outcome(0, d_min_m=1.05), OPTIONS).distance == pytest.approx(5)
    assert reward.authors_code(outcome(0, d_min_m=5.0), OPTIONS).distance == 0


@pytest.mark.parametrize(
    ("theta_deg", "term"), [(np.nan, 0), (0, 0), (45, 5), (-45, 5), (90, 10), (170, 10), (315, 5), (405, 5)]
)
def test_the_angle_term_uses_the_folded_angle_and_is_zero_without_contact(theta_deg: float, term: float) -> None:
    for function in reward.REWARDS.values():
        assert function(outcome(4, theta_deg=theta_deg), OPTIONS).angle == pytest.approx(term)


@given(st.integers(0, 4), st.integers(0, 1), st.floats(-0.5, 20), st.floats(-3600, 3600) | st.just(float("nan")))
def test_every_return_is_finite_not_negative_and_the_sum_of_its_terms(
    n_legs: int, body: int, d_min_m: float, theta_deg: float
) -> None:
    for function in reward.REWARDS.values():
        terms = function(outcome(n_legs, body, d_min_m, theta_deg), OPTIONS)
        assert np.isfinite(terms.total).all()
        assert (terms.total >= 0).all()
        assert terms.total == terms.distance + terms.angle + terms.legs


def test_rewards_do_not_modify_the_outcomes() -> None:
    record = outcome(4, 1, 0.01, -100.0)
    before = record.tobytes()
    for function in reward.REWARDS.values():
        function(record, OPTIONS)
    assert record.tobytes() == before


def test_a_missing_distance_is_not_hidden() -> None:
    assert np.isnan(reward.paper(outcome(4, d_min_m=np.nan), OPTIONS).total).all()


def test_an_unknown_reward_is_refused() -> None:
    with pytest.raises(ConfigError, match="no reward 'money'"):
        reward.by_name("money")
