"""The study's experiment logs of 2021: one CSV for many rollouts, 100 rows a second.

A rollout is a block of rows with the same (k_ep, k_run). Each attempt at it ends with a summary row (the one with a
policy), which also holds the return, the approach velocity in vx, vy, vz, what the return was made of in flip_flag,
and in Error what went wrong. Rows "Flip Data" and "Impact Data" are snapshots that repeat what the samples say.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl.errors import ConfigError
from ivl.flight import table as border
from ivl.flight.log import ALL, GAP_S, Format, Given, Log, fresh_only, frozen_from, with_rules
from ivl.flight.store import Flight, FloatArray, make_flight
from ivl.flight.table import IntArray, Rule, Table, rules

_GRAM_N = 9.81e-3
"""Newton per gram-force in the authors' code."""
_MOMENT = 4 * 0.04 * math.sqrt(0.5) * _GRAM_N
"""N m per unit of Mx and My, which are gram-force added to each motor, at a lever of 40 mm cos 45 degrees."""
_PERIOD_S = 0.01
_N_SAMPLES_MIN, _CLIMB_MPS, _RREV_PER_S = 10, 0.7, 0.01
_REWARD_PER_M = 10 / 2.10
"""Return per metre of the highest point; the rest of the return is for the feet."""
_FEET_BY_REWARD = ((75.0, 4), (15.0, 2), (5.0, 1))
"""Smallest return for the feet, and the feet that it stands for; none below."""
_STATE = ("x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz")
_NEEDED = ("k_ep", "k_run", "policy", "reward", "flip_flag", "t", *_STATE)
_RULES = (
    *rules("p", "xyz", "m", "{}", needed=True),
    *rules("v", "xyz", "mps", "v{}", needed=True),
    *rules("q", "xyzw", "", "q{}", needed=True),
    *rules("w", "xyz", "radps", "w{}", needed=True),
    *rules("track_p", "xyz", "m", "{}_Raw"),
    *rules("track_q", "xyzw", "", "q{}_Raw"),
    *rules("set_p", "xyz", "m", "x_d.{}"),
    *rules("set_v", "xyz", "mps", "v_d.{}"),
    Rule("rrev_per_s", "RREV"),
    Rule("of_x_radps", "OF_x", -1.0),
    Rule("of_y_radps", "OF_y", -1.0),
    Rule("thrust_cmd_N", "F_thrust", 4 * _GRAM_N),
    *rules("moment_cmd", "xy", "Nm", "M{}", _MOMENT),
    Rule("battery_V", "Volts"),
)
_FRAMES = (
    "World: z up, as logged. Body: x forward, y left, z up: the logged rates equal the turning of the logged attitude "
    "on all three axes, and positive My speeds up wy, so nose-up is negative about y. OF_x and OF_y change sign, since "
    "the log has +v/d. F_thrust, Mx and My are gram-force per motor: four times that in newton is the thrust, and with "
    "the lever of 28.3 mm the moment; in the flip the authors command twice the policy's moment and no thrust, since "
    "the rear motors cannot push down, so that the policy's moment is left. Quaternions are scaled to length 1."
)
_CLOCK = (
    "Column t, from the first sample of each attempt on, one row every 10 ms. The vehicle's columns repeat where no "
    "new packet had come. Tracked poses that repeat the one before are left out."
)
_ABSENT = {
    "f_x_mps2": "not logged", "f_y_mps2": "not logged", "f_z_mps2": "not logged",
    "d_ceil_m": "not logged; h_plane_m - p_z_m",
    "moment_cmd_z_Nm": "Mz is logged as gram-force per motor, and the lever of yaw is not known",
}  # fmt: skip
_NOTES = (
    "The vehicle sent numbers of 16 bits: rates, RREV and optical flow end at 32.767 and mean 'at least' there.",
    "The tracking loses the vehicle in most flips, and confuses two attitudes in single frames: smooth track_q or "
    "leave it.",
    "n_legs is read from the return, less 10 / 2.1 per metre of height: 100 or 150 is 4 (three or four feet), 25 or 50 "
    "is 2 (one or two). It is the judgement of the people who flew.",
)


