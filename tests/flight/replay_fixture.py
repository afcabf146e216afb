"""Flights whose answers are known: landings of the simulator, written down as a log would have them.

The simulated sensors are ideal and deliver at each tick, so that what the flight core was told is what the log holds.
"""

from typing import Any

import numpy as np

import ivl
from ivl.flight.store import Flight, make_flight

TICK_S = 0.002
IDEAL = {
    "sense.pose_rate": 500.0, "sense.phase_random": 0.0, "sense.latency": 0.0, "sense.position_noise": 0.0,
    "sense.velocity_noise": 0.0, "sense.gyro_noise": 0.0, "sense.accel_noise": 0.0,
}  # fmt: skip
FLIP, COAST = 3, 4
RREV_C, MOMENT = 4.8, 8.0


def world(**overrides: float) -> ivl.World:
    return ivl.World("habas2021", "wide_short", "as_simulated", **IDEAL | overrides)


def simulated(
    of: ivl.World, speed: float = 2.5, angle: float = 90.0, rrev_c: float = RREV_C, start: str = "imparted", **info: Any
) -> Flight:
    """One landing as a log with a row at each tick; cues, trigger and commands are those of the tick."""
    trace = of.trace(speed, angle, rrev_c, MOMENT, start=start, period_s=TICK_S)
    before, after = trace.rows[:-1], trace.rows[1:]  # a row holds the state before its tick, and what the last one said
    columns = {"t_s": before.t_s, "d_ceil_m": after.d_sensed_m, "phase": after.phase.astype(float)}
    for stem, axes, values in (
        ("p_{}_m", "xyz", before.p_WB_m), ("v_{}_mps", "xyz", before.v_WB_mps), ("q_{}", "xyzw", before.q_WB),
        ("w_{}_radps", "xyz", before.w_B_radps), ("thrust_{}_N", "1234", after.thrust_cmd_N),
    ):  # fmt: skip
        seen = np.where(np.abs(values) < 1e-9, 0.0, values)  # no simulated sensor resolves less
        columns |= {stem.format(axis): seen[:, i] for i, axis in enumerate(axes)}
    columns |= {"rrev_per_s": after.rrev_per_s, "of_y_radps": after.of_y_radps}
    columns["triggered"] = (after.phase >= FLIP).astype(float)
    columns["moment_cmd_y_Nm"] = np.where(after.phase == FLIP, -1e-3 * MOMENT, 0.0)
    plane_m = of.native_model.config()[0]["ivl.h_ceil"][0]
    known = {
        "label": f"{speed:g} m/s", "threshold_per_s": rrev_c, "moment_Nmm": MOMENT, "speed_mps": speed,
        "angle_deg": angle, "h_plane_m": float(plane_m), "judged_by": "simulator",
    }  # fmt: skip
    return make_flight(known | info, columns)


def changed(flight: Flight, rows: Any = slice(None), drop: tuple[str, ...] = (), **info: Any) -> Flight:
    """The same flight with some rows alone, without the columns whose names begin so, and with other things known."""
    left = {n: v[rows].copy() for n, v in flight.samples.items() if not n.startswith(drop or ("none",))}
    return make_flight({**flight.info, **info}, left)


def as_log(flight: Flight, every: int = 5) -> Flight:
    """What a log of 100 Hz without phases has of it."""
    return changed(flight, slice(None, None, every), drop=("phase",))
