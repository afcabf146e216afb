"""What a flight records of its flip, as a vector of features.

In simulation (`simulated`), by its recorder (`of_recorder`), or in a log that was imported (`of_flip`).

    pitch, rate, fall     at `TIMES_S` after the trigger, up to the first contact
    at_contact            time after the trigger, pitch, rate and fall at the first contact
    swing_pitch, swing_rate   at `SWING_S` after that contact; only they tell legs and feet apart
    closing               closing speed just before the trigger
    battery               battery voltage in the hover before the approach
    overshoot             share by which RREV was above the policy's threshold when the trigger fired

The last two are conditions of a flight and not its result.

Pitch is the nose-up rotation since level (degrees), rate the nose-up rate of the gyro (rad/s, clipped where it clips),
fall the distance that was lost since the trigger (m), contact_distance that at the first contact, as motion capture
gives them: late, and interpolated between its poses. What a flight does not have is NaN: samples after the
contact, all of them without a trigger.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl import forms
from ivl.flight.motion import Flip
from ivl.outcome import Outcomes
from ivl.world import Trace, World

FloatArray = npt.NDArray[np.float64]
Rows = npt.NDArray[np.void]

TIMES_S = np.arange(0.03, 0.231, 0.02)
SIGNALS = ("pitch", "rate", "fall")
SWING_S = np.array([0.02, 0.04, 0.06])
SWING_SIGNALS = ("swing_pitch", "swing_rate")
AT_CONTACT = ("contact_time", "contact_pitch", "contact_rate", "contact_distance")
NAMES = (
    *(f"{signal}_{round(1000 * t):03d}" for signal in SIGNALS for t in TIMES_S), *AT_CONTACT,
    *(f"{signal}_{round(1000 * t):03d}" for signal in SWING_SIGNALS for t in SWING_S),
    "closing", "battery", "overshoot",
)  # fmt: skip
N = len(NAMES)
CONDITIONS = np.array([NAMES.index("battery"), NAMES.index("overshoot")])
"""Where the conditions stand among the features."""

_CLOSING_BEFORE_S = 0.02
_LAST_S = 0.24
_BEFORE_CONTACT_S = 0.01
"""Samples closer to the contact are left out: its time is uncertain, and a contact turns the vehicle at once."""
_TRACE_PERIOD_S = 0.005
_GYRO_FULL_RADPS = 34.9
"""Full scale of the gyro (Bosch BMI088 data sheet); rates are compared up to `_CLIP_SHARE` of it."""
_CLIP_SHARE = 0.93
_OVERSHOOT_MAX = 0.1
_NOTICED_LATE_S = 0.03
"""An accelerometer notices the first touch of a leg up to this late (docs/HOST.md)."""
_ATTITUDE_DEG, _CONTACT_S, _BATTERY_V = 0.3, 0.002, 0.01
"""Assumed errors of a recorded attitude, of the time of the first contact as a recorder at 500 Hz gives it, and of a
voltage that was averaged over a hover."""


@dataclass(frozen=True)
class Flight:
    """What all flights of one task have in common.

    What differs from flight to flight are its numbers theta: the policy, and behind it the approach if there is more
    than one.

    Attributes:
        speed_mps: Approach speed.
        angle_deg: Approach angle.
        form: Form of the policy.
        start: How a rollout begins.
        bounds: Box of the policies, shape (dim, 2), in the units of the form.
        approaches: Box of speed and angle, shape (2, 2), in place of the one approach; None: there is one.
        battery_lasts: Whether a flight has the battery of the one before, a little emptier, as in a room; otherwise
            each flight has one of its own.
    """

    speed_mps: float
    angle_deg: float
    form: str
    start: str
    bounds: FloatArray
    approaches: FloatArray | None = None
    battery_lasts: bool = False

    @property
    def box(self) -> FloatArray:
        """Box of theta, shape (dim, 2), or (dim + 2, 2) with more than one approach."""
        return self.bounds if self.approaches is None else np.concatenate([self.bounds, self.approaches])

    def of(self, theta: FloatArray) -> tuple[float, float, list[float]]:
        """Speed, angle and policy of a flight with theta, shape (n,)."""
        numbers = theta.tolist()
        if self.approaches is None:
            return self.speed_mps, self.angle_deg, numbers
        return numbers[-2], numbers[-1], numbers[:-2]


def simulated(world: World, flight: Flight, theta: FloatArray, seed: int, stream: int) -> tuple[FloatArray, Outcomes]:
    """Fly one rollout and record it as a vehicle does.

    Args:
        world: The vehicle.
        flight: What is flown.
        theta: Policy, and the approach if there is more than one, see `Flight`.
        seed: Seed of the rollout and of the noise of its recording.
        stream: Number of the rollout within the seed.

    Returns:
        Features, shape (N,), and the outcome, shape (1,).
    """
    speed_mps, angle_deg, policy = flight.of(theta)
    trace = world.trace(
        speed_mps, angle_deg, *policy, form=flight.form, start=flight.start,
        seed=seed, stream=stream, period_s=_TRACE_PERIOD_S,
    )  # fmt: skip
    rng = np.random.Generator(np.random.PCG64([seed, stream]))
    threshold_per_s = float(theta[0]) if flight.form == forms.PAPER else 0.0
    return of_trace(world, trace, threshold_per_s, rng), np.atleast_1d(np.asarray(trace.outcome)).view(np.recarray)


def with_battery(world: World, rest_V: float) -> World:
    """The world with one battery, in place of any of those of its vehicle."""
    return world.changed(**{"battery.voltage": rest_V, "battery.voltage_scatter": 0.0})


def hover_V(world: World, flight: Flight, rest_V: float) -> float:
    """Voltage in the hover before an approach, of a battery that has `rest_V` at rest; NaN: it has no sag to know.

    What a hover takes from it is simulated, so it does not wait for a first flight to tell.
    """
    if not (math.isfinite(rest_V) and world.params.values["battery.voltage"] > 0.0):
        return math.nan
    speed_mps, angle_deg, policy = flight.of(flight.box.mean(axis=1))
    trace = with_battery(world, rest_V).trace(
        speed_mps, angle_deg, *policy, form=flight.form, start=flight.start, period_s=_TRACE_PERIOD_S
    )
    return float(trace.rows["battery_V"][0])


def rest_V(world: World, flight: Flight, in_hover_V: float) -> float:
    """Voltage at rest of a battery that has `in_hover_V` in the hover; NaN as in `hover_V`.

    What a hover takes is the same at any voltage: its thrust, and so its current, is the weight's.
    """
    return in_hover_V + (in_hover_V - hover_V(world, flight, in_hover_V))


def of_trace(world: World, trace: Trace, threshold_per_s: float, rng: np.random.Generator) -> FloatArray:
    """Features of a simulated flight, shape (N,), with the noise of a recording; a threshold of 0 is unknown."""
    outcome, rows = trace.outcome, trace.rows
    if not outcome["triggered"]:
        return np.full(N, np.nan)
    t_s = rows["t_s"] - float(outcome["t_trigger_s"])
    at = min(int(np.searchsorted(t_s, 0.0)), len(t_s) - 1)
    sense = world.params.values
    n = len(t_s)
    pitch = np.rad2deg(np.unwrap(np.deg2rad(rows["pitch_deg"])))
    pitch = pitch - 360.0 * np.round(pitch[at] / 360.0) + rng.normal(0.0, _ATTITUDE_DEG, n)
    rate = -rows["w_B_radps"][:, 1] + rng.normal(0.0, max(sense["sense.gyro_noise"], 1e-3), n)
    late = np.interp(rows["t_s"] - sense["sense.latency"], rows["t_s"], rows["d_ceil_m"])
    distance = late + sense["world.sensed_gap_offset"] + rng.normal(0.0, max(sense["sense.position_noise"], 1e-4), n)
    closing = -np.gradient(rows["d_ceil_m"], rows["t_s"]) + rng.normal(0.0, max(sense["sense.velocity_noise"], 1e-3), n)
    contact_s = float(outcome["t_impact_s"]) - float(outcome["t_trigger_s"]) + rng.normal(0.0, _CONTACT_S)
    has_battery = sense["battery.voltage"] > 0.0
    battery_V = float(rows["battery_V"][0]) + rng.normal(0.0, _BATTERY_V) if has_battery else np.nan
    overshoot = float(outcome["rrev_trigger"]) / threshold_per_s - 1.0 if threshold_per_s > 0.0 else np.nan
    crossed = abs(overshoot) < _OVERSHOOT_MAX  # else the approach began above the threshold
    return _features(t_s, pitch, rate, distance, closing, contact_s, (battery_V, overshoot if crossed else np.nan))


def of_recorder(
    world: World,
    rows: Rows,
    trigger_row: int | None,
    outcome: Outcomes,
    threshold_per_s: float,
    battery_V: float = np.nan,
    contact_is_seen: bool = True,
) -> FloatArray:
    """Features of a flight that a flight recorder kept, shape (N,).

    The recorder has what the flight core was told: poses as late as they came, rates of the gyro. So nothing is added.

    Args:
        world: Whose surface is landed on.
        rows: Rows of the recorder (`ivl.links.packets.Recording`), in SI units.
        trigger_row: Row of the trigger; None: it did not fire.
        outcome: Outcome of the flight, shape (1,).
        threshold_per_s: RREV_c of the policy; 0 is unknown.
        battery_V: Voltage in the hover before the approach; NaN is unknown.
        contact_is_seen: Whether the outcome tells when the first leg touched. If it tells only when the accelerometer
            noticed, nothing is taken of the contact, and nothing of the time shortly before it.
    """
    if trigger_row is None or not outcome["triggered"][0]:
        return np.full(N, np.nan)
    t_s = rows["t_s"] - rows["t_s"][trigger_row]
    pitch = pitch_deg(rows["q_WB"])
    pitch = pitch - 360.0 * np.round(pitch[trigger_row] / 360.0)
    gap_m = world.surface.gap_m(rows["p_W_m"]) + world.params.values["world.sensed_gap_offset"]
    distance = _between_poses(t_s, gap_m)
    closing = rows["v_W_mps"] @ np.asarray(world.surface.normal_W)
    contact_s = float(outcome["t_impact_s"][0]) - float(outcome["t_trigger_s"][0])
    overshoot = float(outcome["rrev_trigger"][0]) / threshold_per_s - 1.0 if threshold_per_s > 0.0 else np.nan
    conditions = battery_V, overshoot if abs(overshoot) < _OVERSHOOT_MAX else np.nan
    end_s = contact_s if contact_is_seen else contact_s - _NOTICED_LATE_S
    features = _features(t_s, pitch, -rows["w_B_radps"][:, 1], distance, closing, end_s, conditions)
    if not contact_is_seen:
        features[[NAMES.index(name) for name in NAMES if name.startswith(("contact_", "swing_"))]] = np.nan
    return features


def of_flip(flip: Flip, battery_V: float = np.nan, overshoot: float = np.nan) -> FloatArray:
    """Features of the flip of a flight that was imported (`ivl.flight`), shape (N,).

    Args:
        flip: Its flip.
        battery_V: Voltage in the hover before the approach; NaN is unknown.
        overshoot: Share by which the logged RREV was above the threshold at the trigger; NaN is unknown.
    """
    at = flip.is_new_pose | (np.arange(len(flip.t_s)) == 0)
    t_s = np.concatenate([[-_CLOSING_BEFORE_S, 0.0], flip.t_s])
    before_m = flip.h_plane_m - np.asarray(flip.state.p_W_m)[2]
    climb_mps = float(np.asarray(flip.state.v_W_mps)[2])
    later_m = flip.h_plane_m - np.interp(flip.t_s, flip.t_s[at], flip.height_m[at])
    distance = np.concatenate([[before_m + climb_mps * _CLOSING_BEFORE_S, before_m], later_m])
    return _features(
        t_s,
        np.concatenate([np.full(2, flip.pitch_deg[0]), flip.pitch_deg]),
        np.concatenate([np.full(2, flip.rate_radps[0]), flip.rate_radps]),
        distance,
        np.full(len(t_s), climb_mps),
        flip.t_contact_s,
        (battery_V, overshoot if abs(overshoot) < _OVERSHOOT_MAX else np.nan),
    )


def _between_poses(t_s: FloatArray, held: FloatArray) -> FloatArray:
    """A signal that holds its last value from pose to pose, interpolated between the poses; both have shape (n,)."""
    fresh = np.flatnonzero(np.concatenate([[True], np.diff(held) != 0.0]))
    return np.interp(t_s, t_s[fresh], held[fresh])


def pitch_deg(q_WB: FloatArray) -> FloatArray:
    """Nose-up rotation about b_y, unwrapped along the rows, degrees; q_WB has shape (n, 4), x y z w."""
    x, y, z, w = q_WB.T
    return np.asarray(np.degrees(np.unwrap(np.arctan2(2.0 * (x * z - w * y), 1.0 - 2.0 * (y * y + z * z)))))


def _features(
    t_s: FloatArray,
    pitch: FloatArray,
    rate: FloatArray,
    distance: FloatArray,
    closing: FloatArray,
    contact_s: float,
    conditions: tuple[float, float],
) -> FloatArray:
    """Signals at the times of the features; NaN about and after the contact, and after the end of the recording."""
    end_s = contact_s - _BEFORE_CONTACT_S if np.isfinite(contact_s) else _LAST_S
    seen = min(end_s, float(t_s[-1])) >= TIMES_S
    clip = _CLIP_SHARE * _GYRO_FULL_RADPS
    signals = (pitch, np.clip(rate, -clip, clip), float(np.interp(0.0, t_s, distance)) - distance)
    at_times = [np.where(seen, np.interp(TIMES_S, t_s, signal), np.nan) for signal in signals]
    at_contact = np.full(len(AT_CONTACT), np.nan)
    if np.isfinite(contact_s) and contact_s <= t_s[-1]:
        at_contact = np.array([contact_s, *(float(np.interp(contact_s, t_s, s)) for s in (*signals[:2], distance))])
    swing_s = contact_s + SWING_S
    recorded = swing_s <= t_s[-1]  # not after the end of the recording, nor without a contact
    swing = [np.where(recorded, np.interp(swing_s, t_s, signal), np.nan) for signal in signals[:2]]
    before = float(np.interp(-_CLOSING_BEFORE_S, t_s, closing))
    return np.concatenate([*at_times, at_contact, *swing, [before, *conditions]])


def table(features: FloatArray) -> Mapping[str, float]:
    """Features by name, NaN left out."""
    return {name: float(value) for name, value in zip(NAMES, features, strict=True) if np.isfinite(value)}
