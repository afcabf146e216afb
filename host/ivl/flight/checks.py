"""Do the columns of a log fit each other? Rates against the turning of the attitude, velocity against the motion.

A wrong sign, a wrong unit or exchanged axes show here whatever the log's documentation says.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ivl.flight.store import Flight, FloatArray

_Pair = Callable[[Flight], tuple[FloatArray, FloatArray] | None]
_AFTER_TRIGGER_S, _STEP_S_MAX = 0.2, 0.11
_N_MIN, _LOW, _HIGH, _SURE = 50, 0.5, 2.0, 0.5
_SCATTER_MIN = 0.1
"""Least scatter that tells something, rad/s, m/s or m."""


def notes(flights: Sequence[Flight]) -> list[str]:
    """One sentence for each pair of quantities: on which axes they agree, and where they do not."""
    return [
        *_compare(flights, _rates, "about", "the rates", "the turning of the attitude"),
        *_compare(flights, _velocity, "along", "the velocities", "the motion of the position"),
        *_compare(flights, _tracked, "along", "the estimated positions", "the tracked ones"),
    ]


def _compare(flights: Sequence[Flight], pair: _Pair, way: str, what: str, against: str) -> Iterator[str]:
    parts = [both for flight in flights if (both := pair(flight)) is not None]
    if not parts:
        return
    left, right = (np.concatenate(side) for side in zip(*parts, strict=True))
    good: list[str] = []
    bad: list[str] = []
    for i, axis in enumerate("xyz"):
        slope = _slope(left[:, i], right[:, i])
        if np.isfinite(slope):
            (good if _LOW <= slope <= _HIGH else bad).append(f"{slope:.2f} {way} {axis}")
    if good:
        yield f"Checked: {what} fit {against} (slope {', '.join(good)})."
    if bad:
        yield f"WARNING: {what} do not fit {against} (slope {', '.join(bad)}): a sign, a unit or an axis is wrong."


def _slope(left: FloatArray, right: FloatArray) -> float:
    """Slope of the right over the left quantity; NaN if the log does not tell."""
    if len(left) < _N_MIN or left.std() < _SCATTER_MIN or right.std() < _SCATTER_MIN:
        return float("nan")
    if abs(np.corrcoef(left, right)[0, 1]) < _SURE:
        return float("nan")
    return float(left @ right / (left @ left))


def _rows(flight: Flight, names: Sequence[str]) -> FloatArray:
    """Time and these columns where they have something new, up to a little after the trigger."""
    values = np.stack([flight[name] for name in names], axis=1)
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    end_s = flight.info["t_trigger_s"] + _AFTER_TRIGGER_S
    if np.isfinite(end_s):
        rows = rows[flight["t_s"][rows] <= end_s]
    again = np.flatnonzero((values[rows][1:] == values[rows][:-1]).all(axis=1)) + 1
    rows = np.delete(rows, again)
    return np.concatenate([flight["t_s"][rows, None], values[rows]], axis=1)


def _rates(flight: Flight) -> tuple[FloatArray, FloatArray] | None:
    names = [*(f"w_{axis}_radps" for axis in "xyz"), *(f"q_{axis}" for axis in "xyzw")]
    if not flight.has(*names):
        return None
    rows = _rows(flight, names)
    dt_s = np.diff(rows[:, 0])
    near = dt_s <= _STEP_S_MAX
    q = rows[:, 4:]
    return _middle(rows[:, 1:4])[near], _turn(q[:-1], q[1:])[near] / dt_s[near, None]


def _velocity(flight: Flight) -> tuple[FloatArray, FloatArray] | None:
    names = [*(f"v_{axis}_mps" for axis in "xyz"), *(f"p_{axis}_m" for axis in "xyz")]
    if not flight.has(*names):
        return None
    rows = _rows(flight, names)
    dt_s = np.diff(rows[:, 0])
    near = dt_s <= _STEP_S_MAX
    return _middle(rows[:, 1:4])[near], np.diff(rows[:, 4:], axis=0)[near] / dt_s[near, None]


def _tracked(flight: Flight) -> tuple[FloatArray, FloatArray] | None:
    names = [*(f"p_{axis}_m" for axis in "xyz"), *(f"track_p_{axis}_m" for axis in "xyz")]
    if not flight.has(*names):
        return None
    rows = _rows(flight, names)
    middle = np.median(rows[:, 1:4], axis=0) if len(rows) else np.zeros(3)
    return rows[:, 1:4] - middle, rows[:, 4:] - middle


def _middle(values: FloatArray) -> FloatArray:
    return (values[1:] + values[:-1]) / 2


def _turn(before: FloatArray, after: FloatArray) -> FloatArray:
    """Rotation vectors in body axes that lead from one attitude to the next; quaternions x, y, z, w in rows."""
    u, s = before[:, :3], before[:, 3:]
    v, t = after[:, :3], after[:, 3:]
    vector = s * v - t * u - np.cross(u, v)
    scalar = (u * v).sum(axis=1) + (s * t)[:, 0]
    vector = np.where(scalar[:, None] < 0, -vector, vector)
    size = np.linalg.norm(vector, axis=1)
    angle = 2 * np.arctan2(size, np.abs(scalar))
    return np.asarray(vector * (angle / np.maximum(size, 1e-12))[:, None])
