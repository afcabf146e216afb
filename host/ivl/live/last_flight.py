"""The last flight: what was recorded of it beside what the simulator makes of the same policy.

Times count from the trigger. A flight in this process has no recording; then its replay is what moves on the page.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ivl.experiment import Experiment
from ivl.export import flight as exported
from ivl.export.flight import Flight, nose_up_deg
from ivl.landing import LandingSpec
from ivl.outcome import verdict
from ivl.seeds import Purpose, derive
from ivl.world import Trace, World

if TYPE_CHECKING:
    from ivl.links.landing_flight import Landing, Rollout
    from ivl.links.packets import Recording

SPEED = 0.25
"""Of a replay, against real time: a flip takes 0.2 s."""
_BEFORE_S, _AFTER_S, _STEP_S = 0.3, 0.7, 0.005

FloatArray = npt.NDArray[np.float64]


def simulate(experiment: Experiment, world: World, theta: tuple[float, ...], seed: int, stream: int) -> Trace:
    """What the simulator makes of a policy with these random numbers: a pure function of them."""
    spec = LandingSpec(**experiment.task(), form=experiment.policy.form, theta=list(theta), seed=seed, stream=stream)
    return spec.fly(world)[1]


def seed_of(experiment: Experiment) -> int:
    """Seed of the random numbers of trial 0 of a run."""
    return derive(experiment.seed, Purpose.WORLD)


def part(number: int, rollout: "Rollout", world: World, trace: Trace, landing: "Landing | None") -> dict[str, Any]:
    """What the page shows of it.

    Args:
        number: Of the rollout, from 1.
        rollout: What was flown.
        world: Where.
        trace: The same policy simulated.
        landing: What came of it; None: it was flown in this process, and the trace is all there is.
    """
    recording = landing.recording if landing is not None else None
    outcome = landing.outcome[0] if landing is not None else trace.outcome
    return {
        "number": number,
        "theta": rollout.theta,
        "verdict": verdict(outcome),
        "simulated_verdict": verdict(trace.outcome),
        "at_trigger": _at_trigger(outcome),
        "simulated_at_trigger": _at_trigger(trace.outcome),
        "battery_V": landing.battery_V if landing is not None else None,
        "simulated": _of_trace(world, trace),
        "recorded": None if recording is None else _of_recording(world, recording),
    }


def _at_trigger(outcome: Any) -> dict[str, float]:
    names = {"d_m": "d_trigger_m", "rrev_per_s": "rrev_trigger", "vz_mps": "vz_trigger_mps"}
    return {name: float(outcome[column]) for name, column in names.items()}


def _of_trace(world: World, trace: Trace) -> dict[str, Any]:
    rows = trace.rows
    gap_m = world.surface.gap_m(rows.p_WB_m, rows.t_s)
    return _curves(rows.t_s, float(trace.outcome["t_trigger_s"]), rows.pitch_deg, gap_m)


def _of_recording(world: World, recording: "Recording") -> dict[str, Any]:
    rows, trigger = recording.rows, recording.trigger_row
    gap_m = world.surface.gap_m(rows["p_W_m"], rows["t_s"])
    zero_s = float(rows["t_s"][trigger]) if trigger is not None else np.nan
    return _curves(rows["t_s"], zero_s, nose_up_deg(rows["q_WB"]), gap_m)


def _curves(t_s: FloatArray, zero_s: float, pitch_deg: FloatArray, gap_m: FloatArray) -> dict[str, Any]:
    """A flight around its trigger; of one without a trigger, its end."""
    t = t_s - (zero_s if np.isfinite(zero_s) else t_s[-1])
    at = np.arange(max(-_BEFORE_S, t[0]), min(_AFTER_S, t[-1]), _STEP_S)
    if not at.size:
        return {"t_s": [], "pitch_deg": [], "gap_m": []}
    return {"t_s": at, "pitch_deg": np.interp(at, t, pitch_deg), "gap_m": np.interp(at, t, gap_m)}


class Replay:
    """A simulated landing that is shown slowly, again and again."""

    def __init__(self, number: int, world: World, trace: Trace, now_s: float) -> None:
        """Begin now with rollout `number`; times are of any clock that runs evenly."""
        self.number, self._began_s = number, now_s
        self._flight = exported.of_rows(trace.rows, world, f"replay of rollout {number}", {})

    def row(self, now_s: float, clock_s: float) -> Flight:
        """The moment that is shown now, as a flight of one row at the time `clock_s`."""
        flight, t_s = self._flight, self._flight.t_s
        at_s = t_s[0] + (SPEED * (now_s - self._began_s)) % (t_s[-1] - t_s[0])
        i = int(np.searchsorted(t_s, at_s))
        columns = {name: column[i : i + 1] for name, column in flight.columns.items()}
        return Flight(flight.title, columns | {"t_s": np.array([clock_s])}, flight.phase[i : i + 1], flight.world)


def moment(row: Flight) -> dict[str, Any]:
    """A replayed moment, in the fields that a connected vehicle has too."""
    feet = row.feet_W_m
    return {
        "phase": row.phase[0],
        "p_W_m": row.vector("p_WB_m", 3)[0],
        "q_WB": row.vector("q_WB", 4)[0],
        "feet_W_m": None if feet is None else feet[0],
        "feet_stuck": row.feet_stuck[0].tolist() if feet is not None else None,
        "battery_V": float(row.columns["battery_V"][0]) if "battery_V" in row.columns else None,
        "cues": {name: float(row.columns[name][0]) for name in ("d_sensed_m", "rrev_per_s", "of_y_radps")},
    }