@dataclass(frozen=True)
class _Attempt:
    """Rows of one attempt.

    Attributes:
        key: k_ep and k_run, as text.
        number: From 1 on within the rollout.
        last: No other attempt follows.
        rows: Its samples.
        summary: Its row in the table of summaries, None: it has none.
        snapshot: Its row in the table of what the vehicle latched at the trigger, None: it has none.
    """

    key: tuple[str, str]
    number: int
    last: bool
    rows: IntArray
    summary: int | None
    snapshot: int | None


def load(paths: Sequence[Path], given: Given) -> Log:
    """Read logs of the study, one after the other."""
    flights: list[Flight] = []
    notes = list(_NOTES)
    for path in paths:
        flights += _read(path, given, notes)
    return Log(flights, paths, _FRAMES, _CLOCK, _ABSENT, notes)


FORMAT = Format("habas2021", "the study's CSV of 2021: many rollouts in one file, 100 Hz", load)


def _read(path: Path, given: Given, notes: list[str]) -> list[Flight]:
    (samples, *others), order = _tables(path)
    t_s = samples.numbers("t", needed=True)
    if len(t_s) > 1 and (t_s == t_s[0]).all():
        t_s = np.arange(len(t_s), dtype=np.float64) * _PERIOD_S
        samples = Table(path, {**samples.columns, "t": t_s}, samples.places)
        notes.append(f"{path.name}: the clock of the log stands still; its rows are taken to be 10 ms apart.")
    attempts = [a for a in _attempts(samples, others, order, t_s) if a.last or given.attempts == ALL]
    h_plane_m = _plane(samples) if "RREV" in samples.columns else float("nan")
    return [_flight(attempt, samples, others, h_plane_m, given) for attempt in attempts]


def _tables(path: Path) -> tuple[list[Table], list[tuple[int, int]]]:
    """Samples, summaries and snapshots, and the order in which they stand: (number of the table, row)."""
    rows = [(line, row) for line, row in border.read_rows(path) if any(row) and not _is_note(row)]
    if not rows:
        raise ConfigError(f"{path}: is empty")
    names = border.header_of(path, rows[0])
    Table(path, dict.fromkeys(names, ()), np.zeros(0, dtype=np.intp)).need(_NEEDED, "format habas2021")
    where = names.index("policy")
    parts: list[list[tuple[int, list[str]]]] = [[], [], []]
    order = []
    for line, row in rows[1:]:
        if "Impact Data" in row:
            continue
        kind = 2 if "Flip Data" in row else int(len(row) == len(names) and row[where] != "")
        order.append((kind, len(parts[kind])))
        parts[kind].append((line, row))
    tables = [border.make_table(path, names, parts[0])]
    tables += [border.make_table(path, names, part) if part else tables[0].take(slice(0)) for part in parts[1:]]
    return tables, order


def _is_note(row: list[str]) -> bool:
    return row[0] in ("EXP", "SIM") and len(row) > 1 and row[1].startswith("Note")


def _attempts(samples: Table, others: list[Table], order: list[tuple[int, int]], t_s: FloatArray) -> list[_Attempt]:
    """Attempts in the order flown: one ends with its summary, with another rollout, or with a jump of the clock."""
    keys = [_keys(table) for table in (samples, *others)]
    pieces: list[tuple[tuple[str, str], list[int], int | None, int | None]] = []
    is_open = False
    for kind, i in order:
        key = keys[kind][i]
        goes_on = is_open and pieces[-1][0] == key
        if kind == 0:
            if not goes_on or abs(t_s[i] - t_s[i - 1]) > GAP_S:
                pieces.append((key, [], None, None))
            pieces[-1][1].append(i)
        elif kind == 1:
            pieces.append((key, pieces.pop()[1] if goes_on else [], i, None))
        elif pieces and pieces[-1][0] == key:
            pieces.append((*pieces.pop()[:3], i))
        is_open = kind == 0
    total, seen = Counter(key for key, *_ in pieces), Counter[tuple[str, str]]()
    result = []
    for key, rows, summary, snapshot in pieces:
        seen[key] += 1
        last = seen[key] == total[key]
        result.append(_Attempt(key, seen[key], last, np.array(rows, dtype=np.intp), summary, snapshot))
    return [attempt for attempt in result if len(attempt.rows)]


