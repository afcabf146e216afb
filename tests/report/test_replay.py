"""What a page carries of a landing, decoded here a second time and compared with the trace that it was made of."""

from typing import Any

import numpy as np
import planes
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planes import MOVING, NORMALS

import ivl
from ivl.landing import LandingSpec
from ivl.report import replay
from ivl.rewards import RewardChoice
from ivl.world import Trace

KINDS: dict[str, dict[str, Any]] = {
    "four feet": {"speed_mps": 2.5, "angle_deg": 60.0, "rrev_c_per_s": 4.8, "moment_y_Nmm": 8.0},
    "body strike": {"speed_mps": 2.5, "angle_deg": 90.0, "rrev_c_per_s": 7.0, "moment_y_Nmm": 1.0},
    "no trigger": {"speed_mps": 2.5, "angle_deg": 40.0, "rrev_c_per_s": 20.0, "moment_y_Nmm": 5.0},
    "no contact": {"speed_mps": 1.0, "angle_deg": 90.0, "rrev_c_per_s": 0.5, "moment_y_Nmm": 10.0},
    "flown": {"speed_mps": 2.0, "angle_deg": 45.0, "rrev_c_per_s": 4.8, "moment_y_Nmm": 8.0, "start": "flown"},
}


class Decoded:
    """A packed landing at any time, by numpy."""

    def __init__(self, packed: dict[str, Any]) -> None:
        self.packed = packed
        self.t_s = np.cumsum(packed["t"]) * replay.SCALE["t"]
        self.columns = {name: np.cumsum(packed[name], axis=1) * replay.SCALE[name] for name in ("p", "q", "f", "pitch")}

    def at(self, name: str, t_s: np.ndarray) -> np.ndarray:
        """Interpolated columns, shape (len(t_s), n)."""
        return np.column_stack([np.interp(t_s, self.t_s, column) for column in self.columns[name]])


@pytest.fixture(scope="module", params=KINDS)
def landing(request: pytest.FixtureRequest) -> tuple[Any, Decoded, ivl.World]:
    spec = LandingSpec(gear_set="as_simulated", **KINDS[request.param])
    world, trace = spec.fly()
    decoded = Decoded(replay.pack(spec, world, trace, RewardChoice()))
    rows = trace.rows[(trace.rows.t_s >= decoded.t_s[0]) & (trace.rows.t_s <= decoded.t_s[-1])]
    return rows, decoded, world


def test_pose_is_within_a_millimetre_and_a_degree(landing: tuple[Any, Decoded, ivl.World]) -> None:
    rows, decoded, world = landing
    height_m = world.params.values["world.ceiling_height"]
    error_m = np.abs(decoded.at("p", rows.t_s) - (rows.p_WB_m - [0, 0, height_m]))
    assert error_m.max() < 6e-4
    q = decoded.at("q", rows.t_s)
    cosine = np.abs((q / np.linalg.norm(q, axis=1, keepdims=True) * rows.q_WB).sum(axis=1))
    assert np.rad2deg(2 * np.arccos(np.clip(cosine, 0, 1))).max() < 1.0
    assert np.abs(decoded.at("pitch", rows.t_s)[:, 0] - rows.pitch_deg).max() < 0.6


def test_stuck_feet_are_where_they_stick(landing: tuple[Any, Decoded, ivl.World]) -> None:
    rows, decoded, world = landing
    height_m = world.params.values["world.ceiling_height"]
    state = np.zeros((len(rows), 4), dtype=int)
    for t_s, foot, to, *place in decoded.packed["feet"]:
        since = rows.t_s >= t_s - 1e-9
        state[since, foot] = to
        row = int(np.argmax(since))
        assert place == pytest.approx(rows.foot_W_m[row, 3 * foot : 3 * foot + 3] - [0, 0, height_m], abs=1e-4)
    assert (state == rows.foot_state).all()


