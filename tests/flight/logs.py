"""A landing with known truth, and small writers that put it into each kind of log, in its own units and signs.

The formulas here are written from the definitions of the logs and not from the importers.
"""

import csv
import io
import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ivl.links.packets import Recording
from ivl.world import World

G_MPS2 = 9.80665
Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Truth:
    """One flight.

    Attributes:
        columns: Columns of the schema by name, all finite, at 100 Hz.
        threshold_per_s: Policy that was flown.
        moment_Nmm: Policy that was flown.
        speed_mps: Approach speed.
        angle_deg: Approach angle.
        h_plane_m: Height of the plane of the cues.
    """

    columns: Mapping[str, Array]
    threshold_per_s: float = 4.8
    moment_Nmm: float = 8.0
    speed_mps: float = 2.5
    angle_deg: float = 60.0
    h_plane_m: float = 3.0

    def __len__(self) -> int:
        return len(self.columns["t_s"])

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def part(self, rows: slice) -> "Truth":
        """Some of the rows, with the clock of the whole."""
        return Truth({name: values[rows] for name, values in self.columns.items()})

    @property
    def t_trigger_s(self) -> float:
        """Time of the first sample after the trigger, from the first sample on."""
        return float(self["t_s"][np.argmax(self["triggered"])] - self["t_s"][0])


def product(left: Array, right: Array) -> Array:
    """Product of quaternions x, y, z, w in the last axis."""
    u, s, v, t = left[..., :3], left[..., 3:], right[..., :3], right[..., 3:]
    return np.concatenate([s * v + t * u + np.cross(u, v), s * t - (u * v).sum(axis=-1, keepdims=True)], axis=-1)


def turned(q: Array, vectors: Array) -> Array:
    """Vectors turned by quaternions x, y, z, w."""
    u, s = q[..., :3], q[..., 3:]
    return vectors + 2 * np.cross(u, np.cross(u, vectors) + s * vectors)


def about(axis: Sequence[float], angle_rad: float) -> Array:
    """The quaternion of a turn."""
    unit = np.asarray(axis) / np.linalg.norm(axis)
    return np.append(unit * math.sin(angle_rad / 2), math.cos(angle_rad / 2))


def simulated(world: World) -> Truth:
    """A landing in a world frame that is turned about z, and in a body frame that is tilted in the vehicle."""
    rows = world.trace(2.5, 60.0, 4.8, 8.0, period_s=0.01).rows
    n = len(rows)
    yaw, tilt = about((0, 0, 1), 0.4), about((3, 1, 2), 0.3)
    back = tilt * [-1, -1, -1, 1]
    columns: dict[str, Array] = {"t_s": np.arange(n) * 0.01}

    def put(stem: str, axes: str, suffix: str, values: Array) -> None:
        for i, axis in enumerate(axes):
            columns[f"{stem}_{axis}{suffix}"] = np.ascontiguousarray(values[:, i])

    p = np.add(turned(yaw, rows.p_WB_m), (0.11, -0.23, 0.0))
    q = product(product(yaw, rows.q_WB), tilt)
    put("p", "xyz", "_m", p)
    put("v", "xyz", "_mps", np.add(turned(yaw, rows.v_WB_mps), (1e-3, -2e-3, 3e-3)))
    put("q", "xyzw", "", q)
    put("w", "xyz", "_radps", np.add(turned(back, rows.w_B_radps), (1e-3, -2e-3, 3e-3)))
    wave = np.add(np.sin(np.outer(columns["t_s"], [3.1, 4.3, 5.7])), (0.2, 0.3, 9.8))
    put("f", "xyz", "_mps2", wave)
    put("track_p", "xyz", "_m", np.add(p, (0.01, -0.02, 0.03)) + 1e-3 * wave)
    put("track_q", "xyzw", "", product(q, about((1, 2, 3), 0.02)))
    put("set_p", "xyz", "_m", np.add(p, (0.1, 0.2, 0.3)))
    put("set_v", "xyz", "_mps", np.tile([1.25, 0.1, 2.165], (n, 1)))
    columns["d_ceil_m"] = 3.0 - columns["p_z_m"]
    columns["rrev_per_s"] = columns["v_z_mps"] / columns["d_ceil_m"]
    columns["of_x_radps"] = -columns["v_y_mps"] / columns["d_ceil_m"]
    columns["of_y_radps"] = -columns["v_x_mps"] / columns["d_ceil_m"]
    columns["phase"] = rows.phase.astype(np.float64)
    columns["triggered"] = ((rows.phase >= 3) & (rows.phase < 7)).astype(np.float64)
    thrust = rows.thrust_cmd_N * [1.0, 1.01, 1.02, 1.03] + [1e-3, 2e-3, 3e-3, 4e-3]
    put("thrust", "1234", "_N", thrust)
    columns["thrust_cmd_N"] = thrust.sum(axis=1)
    put("moment_cmd", "xyz", "_Nm", np.column_stack([thrust[:, 0], -thrust[:, 1], thrust[:, 2]]) * 0.05)
    put("pwm", "1234", "_norm", np.round(thrust / thrust.max() * 65535) / 65535)
    put("rotor", "1234", "_radps", np.round(1000 + 9000 * thrust / thrust.max()) * 2 * math.pi / 60)
    columns["battery_V"] = 4.1 - 0.2 * columns["t_s"]
    return Truth(columns)


