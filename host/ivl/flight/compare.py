"""Recorded flights against the simulation: motion after the trigger, outcome of each flight, landing window.

Motion: each flip is flown once from its recorded state at the trigger, without scatter. Outcome: it is flown many times
from that state, which is known only so well (`Uncertainty`); the share of simulated landings is the prediction. Window:
landings from hover over the thresholds around those that were flown, at the moments that were flown.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl.errors import ConfigError, IvlError
from ivl.flight import motion
from ivl.flight.motion import Flip, Simulated
from ivl.flight.store import Flights, FloatArray
from ivl.world import State, World

LANDED_LEGS = 3
"""A landing is three or four feet on the ceiling, as in the study."""
CLASSES = (4, 2, 0)
"""Endings: three or four feet, one or two, none."""
_WINDOW_RATE = 0.5
_POLICY_ROLLOUTS = 1000
_WINDOW_ROLLOUTS, _WINDOW_STEP_PER_S, _WINDOW_MARGIN_PER_S = 64, 0.05, 0.6
GROUP_NMM, _GROUP_FLIGHTS = 0.3, 3
_BOOTSTRAPS = 2000
_TRIGGER_LATE_S = 0.003
"""A flip that the simulated vehicle begins later than this, more than a tick, is another flip."""
_BANDS = (10.0, 50.0, 90.0)


@dataclass(frozen=True)
class Uncertainty:
    """How well a recording tells the state at the trigger; standard deviations.

    A log row is up to a period off in time: 3 ms at 2.6 m/s are 8 mm. Velocity: filters of the state estimate differ by
    this much from the slope of the tracked height. Moment: the two front motors of a vehicle, battery to battery.
    """

    height_m: float = 0.008
    velocity_mps: float = 0.05
    rate_radps: float = 0.1
    moment_norm: float = 0.01
    rotor_norm: float = 0.01


@dataclass(frozen=True)
class Row:
    """One flight of a comparison.

    Attributes:
        flip: What was recorded.
        simulated: The same flip flown once, without scatter.
        rates: Share of simulated endings of each class of `CLASSES`.
        n_legs_flown: Class of the recorded ending, None if nobody judged it.
    """

    flip: Flip
    simulated: Simulated
    rates: tuple[float, float, float]
    n_legs_flown: int | None


@dataclass(frozen=True)
class Window:
    """Landing rate over the threshold, at one moment.

    Attributes:
        approach: Speed (m/s) and angle (degrees).
        moment_Nmm: Moment, N mm.
        threshold_per_s: Thresholds, shape (n,).
        rate: Share of landings from hover, shape (n,).
        flown: Threshold and class of each flight near this moment.
    """

    approach: tuple[float, float]
    moment_Nmm: float
    threshold_per_s: FloatArray
    rate: FloatArray
    flown: tuple[tuple[float, int], ...]

    def has(self, flip: Flip) -> bool:
        """True for a flight of this approach and nearly this moment."""
        return flip.approach == self.approach and abs(flip.moment_Nmm - self.moment_Nmm) <= GROUP_NMM

    def span(self) -> tuple[float, float] | None:
        """Smallest and largest threshold at which half of the simulated landings succeed; None if there is none."""
        good = self.threshold_per_s[self.rate >= _WINDOW_RATE]
        return (float(good.min()), float(good.max())) if len(good) else None

    def flown_span(self) -> tuple[float, float] | None:
        """Smallest and largest threshold of the flights that landed."""
        landed = [rrev for rrev, legs in self.flown if legs >= LANDED_LEGS]
        return (min(landed), max(landed)) if landed else None


@dataclass(frozen=True)
class Comparison:
    """Flights and simulation side by side; `summary` gives the figures."""

    rows: tuple[Row, ...]
    left_out: tuple[str, ...]
    windows: tuple[Window, ...]
    at_policies: tuple[tuple[float, float, float], ...]

    def summary(self) -> dict[str, Any]:
        """Every figure by name, ready for JSON."""
        motion_figures = motion_errors([(row.flip, row.simulated) for row in self.rows])
        return {
            "n_flights": len(self.rows),
            "left_out": list(self.left_out),
            **motion_figures,
            **self._outcomes(),
            "windows": [self._window(window) for window in self.windows],
            "policies": [
                {"threshold_per_s": rrev, "moment_Nmm": moment, "rate": rate} for rrev, moment, rate in self.at_policies
            ],
        }

    def _outcomes(self) -> dict[str, Any]:
        judged = [row for row in self.rows if row.n_legs_flown is not None]
        if not judged:
            return {"n_judged": 0}
        rates = np.array([row.rates for row in judged])
        flown = np.array([row.n_legs_flown for row in judged])
        landed = flown >= LANDED_LEGS
        by_legs = {str(c): float(rates[flown == c, 0].mean()) if (flown == c).any() else None for c in CLASSES}
        confusion = {
            str(c): dict(zip(map(str, CLASSES), map(float, rates[flown == c].sum(axis=0)), strict=True))
            for c in CLASSES
        }
        both = bool(landed.any() and not landed.all())  # ranking needs flights of both kinds
        return {
            "n_judged": len(judged),
            "landed_auc": auc(rates[:, 0], landed) if both else None,
            "landed_auc_95": interval(lambda i: auc(rates[i, 0], landed[i]), len(judged)) if both else None,
            "landed_brier": brier(rates[:, 0], landed),
            "landed_brier_95": interval(lambda i: brier(rates[i, 0], landed[i]), len(judged)),
            "rate_by_flown_legs": by_legs,
            "legs_confusion": confusion,
            "two_leg_share": {"flown": float((flown == 2).mean()), "simulated": float(rates[:, 1].mean())},
        }

    @staticmethod
    def _window(window: Window) -> dict[str, Any]:
        return {
            "speed_mps": window.approach[0],
            "angle_deg": window.approach[1],
            "moment_Nmm": window.moment_Nmm,
            "simulated_threshold_per_s": window.span(),
            "landed_threshold_per_s": window.flown_span(),
            "threshold_per_s": window.threshold_per_s.tolist(),
            "rate": window.rate.tolist(),
        }


def flips(flights: Flights) -> tuple[list[Flip], list[str]]:
    """Every flip that can be compared, and one line for each flight that cannot."""
    found, left_out = [], []
    for flight in flights:
        if not flight.info["usable"]:
            left_out.append(f"flight {flight.label}: not usable: {flight.info['note']}")
            continue
        try:
            found.append(motion.flip(flight))
        except ConfigError as error:
            left_out.append(str(error))
    if not found:
        why = left_out[0] if left_out else "the folder has none"
        raise ConfigError(f"no flight can be compared: {why}")
    return found, left_out


def compare(
    flights: Flights,
    home: World,
    n: int = 64,
    seed: int = 0,
    policies: Sequence[tuple[float, float]] = (),
    uncertainty: Uncertainty | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Compare recorded flights with a simulated vehicle.

    Args:
        flights: Recorded flights.
        home: Vehicle and landing gear to compare with; the flights give the ceiling of their room.
        n: Simulated landings for each flight.
        seed: Of everything random.
        policies: Further policies (RREV_c in 1/s, M_yd in N mm) whose landing rate from hover is wanted.
        uncertainty: Of the recorded state at the trigger.
        progress: Called with the number of flights done and their total.

    Raises:
        ConfigError: No flight can be compared.
    """
    found, left_out = flips(flights)
    approach = _usual([flip.approach for flip in found if flip.approach is not None])
    if policies and approach is None:
        raise ConfigError(
            "--policy: the flights do not say their speed and angle: import them with --speed and --angle"
        )
    found, refused = flyable(home, found)
    left_out += refused
    rng = np.random.default_rng(seed)
    rows = []
    for number, flip in enumerate(found):
        world = in_room(home, flip)
        rates = _predict(world, flip, n, rng, uncertainty or Uncertainty())
        quiet = motion.quiet_world(world)
        rows.append(Row(flip, motion.fly(quiet, flip), rates, class_of(flip.n_legs)))
        if progress:
            progress(number + 1, len(found))
    windows: tuple[Window, ...] = ()
    at_policies: list[tuple[float, float, float]] = []
    if approach is not None:
        usual = _usual([_room(flip) for flip in found if flip.approach == approach])
        alike = [flip for flip in found if flip.approach == approach and _room(flip) == usual]
        site = in_room(home, alike[0]) if alike else home
        groups = _groups([flip for flip in alike if np.isfinite(flip.threshold_per_s)])
        windows = tuple(_window(site, approach, group, moment) for moment, group in groups)
        at_policies = [
            (rrev, moment, _rate(site, approach, rrev, moment, _POLICY_ROLLOUTS)) for rrev, moment in policies
        ]
    return Comparison(tuple(rows), tuple(left_out), windows, tuple(at_policies))


