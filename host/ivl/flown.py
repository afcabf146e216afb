"""What a vehicle has flown in a run: its recordings, and beside each the simulated counterpart that is called so.

    for landing in landings(folder, experiment, world, rollouts): landing.recorded, landing.simulated
    summary(found)    # landing rate with its interval, and what the simulator expected of the same policies

The recorder knows pose, rates, force, thrusts and phase. Where legs are drawn, they are drawn as they stand in flight.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import landing, recordings
from ivl.analysis.intervals import wilson
from ivl.belief import recording
from ivl.belief.recording import with_battery
from ivl.experiment import Experiment
from ivl.export.flight import Flight, of_file
from ivl.landing import LandingSpec
from ivl.learning.recorder import SCORED, RolloutRows
from ivl.links.forecast import Forecast, Forecasts
from ivl.outcome import four_leg
from ivl.table import Rows
from ivl.task import settings_of
from ivl.world import Trace, World, rotation

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FlownLanding:
    """A landing that counts.

    Attributes:
        row: Its row in the run's table of rollouts.
        number: Of the rollout, from 1.
        spec: What the counterpart flies: the same policy and approach.
        path: The recording.
        recorded: The recording as a trace with the outcome that the operator has confirmed; None: there is none, or it
            holds no flip, since the trigger did not fire.
        simulated: The counterpart, a single one, with random numbers of its own.
        forecast: What the simulator expects of the policy.
    """

    row: int
    number: int
    spec: LandingSpec
    path: Path
    recorded: Trace | None
    simulated: Trace
    forecast: Forecast


def landings(folder: Path, experiment: Experiment, world: World, rollouts: RolloutRows) -> list[FlownLanding]:
    """Every landing of a flown run that counts, in the order of the rollouts.

    Raises:
        ConfigError: A recording is damaged.
    """
    forecasts = Forecasts(world, experiment)
    found = []
    for row in np.flatnonzero(rollouts.status == SCORED).tolist():
        spec, path = counterpart(folder, experiment, rollouts, row)
        battery_V = rest_V(world, experiment, rollouts, row)
        _, simulated = spec.fly(with_battery(world, battery_V) if math.isfinite(battery_V) else world)
        recorded = None
        if path.is_file() and rollouts.outcomes["triggered"][row]:
            recorded = as_trace(of_file(path, world), world, rollouts.outcomes[row], simulated)
        forecast = forecasts.of(tuple(spec.theta), battery_V)
        found.append(FlownLanding(row, row + 1, spec, path, recorded, simulated, forecast))
    return found


def counterpart(folder: Path, experiment: Experiment, rollouts: RolloutRows, row: int) -> tuple[LandingSpec, Path]:
    """What the simulated counterpart of a flown rollout flies, and where the recording of the rollout is.

    It has the battery that was on board, where that is known.
    """
    trial, stream = int(rollouts.trial[row]), int(rollouts.stream[row])
    spec = landing.of_rollout(experiment, trial, rollouts.theta[row].tolist(), stream)
    path = recordings.path_of(folder, spec.seed, stream)
    battery_V = rest_V(experiment.make_world(), experiment, rollouts, row)
    if not math.isfinite(battery_V):
        return spec, path
    own = settings_of({"battery.voltage": battery_V, "battery.voltage_scatter": 0.0}, "the battery that was on board")
    return spec.model_copy(update={"overrides": {**spec.overrides, **own}}), path


def rest_V(world: World, experiment: Experiment, rollouts: RolloutRows, row: int) -> float:
    """Voltage at rest of the battery that a flown rollout had; NaN: its recording does not tell, or it never sags."""
    if rollouts.recordings is None:
        return math.nan
    in_hover_V = float(rollouts.recordings[row, recording.CONDITIONS[0]])
    return recording.rest_V(world, experiment.flight, in_hover_V)


def last_rest_V(world: World, experiment: Experiment, rollouts: RolloutRows) -> float:
    """Voltage at rest of the last flown battery that is known; NaN: none is."""
    known_V = [rest_V(world, experiment, rollouts, row) for row in np.flatnonzero(rollouts.status == SCORED).tolist()]
    return next((volts for volts in reversed(known_V) if math.isfinite(volts)), math.nan)


def with_last_battery(world: World, experiment: Experiment, rollouts: RolloutRows) -> World:
    """A world with the battery of the last flight, for which the learner recommends; the world itself if none is known.

    One policy cannot serve a full and an empty battery alike, so a judge with another battery would judge another task.
    """
    volts = last_rest_V(world, experiment, rollouts)
    return with_battery(world, volts) if math.isfinite(volts) else world


def as_trace(flight: Flight, world: World, outcome: Any, simulated: Trace) -> Trace:
    """A recording in the rows of a trace; what the recorder does not have is 0, and feet are as those in flight."""
    rows = np.zeros(len(flight), dtype=simulated.rows.dtype)
    for name in rows.dtype.names or ():
        width = int(np.prod(rows.dtype[name].shape))
        columns = [name] if name in flight.columns else [f"{name}_{i + 1}" for i in range(width)]
        if all(column in flight.columns for column in columns):
            values = np.column_stack([flight.columns[column] for column in columns])
            rows[name] = np.nan_to_num(values).reshape(rows[name].shape)  # a cue that there was not
    first = simulated.rows[0]
    feet_B = (first.foot_W_m.reshape(4, 3) - first.p_WB_m) @ rotation(first.q_WB)
    turned = np.einsum("ijn,lj->nli", rotation(rows["q_WB"].T), feet_B)
    rows["foot_W_m"] = (turned + rows["p_WB_m"][:, None, :]).reshape(rows["foot_W_m"].shape)
    rows["d_ceil_m"] = world.surface.gap_m(rows["p_WB_m"])
    return Trace(rows.view(Rows), outcome)


@dataclass(frozen=True)
class Comparison:
    """A recorded flip beside its counterpart; NaN where one of them has none.

    Attributes:
        d_trigger_m: Sensed distance at the trigger: recorded, simulated.
        flip_s: From the trigger to the first contact: recorded, simulated.
        pitch_rms_deg: Difference of the pitch from the trigger until the first of the two contacts.
    """

    d_trigger_m: tuple[float, float]
    flip_s: tuple[float, float]
    pitch_rms_deg: float


def compare(recorded: Trace, simulated: Trace) -> Comparison:
    """Both from their triggers on."""
    both = (recorded, simulated)
    flips_s = [float(trace.outcome["t_impact_s"] - trace.outcome["t_trigger_s"]) for trace in both]
    d_m = [float(trace.outcome["d_trigger_m"]) for trace in both]
    return Comparison((d_m[0], d_m[1]), (flips_s[0], flips_s[1]), _pitch_rms_deg(both, np.nanmin([*flips_s, np.inf])))


def _pitch_rms_deg(both: Sequence[Trace], until_s: float) -> float:
    """Of two flips that begin at their triggers; the pitch counts from that of the trigger."""
    if not (np.isfinite(until_s) and all(trace.outcome["triggered"] for trace in both)):
        return float("nan")
    grid_s = np.arange(0.0, until_s, 0.002)
    pitch_deg = []
    for trace in both:
        t_s = trace.rows.t_s - float(trace.outcome["t_trigger_s"])
        own = np.interp(grid_s, t_s, np.rad2deg(np.unwrap(np.deg2rad(trace.rows.pitch_deg))))
        pitch_deg.append(own)
    return float(np.sqrt(np.mean((pitch_deg[0] - pitch_deg[1]) ** 2)))


def summary(found: Sequence[FlownLanding], rollouts: RolloutRows) -> dict[str, Any]:
    """What was flown, in numbers: landing rate with its 95 % interval, and what the simulator expected."""
    landed = four_leg(rollouts.outcomes)[[each.row for each in found]]
    n = len(found)
    lo, hi = wilson(landed.mean() if n else np.nan, n)
    rms = [compare(each.recorded, each.simulated).pitch_rms_deg for each in found if each.recorded is not None]
    finite = [value for value in rms if np.isfinite(value)]
    expected = [each.forecast.n_landed / each.forecast.n for each in found]
    return {
        "landings": n,
        "landed": int(landed.sum()),
        "rate": float(landed.mean()) if n else None,
        "rate_lo": float(lo) if n else None,
        "rate_hi": float(hi) if n else None,
        "recorded": sum(each.path.is_file() for each in found),
        "simulated_rate": float(np.mean(expected)) if expected else None,
        "pitch_rms_deg_median": float(np.median(finite)) if finite else None,
    }
