"""A recorded flight as the flight core is told it, tick by tick.

The core ticks at its own rate; what was logged is held until the next sample, as a vehicle holds what its estimator and
its radio bring. The request is IDLE, HOVER shortly before the approach, and APPROACH from the sample on at which the
recorded one began.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl import forms, native
from ivl.errors import ArgumentError, ConfigError
from ivl.flight import phases
from ivl.flight.store import Flight, FloatArray
from ivl.world import World

IntArray = npt.NDArray[np.int64]

HOVER_S = 1.0
"""The request is HOVER for so long before the approach, and firmware.ready_s_min longer."""
FLIGHT_S_MAX = 3600.0
ASK_IDLE, ASK_HOVER, ASK_APPROACH = range(3)
"""Requests, ivl_request_t."""

_ABSURD = 1.0e9
_SLACK_S = 1.0e-6  # a sample that falls due at a tick is seen by that tick, whatever its time was rounded to
_NEEDED = (("p", "xyz", "m"), ("v", "xyz", "mps"), ("q", "xyzw", ""), ("w", "xyz", "radps"))


@dataclass(frozen=True)
class Ticks:
    """What the core is told of one flight.

    Attributes:
        inputs: One record of the library's table of replay inputs a tick.
        seen: For each sample the number of the tick that sees it first.
        fed: False for a sample that a later one replaced before a tick came.
        begins: Sample at which the approach begins; the number of samples if there is none.
        begun_by: What says so: "phase", "set-point", "closing speed", or "nothing".
        policy: Number of the form, and parameters in SI units, as committed.
        config: Configuration of the core, one record.
        notes: What was not in the log, one phrase each.
    """

    inputs: npt.NDArray[np.void]
    seen: IntArray
    fed: npt.NDArray[np.bool_]
    begins: int
    begun_by: str
    policy: tuple[int, FloatArray]
    config: npt.NDArray[np.void]
    notes: tuple[str, ...]


def trigger_sample(flight: Flight) -> int | None:
    """First sample after the trigger, as logged; None if the log tells of none."""
    on = np.zeros(len(flight), dtype=bool)
    if flight.has("triggered"):
        on = flight["triggered"] > 0.5
    elif np.isfinite(flight.info["t_trigger_s"]):
        on = flight["t_s"] >= flight.info["t_trigger_s"] - _SLACK_S
    elif flight.has("phase"):
        on = phases.trigger(flight["phase"])[1] > 0.5
    return int(np.argmax(on)) if on.any() else None


def tells_trigger(flight: Flight) -> bool:
    """True if the log would show a trigger."""
    return flight.has("triggered") or flight.has("phase") or bool(np.isfinite(flight.info["t_trigger_s"]))


def why_not(flight: Flight) -> str:
    """Why a flight cannot be replayed; empty if it can."""
    missing = [stem for stem, axes, suffix in _NEEDED if not np.isfinite(flight.stack(stem, axes, suffix)).all(1).any()]
    if missing:
        return f"the log has no {', '.join(missing)}: a replay needs position, velocity, attitude and rates"
    length_s = flight["t_s"][-1] - flight["t_s"][0]
    return f"it lasts {length_s:.0f} s (allowed 0 .. {FLIGHT_S_MAX:.0f} s)" if length_s > FLIGHT_S_MAX else ""


def make(flight: Flight, world: World, battery: bool = False) -> Ticks:
    """Turn a flight into the ticks of a core as `world` configures it.

    Args:
        flight: One for which `why_not` has no answer.
        world: Gives the configuration; the plane of the cues is the flight's own, where the log tells it.
        battery: Tell the core of the logged battery, so that its rules about it apply.

    Raises:
        ConfigError: The configuration asks for sensors that no log of flights has, or the plane is out of range.
    """
    config = _configure(flight, world)
    rate_hz = float(config["ivl.tick_hz"][0])
    t_s = flight["t_s"] - flight["t_s"][0]
    seen = np.ceil((t_s - _SLACK_S) * rate_hz).astype(np.int64)
    ticks = np.arange(seen[-1] + 1)
    latest = np.searchsorted(seen, ticks, side="right") - 1
    begins, begun_by = find_approach(flight)
    inputs = np.zeros(len(ticks), dtype=native.library().replay_in_dtype)
    inputs["t_us"] = _clock_us(ticks / rate_hz)
    with np.errstate(over="ignore"):  # what is too large for the core's numbers becomes infinite, and is refused
        notes = _tell_state(inputs, flight, t_s, latest, float(config["ivl.gravity"][0]))
        _tell_request(inputs, flight, begins, latest, config)
    if battery:
        _tell_battery(inputs, flight, latest)
    policy, policy_note = _policy(flight)
    notes += [policy_note] if policy_note else []
    notes += [] if np.isfinite(flight.info["h_plane_m"]) else ["the plane of the cues is the world's, not the log's"]
    return Ticks(inputs, seen, np.append(np.diff(seen) > 0, True), begins, begun_by, policy, config, tuple(notes))


def find_approach(flight: Flight) -> tuple[int, str]:
    """Sample at which the recorded approach began, and what tells so.

    In this order: the logged phase; the set-point's velocity, which is not zero from then on until the trigger; the
    closing speed, which is positive from then on until the trigger. Without a trigger, until its largest value.
    """
    n, trigger = len(flight), trigger_sample(flight)
    if flight.has("phase"):
        began = np.isin(flight["phase"], (phases.APPROACH, phases.FLIP))
        return (int(np.argmax(began)), "phase") if began.any() else (n, "nothing")
    speed = np.linalg.norm(_numbers(flight.stack("set_v", "xyz", "mps")), axis=1)
    for known, told_by in ((speed, "set-point"), (_numbers(flight["v_z_mps"]), "closing speed")):
        last = int(np.argmax(known)) if trigger is None else max(trigger - 1, 0)
        if known[last] > 0.0:
            stands = np.flatnonzero(known[: last + 1] <= 0.0)
            return (int(stands[-1]) + 1 if len(stands) else 0), told_by
    return n, "nothing"


def _numbers(values: FloatArray) -> FloatArray:
    """What is unknown is 0, and what is absurd is large."""
    return np.clip(np.nan_to_num(values, nan=0.0), -_ABSURD, _ABSURD)


def _configure(flight: Flight, world: World) -> npt.NDArray[np.void]:
    config, _ = world.native_model.config()
    if config["ivl.d_source"][0] != 0:
        raise ConfigError(
            f"firmware.d_source: value {int(config['ivl.d_source'][0])}: recorded flights hold no readings of a camera "
            "or a ranging sensor (allowed 0, the known height)"
        )
    plane_m = float(flight.info["h_plane_m"])
    if np.isfinite(plane_m):
        field = native.library().layout(native.LAYOUT_CONFIG)[0]["ivl.h_ceil"]
        if not field.lo <= plane_m <= field.hi:
            raise ConfigError(
                f"flight {flight.label}: h_plane_m: value {plane_m:g} is out of range "
                f"(allowed {field.lo:g} .. {field.hi:g} m)"
            )
        config["ivl.h_ceil"] = plane_m
    return config


def _policy(flight: Flight) -> tuple[tuple[int, FloatArray], str]:
    """What is committed; without a policy in the log the largest threshold, and nothing is said about the trigger."""
    form, theta, note = forms.by_name(forms.PAPER), [0.0, 0.0], ""
    try:
        if flight.info["form"]:
            form, theta = forms.by_name(flight.info["form"]), [float(text) for text in flight.info["theta"].split()]
        else:
            theta = [float(flight.info["threshold_per_s"]), np.nan_to_num(float(flight.info["moment_Nmm"]))]
            if np.isnan(theta[0]):
                theta, note = [form.params[0].hi, 0.0], "no policy in the log: the trigger is not compared"
        return (form.number, form.to_si(theta)), note
    except (ArgumentError, ValueError) as error:
        raise ConfigError(f"flight {flight.label}: policy: {error}") from error


def _clock_us(t_s: FloatArray) -> npt.NDArray[np.uint64]:
    """The core's clock, as in the simulator: 1 s at the first sample."""
    return np.floor((t_s + 1.0) * 1.0e6 + 0.5).astype(np.uint64)