def flyable(home: World, found: Sequence[Flip]) -> tuple[list[Flip], list[str]]:
    """Flips that the simulation can start as they were recorded, and one line for each that it cannot.

    Raises:
        ConfigError: It can start none.
    """
    good, refused = [], []
    for flip in found:
        try:
            simulated = motion.fly(motion.quiet_world(in_room(home, flip)), flip)
        except IvlError as error:
            refused.append(str(error) if flip.label in str(error) else f"flight {flip.label}: {error}")
            continue
        if float(simulated.trace.outcome.t_trigger_s) <= _TRIGGER_LATE_S:
            good.append(flip)
        else:
            refused.append(f"flight {flip.label}: it moves away from the ceiling at its trigger")
    if not good:
        raise ConfigError(f"no flight can be flown: {refused[0]}")
    return good, refused


def in_room(world: World, flip: Flip) -> World:
    """The vehicle in the room of the flight."""
    return world.changed(**motion.site_overrides(flip, world.params.values["world.sensed_gap_offset"]))


def motion_errors(pairs: Sequence[tuple[Flip, Simulated]]) -> dict[str, Any]:
    """Differences of recorded and simulated motion up to 200 ms after the trigger, over all samples of all flights."""
    errors: dict[str, list[FloatArray]] = {"pitch": [], "height": [], "rate": []}
    contacts = []
    for flip, simulated in pairs:
        used = flip.compared()
        errors["pitch"].append((simulated.pitch_deg - flip.pitch_deg)[used])
        errors["height"].append((simulated.height_m - flip.height_m)[used & flip.is_new_pose])
        rates = motion.clip_rate(simulated.rate_radps) - motion.clip_rate(flip.rate_radps)
        errors["rate"].append(rates[used])
        contacts.append(simulated.t_contact_s - flip.t_contact_s)
    both = np.array([c for c in contacts if np.isfinite(c)])
    return {
        "pitch_rms_deg": _rms(errors["pitch"]),
        "height_rms_m": _rms(errors["height"]),
        "rate_rms_radps": _rms(errors["rate"]),
        "t_contact_error_s": float(np.median(both)) if len(both) else None,
        "t_contact_spread_s": float(np.std(both)) if len(both) else None,
        "n_contacts": len(both),
    }


