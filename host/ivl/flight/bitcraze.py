"""Log variables of the Crazyflie's firmware, and of this project's app on it, as columns of the schema.

Signs and units are those of the firmware: degrees and g; roll, pitch and yaw with the pitch positive nose up, which is
the opposite of a turn about body y; gyro, quaternion and velocity with the usual signs; `stateEstimateZ` in
millimetres and milliradians, with the legacy sign of its pitch rate; motors from 0 to 65535.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ivl import forms
from ivl.flight import streams
from ivl.flight.log import Given, frozen_from
from ivl.flight.phases import plane, trigger
from ivl.flight.store import Flight, FloatArray, make_flight
from ivl.flight.streams import Merged, Stream
from ivl.flight.table import LIMITS, Rule, Table, rules

_G_MPS2, _PWM_MAX, _RPM = 9.80665, 65535.0, 2 * math.pi / 60
_DEG = math.pi / 180
_QUATERNION_BITS, _QUATERNION_MAX = 9, 2.0**32 - 1

_GROUPS: tuple[Sequence[Rule], ...] = (
    rules("p", "xyz", "m", "stateEstimate.{}"),
    rules("p", "xyz", "m", "stateEstimateZ.{}", 1e-3),
    [Rule(f"p_{axis}_m", f"kalman.state{axis.upper()}") for axis in "xyz"],
    rules("v", "xyz", "mps", "stateEstimate.v{}"),
    rules("v", "xyz", "mps", "stateEstimateZ.v{}", 1e-3),
    rules("q", "xyzw", "", "stateEstimate.q{}"),
    [Rule(f"q_{axis}", f"kalman.q{i}") for i, axis in enumerate("wxyz")],
    rules("w", "xyz", "radps", "gyro.{}", _DEG),
    [
        Rule("w_x_radps", "stateEstimateZ.rateRoll", 1e-3),
        Rule("w_y_radps", "stateEstimateZ.ratePitch", -1e-3),
        Rule("w_z_radps", "stateEstimateZ.rateYaw", 1e-3),
    ],
    rules("f", "xyz", "mps2", "acc.{}", _G_MPS2),
    rules("track_p", "xyz", "m", "locSrv.{}"),
    rules("track_q", "xyzw", "", "locSrv.q{}"),
    rules("track_p", "xyz", "m", "lighthouse.{}"),
    [Rule(f"track_p_{axis}_m", f"ext_pos.{axis.upper()}") for axis in "xyz"],
    rules("set_p", "xyz", "m", "ctrltarget.{}"),
    rules("set_p", "xyz", "m", "ctrltargetZ.{}", 1e-3),
    rules("set_v", "xyz", "mps", "ctrltarget.v{}"),
    rules("set_v", "xyz", "mps", "ctrltargetZ.v{}", 1e-3),
    [Rule("phase", "ivl.phase")],
    [Rule("d_ceil_m", "ivl.d_ceil", nothing=0.0)],
    [Rule("rrev_per_s", "ivl.rrev", nothing=0.0)],
    [Rule("of_y_radps", "ivl.of_y", nothing=0.0)],
    [Rule("thrust_cmd_N", "ivl.thrust_total")],
    [Rule("moment_cmd_y_Nm", "ivl.pitch_moment")],
    rules("thrust", "1234", "N", "ivl.thrust{}"),
    rules("pwm", "1234", "norm", "motor.m{}", 1 / _PWM_MAX),
    rules("pwm", "1234", "norm", "ivl.pwm{}", 1 / _PWM_MAX),
    [Rule(f"rotor_{i}_radps", f"motor.m{i}_rpm", _RPM, nothing=_PWM_MAX) for i in range(1, 5)],
    rules("rotor", "1234", "radps", "rpm.m{}", _RPM),
    [Rule("battery_V", "pm.vbat")],
    [Rule("battery_V", "pm.vbatMV", 1e-3)],
)
"""What the firmware logs twice stands here in the order of preference."""
_POLICY = ("threshold_per_s", "moment_Nmm")
_FACTS = ("ivl.theta0", "ivl.theta1", "ivl.policy_form", "ivl.policy_seq", "ivl.n_trigger", "ivl.trg_seq")
"""Variables of the app that are no samples, but tell what was flown."""
FRAMES = (
    "World and body as the firmware has them: world z up, x taken to be along the approach; body x forward, y left, z "
    "up; quaternion body to world. gyro in deg/s and acc in g as they are. Where only roll, pitch and yaw are logged, "
    "the attitude is made of them with the pitch turned round, since the firmware counts it positive nose up; so is "
    "the pitch rate of stateEstimateZ. Motors 1 to 4: front right, rear right, rear left, front left."
)
NOTES = ("Where the app says 0 for a distance, RREV or flow that it has not, nothing is stored.",)


def stream(name: str, table: Table, t_s: FloatArray, given: Given) -> Stream:
    """What one log block or event has (arguments and errors as `streams.make`)."""
    made = streams.make(name, table, t_s, _GROUPS, given)
    columns = dict(made.columns)
    if not any(column.startswith("q_") for column in columns):
        columns |= _attitude(table)
    columns |= {fact: table.numbers(fact) for fact in _FACTS if fact in table.columns}
    return replace(made, columns=columns)


def _attitude(table: Table) -> dict[str, FloatArray]:
    """The quaternion, from the compressed one or from the firmware's angles."""
    if "stateEstimateZ.quat" in table.columns:
        return _decompressed(table, "stateEstimateZ.quat")
    for group in ("stateEstimate", "stabilizer"):
        names = [f"{group}.{angle}" for angle in ("roll", "pitch", "yaw")]
        if all(name in table.columns for name in names):
            return _of_angles(*(_angle(table, name) for name in names))
    return {}


