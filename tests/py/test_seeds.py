from hypothesis import given
from hypothesis import strategies as st

from ivl.seeds import Purpose, derive


@given(st.integers(0, 2**63 - 1))
def test_derived_seeds_fit_a_signed_64_bit_integer_and_differ_by_purpose(seed: int) -> None:
    derived = [derive(seed, purpose) for purpose in Purpose]
    assert all(0 <= value < 2**63 for value in derived)
    assert len(set(derived)) == len(derived)


def test_neighbouring_seeds_share_nothing() -> None:
    derived = {derive(seed, purpose) for seed in range(1000) for purpose in Purpose}
    assert len(derived) == 1000 * len(Purpose)


def test_derivation_never_changes_since_stored_runs_depend_on_it() -> None:
    assert derive(0, Purpose.WORLD) == 2918264622725855778
    assert derive(1, Purpose.LEARNER) == 7764949442709860949