def _rms(parts: Sequence[FloatArray]) -> float:
    whole = np.concatenate(parts)
    return float(np.sqrt(np.mean(whole**2))) if len(whole) else float("nan")


def class_of(n_legs: float) -> int | None:
    """Class of an ending; None if nobody judged it."""
    if not np.isfinite(n_legs):
        return None
    return 4 if n_legs >= LANDED_LEGS else 2 if n_legs >= 1 else 0


def auc(score: FloatArray, landed: npt.NDArray[np.bool_]) -> float:
    """Chance that a flight that landed was given a higher rate than one that did not; ties count half."""
    yes, no = score[landed], score[~landed]
    if not len(yes) or not len(no):
        return float("nan")
    higher, equal = yes[:, None] > no, yes[:, None] == no
    return float(np.mean(higher + 0.5 * equal))


def brier(rate: FloatArray, landed: npt.NDArray[np.bool_]) -> float:
    """Mean square of predicted rate minus what happened."""
    return float(np.mean((rate - landed) ** 2))


def interval(figure: Callable[[npt.NDArray[np.intp]], float], n: int) -> tuple[float, float]:
    """95 % interval of a figure of n flights, by resampling flights."""
    rng = np.random.default_rng(0)
    drawn = np.array([figure(rng.integers(0, n, n)) for _ in range(_BOOTSTRAPS)])
    low, high = np.nanpercentile(drawn, (2.5, 97.5))
    return float(low), float(high)


def scattered(start: State, n: int, rng: np.random.Generator, known: Uncertainty) -> State:
    """The state at the trigger n times, each as it may have been."""
    p, v = np.tile(np.asarray(start.p_W_m), (n, 1)), np.tile(np.asarray(start.v_W_mps), (n, 1))
    w, rotors = np.tile(np.asarray(start.w_B_radps), (n, 1)), np.tile(np.asarray(start.rotor_radps), (n, 1))
    p[:, 2] += rng.normal(0.0, known.height_m, n)
    v[:, 2] += rng.normal(0.0, known.velocity_mps, n)
    w[:, 1] += rng.normal(0.0, known.rate_radps, n)
    rotors *= 1.0 + rng.normal(0.0, known.rotor_norm, (n, 1))
    q = np.tile(np.asarray(start.q_WB), (n, 1))
    return replace(start, p_W_m=p, v_W_mps=v, w_B_radps=w, rotor_radps=np.abs(rotors), q_WB=q)