def _tell_state(
    inputs: npt.NDArray[np.void], flight: Flight, t_s: FloatArray, latest: IntArray, gravity_mps2: float
) -> list[str]:
    """Fill in the sensed state: of each sensor the last complete sample."""
    motion = np.hstack([flight.stack("p", "xyz", "m"), flight.stack("v", "xyz", "mps")])
    held, source = _held(motion, latest)
    inputs["p_WB_m"], inputs["v_WB_mps"] = held[:, :3], held[:, 3:]
    inputs["t_pose_us"] = np.minimum(_clock_us(t_s)[source], inputs["t_us"])
    inputs["q_WB"] = _held(flight.stack("q", "xyzw"), latest)[0]
    inputs["w_B_radps"] = _held(flight.stack("w", "xyz", "radps"), latest)[0]
    if not flight.has("f_x_mps2", "f_y_mps2", "f_z_mps2"):
        inputs["f_B_mps2"] = (0.0, 0.0, gravity_mps2)
        return ["no accelerometer in the log: the replay feels no contact"]
    inputs["f_B_mps2"] = _held(flight.stack("f", "xyz", "mps2"), latest)[0]
    return []


def _held(values: FloatArray, latest: IntArray) -> tuple[FloatArray, IntArray]:
    """For each tick the last complete sample up to the latest one, and its number; NaN where there is none yet."""
    whole = np.isfinite(values).all(axis=1)
    source = np.maximum.accumulate(np.where(whole, np.arange(len(values)), -1))[latest]
    return np.where(source[:, None] >= 0, values[source], np.nan), np.maximum(source, 0)


