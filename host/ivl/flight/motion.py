"""The flip as it was recorded, and the same flip flown by the simulator.

Both sides are what the vehicle itself would log: attitude and rate from the gyro, clipped where the gyro clips; height
as the state estimate gives it, late by `sense.latency`, where a new pose has come. The trigger fires when a pose comes.
Time runs from the trigger.

    flip = motion.flip(flight)
    simulated = motion.fly(world, flip)
    np.sqrt(np.mean((simulated.pitch_deg - flip.pitch_deg) ** 2))
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ivl.errors import ConfigError
from ivl.flight.schema import POSE
from ivl.flight.store import Flight, FloatArray
from ivl.world import State, Trace, World

BoolArray = npt.NDArray[np.bool_]

FLIP_AT_ONCE = (1.0, 90.0, 0.0)
"""Speed, angle and RREV_c of a landing that flips at its first tick; speed and angle then say nothing."""
MOTION_S = 0.2
"""Motion is compared up to this long after the trigger, or to the contact."""
_BEFORE_S, _THRUST_S = 0.1, 0.03
GRAVITY_MPS2 = 9.81
_SETTLED_S = (0.8, 1.3)
_CONTACT_AFTER_S, _CONTACT_RATE_RADPS, _CONTACT_DROP_RADPS = 0.06, 8.0, 1.5
_CONTACT_WINDOW_S = 0.01
_CLIP_SHARE = 0.93
"""Rates are compared below this share of the gyro's full scale: a log of 16 bits ends before the gyro does."""
_TRACE_PERIOD_S = 0.002
_HANGING_DEG = 20.0
_SHORT_END = {"end.contact_time": 0.1, "end.missed_time": 0.6}
_GYRO_DEFAULT_RADPS = 34.9


@dataclass(frozen=True)
class Flip:
    """What a flight recorded of its flip.

    Attributes:
        label: Of the flight.
        moment_Nmm: Policy's moment, magnitude.
        threshold_per_s: Policy's threshold, NaN if it is not known.
        approach: Speed (m/s) and angle (degrees) that were asked for, None if they are not known.
        h_plane_m: Height of the plane of the cues in W.
        h_surface_m: Height of the ceiling's surface in W, NaN if it was not measured.
        state: State at the trigger as the vehicle sensed it; rotor speeds unknown, battery without load if known.
        climb_mps2: Vertical acceleration before the trigger.
        climb_age_s: How long before the trigger that was, on average.
        climb_is_sensed: True: from the velocity of the state estimate, which is late; False: from the accelerometer.
        t_s: Times of the samples after the trigger that are no repeats, shape (n,).
        pitch_deg: Nose-up rotation, unwrapped, shape (n,).
        rate_radps: Nose-up rate, shape (n,).
        height_m: Sensed height, shape (n,).
        is_new_pose: True where a new pose had come since the sample before, shape (n,).
        t_contact_s: First sharp fall of the rate, NaN if there is none.
        hanging_m: Height at which it hangs at the end, inverted and still; NaN if it does not.
        n_legs: Feet at the end as judged, NaN if nobody did.
    """

    label: str
    moment_Nmm: float
    threshold_per_s: float
    approach: tuple[float, float] | None
    h_plane_m: float
    h_surface_m: float
    state: State
    climb_mps2: float
    climb_age_s: float
    climb_is_sensed: bool
    t_s: FloatArray
    pitch_deg: FloatArray
    rate_radps: FloatArray
    height_m: FloatArray
    is_new_pose: BoolArray
    t_contact_s: float
    hanging_m: float
    n_legs: float

    def compared(self) -> BoolArray:
        """Samples of the free rotation: up to `MOTION_S` and before the recorded contact."""
        end_s = min(MOTION_S, self.t_contact_s) if np.isfinite(self.t_contact_s) else MOTION_S
        return np.asarray((self.t_s > 0) & (self.t_s <= end_s))


@dataclass(frozen=True)
class Simulated:
    """The same signals of a simulated flip, at the times of the recorded samples; see `Flip`."""

    pitch_deg: FloatArray
    rate_radps: FloatArray
    height_m: FloatArray
    t_contact_s: float
    trace: Trace