def _predict(
    world: World, flip: Flip, n: int, rng: np.random.Generator, known: Uncertainty
) -> tuple[float, float, float]:
    state = scattered(motion.start_state(world, flip), n, rng, known)
    moments = np.clip(flip.moment_Nmm * (1.0 + rng.normal(0.0, known.moment_norm, n)), 0.0, None)
    seed = int(rng.integers(2**62))
    outcomes = world.rollouts(*motion.FLIP_AT_ONCE, moments, seed=seed, start="state", state=state)
    legs = np.asarray(outcomes.n_legs)
    shares = (legs >= LANDED_LEGS, (legs > 0) & (legs < LANDED_LEGS), legs == 0)
    landed, two, none = (float(np.mean(share)) for share in shares)
    return landed, two, none


def _usual(values: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    """The value that most flights have; None without any."""
    return max(values, key=values.count) if values else None


def _room(flip: Flip) -> tuple[float, float]:
    """Plane of the cues and surface of the ceiling; the latter -1 if it was not measured."""
    return flip.h_plane_m, flip.h_surface_m if np.isfinite(flip.h_surface_m) else -1.0


def _groups(found: Sequence[Flip]) -> list[tuple[float, list[Flip]]]:
    """Flights of nearly the same moment, largest group first; groups of a few flights only are left out."""
    moments = np.array([flip.moment_Nmm for flip in found])
    left = np.ones(len(found), dtype=bool)
    groups = []
    while left.any():
        near = left & (np.abs(moments - moments[:, None]) <= 0.5 * GROUP_NMM)
        chosen = near[int(np.argmax(np.where(left, near.sum(axis=1), -1)))]
        if chosen.sum() < _GROUP_FLIGHTS:
            break
        groups.append(
            (float(np.median(moments[chosen])), [flip for flip, near_it in zip(found, chosen, strict=True) if near_it])
        )
        left &= ~chosen
    return groups


def _window(world: World, approach: tuple[float, float], group: Sequence[Flip], moment_Nmm: float) -> Window:
    thresholds = [flip.threshold_per_s for flip in group]
    low, high = min(thresholds) - _WINDOW_MARGIN_PER_S, max(thresholds) + _WINDOW_MARGIN_PER_S
    grid = np.arange(max(low, 0.5), high, _WINDOW_STEP_PER_S)
    rate = np.array([_rate(world, approach, float(rrev), moment_Nmm, _WINDOW_ROLLOUTS) for rrev in grid])
    flown = [(flip.threshold_per_s, class_of(flip.n_legs)) for flip in group]
    known = tuple((rrev, legs) for rrev, legs in flown if legs is not None)
    return Window(approach, moment_Nmm, grid, rate, known)


def _rate(world: World, approach: tuple[float, float], threshold_per_s: float, moment_Nmm: float, n: int) -> float:
    streams = np.arange(n, dtype=np.uint64)
    outcomes = world.rollouts(*approach, threshold_per_s, moment_Nmm, start="flown", stream=streams)
    return float(np.mean(np.asarray(outcomes.n_legs) >= LANDED_LEGS))


def bands(world: World, flip: Flip, n: int, seed: int, known: Uncertainty) -> tuple[FloatArray, FloatArray]:
    """Times, and the 10th, 50th and 90th percentile of pitch, height and rate over the scatter.

    Returns:
        Times, shape (n_times,), and bands, shape (3, 3, n_times): signal (pitch in degrees, height in m, rate in
        rad/s), percentile, time.
    """
    rng = np.random.default_rng(seed)
    state = scattered(motion.start_state(world, flip), n, rng, known)
    times = np.arange(0.0, 0.45, 0.005)
    at = replace(flip, t_s=times)
    signals = np.empty((3, n, len(times)))
    for i in range(n):
        one = State(**{name: _nth(value, i) for name, value in vars(state).items()})
        simulated = motion.fly(world, at, one, seed=i)
        signals[:, i] = simulated.pitch_deg, simulated.height_m, simulated.rate_radps
    return times, np.moveaxis(np.percentile(signals, _BANDS, axis=1), 0, 1)


def _nth(value: Any, i: int) -> Any:
    return value[i] if isinstance(value, np.ndarray) and value.ndim == 2 else value
