import json

import numpy as np
import pandas as pd
import pytest

import ivl
from ivl import native, outcome


def outcomes(n_legs: list[int], body: list[int]) -> np.ndarray:
    records = np.zeros(len(n_legs), dtype=native.library().outcome_dtype)
    records["n_legs"], records["body_contact"] = n_legs, body
    return records


def test_three_legs_count_as_a_four_leg_landing() -> None:
    assert outcome.four_leg(outcomes([0, 1, 2, 3, 4], [0] * 5)).tolist() == [False, False, False, True, True]


@pytest.mark.parametrize("end", ["refused", "not_finite", "step_limit"])
def test_a_rollout_whose_simulation_broke_down_is_no_landing(end: str) -> None:
    records = outcomes([4, 4], [0, 0])
    codes = [code for code in range(20) if native.library().end_reason(code) == end]
    records["end_reason"][1] = codes[0]
    assert outcome.valid(records).tolist() == [True, False]
    assert outcome.four_leg(records).tolist() == [True, False]
    assert outcome.clean(records).tolist() == [True, False]


def test_clean_needs_four_legs_and_no_body_contact() -> None:
    assert outcome.clean(outcomes([4, 4, 3, 2], [0, 1, 0, 0])).tolist() == [True, False, True, False]


@pytest.mark.parametrize(
    ("angle_deg", "folded_deg"),
    [(0, 0), (90, 90), (-90, 90), (180, 180), (200, 160), (360, 0), (-400, 40), (720 + 30, 30)],
)
def test_angles_fold_to_their_magnitude(angle_deg: float, folded_deg: float) -> None:
    assert outcome.folded_deg(np.array([angle_deg])) == pytest.approx([folded_deg])


def test_folding_keeps_nan() -> None:
    assert np.isnan(outcome.folded_deg(np.array([np.nan]))).all()


def test_as_dict_is_json_with_null_for_what_did_not_happen(world: ivl.World) -> None:
    record = world.rollouts(2.5, 90.0, 4.8, 8.0)
    record.t_trigger_s = np.nan
    data = json.loads(json.dumps(outcome.as_dict(record, world.end_reason(record.end_reason)), allow_nan=False))
    assert data["t_trigger_s"] is None
    assert data["n_legs"] == 4
    assert len(data["leg_order"]) == 4
    assert data["end_reason"] == "contact_time"
    assert set(data) == set(record.dtype.names)


def test_solved_and_stuck_are_shares_of_what_is_possible() -> None:
    rates = np.array([0.0, 0.36, 0.37, 0.59, 0.61, 0.75, np.nan])
    assert outcome.solved(rates, possible=0.75).tolist() == [False, False, False, False, True, True, False]
    assert outcome.stuck(rates, possible=0.75).tolist() == [True, True, True, False, False, False, False]
    assert outcome.solved(rates, possible=0.75, share=0.9).tolist() == [False] * 5 + [True, False]
    assert outcome.solved(pd.Series(rates), possible=0.75).tolist() == outcome.solved(rates, possible=0.75).tolist()
    assert (bool(outcome.solved(0.8)), bool(outcome.solved(0.79)), bool(outcome.stuck(0.5))) == (True, False, False)


@pytest.mark.parametrize("possible", [0.0, np.nan])
def test_where_no_landing_is_possible_nothing_is_solved(possible: float) -> None:
    rates = np.array([0.0, 0.5, 1.0, np.nan])
    assert outcome.solved(rates, possible).tolist() == [False] * 4
    assert not outcome.solved(0.0, possible)
    assert outcome.solved(np.zeros(2), np.array([possible, 0.5])).tolist() == [False, False]
    assert not outcome.stuck(0.0, possible)
