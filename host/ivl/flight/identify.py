"""The vehicle that flew: parameters from recorded motion, never from outcomes.

Least squares over flights (scipy's trust-region method), with the values of the vehicle file as a prior: value and
`sigma` of each fitted parameter, and the ranges of the parameter table as bounds.

    residuals of a flight   pitch, rate, sensed height from the trigger to 200 ms or the contact; time of the contact
    of all flights          mean height at which the vehicle hung inverted and still
    weights                 the spread of each kind of residual, estimated from the fit itself, and the number of
                            samples that are worth one independent look

Samples of one flight are alike: its whole motion shifts with the trigger's jitter. Intervals therefore come from
resampling whole flights, each time solved anew with the fit's own derivatives. What all flights share is drawn about
itself instead: the prior, the hanging height, which is as uncertain as the place of the tracked point in the body, and
the rotor speeds at the trigger, which a climb tells to 1 % or so: an error that all flights share is fitted along.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats  # type: ignore[import-untyped]
from scipy.optimize import least_squares  # type: ignore[import-untyped]

from ivl import model, native, yamlfile
from ivl.errors import ConfigError
from ivl.flight import compare, motion
from ivl.flight.motion import Flip
from ivl.flight.store import Flights, FloatArray
from ivl.world import World

Spread = dict[str, float]

KINDS = ("pitch", "rate", "height", "contact")
"""Kinds of residuals, in the order of the residual vector of a flight."""
_START_SPREAD = {"pitch": 4.0, "rate": 1.0, "height": 0.01, "contact": 0.006}
_LEAST_SPREAD = {"pitch": 0.3, "rate": 0.1, "height": 0.001, "contact": 0.002}
"""Units: degrees, rad/s, m, s. A fit never claims to be better than the least."""
_LOOKS = {"pitch": 3.0, "rate": 3.0, "height": 3.0, "contact": 1.0}
"""Independent looks that the samples of one flight are worth together."""
_FACTOR = 20.0
"""No parameter is sought further from its prior than this factor; one that is 0 anywhere in its range."""
_ROTOR_SIGMA, _FAR = 0.006, 10.0
"""Common relative error of the rotor speeds at the trigger, which are read from the climb."""
_PITCH_GROWTH_DEG, _RATE_GROWTH_RADPS = 20.0, 5.0
_CONTACT_FAR_S = 0.04
_HANGING_SIGMA_M = 0.01
"""Of the tracked point above the centre of mass, twice: it hangs as far below as it flew above."""
_STARTS, _FITTED_STARTS = 24, 3
_ROUNDS, _EVALUATIONS, _SETTLED = 6, 20, 0.05
_STEP = 0.02
"""For derivatives, in units of the prior's spread: motion is smooth, the time of a contact is not."""
_RESAMPLES = 1000
_ALIKE, _SILENT = 0.9, 0.8
_UNSEEN = 1e-6
"""Information about a parameter, in units of its scale, below which the flights do not depend on it."""
_NORMAL_95 = 1.96
_FITTED_GROUPS = ("world", "body", "rotor", "battery", "aero", "sense", "prop_plate", "base_plate", "plate")


@dataclass(frozen=True)
class Prior:
    """What is known of a parameter before the flights.

    Attributes:
        value: In the unit of the parameter table.
        sigma: Standard deviation; infinite if the file gives none.
        lo: Smallest allowed value.
        hi: Largest allowed value.
    """

    value: float
    sigma: float
    lo: float
    hi: float

    @property
    def scale(self) -> float:
        """Size of a typical change, for the solver."""
        if np.isfinite(self.sigma):
            return self.sigma
        return abs(self.value) / 10 or (self.hi - self.lo) / 100


