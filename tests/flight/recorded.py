"""Recordings of simulated landings as a vehicle would log them: sensed state, held and late."""

from typing import Any

import numpy as np

from ivl.flight.store import Flight, Flights, Manifest, make_flight
from ivl.world import World

MANIFEST = Manifest("test", [{"file": "made.csv", "sha256": "0"}], "MIT", "as the schema", "from the first sample on")
QUIET = {"sense.position_noise": 0.0, "sense.velocity_noise": 0.0, "rotor.thrust_scatter": 0.0,
         "battery.voltage_scatter": 0.0, "sense.phase_random": 0.0}  # fmt: skip


def landing(world: World, rrev: float, moment: float, stream: int = 0, period_s: float = 0.002, **known: Any) -> Flight:
    """One landing from a hover, recorded every `period_s`; position and velocity held and late as the world says.

    The world's `sense.phase_random` must be 0, so that poses are sampled at whole periods.
    """
    assert world.params.values["sense.phase_random"] == 0.0
    trace = world.trace(2.5, 90.0, rrev, moment, stream=stream, start="flown", period_s=0.002)
    rows = trace.rows
    values = world.params.values
    sampled = (
        np.floor((rows.t_s - values["sense.latency"]) * values["sense.pose_rate"] + 1e-6) / values["sense.pose_rate"]
    )
    held = np.clip(sampled, 0.0, None)
    columns = {"t_s": rows.t_s}
    for i, axis in enumerate("xyz"):
        columns[f"p_{axis}_m"] = np.interp(held, rows.t_s, rows.p_WB_m[:, i])
        columns[f"v_{axis}_mps"] = np.interp(held, rows.t_s, rows.v_WB_mps[:, i])
        columns[f"w_{axis}_radps"] = rows.w_B_radps[:, i]
    columns |= {f"q_{axis}": rows.q_WB[:, i] for i, axis in enumerate("xyzw")}
    columns |= {"battery_V": rows.battery_V, "phase": rows.phase.astype(float)}
    step = round(period_s / 0.002)
    kept = {name: data[::step] for name, data in columns.items()}
    first = int(np.argmax(rows.phase >= 3)) - 1 if trace.outcome.triggered else None
    h_plane = values["world.ceiling_height"] + values["world.sensed_gap_offset"]
    info = {"label": f"made-{stream}", "threshold_per_s": rrev, "moment_Nmm": moment, "h_plane_m": h_plane,
            "speed_mps": 2.5, "angle_deg": 90.0, "n_legs": float(trace.outcome.n_legs), "judged_by": "simulator",
            "usable": True, **known}  # fmt: skip
    if first is not None:
        at = kept["t_s"][np.argmax(kept["t_s"] >= rows.t_s[first] - 1e-9)]
        info |= {"t_trigger_s": at, "trigger_age_s": at - rows.t_s[first]}
    return make_flight(info, kept)


def folder(*flights: Flight) -> Flights:
    """Flights as a folder holds them."""
    return Flights(MANIFEST, flights)