def flip(flight: Flight) -> Flip:
    """The flip of a recorded flight.

    Raises:
        ConfigError: The flight did not trigger, or lacks what the comparison needs; one line that says what.
    """
    _check(flight)
    t_s = flight["t_s"] - (float(flight.info["t_trigger_s"]) - _trigger_age(flight))
    fresh = _fresh(flight)
    at = int(np.argmax((t_s >= -1e-9) & _complete(flight)))
    before = fresh & (t_s > -_BEFORE_S) & (t_s <= t_s[at])
    after = fresh & (t_s > 0)
    if before.sum() < 3 or after.sum() < 5:
        raise ConfigError(f"flight {flight.label}: too few samples around the trigger")
    climb, climb_age_s, climb_is_sensed = _climb(flight, t_s, before)
    state = State(
        p_W_m=flight.stack("p", "xyz", "m")[at],
        v_W_mps=flight.stack("v", "xyz", "mps")[at],
        q_WB=_unit(flight.stack("q", "xyzw")[at]),
        w_B_radps=np.mean(flight.stack("w", "xyz", "radps")[before][-3:], axis=0),
        battery_V=_open_circuit(flight, t_s),
    )
    pitch = pitch_deg(flight.stack("q", "xyzw"))
    pitch -= 360.0 * np.round(pitch[at] / 360.0)
    rate = -flight["w_y_radps"]
    return Flip(
        label=flight.label,
        moment_Nmm=float(flight.info["moment_Nmm"]),
        threshold_per_s=float(flight.info["threshold_per_s"]),
        approach=_approach(flight),
        h_plane_m=float(flight.info["h_plane_m"]),
        h_surface_m=float(flight.info["h_surface_m"]),
        state=state,
        climb_mps2=climb,
        climb_age_s=climb_age_s,
        climb_is_sensed=climb_is_sensed,
        t_s=t_s[after],
        pitch_deg=pitch[after],
        rate_radps=rate[after],
        height_m=flight["p_z_m"][after],
        is_new_pose=_new_pose(flight)[after],
        t_contact_s=contact_time(t_s[after], rate[after], _window(t_s[after])),
        hanging_m=_hanging(flight, pitch),
        n_legs=float(flight.info["n_legs"]),
    )


def site_overrides(flip: Flip, gap_offset_m: float) -> dict[str, float]:
    """The ceiling of the room in which the flight was flown: level, its height is a recorded number.

    Args:
        flip: The recorded flip.
        gap_offset_m: `world.sensed_gap_offset` of the vehicle, used where the surface was not measured.
    """
    surface_m = flip.h_surface_m if np.isfinite(flip.h_surface_m) else flip.h_plane_m - gap_offset_m
    return {"world.ceiling_height": surface_m, "world.sensed_gap_offset": flip.h_plane_m - surface_m}


def start_state(world: World, flip: Flip, rotor_factor: float = 1.0) -> State:
    """The true state at the trigger: what was sensed, `sense.latency` later; rotors that give the recorded climb.

    Args:
        world: The vehicle, in the room of the flight.
        flip: The recorded flip.
        rotor_factor: On the rotor speeds, since a climb tells them to 1 % or so.
    """
    values = world.params.values
    lag_s = values["sense.latency"]
    climb = _present_climb(world, flip)
    v_W_mps = np.asarray(flip.state.v_W_mps) + np.array([0.0, 0.0, climb * lag_s])
    p_W_m = np.asarray(flip.state.p_W_m) + lag_s * v_W_mps
    climb_rate = float(v_W_mps[2])
    force_N = world.derived()["mass_total_kg"] * (values["world.gravity"] + climb) + values["aero.drag_z"] * climb_rate
    air = max(1.0 - values["rotor.inflow_loss"] * max(climb_rate, 0.0), 0.1)
    most = world.derived()["rotor_speed_max_radps"]
    speed = float(np.sqrt(max(force_N, 0.0) / (4.0 * values["rotor.thrust_constant"] * air)))
    rotors = np.full(4, min(rotor_factor * speed, most))
    battery_V = flip.state.battery_V if values["battery.voltage"] > 0.0 else None  # a voltage would turn the battery on
    return replace(flip.state, p_W_m=p_W_m, v_W_mps=v_W_mps, rotor_radps=rotors, battery_V=battery_V)


def _present_climb(world: World, flip: Flip) -> float:
    """Vertical acceleration at the trigger: the recorded one is older, and drag and inflow have lowered it since."""
    values = world.params.values
    mass_kg = world.derived()["mass_total_kg"]
    thrust_N = mass_kg * (values["world.gravity"] + flip.climb_mps2)
    rate_per_s = (values["aero.drag_z"] + values["rotor.inflow_loss"] * thrust_N) / mass_kg
    age_s = flip.climb_age_s + (sensing_lag(world) if flip.climb_is_sensed else 0.0)
    return flip.climb_mps2 * float(np.exp(-rate_per_s * age_s))


