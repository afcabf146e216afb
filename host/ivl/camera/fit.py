"""A noise model of rendered readings: a sensor set that gives the same errors without a picture.

    model = fit.of_world(World(sensing="aideck60", texture="panels"), n_approaches=60, seed=1)
    print(fit.as_yaml(model, "mine", "how it was made"))

The model is that of `rrev.*` (docs/MODEL.md section 13.5): a mean error, one that is drawn once a landing, noise with a
constant part and one of the value, correlated from sample to sample, outliers, and readings that are not valid.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl.camera import film
from ivl.camera.film import Film
from ivl.errors import ArgumentError
from ivl.world import World

SPEEDS_MPS, ANGLES_DEG = (1.5, 3.5), (30.0, 90.0)
"""Approaches that are flown, uniformly drawn: those of the box in which policies are judged."""
RREV_RANGE_PER_S = (0.5, 8.0)
"""Readings that are fitted."""
STEEP_PER_S = 1.5  # from here on errors are a part of the value
_LATE_PER_S, _MOMENT_NMM = 8.0, 8.0  # a flip so late that the camera has seen all
_OUTLIER_SIGMAS = 5.0
_MAD_TO_SIGMA = 1.4826
_BINS = 10
_LEAST = 200  # readings

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """Readings of several landings, one row each.

    Attributes:
        landing: Number of the landing.
        picture: Number of the picture.
        valid: Whether the reading is valid.
        rrev_per_s: True RREV at its instant.
        error_per_s: Its error.
        sigma_per_s: Standard deviation that it declares.
        of_y_error_radps: Error of OF_y.
    """

    landing: npt.NDArray[np.int64]
    picture: npt.NDArray[np.int64]
    valid: npt.NDArray[np.bool_]
    rrev_per_s: Vector
    error_per_s: Vector
    sigma_per_s: Vector
    of_y_error_radps: Vector

    def within(self, low_per_s: float, high_per_s: float) -> "Errors":
        """Those whose true RREV is between two values."""
        kept = (self.rrev_per_s >= low_per_s) & (self.rrev_per_s <= high_per_s)
        return Errors(*(getattr(self, name)[kept] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Model:
    """Numbers of `rrev.*`, in the units of the parameter table, and how many readings they come from.

    Attributes:
        numbers: By the name behind `rrev.`.
        sigma: Standard error of some of them.
        n: Readings.
    """

    numbers: dict[str, float]
    sigma: dict[str, float]
    n: int


def of_films(films: list[Film]) -> Errors:
    """Errors of all readings but the first of each landing, which has nothing to compare with."""
    columns: list[list[npt.NDArray[Any]]] = [[] for _ in Errors.__dataclass_fields__]
    for number, each in enumerate(films):
        if len(each) < 2:
            continue
        truth, seen = each.truth(), each.seen
        rows = (
            np.full(len(each), number),
            np.arange(len(each)),
            seen.valid,
            truth.rrev_per_s,
            seen.number("rrev") - truth.rrev_per_s,
            seen.number("sigma_rrev"),
            seen.number("of_y") - truth.of_y_radps,
        )
        for column, row in zip(columns, rows, strict=True):
            column.append(np.asarray(row[1:]))
    whole: list[Any] = [np.concatenate(column) if column else np.empty(0) for column in columns]
    return Errors(*whole)


def approaches(world: World, n: int, seed: int) -> list[Film]:
    """Films of random approaches from a hover."""
    rng = np.random.default_rng(seed)
    drawn = [(rng.uniform(*SPEEDS_MPS), rng.uniform(*ANGLES_DEG), stream) for stream in range(n)]

    def one(each: tuple[float, float, int]) -> Film:
        speed, angle, stream = each
        return film.shoot(world, speed, angle, _LATE_PER_S, _MOMENT_NMM, start="flown", seed=seed, stream=stream)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(one, drawn))


def of_world(world: World, n_approaches: int, seed: int) -> Model:
    """Fly approaches and fit their readings.

    Raises:
        ArgumentError: There are too few valid readings.
    """
    values = world.params.values
    late_s = values["camera.delay"] + values["camera.transport"] + 0.5 / values["camera.rate"]
    return of_errors(of_films(approaches(world, n_approaches, seed)), values["camera.rate"], late_s)


def of_errors(errors: Errors, rate_hz: float, delay_s: float) -> Model:
    """The model of some errors.

    Args:
        errors: Of readings.
        rate_hz: Of the camera.
        delay_s: From the sampling instant to the arrival.

    Raises:
        ArgumentError: There are too few valid readings.
    """
    judged = errors.within(*RREV_RANGE_PER_S)
    if judged.valid.sum() < _LEAST:
        raise ArgumentError(f"{judged.valid.sum()} valid readings are too few for a fit, {_LEAST} are needed")
    landing, picture = judged.landing[judged.valid], judged.picture[judged.valid]
    rrev, error = judged.rrev_per_s[judged.valid], judged.error_per_s[judged.valid]
    wild = _wild(rrev, error)
    steep = (rrev > STEEP_PER_S) & ~wild
    mean, bias = _offsets(landing[steep], error[steep] / rrev[steep])
    constant, relative = _law(rrev[~wild], (error - mean * rrev)[~wild], bias)
    sigma = np.sqrt(constant**2 + (relative * rrev) ** 2)
    same = (np.diff(landing) == 0) & (np.diff(picture) == 1) & ~wild[1:] & ~wild[:-1]
    z = (error - mean * rrev) / sigma
    correlation = float(np.clip(np.mean(z[1:][same] * z[:-1][same]) / np.mean(z[~wild] ** 2), 0.0, 0.99))
    n = int(judged.valid.sum())
    share = float(wild.mean())
    numbers = {
        "rate": rate_hz,
        "delay": delay_s,
        "noise": constant,
        "noise_rel": relative,
        "mean_rel": mean,
        "bias_rel": bias,
        "correlation": correlation,
        "outlier": share,
        "outlier_rel": float(np.sqrt(np.mean((error[wild] / rrev[wild]) ** 2))) if wild.any() else 0.0,
        "drop": float(1.0 - judged.valid.mean()),
    }
    free = n * (1.0 - correlation) / (1.0 + correlation)  # readings that are independent
    errors_of = {
        "noise": constant / np.sqrt(2.0 * free),
        "noise_rel": relative / np.sqrt(2.0 * free),
        "mean_rel": float(np.hypot(relative, constant / np.mean(rrev)) / np.sqrt(free)),
        "correlation": float((1.0 - correlation**2) / np.sqrt(n)),
        "outlier": float(np.sqrt(share * (1.0 - share) / n)),
    }
    return Model(numbers, errors_of, n)


def _wild(rrev: Vector, error: Vector) -> npt.NDArray[np.bool_]:
    """Outliers: beyond five robust standard deviations of readings with a similar RREV."""
    edges = np.quantile(rrev, np.linspace(0.0, 1.0, _BINS + 1))
    bins = np.clip(np.searchsorted(edges, rrev, side="right") - 1, 0, _BINS - 1)
    wild = np.zeros(len(rrev), dtype=bool)
    for k in range(_BINS):
        inside = bins == k
        middle = np.median(error[inside])
        sigma = _MAD_TO_SIGMA * np.median(np.abs(error[inside] - middle))
        wild[inside] = np.abs(error[inside] - middle) > _OUTLIER_SIGMAS * sigma
    return wild


def _offsets(landing: npt.NDArray[np.int64], part: Vector) -> tuple[float, float]:
    """Mean of errors over values, and the standard deviation of what each landing has of its own.

    The means of the halves of a landing share what is its own, and little else.
    """
    firsts, seconds = [], []
    for number in np.unique(landing):
        own = part[landing == number]
        half = len(own) // 2
        if half >= 2:
            firsts.append(own[:half].mean())
            seconds.append(own[half:].mean())
    shared = float(np.cov(firsts, seconds)[0, 1]) if len(firsts) > 2 else 0.0
    return float(part.mean()), float(np.sqrt(max(shared, 0.0)))


def _law(rrev: Vector, error: Vector, bias: float) -> tuple[float, float]:
    """Constant part of the noise and that of the value, beside what each landing has of its own."""
    from scipy.optimize import nnls  # type: ignore[import-untyped]

    edges = np.quantile(rrev, np.linspace(0.0, 1.0, _BINS + 1))
    bins = np.clip(np.searchsorted(edges, rrev, side="right") - 1, 0, _BINS - 1)
    square = np.array([np.mean(rrev[bins == k] ** 2) for k in range(_BINS)])
    variance = np.array([np.mean(error[bins == k] ** 2) for k in range(_BINS)])
    rest = np.maximum(variance - bias**2 * square, 0.2 * variance)
    found, _ = nnls(np.column_stack([1.0 / rest, square / rest]), np.ones(_BINS))
    return float(np.sqrt(found[0])), float(np.sqrt(found[1]))


_UNITS = {"rate": "Hz", "delay": "s", "noise": "1/s"}


def as_yaml(model: Model, name: str, doc: str, source: str, world: World) -> str:
    """A sensor set with this model, which tells the flight core the same of its camera as the world of the pictures."""
    lines = [f"name: {name}", f"doc: {doc}", "includes: [imu]", "rrev:"]
    for key, value in model.numbers.items():
        sigma = f", sigma: {model.sigma[key]:.2g}" if model.sigma.get(key) else ""
        where = "of the rendered camera" if key in ("rate", "delay") else source
        lines.append(f'  {key}: {{value: {value:.4g}, unit: {_UNITS.get(key, "1")}{sigma}, source: "{where}"}}')
    lines += [
        '  resolution: {value: 1.5259e-05, unit: 1/s, source: "1/65536: the estimator\'s unit"}',
        '  max: {value: 20.0, unit: 1/s, source: "as the flight core ignores what is beyond"}',
        "firmware:",
        '  d_source: {value: 2, unit: "1", source: "the filter: the best source for this equipment"}',
        "  rrev_delay: {from: rrev.delay}",
    ]
    for key, unit in (("rrev_sigma", "1/s"), ("rrev_sigma_norm", "1")):
        value = world.params.values[f"firmware.{key}"]
        lines.append(f'  {key}: {{value: {value:g}, unit: {unit}, source: "as {world.sensing}"}}')
    return "\n".join(lines).replace("unit: 1,", 'unit: "1",').replace("unit: 1}", 'unit: "1"}') + "\n"