# ---- the study's CSV of 2021

HABAS_HEADER = (
    "k_ep,k_run,alpha_mu,alpha_sig,mu,sigma,policy,t,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz,reward,flip_flag,impact_flag,"
    "n_rollouts,RREV,OF_x,OF_y,F_thrust,Mx,My,Mz,x_d.x,x_d.y,x_d.z,v_d.x,v_d.y,v_d.z,a_d.x,a_d.y,a_d.z,Volts,"
    "x_Ext,y_Ext,z_Ext,Error,x_Raw,y_Raw,z_Raw,qw_Raw,qx_Raw,qy_Raw,qz_Raw"
)
HABAS = next(csv.reader([HABAS_HEADER]))


def habas_rows(
    truth: Truth,
    key: tuple[int, int] = (0, 0),
    reward: float = 110.0,
    z_max_m: float = 2.1,
    error: str = "",
    summary: bool = True,
    start_s: float = 7.0,
) -> list[dict[str, Any]]:
    """One attempt: its samples, summary, snapshots, and a blank line (an empty row)."""  # fmt: skip
    names = {"k_ep": key[0], "k_run": key[1]}
    lever_N = 4 * 0.04 * math.sqrt(0.5)
    gram_N = 9.81e-3
    rows: list[dict[str, Any]] = []
    for i in range(len(truth)):
        c = {name: float(values[i]) for name, values in truth.columns.items()}
        row: dict[str, Any] = {"t": round(c["t_s"] + start_s, 6), "flip_flag": str(bool(c["triggered"]))}
        row |= {axis: c[f"p_{axis}_m"] for axis in "xyz"} | {f"v{axis}": c[f"v_{axis}_mps"] for axis in "xyz"}
        row |= {f"q{axis}": c[f"q_{axis}"] for axis in "xyzw"} | {f"w{axis}": c[f"w_{axis}_radps"] for axis in "xyz"}
        row |= {"RREV": c["rrev_per_s"], "OF_x": -c["of_x_radps"], "OF_y": -c["of_y_radps"]}
        row |= {"F_thrust": c["thrust_cmd_N"] / 4 / gram_N, "Volts": c["battery_V"], "n_rollouts": 8}
        row |= {f"M{axis}": c[f"moment_cmd_{axis}_Nm"] / lever_N / gram_N for axis in "xyz"}
        row |= {f"x_d.{axis}": c[f"set_p_{axis}_m"] for axis in "xyz"}
        row |= {f"v_d.{axis}": c[f"set_v_{axis}_mps"] for axis in "xyz"}
        row |= {f"{axis}_Raw": c[f"track_p_{axis}_m"] for axis in "xyz"}
        row |= {f"q{axis}_Raw": c[f"track_q_{axis}"] for axis in "xyzw"}
        rows.append(names | row)
    if summary:
        policy = f"[{truth.threshold_per_s} {truth.moment_Nmm} 0.  ]"
        up, along = (f(math.radians(truth.angle_deg)) * truth.speed_mps for f in (math.sin, math.cos))
        asked = {
            "vx": along,
            "vy": 0,
            "vz": up,
            "reward": reward,
            "flip_flag": f"[ {z_max_m} -9.5 -12.]",
            "Error": error,
        }
        rows.append(names | {"policy": policy, "mu": "[4.2 5. ]", **asked})
        first = int(np.argmax(truth["triggered"])) or 1
        rows.append(names | {"z": latched_m(truth, first), "Error": "Flip Data"} if len(truth) > 1 else {})
        rows.append(names | {"Error": "Impact Data"})
    return [*rows, {}]