@dataclass(frozen=True)
class Estimate:
    """A fitted parameter: value, standard deviation and 95 % interval, with its prior."""

    name: str
    unit: str
    prior: Prior
    value: float
    sigma: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class Identification:
    """Result of a fit.

    Attributes:
        estimates: Fitted parameters.
        correlation: Of the estimates, shape (n, n).
        used: Labels of the flights that were fitted.
        held_out: Labels of those that were not.
        spread: Spread of each kind of residual.
        before: Motion errors of the vehicle as it was, of fitted and held-out flights.
        after: The same of the fitted vehicle.
        words: What the flights cannot tell, one sentence each.
        left_out: Flights that could not be used, one line each.
        draws: Equally good fits: parameter values of resampled flights, shape (n_draws, n_parameters).
        held: Parameters that were changed and held.
        rotor_error: Fitted common error of the recorded rotor speeds at the trigger, as a share; `after` is without it.
    """

    estimates: tuple[Estimate, ...]
    correlation: FloatArray
    used: tuple[str, ...]
    held_out: tuple[str, ...]
    spread: Mapping[str, float]
    before: Mapping[str, Any]
    after: Mapping[str, Any]
    words: tuple[str, ...]
    left_out: tuple[str, ...]
    draws: FloatArray
    held: Mapping[str, float]
    rotor_error: float

    def overrides(self) -> dict[str, float]:
        """The fitted values, as overrides of a world."""
        return {estimate.name: estimate.value for estimate in self.estimates}

    def summary(self) -> dict[str, Any]:
        """Every figure by name, ready for JSON."""
        return {
            "n_flights": len(self.used),
            "held_out": list(self.held_out),
            "left_out": list(self.left_out),
            "parameters": {
                e.name: {"unit": e.unit, "prior": e.prior.value,
                         "prior_sigma": e.prior.sigma if np.isfinite(e.prior.sigma) else None,
                         "value": e.value, "sigma": e.sigma, "interval_95": list(e.interval)}
                for e in self.estimates
            },
            "correlation": self.correlation.tolist(),
            "spread": dict(self.spread),
            "held": dict(self.held),
            "rotor_error": self.rotor_error,
            "before": dict(self.before),
            "after": dict(self.after),
            "words": list(self.words),
        }  # fmt: skip