def _keys(table: Table) -> list[tuple[str, str]]:
    """k_ep and k_run of each row."""
    for name in ("k_ep", "k_run"):
        for row, cell in enumerate(table.text(name)):
            if not (cell.isascii() and cell.isdigit()):
                raise table.fault(row, name, f"value '{border.shorten(cell)}' is no whole number")
    return list(zip(table.text("k_ep"), table.text("k_run"), strict=True))


def _plane(samples: Table) -> float:
    """Height for which the vehicle computed RREV = v_z / d, m; NaN if too few samples tell."""
    z, vz, rrev = (samples.numbers(name) for name in ("z", "vz", "RREV"))
    before = np.array([flag == "False" for flag in samples.text("flip_flag")])
    telling = (vz > _CLIMB_MPS) & (rrev > _RREV_PER_S) & before
    if telling.sum() < _N_SAMPLES_MIN:
        return float("nan")
    return round(float(np.median(z[telling] + vz[telling] / rrev[telling])), 3)


def _flight(attempt: _Attempt, samples: Table, others: list[Table], h_plane_m: float, given: Given) -> Flight:
    part = samples.take(attempt.rows[_n_empty(samples, attempt.rows) :])
    t_s = border.clock(part, "t", 1.0)
    columns = border.samples(part, with_rules(_RULES, given, part))
    fresh_only(columns)
    info: dict[str, Any] = {"label": "ep{}-run{}".format(*attempt.key), "source": part.path.name}
    info["h_plane_m"] = h_plane_m
    if not (attempt.last and attempt.number == 1) and given.attempts == ALL:
        info["label"] += f"-try{attempt.number}"
    triggered, by_command = _triggered(part, columns)
    columns["triggered"] = triggered.astype(np.float64)
    first = int(np.argmax(triggered)) if triggered.any() else None
    if first is not None:
        info["t_trigger_s"] = t_s[first] - t_s[0]
        info["trigger_age_s"] = _trigger_age(columns["p_z_m"], t_s, first, others[1], attempt.snapshot)
    notes = ["flip_flag never set: trigger and moment read from the commands"] if by_command else []
    info |= _asked(columns, first, by_command)
    if attempt.summary is not None:
        info |= _summary(others[0], attempt.summary, notes)
    else:
        notes.append("no summary row: outcome not known")
    flight = make_flight(info, {"t_s": t_s - t_s[0], **columns})
    return _judge(flight, notes)


def _trigger_age(height_m: FloatArray, t_s: FloatArray, first: int, snapshots: Table, row: int | None) -> float:
    """How long before sample `first` the vehicle triggered: when it was at the height that its snapshot holds.

    A row tells what came within the 10 ms before it, so half of that is added.
    """
    back = slice(max(first - 4, 0), first + 1)
    near = height_m[back]
    if row is None or "z" not in snapshots.columns or (np.diff(near) < 0).any():
        return _PERIOD_S / 2
    latched_m = float(snapshots.take(np.array([row])).numbers("z")[0])
    if not near[0] <= latched_m <= near[-1]:
        return _PERIOD_S / 2
    return float(t_s[first] - np.interp(latched_m, near, t_s[back])) + _PERIOD_S / 2


def _n_empty(samples: Table, rows: IntArray) -> int:
    """Number of rows at the beginning that were written before the vehicle had sent its first packet."""
    part = samples.take(rows[:-1])
    empty = [(part.numbers(name) == (name == "qw")).astype(bool) for name in _STATE if name in part.columns]
    return int(np.argmin([*np.all(empty, axis=0), False]))