def sensing_lag(world: World) -> float:
    """How late position and velocity are on average, a pose being held until the next one arrives."""
    return world.params.values["sense.latency"] + 0.5 / world.params.values["sense.pose_rate"]


def fly(world: World, flip: Flip, state: State | None = None, seed: int = 0) -> Simulated:
    """Fly the recorded flip in the simulator, from the state at the trigger.

    Args:
        world: The vehicle, in the room of the flight (`site_overrides`).
        flip: The recorded flip.
        state: Where to start, in place of `start_state`.
        seed: Of the scatter that the vehicle has.
    """
    start = start_state(world, flip) if state is None else state
    trace = world.trace(*FLIP_AT_ONCE, flip.moment_Nmm, seed=seed, start="state", state=start,
                        period_s=_TRACE_PERIOD_S)  # fmt: skip
    rows = trace.rows
    if len(rows) < 2:
        raise ConfigError(f"flight {flip.label}: it starts at or behind the ceiling: check h_plane_m and h_surface_m")
    values = world.params.values
    # a sample shows a pose that came within the period before it
    lag_s = values["sense.latency"] + 0.5 * float(np.median(np.diff(flip.t_s)))
    gyro_max = min(values["sense.gyro_max"], _GYRO_DEFAULT_RADPS)
    rate = -np.clip(rows.w_B_radps[:, 1], -gyro_max, gyro_max)
    turned = np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(rows.t_s))))
    pitch = rows.pitch_deg[0] + np.degrees(turned)
    sampled = np.interp(flip.t_s, rows.t_s, rate)
    return Simulated(
        pitch_deg=np.interp(flip.t_s, rows.t_s, pitch),
        rate_radps=sampled,
        height_m=_late(flip, rows.t_s, rows.p_WB_m[:, 2], lag_s),
        t_contact_s=contact_time(rows.t_s, rate, _window(flip.t_s)),
        trace=trace,
    )


def quiet_world(world: World) -> World:
    """The same world without scatter, whose landings end soon after the contact."""
    return world.changed(**dict.fromkeys(SCATTER, 0.0), **_SHORT_END)


SCATTER = ("sense.position_noise", "sense.velocity_noise", "rotor.thrust_scatter", "battery.voltage_scatter",
            "sense.gyro_noise", "sense.accel_noise", "sense.attitude_noise")  # fmt: skip


def clip_rate(rate_radps: FloatArray) -> FloatArray:
    """Rates as far as every log can tell them."""
    most = _CLIP_SHARE * _GYRO_DEFAULT_RADPS
    return np.asarray(np.clip(rate_radps, -most, most))


def pitch_deg(q_WB: FloatArray) -> FloatArray:
    """Nose-up rotation of attitudes, unwrapped over time, degrees.

    Args:
        q_WB: Unit quaternions x, y, z, w, shape (n, 4); a sample that is not known gives NaN there and nowhere else.
    """
    x, y, z, w = q_WB.T
    nose_z, up_z = 2.0 * (x * z - w * y), 1.0 - 2.0 * (x * x + y * y)
    turned = np.degrees(np.arctan2(nose_z, up_z))
    known = np.isfinite(turned)
    turned[known] = np.unwrap(turned[known], period=360.0)
    return np.asarray(turned)


def _climb(flight: Flight, t_s: FloatArray, before: BoolArray) -> tuple[float, float, bool]:
    """Vertical acceleration before the trigger, its age, and whether it had to be read from the sensed velocity.

    It gives the thrust, on which the flip depends much: 1 % of rotor speed turns it by 5 degrees in 200 ms.
    """
    last = before & (t_s > -_THRUST_S)
    force = flight.stack("f", "xyz", "mps2")[last]
    known = np.isfinite(force).all(axis=1)
    if known.any():
        force, rows = force[known], np.flatnonzero(last)[known]
        x, y, z, w = flight.stack("q", "xyzw")[rows].T
        up = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)
        return float(np.mean(np.sum(up * force, axis=1))) - GRAVITY_MPS2, -float(np.mean(t_s[rows])), False
    return float(np.polyfit(t_s[before], flight["v_z_mps"][before], 1)[0]), -float(np.mean(t_s[before])), True


