"""A landing in few numbers: what the page needs to draw it at any time, and nothing else.

Only the rows are kept that linear interpolation needs to be within the tolerances below, so that rows are rare where
the motion is plain and dense where it turns: around the trigger and the contacts. Places and attitudes are given in the
frame of the surface, so that the page draws any surface as its plane z = 0. Feet are given in body axes, where they
rest while they are free, and by their place on the surface while they are stuck. Numbers are whole multiples of
the units of `SCALE`, each column as differences, which is what makes them small once compressed.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import native, outcome
from ivl.landing import LandingSpec
from ivl.rewards import TOTAL, RewardChoice
from ivl.world import Trace, World, rotation

SCALE = {"t": 1e-4, "p": 1e-4, "q": 1e-4, "f": 1e-4, "pitch": 0.1, "cues": (1e-4, 1e-3, 1e-2, 1e-2)}
"""Unit of a stored number: s, m, 1, m, degrees; cues: s, m, 1/s, rad/s. The page gets this table with the data."""
TOLERANCE = {"p": 4e-4, "q": 2.5e-3, "f": 8e-4, "pitch": 0.5}
"""Largest error of interpolation, in the units of the trace: m, 1, m, degrees."""
BEFORE_TRIGGER_S, AFTER_CONTACT_S = 0.30, 0.80
STUCK = 2

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]


def pack(spec: LandingSpec, world: World, trace: Trace, reward: RewardChoice) -> dict[str, Any]:
    """A landing as plain data for the page.

    Args:
        spec: What was flown; its policy and approach are shown.
        world: Names the phases and ends.
        trace: The landing, in rows of one tick.
        reward: What the run paid for landings.
    """
    rows = _window(world, trace)
    signals = _signals(world, rows)
    forced = _changes(rows["foot_state"]) | _changes(rows["phase"]) | _nearest(rows.t_s, trace.outcome)
    scaled = np.hstack([signals[name] / TOLERANCE[name] for name in TOLERANCE])
    kept = keep_rows(rows.t_s, scaled, forced)
    packed = {name: _integers(signals[name][kept], SCALE[name]) for name in TOLERANCE}
    # seeds are text: a browser's numbers are exact to 2^53 only
    return {
        "spec": {**spec.model_dump(mode="json"), "seed": str(spec.seed), "stream": str(spec.stream)},
        "outcome": _result(world, trace, reward),
        "t": _integers(rows.t_s[kept][:, None], SCALE["t"])[0],
        **packed,
        "feet": _foot_events(world, rows),
        "phases": _phase_events(world, rows),
        "cues": _cue_changes(rows, trace.outcome),
    }


def keep_rows(t_s: FloatArray, values: FloatArray, forced: npt.NDArray[np.bool_]) -> IntArray:
    """Rows that suffice for linear interpolation to be within 1 of all values.

    Args:
        t_s: Time of each row, increasing, shape (n,).
        values: Signals over their tolerances, shape (n, k).
        forced: Rows that are kept in any case, shape (n,); the first and the last always are.

    Returns:
        Indices of the rows to keep, increasing.
    """
    keep = forced.copy()
    keep[[0, -1]] = True
    corners = np.flatnonzero(keep)
    pending = list(zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True))
    while pending:
        first, last = pending.pop()
        if last - first < 2:
            continue
        inner = slice(first + 1, last)
        share = ((t_s[inner] - t_s[first]) / (t_s[last] - t_s[first]))[:, None]
        straight = values[first] + share * (values[last] - values[first])
        error = np.abs(values[inner] - straight).max(axis=1)
        worst = int(np.argmax(error))
        if error[worst] > 1:
            middle = first + 1 + worst
            keep[middle] = True
            pending += [(first, middle), (middle, last)]
    return np.flatnonzero(keep)


def _window(world: World, trace: Trace) -> Any:
    """Rows from shortly before the trigger (no-go, or closest approach) until the swing has had its time."""
    rows, result = trace.rows, trace.outcome
    closest_s = float(rows.t_s[int(np.argmin(rows.d_ceil_m))])
    trigger_s = float(result.t_trigger_s) if np.isfinite(result.t_trigger_s) else closest_s
    if result.no_go:
        trigger_s = world.called_off_s(trace)
    touch_s = float(result.t_impact_s) if np.isfinite(result.t_impact_s) else closest_s
    inside = (rows.t_s >= trigger_s - BEFORE_TRIGGER_S) & (rows.t_s <= touch_s + AFTER_CONTACT_S)
    return rows[inside]


def _signals(world: World, rows: Any) -> dict[str, FloatArray]:
    """What moves, each of shape (n, columns): position and attitude in S, feet in body axes, pitch."""
    feet_W = rows.foot_W_m.reshape(-1, 4, 3) - rows.p_WB_m[:, None, :]
    feet_B = np.einsum("jin,nlj->nli", rotation(rows.q_WB.T), feet_W)
    feet_B = _held_while_stuck(feet_B, rows["foot_state"] == STUCK)
    return {
        "p": world.surface.seen(rows.p_WB_m, rows.t_s),
        "q": _continuous(world.surface.turned(rows.q_WB)),
        "f": feet_B.reshape(len(rows), 12),
        "pitch": rows.pitch_deg[:, None],
    }


def _held_while_stuck(feet_B: FloatArray, stuck: npt.NDArray[np.bool_]) -> FloatArray:
    """Feet as they are in the row in which they stick, for as long as they do: the page has their place by then."""
    goes_on = np.vstack([np.zeros((1, 4), dtype=np.bool_), stuck[1:] & stuck[:-1]])
    own_row = np.where(goes_on, 0, np.arange(len(stuck))[:, None])
    return np.asarray(feet_B[np.maximum.accumulate(own_row, axis=0), np.arange(4)])


def _continuous(q: FloatArray) -> FloatArray:
    """The same attitudes without jumps between q and -q, which interpolation would cross."""
    flips = np.concatenate([[1.0], np.where(np.sum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0)])
    return np.asarray(q * np.cumprod(flips)[:, None])


def _changes(column: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    """True in the last row before a change and in the first one after it."""
    changed = np.any(np.diff(column.reshape(len(column), -1), axis=0) != 0, axis=1)
    return np.asarray(np.append(changed, False) | np.append(False, changed))


def _nearest(t_s: FloatArray, result: Any) -> npt.NDArray[np.bool_]:
    marks = np.zeros(len(t_s), dtype=np.bool_)
    for time_s in (result.t_trigger_s, result.t_impact_s):
        if np.isfinite(time_s):
            marks[int(np.argmin(np.abs(t_s - time_s)))] = True
    return marks


def _integers(values: FloatArray, unit: Any) -> list[list[int]]:
    """Each column as whole multiples of `unit`: the first value, then differences."""
    whole = np.rint(values / unit).astype(np.int64)
    return [np.diff(column, prepend=0).tolist() for column in whole.T]


def _foot_events(world: World, rows: Any) -> list[list[float]]:
    """[time, foot 0..3, state, x, y, z] of each change of a foot; the place is in S."""
    places = np.round(world.surface.seen(rows.foot_W_m.reshape(-1, 4, 3), rows.t_s[:, None]), 4)
    state = rows["foot_state"]
    before = np.vstack([np.zeros((1, 4), dtype=state.dtype), state[:-1]])
    return [
        [round(float(rows.t_s[i]), 4), int(foot), int(state[i, foot]), *places[i, foot].tolist()]
        for i, foot in zip(*np.nonzero(state != before), strict=True)
    ]


def _phase_events(world: World, rows: Any) -> list[list[Any]]:
    phase = rows.phase
    begins = np.flatnonzero(np.append(True, phase[1:] != phase[:-1]))
    return [[round(float(rows.t_s[i]), 4), world.phase_name(int(phase[i]))] for i in begins]


def _cue_changes(rows: Any, result: Any) -> list[list[int]]:
    """Columns time, distance, RREV, OF_y as the flight core sees them, at each new sample until the first contact."""
    until_s = result.t_impact_s if np.isfinite(result.t_impact_s) else np.inf
    cues = np.column_stack([rows.t_s, rows.d_sensed_m, rows.rrev_per_s, rows.of_y_radps])[rows.t_s <= until_s]
    new = np.append(True, np.any(np.diff(cues[:, 1:], axis=0) != 0, axis=1))
    return _integers(cues[new], np.array(SCALE["cues"]))


def _result(world: World, trace: Trace, reward: RewardChoice) -> dict[str, Any]:
    """The outcome rounded for reading, with what it amounts to: `reward` is the return, `terms` what it is made of."""
    record = trace.outcome
    plain = outcome.as_dict(record, world.end_reason(record.end_reason))
    result = {k: float(f"{v:.5g}") if isinstance(v, float) else v for k, v in plain.items()}
    result["verdict"] = outcome.verdict(record)
    result["t_no_go_s"] = world.called_off_s(trace) if record.no_go else None
    batch = np.array([record], dtype=native.library().outcome_dtype)
    result["four_leg"] = bool(outcome.four_leg(batch)[0])
    result["clean"] = bool(outcome.clean(batch)[0])
    terms = {name: float(f"{float(value[0]):.5g}") for name, value in reward.score(batch).items()}
    result["reward"], result["terms"] = terms.pop(TOTAL), terms
    return result