def _triggered(part: Table, columns: dict[str, FloatArray]) -> tuple[npt.NDArray[np.bool_], bool]:
    """From the trigger on; and whether that had to be read from the commands."""
    flags = part.text("flip_flag")
    for row, flag in enumerate(flags):
        if flag not in ("True", "False"):
            raise part.fault(row, "flip_flag", f"value '{border.shorten(flag)}' is neither True nor False")
    triggered = np.logical_or.accumulate(np.array([flag == "True" for flag in flags]))
    if triggered.any() or not {"thrust_cmd_N", "moment_cmd_y_Nm"} <= set(columns):
        return triggered, False
    turning = (columns["thrust_cmd_N"] == 0) & (columns["moment_cmd_y_Nm"] < 0)
    return np.logical_or.accumulate(turning), bool(turning.any())


def _asked(columns: dict[str, FloatArray], first: int | None, by_command: bool) -> dict[str, float]:
    """Policy and approach, as far as the samples tell; half of the commanded moment is that of the policy."""
    result = {}
    if by_command and first is not None:
        result["moment_Nmm"] = -500 * float(columns["moment_cmd_y_Nm"][first])
    if all(f"set_v_{axis}_mps" in columns for axis in "xyz"):
        row = first if first is not None else -1
        result |= _approach([float(columns[f"set_v_{axis}_mps"][row]) for axis in "xyz"])
    return result


def _approach(v_mps: Sequence[float]) -> dict[str, float]:
    speed_mps = math.hypot(*v_mps)
    angle_deg = math.degrees(math.atan2(v_mps[2], math.hypot(v_mps[0], v_mps[1]))) if speed_mps else float("nan")
    return {"speed_mps": speed_mps, "angle_deg": angle_deg}


def _summary(summaries: Table, row: int, notes: list[str]) -> dict[str, Any]:
    """What a summary row says."""
    one = summaries.take(np.array([row]))
    policy = _numbers(one, "policy")
    if len(policy) < 2:
        text = border.shorten(one.text("policy")[0])
        raise one.fault(0, "policy", f"value '{text}': expected [RREV_c M_yd]")
    info: dict[str, Any] = {"threshold_per_s": policy[0], "moment_Nmm": policy[1]}
    v_mps = [float(one.numbers(name)[0]) for name in ("vx", "vy", "vz")]
    if np.isfinite(v_mps).all():
        info |= _approach(v_mps)
    reward = float(one.numbers("reward")[0])
    z_max_m = ([*_numbers(one, "flip_flag"), float("nan")])[0]
    feet = reward - _REWARD_PER_M * z_max_m
    if np.isfinite(feet):
        n_legs = next((n for least, n in _FEET_BY_REWARD if feet >= least), 0)
        info |= {"reward": reward, "n_legs": n_legs, "judged_by": f"reward {abs(round(feet))}"}
    error = one.text("Error")[0] if "Error" in one.columns else ""
    if error and not error.startswith("Rollout Completed"):
        info["usable"] = False
        notes.append(f"the log says: {error}")
    return info


def _numbers(one: Table, name: str) -> list[float]:
    """A list as numpy prints it: "[3.72 6.05 0.  ]"."""
    text = one.text(name)[0]
    try:
        values = [float(word) for word in text.strip("[]").split()]
    except ValueError:
        values = [math.inf]
    if any(math.isinf(value) for value in values):
        raise one.fault(0, name, f"value '{border.shorten(text)}' is no list of numbers")
    return values


def _judge(flight: Flight, notes: list[str]) -> Flight:
    """Not usable: too short, or the vehicle's state stopped in the log while the vehicle moved."""
    info = dict(flight.info)
    if len(flight) < _N_SAMPLES_MIN:
        notes.append(f"no more than {len(flight)} sample{'s' if len(flight) > 1 else ''}")
    stop_s = frozen_from(flight)
    if stop_s is not None:
        notes.append(f"the vehicle's state stands still from {stop_s:.2f} s on, while the tracking sees it move")
    info["usable"] &= len(flight) >= _N_SAMPLES_MIN and stop_s is None
    info["note"] = "; ".join(notes)
    return Flight(info, flight.samples)