def contact_time(t_s: FloatArray, rate_radps: FloatArray, window_s: float) -> float:
    """When a flip's rate first falls sharply within a window; NaN if it does not.

    A gyro at its full scale hides a contact, in a recording and in the simulation alike.

    Args:
        t_s: Times, shape (n,).
        rate_radps: Nose-up rate, shape (n,).
        window_s: Of the fall; recordings and simulations that are compared have the same.
    """
    rate = clip_rate(rate_radps)
    earlier = np.interp(t_s - window_s, t_s, rate)
    falls = (t_s > _CONTACT_AFTER_S) & (earlier > _CONTACT_RATE_RADPS) & (rate < earlier - _CONTACT_DROP_RADPS)
    if not falls.any():
        return float("nan")
    return float(t_s[np.argmax(falls)]) - 0.5 * float(np.median(np.diff(t_s)))


def _window(t_s: FloatArray) -> float:
    """A window that this recording resolves."""
    return max(float(np.median(np.diff(t_s))), _CONTACT_WINDOW_S)


def _approach(flight: Flight) -> tuple[float, float] | None:
    speed_mps, angle_deg = float(flight.info["speed_mps"]), float(flight.info["angle_deg"])
    return (round(speed_mps, 2), round(angle_deg, 1)) if np.isfinite([speed_mps, angle_deg]).all() else None


def _trigger_age(flight: Flight) -> float:
    """Time from the trigger to the first sample after it; half a period where the log does not tell."""
    known = float(flight.info["trigger_age_s"])
    return known if np.isfinite(known) else 0.5 * float(np.median(np.diff(flight["t_s"])))


def _check(flight: Flight) -> None:
    for name in ("t_trigger_s", "moment_Nmm", "h_plane_m"):
        if not np.isfinite(flight.info[name]):
            missing = "it did not trigger" if name == "t_trigger_s" else f"{name} is not known"
            raise ConfigError(f"flight {flight.label}: {missing}")
    if not flight.has(*POSE):
        missing = next(name for name in POSE if not flight.has(name))
        raise ConfigError(f"flight {flight.label}: column {missing} is not in the log")


def _fresh(flight: Flight) -> BoolArray:
    """Samples that differ from the one before: a log repeats its last value while nothing new has come."""
    pose = np.stack([flight[name] for name in POSE], axis=1)
    changed = (np.diff(pose, axis=0) != 0.0).any(axis=1)
    return np.concatenate(([True], changed)) & _complete(flight)


def _complete(flight: Flight) -> BoolArray:
    return np.asarray(np.isfinite(np.stack([flight[name] for name in POSE], axis=1)).all(axis=1))


def _new_pose(flight: Flight) -> BoolArray:
    moved = np.diff(flight.stack("p", "xyz", "m"), axis=0) != 0.0
    return np.concatenate(([True], moved.any(axis=1)))


def _unit(q_WB: FloatArray) -> FloatArray:
    return np.asarray(q_WB / np.linalg.norm(q_WB))


def _open_circuit(flight: Flight, t_s: FloatArray) -> float | None:
    """Voltage after the motors were cut; None if the log does not tell."""
    volts = flight["battery_V"][(t_s > _SETTLED_S[0]) & (t_s < _SETTLED_S[1])]
    under_load = flight["battery_V"][(t_s > -0.2) & (t_s <= 0.0)]
    if not np.isfinite(volts).any() or not np.isfinite(under_load).any():
        return None
    settled = float(np.nanmedian(volts))
    return settled if settled > float(np.nanmedian(under_load)) else None


def _hanging(flight: Flight, pitch: FloatArray) -> float:
    """Height over the last tenth of the flight, if the vehicle hangs there inverted and still."""
    last = slice(-max(len(flight) // 10, 3), None)
    height = flight["track_p_z_m"] if flight.has("track_p_z_m") else flight["p_z_m"]
    heights = height[last][np.isfinite(height[last])]
    inverted = bool((np.abs(pitch[last] % 360.0 - 180.0) < _HANGING_DEG).all())
    still = bool((np.abs(flight["w_y_radps"][last]) < 2.0).all())
    return float(np.median(heights)) if len(heights) and inverted and still else float("nan")


def _late(flip: Flip, t_s: FloatArray, values: FloatArray, lag_s: float) -> FloatArray:
    """A signal as it arrives `lag_s` late; before the start it goes on as it was recorded to move."""
    at = flip.t_s - lag_s
    slope = (values[1] - values[0]) / (t_s[1] - t_s[0])
    return np.asarray(np.where(at < 0.0, values[0] + slope * at, np.interp(at, t_s, values)))
