"""The outcome of a landing as a person and a recorder see it."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import planes
import pytest
from planes import NORMALS

from ivl import World, native
from ivl.errors import RolloutError
from ivl.links import packets, truth
from ivl.links.landing_flight import check_abort
from ivl.links.packets import Phase, Recording
from ivl.links.trouble import Cause
from ivl.links.truth import Resting
from ivl.links.vehicle import Snapshot


@pytest.fixture(scope="module")
def world() -> World:
    return World("habas2021", "wide_short", "as_simulated")


def test_pitch_is_nose_up_and_goes_on_beyond_half_a_turn() -> None:
    angles = np.radians(np.arange(0.0, 271.0, 10.0))
    q_WB = np.column_stack((0 * angles, -np.sin(angles / 2), 0 * angles, np.cos(angles / 2)))
    assert truth.pitch_deg(q_WB) == pytest.approx(np.degrees(angles))


def test_pitch_agrees_with_the_simulator_through_a_landing(world: World) -> None:
    rows = world.trace(2.5, 90.0, 4.8, 8.0).rows
    assert truth.pitch_deg(rows.q_WB) == pytest.approx(rows.pitch_deg, abs=1e-6)


def hanging(world: World) -> Resting:
    """A vehicle that hangs level."""
    return Resting((0.2, 0.1, world.surface.point_W_m[2] - world.hanging_gap_m()), (0.0, 0.0, -1.0))


def leaning(tilt_deg: float) -> tuple[float, float, float]:
    """The z axis of a body that hangs, but for this tilt."""
    return (math.sin(math.radians(tilt_deg)), 0.0, -math.cos(math.radians(tilt_deg)))


def test_legs_are_suggested_from_height_and_tilt(world: World) -> None:
    level = hanging(world)
    assert truth.suggest_legs(level, world) == 4
    assert truth.suggest_legs(replace(level, up_W=leaning(40.0)), world) == 2
    assert truth.suggest_legs(replace(level, up_W=(0.0, 0.3, 0.95)), world) == 2
    assert truth.suggest_legs(replace(level, up_W=(math.nan, math.nan, math.nan)), world) == 2
    assert truth.suggest_legs(Resting((0.0, 0.0, 0.03), (0.0, 0.0, 1.0)), world) == 0


@pytest.mark.parametrize("normal", NORMALS)
def test_legs_are_suggested_at_any_surface(world: World, normal: str) -> None:
    seen = planes.Seen(world, NORMALS[normal])
    for tilt_deg, legs in ((0.0, 4), (24.0, 4), (26.0, 2), (170.0, 2)):
        rests = Resting(seen.point(hanging(world).p_W_m), seen.direction(leaning(tilt_deg)))
        assert truth.suggest_legs(rests, seen.world) == legs
    away = Resting(seen.point((0.0, 0.0, 2.0)), seen.direction((0.0, 0.0, -1.0)))
    assert truth.suggest_legs(away, seen.world) == 0


def test_a_resting_pose_is_told_by_position_and_attitude() -> None:
    hanging_still = Resting.of((1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0))
    assert hanging_still == Resting((1.0, 2.0, 3.0), (0.0, 0.0, -1.0))
    assert Resting.of((1.0, 2.0, 3.0), (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))).up_W == pytest.approx((0, -1, 0))
    assert np.isnan(Resting.of((1.0, 2.0, 3.0), None).up_W).all()


def test_hanging_height_is_where_the_simulated_vehicle_comes_to_rest(world: World) -> None:
    rows = world.trace(2.5, 90.0, 4.8, 8.0).rows
    assert rows.d_ceil_m[-1] == pytest.approx(world.hanging_gap_m(), abs=0.02)


def recording_of(world: World, threshold_per_s: float, moment_Nmm: float) -> Recording:
    """What an ideal recorder would hold of a simulated landing, without forces."""
    flight = world.trace(2.5, 90.0, threshold_per_s, moment_Nmm, period_s=0.002).rows
    names = [("t_s", "f8", ()), ("p_W_m", "f8", (3,)), ("v_W_mps", "f8", (3,)), ("q_WB", "f8", (4,))]
    names += [("w_B_radps", "f8", (3,)), ("f_B_mps2", "f8", (3,)), ("phase", "u1", ())]
    rows = np.zeros(len(flight), dtype=names)
    for name, source in (("t_s", "t_s"), ("p_W_m", "p_WB_m"), ("v_W_mps", "v_WB_mps"), ("q_WB", "q_WB")):
        rows[name] = flight[source]
    rows["w_B_radps"], rows["phase"] = flight.w_B_radps, flight.phase
    flips = np.flatnonzero(rows["phase"] == Phase.FLIP)
    return Recording(1, 1, 0, int(flips[0]) if len(flips) else None, 500.0, rows)


def test_outcome_of_a_recording_agrees_with_the_simulator(world: World) -> None:
    known = world.trace(2.5, 90.0, 4.8, 8.0).outcome
    recording = recording_of(world, 4.8, 8.0)
    touch = int(np.argmax(recording.rows["t_s"] >= known.t_impact_s))
    recording.rows["f_B_mps2"][touch] = (0.0, 0.0, -60.0)
    snapshot = Snapshot(1, 0.5, 4.9, 0.0, 0.0, 2.5)
    rest = Resting(tuple(recording.rows["p_W_m"][-1]), (0.0, 0.0, -1.0))
    outcome = truth.outcome_of_flight(recording, snapshot, 4, False, rest, world)[0]
    assert outcome["t_trigger_s"] == pytest.approx(known.t_trigger_s, abs=0.003)
    assert outcome["t_impact_s"] == pytest.approx(known.t_impact_s, abs=0.003)
    assert outcome["theta_impact_deg"] == pytest.approx(known.theta_impact_deg, abs=5.0)
    assert outcome["vz_impact_mps"] == pytest.approx(known.vz_impact_mps, abs=0.1)
    assert outcome["rate_impact_radps"] == pytest.approx(known.rate_impact_radps, abs=3.0)
    assert outcome["d_min_m"] == pytest.approx(known.d_min_m, abs=0.003)
    assert world.end_reason(outcome["end_reason"]) == "contact_time"
    assert (outcome["n_legs"], outcome["d_trigger_m"], outcome["rrev_trigger"]) == (4, 0.5, 4.9)


@pytest.mark.parametrize("normal", NORMALS)
def test_the_closest_approach_is_to_the_surface_wherever_it_is(world: World, normal: str) -> None:
    seen, recording = planes.Seen(world, NORMALS[normal]), recording_of(world, 4.8, 8.0)
    known = world.trace(2.5, 90.0, 4.8, 8.0).outcome
    rows = recording.rows.copy()
    rows["p_W_m"] = seen.points(rows["p_W_m"][:, None], np.zeros(len(rows)))[:, 0]
    rests = Resting(tuple(rows["p_W_m"][-1]), seen.direction((0.0, 0.0, -1.0)))
    snapshot = Snapshot(1, 0.5, 4.9, 0.0, 0.0, 2.5)
    outcome = truth.outcome_of_flight(replace(recording, rows=rows), snapshot, 4, False, rests, seen.world)[0]
    assert outcome["d_min_m"] == pytest.approx(known.d_min_m, abs=0.003)


def test_outcome_without_a_trigger_says_nothing_about_one(world: World) -> None:
    recording = replace(recording_of(world, 4.8, 8.0), trigger_row=None)
    snapshot = Snapshot(9, 0.5, 4.9, 0.0, 0.0, 2.5)
    upright = Resting((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    outcome = truth.outcome_of_flight(recording, snapshot, 0, False, upright, world)[0]
    assert outcome["triggered"] == 0
    assert np.isnan([outcome["t_trigger_s"], outcome["d_trigger_m"], outcome["t_impact_s"]]).all()


# ---- the terminal


def test_recorder_constants_are_those_of_the_firmware() -> None:
    assert int.from_bytes(b"IVLR", "little") == packets.RECORD_MAGIC


def aborted(rule: str, reason: str = "") -> Any:
    """What a vehicle remembers of an abort."""
    return SimpleNamespace(aborted_by=rule, abort_reason=reason, spoiled_by="", abort_cause=Cause.TRACKING)


@pytest.mark.parametrize("rule", native.library().rules())
def test_an_abort_by_each_rule_is_scored_or_discarded_as_its_row_says(rule: str) -> None:
    if native.library().rules()[rule]:
        with pytest.raises(RolloutError, match=f"the vehicle aborted: {rule}$"):
            check_abort(aborted(rule))
    else:
        check_abort(aborted(rule))


def test_what_others_did_is_not_the_policy_s_fault() -> None:
    rules = native.library().rules()
    assert all(rules[name] for name in ("none", "state", "host", "uncertain"))
    assert not any(rules[name] for name in ("too_close", "tilt", "approach_time"))
    with pytest.raises(RolloutError, match="aborted: a person"):
        check_abort(aborted("tilt", "a person"))
    check_abort(aborted(""))


def test_the_table_of_rules_is_told_to_its_end() -> None:
    library = native.library()
    assert list(library.rules()) == [library.rule_name(code) for code in range(len(library.rules()))]
    assert library.rule_name(len(library.rules())) == "?"