def _tell_request(
    inputs: npt.NDArray[np.void], flight: Flight, begins: int, latest: IntArray, config: npt.NDArray[np.void]
) -> None:
    """Fill in the operator's requests and their arguments."""
    wait_s = HOVER_S + float(config["ivl.ready_s_min"][0])
    idle = flight["t_s"] < flight["t_s"][min(begins, len(flight) - 1)] - wait_s
    if flight.has("phase"):
        idle = flight["phase"] == phases.IDLE
    request = np.select([idle, np.arange(len(flight)) >= begins], [ASK_IDLE, ASK_APPROACH], ASK_HOVER)
    inputs["request"] = request[latest]
    set_p = flight.stack("set_p", "xyz", "m")
    has_point = np.isfinite(set_p).all(axis=1, keepdims=True)
    hover = np.where(has_point, set_p, flight.stack("p", "xyz", "m"))
    inputs["p_hover_W_m"] = _held(hover, latest)[0]
    inputs["speed_mps"], inputs["angle_rad"] = _approach_arguments(flight, begins)


def _approach_arguments(flight: Flight, begins: int) -> tuple[float, float]:
    """Speed in m/s and angle in rad: as asked for, or those of the fastest set-point, or of the fastest motion."""
    speed_mps, angle_deg = float(flight.info["speed_mps"]), float(flight.info["angle_deg"])
    if np.isfinite(speed_mps) and np.isfinite(angle_deg):
        return speed_mps, float(np.deg2rad(angle_deg))
    trigger = trigger_sample(flight)
    during = slice(min(begins, len(flight) - 1), None if trigger is None else max(trigger, begins + 1))
    for stem in ("set_v", "v"):
        velocity = _numbers(flight.stack(stem, "xyz", "mps")[during])
        speed = np.linalg.norm(velocity, axis=1)
        if speed.max() > 0.0:
            x, y, z = velocity[int(np.argmax(speed))]
            return float(speed.max()), float(np.clip(np.arctan2(z, np.hypot(x, y)), 0.0, 0.5 * np.pi))
    return speed_mps, 0.0


def _tell_battery(inputs: npt.NDArray[np.void], flight: Flight, latest: IntArray) -> None:
    """Fill in the battery, and that all else is well, from the tick after the first request on.

    A log tells of the battery under load; the rule about a battery at rest, which the core asks before it arms, is left
    out. An unknown voltage counts as an empty battery.
    """
    armed = np.arange(len(inputs)) > np.argmax(inputs["request"] != ASK_IDLE)
    for name in ("vitals_given", "configured", "can_fly"):
        inputs[name] = armed
    inputs["battery_V"] = _numbers(_held(flight["battery_V"][:, None], latest)[0][:, 0])