def test_phases_and_cues_are_those_of_the_trace(landing: tuple[Any, Decoded, ivl.World]) -> None:
    rows, decoded, world = landing
    cues = np.cumsum(decoded.packed["cues"], axis=1).T * np.array(replay.SCALE["cues"])
    held = cues[np.searchsorted(cues[:, 0], rows.t_s + 1e-6, side="right") - 1]
    impact_s = decoded.packed["outcome"]["t_impact_s"]
    before = rows.t_s <= (np.inf if impact_s is None else impact_s)
    truth = np.column_stack([rows.d_sensed_m, rows.rrev_per_s, rows.of_y_radps])
    assert np.abs(held[before, 1:] - truth[before]).max() < 6e-3
    starts = np.array([event[0] for event in decoded.packed["phases"]])
    names = np.array([event[1] for event in decoded.packed["phases"]])
    shown = names[np.searchsorted(starts, rows.t_s + 1e-9, side="right") - 1]
    assert shown.tolist() == [world.phase_name(int(code)) for code in rows.phase]


def test_rows_are_dense_around_the_flip_and_few_in_all(spec: LandingSpec) -> None:
    world, trace = spec.fly()
    decoded = Decoded(replay.pack(spec, world, trace, RewardChoice()))
    trigger_s, impact_s = float(trace.outcome.t_trigger_s), float(trace.outcome.t_impact_s)
    flip = ((decoded.t_s >= trigger_s) & (decoded.t_s <= impact_s + 0.1)).sum() / (impact_s + 0.1 - trigger_s)
    approach = (decoded.t_s < trigger_s).sum() / (trigger_s - decoded.t_s[0])
    assert flip > 5 * approach
    assert len(decoded.t_s) < 0.3 * len(trace.rows)


def test_turning_feet_that_are_sliding_or_let_go_are_told() -> None:
    spec = LandingSpec(
        gear_set="as_simulated", overrides={"leg.adhesion": 0.3, "leg.stick_delay": 0.004}, **KINDS["four feet"]
    )
    world, trace = spec.fly()
    packed = replay.pack(spec, world, trace, RewardChoice())
    states = {event[2] for event in packed["feet"]}
    assert {0, 1} <= states


def test_a_straight_line_needs_its_ends_only() -> None:
    t_s = np.linspace(0, 1, 50)
    assert replay.keep_rows(t_s, np.column_stack([5 * t_s, -t_s]), np.zeros(50, dtype=bool)).tolist() == [0, 49]


def test_a_corner_and_forced_rows_are_kept() -> None:
    t_s = np.linspace(0, 1, 51)
    forced = np.zeros(51, dtype=bool)
    forced[7] = True
    kept = replay.keep_rows(t_s, 100 * np.abs(t_s - 0.5)[:, None], forced)
    assert kept.tolist() == [0, 7, 25, 50]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-20, 20), min_size=2, max_size=60), st.integers(0, 2**32 - 1))
def test_interpolation_is_within_the_tolerance_whatever_the_signal(values: list[float], seed: int) -> None:
    t_s = np.cumsum(np.random.default_rng(seed).uniform(0.01, 1, len(values)))
    signal = np.array(values)
    kept = replay.keep_rows(t_s, signal[:, None], np.zeros(len(values), dtype=bool))
    assert np.abs(np.interp(t_s, t_s[kept], signal[kept]) - signal).max() <= 1 + 1e-9


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), MOVING])
@pytest.mark.parametrize("normal", NORMALS)
def test_a_page_shows_any_surface_as_it_shows_a_ceiling(normal: str, velocity: tuple[float, float, float]) -> None:
    """The same landing under the same plane, seen from another frame, is the same picture to the last digits."""
    spec = LandingSpec(gear_set="as_simulated", **KINDS["four feet"])
    world, trace = spec.fly()
    seen = planes.Seen(world, NORMALS[normal], velocity)
    other = replay.pack(spec, seen.world, Trace(seen.rows(trace.rows), trace.outcome), RewardChoice())
    known = Decoded(replay.pack(spec, world, trace, RewardChoice()))
    again = Decoded(other)
    for name in ("p", "q", "f", "pitch"):
        one, two = known.at(name, known.t_s), again.at(name, known.t_s)
        if name == "q":
            two *= np.sign(one[0] @ two[0])  # -q is the attitude q
        error = np.abs(two - one)
        assert error.max() <= 2.0 * replay.TOLERANCE[name], name
    assert np.array(other["feet"], dtype=float) == pytest.approx(np.array(known.packed["feet"], dtype=float), abs=2e-4)