def _angle(table: Table, name: str) -> FloatArray:
    values = table.numbers(name) * _DEG
    huge = np.abs(values) > LIMITS["1"]
    if huge.any():
        raise table.fault(int(np.argmax(huge)), name, "an angle beyond all reason")
    return values


def _of_angles(roll: FloatArray, pitch_up: FloatArray, yaw: FloatArray) -> dict[str, FloatArray]:
    """Yaw, then pitch, then roll, in radians; a nose-up pitch is a negative turn about body y."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a / 2), np.sin(a / 2)) for a in (roll, -pitch_up, yaw))
    return {
        "q_x": sr * cp * cy - cr * sp * sy,
        "q_y": cr * sp * cy + sr * cp * sy,
        "q_z": cr * cp * sy - sr * sp * cy,
        "q_w": cr * cp * cy + sr * sp * sy,
    }


def _decompressed(table: Table, name: str) -> dict[str, FloatArray]:
    """32 bits: which component is the largest, then sign and 9 bits of each other one, in units of 0.7071 / 511."""
    values = table.numbers(name, needed=True)
    bad = (values < 0) | (values > _QUATERNION_MAX) | (values != np.floor(values))
    if bad.any():
        raise table.fault(int(np.argmax(bad)), name, "is no quaternion of 32 bits")
    bits = values.astype(np.uint64)
    largest = (bits >> np.uint64(30)).astype(np.intp)
    q = np.zeros((4, len(bits)))
    one, mask = np.uint64(1), np.uint64((1 << _QUATERNION_BITS) - 1)
    for axis in (3, 2, 1, 0):
        sent = largest != axis
        size = (bits & mask).astype(np.float64) * (math.sqrt(0.5) / float(mask))
        sign = np.where((bits >> np.uint64(_QUATERNION_BITS)) & one, -1.0, 1.0)
        q[axis] = np.where(sent, sign * size, 0.0)
        bits = np.where(sent, bits >> np.uint64(_QUATERNION_BITS + 1), bits)
    rest = 1.0 - (q**2).sum(axis=0)
    if (rest < 0).any():
        raise table.fault(int(np.argmax(rest < 0)), name, "is no quaternion: its components are too large")
    q[largest, np.arange(len(values))] = np.sqrt(rest)
    return {f"q_{axis}": q[i] for i, axis in enumerate("xyzw")}


def by_folder(
    paths: Sequence[Path], suffixes: Sequence[str], stream_of: Callable[[Path, Given], Stream], given: Given
) -> tuple[list[Flight], list[Path], str]:
    """The flights, the files, and what their clocks are; files of one folder are parts of one recording."""
    folders: dict[Path, list[Path]] = {}
    for path in paths:
        for file in streams.files_of(path, suffixes):
            folders.setdefault(file.parent, []).append(file)
    result: list[Flight] = []
    clocks: dict[str, None] = {}
    for folder, files in folders.items():
        where = str(files[0] if len(files) == 1 else folder)
        found = streams.known([stream_of(file, given) for file in files], given, where)
        for recording in streams.recordings(found):
            members, clock = flights(recording)
            result += members
            clocks[clock] = None
    return result, [file for files in folders.values() for file in files], " | ".join(clocks)


def flights(members: Sequence[Stream]) -> tuple[list[Flight], str]:
    """The flights of one recording, and what its clock is."""
    merged = streams.merge(members)
    return [_flight(merged, rows) for rows in streams.flights(merged)], merged.clock


def _flight(merged: Merged, rows: Any) -> Flight:
    t_s = merged.t_s[rows]
    columns = {name: values[rows] for name, values in merged.columns.items()}
    facts = {name: columns.pop(name) for name in _FACTS if name in columns}
    first = _trigger(columns, facts)
    info: dict[str, Any] = {"label": merged.sources[rows[0]].stem, "source": merged.sources[rows[0]].name}
    if first is not None:
        info["t_trigger_s"] = t_s[first] - t_s[0]
    if "p_z_m" in columns and "d_ceil_m" in columns:
        info["h_plane_m"] = plane(columns["p_z_m"] + columns["d_ceil_m"])
    at = len(t_s) - 1 if first is None else first
    paper = forms.by_name(forms.PAPER)
    if float(facts.get("ivl.policy_form", np.zeros(len(t_s)))[at]) == paper.number:
        for name, log, parameter in zip(_POLICY, ("ivl.theta0", "ivl.theta1"), paper.params, strict=True):
            if log in facts:
                info[name] = float(facts[log][at]) / parameter.si
    flight = make_flight(info, {"t_s": t_s - t_s[0], **columns})
    stop_s = frozen_from(flight)
    if stop_s is None:
        return flight
    note = f"the vehicle's state stands still from {stop_s:.2f} s on, while the tracking sees it move"
    return Flight({**flight.info, "usable": False, "note": note}, flight.samples)


def _trigger(columns: dict[str, FloatArray], facts: dict[str, FloatArray]) -> int | None:
    """Row of the first sample after the trigger, None if the log tells of none; adds the column `triggered`."""
    if "phase" in columns:
        first, columns["triggered"] = trigger(columns["phase"])
        return first
    for name in ("ivl.n_trigger", "ivl.trg_seq"):
        if name in facts:
            jumps = np.concatenate([[False], np.diff(facts[name]) != 0])
            columns["triggered"] = np.logical_or.accumulate(jumps).astype(np.float64)
            return int(np.argmax(jumps)) if jumps.any() else None
    return None
