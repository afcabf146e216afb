import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ivl import native
from ivl.errors import ConfigError
from ivl.quantity import Quantity
from ivl.rewards import REWARDS, Options, Reward, RewardChoice, by_name


def outcome(n_legs: int, body: int = 0, d_min_m: float = 0.1, theta_deg: float = np.nan) -> np.ndarray:
    record = np.zeros(1, dtype=native.library().outcome_dtype)
    record["n_legs"], record["body_contact"] = n_legs, body
    record["d_min_m"], record["theta_impact_deg"] = d_min_m, theta_deg
    return record


def terms(name: str, outcomes: np.ndarray, **options: float) -> dict[str, np.ndarray]:
    return RewardChoice(name=name, options=options).score(outcomes)


@pytest.mark.parametrize(
    ("n_legs", "body", "legs"),
    [(0, 0, 0), (1, 0, 50), (2, 0, 50), (3, 0, 150), (4, 0, 150), (4, 1, 75), (2, 1, 25), (0, 1, 0)],
)
def test_paper_pays_for_legs_and_halves_on_body_contact(n_legs: int, body: int, legs: float) -> None:
    assert terms("paper", outcome(n_legs, body))["legs"] == legs


@pytest.mark.parametrize(
    ("n_legs", "body", "legs"),
    [(0, 0, 0), (1, 0, 10), (2, 0, 50), (3, 0, 150), (4, 0, 150), (4, 1, 100), (2, 1, 25), (1, 1, 10)],
)
def test_authors_code_pays_by_its_own_table(n_legs: int, body: int, legs: float) -> None:
    assert terms("authors_code", outcome(n_legs, body))["legs"] == legs


def test_paper_pays_the_inverse_of_the_closest_distance_down_to_the_floor() -> None:
    assert terms("paper", outcome(0, d_min_m=0.25))["distance"] == 4
    assert terms("paper", outcome(0, d_min_m=0.001))["distance"] == 20
    assert terms("paper", outcome(0, d_min_m=-0.01))["distance"] == 20


def test_authors_code_pays_the_height_of_the_closest_approach() -> None:
    assert terms("authors_code", outcome(0, d_min_m=1.05))["height"] == pytest.approx(5)
    assert terms("authors_code", outcome(0, d_min_m=5.0))["height"] == 0


@pytest.mark.parametrize(
    ("theta_deg", "term"), [(np.nan, 0), (0, 0), (45, 5), (-45, 5), (90, 10), (170, 10), (315, 5), (405, 5)]
)
def test_the_angle_term_uses_the_folded_angle_and_is_zero_without_contact(theta_deg: float, term: float) -> None:
    for name in REWARDS:
        assert terms(name, outcome(4, theta_deg=theta_deg))["angle"] == pytest.approx(term)


@given(st.integers(0, 4), st.integers(0, 1), st.floats(-0.5, 20), st.floats(-3600, 3600) | st.just(float("nan")))
def test_every_return_is_finite_not_negative_and_the_sum_of_its_terms(
    n_legs: int, body: int, d_min_m: float, theta_deg: float
) -> None:
    for name in REWARDS:
        found = terms(name, outcome(n_legs, body, d_min_m, theta_deg))
        total = found.pop("total")
        assert np.isfinite(total).all()
        assert (total >= 0).all()
        assert total == sum(found.values())


def test_rewards_do_not_modify_the_outcomes() -> None:
    record = outcome(4, 1, 0.01, -100.0)
    before = record.tobytes()
    for name in REWARDS:
        terms(name, record)
    assert record.tobytes() == before


def test_a_missing_distance_is_not_hidden() -> None:
    assert np.isnan(terms("paper", outcome(4, d_min_m=np.nan))["total"]).all()


def test_an_unknown_reward_is_refused() -> None:
    with pytest.raises(ConfigError, match="no reward 'money'"):
        by_name("money")
    with pytest.raises(ValueError, match="no reward 'money'"):
        RewardChoice(name="money")


def test_a_reward_declares_what_it_gives_and_says_what_it_means() -> None:
    for name, reward in REWARDS.items():
        assert reward.name == name
        assert list(terms(name, outcome(4))) == ["total", *(term.name for term in reward.terms)]
        assert all(term.unit and term.doc for term in reward.terms)


def test_a_reward_has_options_of_its_own_alone() -> None:
    assert terms("paper", outcome(0, d_min_m=0.1), d_floor_m=0.5)["distance"] == 2
    assert terms("authors_code", outcome(0, d_min_m=1.0), h_ceil_m=4.0)["height"] == pytest.approx(7.5)
    with pytest.raises(ValueError, match="d_floor_m"):
        RewardChoice(name="authors_code", options={"d_floor_m": 0.1})
    with pytest.raises(ValueError, match="options"):
        RewardChoice(name="authors_code", options=RewardChoice(name="paper").options)


def test_a_choice_writes_every_default_and_reads_itself_back() -> None:
    choice = RewardChoice(name="authors_code")
    assert choice.model_dump(mode="json") == {"name": "authors_code", "options": {"weights": {}, "h_ceil_m": 2.1}}
    assert RewardChoice.model_validate(choice.model_dump(mode="json")) == choice
    assert RewardChoice().model_dump(mode="json")["options"] == {"weights": {}, "d_floor_m": 0.05}


def test_terms_that_were_not_declared_are_an_error() -> None:
    odd = Reward("odd", "", (Quantity("legs", "1", "feet"),), lambda outcomes, _: {"total": outcomes["n_legs"]})
    with pytest.raises(ConfigError, match=r"reward odd: gives \['total'\], declares \['legs', 'total'\]"):
        odd.score(outcome(4), Options())


@pytest.mark.parametrize("names", [["total"], ["legs", "legs"], ["two words"], ["Legs"]])
def test_terms_that_cannot_be_columns_are_refused(names: list[str]) -> None:
    with pytest.raises(ValueError, match="must be different names of columns"):
        Reward("odd", "", tuple(Quantity(name, "1", "") for name in names), lambda _outcomes, _options: {})


def test_a_weight_is_a_factor_on_one_term_and_on_its_part_of_the_return() -> None:
    record = outcome(3, 1, 0.25, 45.0)
    plain, weighted = terms("paper", record), terms("paper", record, weights={"legs": 0.5, "angle": 3.0})
    assert weighted["legs"] == 0.5 * plain["legs"] == 37.5
    assert weighted["angle"] == 3.0 * plain["angle"] == 15.0
    assert weighted["distance"] == plain["distance"] == 4.0
    assert weighted["total"] == 4.0 + 15.0 + 37.5


@pytest.mark.parametrize(
    ("weights", "message"),
    [({"lgs": 1.0}, r"weights.lgs: no such term \(the reward paper has distance, angle, legs\)"),
     ({"legs": -1.0}, "greater than or equal to 0"), ({"legs": float("inf")}, "finite"), ({"legs": "2"}, "number")],
)  # fmt: skip
def test_a_weight_that_cannot_be_is_refused(weights: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RewardChoice(name="paper", options={"weights": weights})