def latched_m(truth: Truth, first: int) -> float:
    """Height at the trigger, which fired in the middle between two samples."""
    return float(truth["p_z_m"][first - 1 : first + 1].mean())


def habas_text(rows: Sequence[Mapping[str, Any]], note: str = "EXP,Note:a test", end: str = "\r\n") -> str:
    """The file: header, note line, rows."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator=end)
    writer.writerow(HABAS)
    if note:
        out.write(note + end)
    for row in rows:
        writer.writerow([row.get(name, "") for name in HABAS] if row else [])
    return out.getvalue()


# ---- this project


def recording_text(truth: Truth) -> str:
    """The flight recorder's table, by the program's own writer."""
    shapes = [("t_s", "f8"), ("p_W_m", "f8", 3), ("v_W_mps", "f8", 3), ("q_WB", "f8", 4), ("w_B_radps", "f8", 3)]
    shapes += [("f_B_mps2", "f8", 3), ("d_ceil_m", "f8"), ("thrust_N", "f8", 4), ("phase", "u1"), ("rule", "u1")]
    rows = np.zeros(len(truth), dtype=shapes)
    rows["t_s"], rows["d_ceil_m"], rows["phase"] = truth["t_s"], truth["d_ceil_m"], truth["phase"]
    for name, stem, axes, unit in (
        ("p_W_m", "p", "xyz", "_m"), ("v_W_mps", "v", "xyz", "_mps"), ("q_WB", "q", "xyzw", ""),
        ("w_B_radps", "w", "xyz", "_radps"), ("f_B_mps2", "f", "xyz", "_mps2"), ("thrust_N", "thrust", "1234", "_N"),
    ):  # fmt: skip
        for i, axis in enumerate(axes):
            rows[name][:, i] = truth[f"{stem}_{axis}{unit}"]
    return Recording(1, 1, 0, None, 100.0, rows).to_csv()


# ---- the Crazyflie's firmware


def euler_deg(truth: Truth) -> tuple[Array, Array, Array]:
    """Roll, pitch and yaw as the firmware has them: pitch positive nose up."""
    x, y, z, w = (truth[f"q_{axis}"] for axis in "xyzw")
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    down = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.degrees(roll), -np.degrees(down), np.degrees(yaw)


def compressed(truth: Truth) -> Array:
    """The quaternion in 32 bits: index of the largest, then the others with sign and 9 bits."""
    result = []
    for attitude in np.stack([truth[f"q_{axis}"] for axis in "xyzw"], axis=1):
        largest = int(np.argmax(np.abs(attitude)))
        q = attitude * np.sign(attitude[largest])
        word = largest
        for i in range(4):
            if i != largest:
                word = word << 10 | (q[i] < 0) << 9 | int(511 * abs(q[i]) / math.sqrt(0.5) + 0.5)
        result.append(word)
    return np.array(result, dtype=np.float64)


def variables(truth: Truth) -> dict[str, Array]:
    """Log variables of firmware and app."""
    c = truth.columns
    roll, pitch, yaw = euler_deg(truth)
    result = {f"stateEstimate.{axis}": c[f"p_{axis}_m"] for axis in "xyz"}
    result |= {f"stateEstimate.v{axis}": c[f"v_{axis}_mps"] for axis in "xyz"}
    result |= {f"stateEstimate.q{axis}": c[f"q_{axis}"] for axis in "xyzw"}
    result |= {f"stateEstimateZ.{axis}": np.trunc(1000 * c[f"p_{axis}_m"]) for axis in "xyz"}
    result |= {f"stateEstimateZ.v{axis}": np.trunc(1000 * c[f"v_{axis}_mps"]) for axis in "xyz"}
    result |= {"stateEstimateZ.quat": compressed(truth)}
    result |= {"stateEstimateZ.rateRoll": np.trunc(1000 * c["w_x_radps"])}
    result |= {"stateEstimateZ.ratePitch": np.trunc(-1000 * c["w_y_radps"])}
    result |= {"stateEstimateZ.rateYaw": np.trunc(1000 * c["w_z_radps"])}
    result |= {"stabilizer.roll": roll, "stabilizer.pitch": pitch, "stabilizer.yaw": yaw}
    result |= {f"gyro.{axis}": np.degrees(c[f"w_{axis}_radps"]) for axis in "xyz"}
    result |= {f"acc.{axis}": c[f"f_{axis}_mps2"] / G_MPS2 for axis in "xyz"}
    result |= {f"locSrv.{axis}": c[f"track_p_{axis}_m"] for axis in "xyz"}
    result |= {f"locSrv.q{axis}": c[f"track_q_{axis}"] for axis in "xyzw"}
    result |= {f"ctrltarget.{axis}": c[f"set_p_{axis}_m"] for axis in "xyz"}
    result |= {f"ctrltarget.v{axis}": c[f"set_v_{axis}_mps"] for axis in "xyz"}
    result |= {f"motor.m{i}": np.rint(65535 * c[f"pwm_{i}_norm"]) for i in "1234"}
    result |= {f"motor.m{i}_rpm": np.rint(c[f"rotor_{i}_radps"] * 60 / (2 * math.pi)) for i in "1234"}
    result |= {f"ivl.thrust{i}": c[f"thrust_{i}_N"] for i in "1234"}
    result |= {"ivl.thrust_total": c["thrust_cmd_N"], "ivl.pitch_moment": c["moment_cmd_y_Nm"], "ivl.phase": c["phase"]}
    result |= {"ivl.d_ceil": c["d_ceil_m"], "ivl.rrev": c["rrev_per_s"], "ivl.of_y": c["of_y_radps"]}
    result |= {"pm.vbat": c["battery_V"], "pm.vbatMV": np.rint(1000 * c["battery_V"])}
    result |= {f"kalman.state{axis.upper()}": c[f"p_{axis}_m"] for axis in "xyz"}
    result |= {f"kalman.q{i}": c[f"q_{axis}"] for i, axis in enumerate("wxyz")}
    result |= {f"lighthouse.{axis}": c[f"track_p_{axis}_m"] for axis in "xyz"}
    result |= {f"ext_pos.{axis.upper()}": c[f"track_p_{axis}_m"] for axis in "xyz"}
    result |= {f"ctrltargetZ.{axis}": np.trunc(1000 * c[f"set_p_{axis}_m"]) for axis in "xyz"}
    result |= {f"ctrltargetZ.v{axis}": np.trunc(1000 * c[f"set_v_{axis}_mps"]) for axis in "xyz"}
    result |= {f"rpm.m{i}": np.rint(c[f"rotor_{i}_radps"] * 60 / (2 * math.pi)) for i in "1234"}
    result |= {f"ivl.pwm{i}": np.rint(65535 * c[f"pwm_{i}_norm"]) for i in "1234"}
    n = np.ones(len(truth))
    result |= {"ivl.theta0": truth.threshold_per_s * n, "ivl.theta1": truth.moment_Nmm / 1000 * n}
    return result | {"ivl.n_trigger": 3 + c["triggered"], "ivl.policy_seq": 7 * n}


WHOLE = {"motor", "stateEstimateZ", "ivl.phase", "ivl.n_trigger", "ivl.policy_seq"}
"""Groups and variables that are whole numbers in the log."""


def cell(name: str, value: float) -> str:
    """A number as the client prints it."""
    return str(int(value)) if name in WHOLE or name.split(".")[0] in WHOLE else str(float(value))


def cfclient_text(truth: Truth, names: Sequence[str], every: int = 1, start_ms: int = 123_456) -> str:
    """A log block as the client writes it."""
    values = variables(truth)
    lines = [",".join(["Timestamp", *names])]
    for i in range(0, len(truth), every):
        time_ms = (start_ms + round(1000 * truth["t_s"][i])) % 2**24
        lines.append(",".join([str(time_ms), *(cell(name, values[name][i]) for name in names)]))
    return "\n".join(lines) + "\n"


def usd_bytes(truth: Truth, kinds: Mapping[str, tuple[Sequence[str], int]], version: int = 2) -> bytes:
    """A file of the micro-SD card.

    Args:
        truth: The flight.
        kinds: By the name of the event its variables, and every how many rows it comes.
        version: Version of the file.
    """
    values = variables(truth)
    out = bytearray(struct.pack("<BHH", 0xBC, version, len(kinds)))
    letters = {}
    for number, (event, (names, _)) in enumerate(kinds.items()):
        letters[event] = "".join(_letter(name) for name in names)
        out += struct.pack("<H", 0xFFFF - number) + event.encode() + b"\0" + struct.pack("<H", len(names))
        for name, letter in zip(names, letters[event], strict=True):
            out += f"{name}({letter})".encode() + b"\0"
    for i in range(len(truth)):
        for number, (event, (names, every)) in enumerate(kinds.items()):
            if i % every == 0:
                t_us = 5_000_000 + round(1e6 * truth["t_s"][i]) + 10 * number
                out += struct.pack("<HI", 0xFFFF - number, t_us // 1000) if version == 1 else b""
                out += struct.pack("<HQ", 0xFFFF - number, t_us) if version == 2 else b""
                row = [values[name][i] for name in names]
                row = [int(x) if k in "HhIiBb" else float(x) for x, k in zip(row, letters[event], strict=True)]
                out += struct.pack("<" + letters[event], *row)
    return bytes(out) + struct.pack("<I", zlib.crc32(out))


def _letter(name: str) -> str:
    if name == "stateEstimateZ.quat":
        return "I"
    if name.startswith("stateEstimateZ"):
        return "h"
    return "H" if name.startswith("motor") else "B" if name == "ivl.phase" else "f"


# ---- Crazyswarm


def states_text(truth: Truth) -> str:
    """What the simulator of Crazyswarm2 records."""
    lines = ["timestamp,x,y,z,qw,qx,qy,qz"]
    names = ["t_s", "p_x_m", "p_y_m", "p_z_m", "q_w", "q_x", "q_y", "q_z"]
    lines += [",".join(str(float(truth[name][i])) for name in names) for i in range(len(truth))]
    return "\n".join(lines) + "\n"


def states_npz(truth: Truth, path: Path) -> None:
    """The same as an archive."""
    pos = np.stack([truth[f"p_{axis}_m"] for axis in "xyz"], axis=1)
    quat = np.stack([truth[f"q_{axis}"] for axis in "wxyz"], axis=1)
    np.savez_compressed(path, t=truth["t_s"], pos=pos, quat=quat)


def topic_text(truth: Truth, columns: Mapping[str, str]) -> str:
    """A topic as `rostopic echo -p` prints it; columns of the log by name with those of the truth."""
    lines = ["%time,field.header.seq,field.header.stamp,field.header.frame_id," + ",".join(columns)]
    for i in range(len(truth)):
        t_ns = 1_600_000_000_000_000_000 + round(1e9 * truth["t_s"][i])
        lines.append(f"{t_ns},{i},{t_ns},world," + ",".join(str(float(truth[name][i])) for name in columns.values()))
    return "\n".join(lines) + "\n"