def identify(
    flights: Flights,
    home: World,
    names: Sequence[str],
    sigmas: Mapping[str, float] | None = None,
    held_out: Callable[[int, Flip], bool] | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Fit parameters of a vehicle to the motion of recorded flights.

    Args:
        flights: Recorded flights.
        home: Vehicle to start from and landing gear that was flown; parameters that it overrides are held.
        names: Parameters to fit, by dotted name.
        sigmas: Prior standard deviations in place of those of the file.
        held_out: True for a flight (by number and flip) that is not fitted but judged.
        seed: Of the resampling.
        progress: Called with a line after each round.

    Raises:
        ConfigError: A name is unknown or cannot be fitted, or no flight can be used.
    """
    if home.sensing is not None:
        raise ConfigError(f"sensing: {home.sensing}: a vehicle is identified with its own sensing, which its file has")
    held = dict(home.overrides)
    _check_sigmas(names, sigmas or {})
    priors = _priors(home.vehicle, names, held, sigmas or {})
    found, left_out = compare.flips(flights)
    _check_site(names, held, found)
    found, refused = compare.flyable(home, found)
    left_out += refused
    judged = [held_out is not None and held_out(i, flip) for i, flip in enumerate(found)]
    used = [flip for flip, out in zip(found, judged, strict=True) if not out]
    apart = [flip for flip, out in zip(found, judged, strict=True) if out]
    if not used:
        raise ConfigError("no flight is left to fit: every one is held out")
    problem = _Problem(home, dict(zip(names, priors, strict=True)), used)
    rng = np.random.default_rng(seed)
    x, spread = problem.solve(rng, progress)
    at, blocks = problem.derivatives(x, spread)
    _check_seen(names, priors, blocks)
    values, draws, covariance = problem.resample(x, at, blocks, rng)
    sigma = np.sqrt(np.diag(covariance))
    reach = float(stats.t.ppf(0.975, max(len(used) - 1, 1))) * sigma  # few flights tell their own spread badly
    estimates = tuple(
        Estimate(name, native.library().params[name].unit, prior, float(v), float(s), _interval(prior, v, r))
        for name, prior, v, s, r in zip(names, priors, values, sigma, reach, strict=True)
    )
    fitted = {**held, **{e.name: e.value for e in estimates}}
    correlation = covariance / np.outer(sigma, sigma)
    before, after = ({"fitted": problem.errors(used, o), "held_out": problem.errors(apart, o)} for o in (held, fitted))
    words = _words(estimates, correlation, len(used)) + _no_better(before, after)
    labels = tuple(flip.label for flip in used), tuple(flip.label for flip in apart)
    return Identification(
        estimates, correlation, *labels, spread, before, after, words, tuple(left_out), draws, held,
        _ROTOR_SIGMA * float(x[-1]),
    )  # fmt: skip


def _check_sigmas(names: Sequence[str], sigmas: Mapping[str, float]) -> None:
    for name in sigmas:
        if name not in names:
            raise ConfigError(f"--sigma: {name}: is not fitted (fitted: {', '.join(names)})")


def _check_site(names: Sequence[str], held: Mapping[str, float], found: Sequence[Flip]) -> None:
    """The flights give the ceiling of their room; what they have measured cannot be fitted or held otherwise."""
    measured = any(np.isfinite(flip.h_surface_m) for flip in found)
    for option, asked in (("--fit", names), ("--set", held)):
        # a recorded number: flights were recorded under level ceilings alone
        if "world.ceiling_height" in asked:
            raise ConfigError(f"{option}: world.ceiling_height: the flights give it (h_plane_m)")
        if measured and "world.sensed_gap_offset" in asked:
            raise ConfigError(f"{option}: world.sensed_gap_offset: these flights measured it (h_surface_m)")


def _check_seen(names: Sequence[str], priors: Sequence[Prior], blocks: Sequence[FloatArray]) -> None:
    """A parameter without effect on the flights and without a prior has no value."""
    seen = np.sum([np.sum(block**2, axis=0) for block in blocks], axis=0)
    for name, prior, size in zip(names, priors, seen[:-1], strict=True):
        if not np.isfinite(prior.sigma) and size < _UNSEEN:
            raise ConfigError(
                f"--fit: {name}: the motion of these flights does not depend on it, and the vehicle file gives no "
                "sigma: leave it out, or state what is known with --sigma"
            )


def _interval(prior: Prior, value: float, reach: float) -> tuple[float, float]:
    """95 % interval: within the allowed range, and not wider than what was known before the flights."""
    half = min(reach, _NORMAL_95 * prior.sigma)
    return float(max(value - half, prior.lo)), float(min(value + half, prior.hi))


def _no_better(before: Mapping[str, Any], after: Mapping[str, Any]) -> tuple[str, ...]:
    was, now = (figures["fitted"]["pitch_rms_deg"] for figures in (before, after))
    if now <= was:
        return ()
    return (
        f"Pitch is {now:.1f} degrees off after the fit and {was:.1f} before: the fit weighs height, rate and contacts "
        "as well, and lets the rotor speeds at the trigger be off together. The old vehicle explains pitch better.",
    )


class _Problem:
    """The fit: residuals of all flights as a function of x, the parameters in units of their prior's scale."""

    def __init__(self, home: World, priors: dict[str, Prior], flips: list[Flip]) -> None:
        self._home, self._held, self._priors, self._flips = home, dict(home.overrides), priors, flips
        self._scale = np.array([prior.scale for prior in priors.values()])
        self._center = np.array([prior.value for prior in priors.values()])
        self._n = len(priors)

    def values(self, x: FloatArray) -> FloatArray:
        """Parameter values of x, whose last element is the common error of the rotor speeds; shape (..., n)."""
        return np.asarray(self._center + self._scale * x[..., : self._n])

    def overrides(self, x: FloatArray) -> dict[str, float]:
        values = zip(self._priors.items(), self.values(x), strict=True)
        return {**self._held, **{name: float(np.clip(v, prior.lo, prior.hi)) for (name, prior), v in values}}

    def world(self, flip: Flip, overrides: dict[str, float]) -> World:
        return motion.quiet_world(compare.in_room(self._home.changed(**overrides), flip))

    def errors(self, flips: Sequence[Flip], overrides: dict[str, float]) -> dict[str, Any] | None:
        """Motion errors of flights; None without any."""
        if not flips:
            return None
        rooms = _Rooms(self, overrides)
        return compare.motion_errors([(flip, motion.fly(rooms.world(flip), flip)) for flip in flips])

    def raw(self, x: FloatArray) -> list[dict[str, FloatArray]]:
        """Residuals of each flight by kind, in their own units."""
        rooms = _Rooms(self, self.overrides(x))
        factor = 1.0 + _ROTOR_SIGMA * float(x[-1])
        return [_residuals(rooms.world(flip), flip, factor) for flip in self._flips]

    def solve(self, rng: np.random.Generator, progress: Callable[[str], None] | None) -> tuple[FloatArray, Spread]:
        """Alternate between the fit and the spread of its residuals."""
        x = self._best_start(rng, dict(_START_SPREAD))
        spread = _spread(self.raw(x))
        for number in range(_ROUNDS):
            before, x = x, self._fit(x, spread)
            spread = _spread(self.raw(x))
            if progress:
                named = ", ".join(f"{n} {v:.4g}" for n, v in zip(self._priors, self.values(x), strict=True))
                progress(f"round {number + 1}: {named}")
            if np.abs(x - before).max() < _SETTLED:
                break
        return x, spread

    def _best_start(self, rng: np.random.Generator, spread: Spread) -> FloatArray:
        """The best of a few fits from points drawn from the prior: contacts make valleys of their own."""
        lo, hi = self._bounds()
        drawn = np.clip(rng.uniform(-1.5, 1.5, (_STARTS, self._n + 1)), 0.8 * lo, 0.8 * hi)
        drawn[:, -1] = 0.0
        drawn[0] = 0.0
        ranked = sorted(drawn, key=lambda x: self._cost(x, spread))
        return min((self._fit(x, spread) for x in ranked[:_FITTED_STARTS]), key=lambda x: self._cost(x, spread))

    def _cost(self, x: FloatArray, spread: Spread) -> float:
        return 0.5 * float(np.sum(self._residuals(x, spread) ** 2))

    def _residuals(self, x: FloatArray, spread: Spread) -> FloatArray:
        """Those of flights through the robust loss; what they share as it is."""
        return np.concatenate([_robust(np.concatenate(_weighted(self.raw(x), spread))), self.shared(x)])

    def _jacobian(self, x: FloatArray, spread: Spread) -> FloatArray:
        here, blocks = self.derivatives(x, spread)
        r = np.concatenate(here)
        bent = _robust(r)
        slope = np.where(np.abs(r) < 1e-6, 1.0, r / (np.sqrt(1.0 + r**2) * np.where(bent == 0.0, 1.0, bent)))
        return np.concatenate([slope[:, None] * np.concatenate(blocks), self._shared_slope(x)])

    def _fit(self, x: FloatArray, spread: Spread) -> FloatArray:
        lo, hi = self._bounds()
        result = least_squares(
            lambda x: self._residuals(x, spread),
            np.clip(x, lo + 1e-9, hi - 1e-9),
            jac=lambda x: self._jacobian(x, spread),
            bounds=(lo, hi),
            x_scale="jac",
            max_nfev=_EVALUATIONS,
            ftol=1e-4,
            xtol=1e-3,
        )
        return np.asarray(result.x)

    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        lo = np.array([p.lo for p in self._priors.values()])
        hi = np.array([p.hi for p in self._priors.values()])
        ends = (lo - self._center) / self._scale, (hi - self._center) / self._scale
        return np.append(ends[0], -_FAR), np.append(ends[1], _FAR)

    def shared(self, x: FloatArray) -> FloatArray:
        """What is not of a single flight, in standard deviations: distance from the prior, hanging height."""
        known = np.array([np.isfinite(prior.sigma) for prior in self._priors.values()] + [True])
        rooms = _Rooms(self, self.overrides(x))
        hanging = [rooms.hanging_m(flip) - flip.hanging_m for flip in self._flips if np.isfinite(flip.hanging_m)]
        height = [float(np.median(hanging)) / _HANGING_SIGMA_M] if hanging else []
        return np.concatenate([np.where(known, x, 0.0), height])

    def _shared_slope(self, x: FloatArray) -> FloatArray:
        sides = enumerate(self._sides(x))
        return np.stack(
            [(self.shared(high) - self.shared(low)) / (high[i] - low[i]) for i, (low, high) in sides], axis=1
        )

    def _sides(self, x: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Points below and above x along each parameter, within the bounds."""
        lo, hi = self._bounds()
        steps = _STEP * np.eye(len(x))
        return [(np.maximum(x - step, lo), np.minimum(x + step, hi)) for step in steps]

    def derivatives(self, x: FloatArray, spread: Mapping[str, float]) -> tuple[list[FloatArray], list[FloatArray]]:
        """Weighted residuals of each flight, and their derivatives, shape (n_residuals, n_parameters)."""
        here = _weighted(self.raw(x), spread)
        blocks = [np.zeros((len(r), len(x))) for r in here]
        for i, (low, high) in enumerate(self._sides(x)):
            above, below = _weighted(self.raw(high), spread), _weighted(self.raw(low), spread)
            for block, a, b in zip(blocks, above, below, strict=True):
                block[:, i] = np.clip((a - b) / (high[i] - low[i]), -50.0, 50.0)
        return here, blocks

    def resample(
        self, x: FloatArray, at: list[FloatArray], blocks: list[FloatArray], rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Values, resampled values, covariance: flights are drawn anew, what they share is drawn about itself."""
        # first and second derivative of the robust loss: a flight whose log slipped counts little here as well
        normal = [block.T @ (block / (1.0 + r[:, None] ** 2) ** 1.5) for block, r in zip(blocks, at, strict=True)]
        slope = [block.T @ (r / np.sqrt(1.0 + r**2)) for block, r in zip(blocks, at, strict=True)]
        shared, shared_slope = self.shared(x), self._shared_slope(x)
        n = len(blocks)
        drawn = []
        for _ in range(_RESAMPLES):
            count = rng.multinomial(n, np.full(n, 1.0 / n))
            matrix = np.tensordot(count, normal, axes=1) + shared_slope.T @ shared_slope
            right = np.tensordot(count, slope, axes=1)
            right = right + shared_slope.T @ (shared + rng.normal(size=len(shared)))
            drawn.append(x - np.linalg.lstsq(matrix, right, rcond=None)[0])
        lo, hi = self._bounds()
        spread = self.values(np.clip(np.array(drawn), lo, hi))  # the common error of the rotors is in it
        # the fit has taken as many looks from the flights as it has parameters: what is left looks too good
        covariance = np.atleast_2d(np.cov(spread.T)) * n / max(n - len(x), 1)
        return self.values(x), spread, covariance


class _Rooms:
    """Worlds of one set of parameters: one for each room, made once."""

    def __init__(self, problem: _Problem, overrides: dict[str, float]) -> None:
        self._problem, self._overrides = problem, overrides
        self._worlds: dict[tuple[float, float], World] = {}
        self._hanging: dict[tuple[float, float], float] = {}

    def world(self, flip: Flip) -> World:
        key = (flip.h_plane_m, flip.h_surface_m if np.isfinite(flip.h_surface_m) else -1.0)
        if key not in self._worlds:
            self._worlds[key] = self._problem.world(flip, self._overrides)
        return self._worlds[key]

    def hanging_m(self, flip: Flip) -> float:
        """Height at which the vehicle hangs on four feet in the flight's room, whose ceiling is level."""
        world = self.world(flip)
        return world.surface.point_W_m[2] - world.hanging_gap_m()


def _residuals(world: World, flip: Flip, rotor_factor: float) -> dict[str, FloatArray]:
    """Simulated minus recorded, by kind."""
    simulated = motion.fly(world, flip, motion.start_state(world, flip, rotor_factor))
    used = flip.compared()
    rate, recorded_rate = motion.clip_rate(simulated.rate_radps), motion.clip_rate(flip.rate_radps)
    # what is wrong with a flip grows as it turns: pitch and rate are held against their own size
    parts = {
        "pitch": ((simulated.pitch_deg - flip.pitch_deg) / (1.0 + np.abs(flip.pitch_deg) / _PITCH_GROWTH_DEG))[used],
        "rate": ((rate - recorded_rate) / (1.0 + np.abs(recorded_rate) / _RATE_GROWTH_RADPS))[used],
        "height": (simulated.height_m - flip.height_m)[used & flip.is_new_pose],
    }
    parts["contact"] = np.array([_contact_error(simulated.t_contact_s, flip.t_contact_s)])
    return parts


def _robust(residual: FloatArray) -> FloatArray:
    """Residuals whose squares make the loss 2 (sqrt(1 + r^2) - 1): linear where a flight is far off."""
    return np.asarray(np.sign(residual) * np.sqrt(2.0 * (np.sqrt(1.0 + residual**2) - 1.0)))


def _contact_error(simulated_s: float, recorded_s: float) -> float:
    """Simulated minus recorded; a contact that the simulation lacks counts as one that is far off."""
    if not np.isfinite(recorded_s):
        return 0.0
    late = simulated_s - recorded_s if np.isfinite(simulated_s) else _CONTACT_FAR_S
    return float(np.clip(late, -_CONTACT_FAR_S, _CONTACT_FAR_S))


def _weighted(raw: Sequence[Mapping[str, FloatArray]], spread: Mapping[str, float]) -> list[FloatArray]:
    """Residuals in units of their spread, so that the samples of a flight count as their independent looks."""
    return [
        np.concatenate([parts[k] / spread[k] * np.sqrt(min(_LOOKS[k] / max(len(parts[k]), 1), 1.0)) for k in KINDS])
        for parts in raw
    ]


def _spread(raw: Sequence[Mapping[str, FloatArray]]) -> dict[str, float]:
    """Spread of each kind, robust against single flights whose log slipped."""
    result = {}
    for kind in KINDS:
        whole = np.concatenate([parts[kind] for parts in raw])
        known = whole[whole != 0.0]
        robust = float(np.median(np.abs(known)) / 0.6745) if len(known) else _START_SPREAD[kind]
        result[kind] = max(robust, _LEAST_SPREAD[kind])
    return result


def _priors(vehicle: str, names: Sequence[str], held: Mapping[str, float], sigmas: Mapping[str, float]) -> list[Prior]:
    table = native.library().params
    quantities = model.load_vehicle(vehicle).quantities
    priors = []
    for name in names:
        field = table.get(name)
        if field is None or name.partition(".")[0] not in _FITTED_GROUPS:
            allowed = sorted(n for n in quantities if n.partition(".")[0] in _FITTED_GROUPS)
            known = "of the landing gear, not of the vehicle" if field is not None else "unknown"
            raise ConfigError(f"--fit: {name}: {known} (of {vehicle}: {', '.join(allowed)})")
        if name in held:
            raise ConfigError(f"--fit: {name}: is also given by --set")
        quantity = quantities.get(name)
        value = quantity.value if quantity else field.default
        if value is None:
            raise ConfigError(f"--fit: {name}: the vehicle {vehicle} does not give it")
        sigma = sigmas.get(name, quantity.sigma if quantity and quantity.sigma else float("inf"))
        if not sigma > 0.0:
            raise ConfigError(f"--sigma: {name}: value {sigma!r} (allowed: above 0)")
        lo, hi = (field.lo, field.hi) if value == 0.0 else sorted((value / _FACTOR, value * _FACTOR))
        priors.append(Prior(value, sigma, max(lo, field.lo), min(hi, field.hi, 1e6)))
    if len(set(names)) != len(names):
        raise ConfigError("--fit: a parameter is named twice")
    return priors


def _words(estimates: Sequence[Estimate], correlation: FloatArray, n: int) -> tuple[str, ...]:
    """What the flights cannot tell."""
    words = []
    for i, one in enumerate(estimates):
        if np.isfinite(one.prior.sigma) and one.sigma > _SILENT * one.prior.sigma:
            words.append(f"The flights say little of {one.name}: its spread is that of the vehicle file.")
        for j in range(i):
            if abs(correlation[i, j]) > _ALIKE:
                words.append(
                    f"The flights do not separate {estimates[j].name} from {one.name} (correlation "
                    f"{correlation[i, j]:.2f}): only their combination is known. Measure one of them otherwise."
                )
        at_bound = min(abs(one.value - one.prior.lo), abs(one.value - one.prior.hi))
        if at_bound < 1e-6 * max(abs(one.value), 1e-9):
            words.append(f"{one.name} ended at the end of its allowed range: the model does not explain the flights.")
    if n < 5:
        words.append(f"Few flights ({n}): the intervals are rough.")
    return tuple(words)


def vehicle_file(vehicle: str, result: Identification, source: str) -> dict[str, Any]:
    """The vehicle with the fitted numbers, as the content of a vehicle file.

    Args:
        vehicle: Name or file that was started from.
        result: Of `identify`.
        source: What the numbers come from, in a few words.
    """
    part = model.load_vehicle(vehicle)
    fitted = {estimate.name: estimate for estimate in result.estimates}
    groups: dict[str, dict[str, Any]] = {}
    quantities = {name: replace_quantity(q, fitted.get(name), source) for name, q in part.quantities.items()}
    for name, value in result.held.items():
        if name.partition(".")[0] != "leg":  # the legs are of the gear's file
            unit = native.library().params[name].unit
            quantities[name] = {"value": value, "unit": unit, "source": "held by hand while the others were identified"}
    for name, estimate in fitted.items():
        if name not in quantities:
            quantities[name] = _quantity(estimate, source)
    for name, quantity in quantities.items():
        group, _, key = name.partition(".")
        groups.setdefault(group, {})[key] = quantity
    doc = f"{part.doc} Identified from {len(result.used)} recorded flights: {', '.join(fitted)}."
    return {"name": f"{part.name}_identified", "doc": doc, **groups}


def vehicle_text(vehicle: str, values: Mapping[str, float], sigmas: Mapping[str, float]) -> str:
    """A vehicle file with other values and standard deviations, to see what flights make of them."""
    part = model.load_vehicle(vehicle)
    groups: dict[str, dict[str, Any]] = {}
    for name, quantity in part.quantities.items():
        group, _, key = name.partition(".")
        told = replace_quantity(quantity, None, "")
        if name in values:
            told |= {"value": values[name], "sigma": sigmas[name], "source": "set aside, to be identified"}
        groups.setdefault(group, {})[key] = told
    return yamlfile.dump({"name": f"{part.name}_off", "doc": part.doc, **groups})


def replace_quantity(quantity: model.Quantity, estimate: Estimate | None, source: str) -> dict[str, Any]:
    """A quantity as it stands in a vehicle file, fitted or as it was."""
    if estimate is not None:
        return _quantity(estimate, source)
    kept: dict[str, Any] = {"value": quantity.value, "unit": quantity.unit}
    if quantity.sigma is not None:
        kept["sigma"] = quantity.sigma
    return {**kept, "source": quantity.source}


def _quantity(estimate: Estimate, source: str) -> dict[str, Any]:
    return {"value": estimate.value, "unit": estimate.unit, "sigma": estimate.sigma, "source": source}
