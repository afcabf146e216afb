"""The start of the search: a map of thresholds and moments over cells of speed and angle, and a fit to its best.

A cell's best is looked for after the map was smoothed over the error of the trigger's instant: landings come in two
narrow ridges, and the fit must not go between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl.outcome import Outcomes
from ivl.policy.flying import Place, fly, score
from ivl.policy.general import MapSettings
from ivl.policy.region import Approaches, Region
from ivl.policy.shape import General
from ivl.seeds import Purpose, derive

FloatArray = npt.NDArray[np.float64]

_POSSIBLE = 0.25
"""A cell whose best is below this teaches nothing."""
_FAINT, _REACH_MPS = 0.03, 0.8
"""Weight of what is guessed where nothing lands, against that of a cell that always lands; and from how far."""


@dataclass(frozen=True)
class Best:
    """The best threshold of each cell in which a landing is possible, at the moment that is best for all.

    Attributes:
        vx_mps: Velocity along the ceiling that the core sensed there at its trigger, shape (n,).
        vz_mps: Closing speed that it sensed, shape (n,).
        threshold_per_s: Threshold of RREV, shape (n,).
        weight: Score of the cell, 0 .. 1, shape (n,).
        moment_Nmm: The moment.
        n_flights: What the map cost.
    """

    vx_mps: FloatArray
    vz_mps: FloatArray
    threshold_per_s: FloatArray
    weight: FloatArray
    moment_Nmm: float
    n_flights: int


@dataclass(frozen=True)
class Map:
    """Flights of level policies, each of every threshold and moment in every cell.

    Attributes:
        speed_edges_mps: Edges of the cells along the speed, shape (n + 1,).
        angle_edges_deg: Edges along the angle, shape (m + 1,).
        tau_s: 1 / threshold of each policy, rising.
        timing_s: Error of the trigger's instant over which `smoothed` is a mean, unless it is told another.
        moments_Nmm: Moments.
        flown: Outcomes of each place, shape (moments, thresholds, cells); the angle of the cells runs faster.
    """

    speed_edges_mps: FloatArray
    angle_edges_deg: FloatArray
    tau_s: FloatArray
    timing_s: float
    moments_Nmm: FloatArray
    flown: list[Outcomes]

    def smoothed(self, timing_s: float | None = None) -> list[FloatArray]:
        """Scores of each place, smoothed over the map's own error of the trigger's instant, or over another."""
        return [smooth(score(outcomes), self.tau_s, timing_s or self.timing_s) for outcomes in self.flown]


def fly_map(
    grid: MapSettings,
    regions: Sequence[Region],
    seed: int,
    general: General,
    places: Sequence[Place],
    threads: int | None = None,
) -> Map:
    """Fly the map in every place."""
    edges = _edges(grid, regions)
    speed, angle = np.meshgrid(*(0.5 * (edge[1:] + edge[:-1]) for edge in edges), indexing="ij")
    stream = np.arange(speed.size, dtype=np.uint64)
    cells = Approaches(speed.reshape(-1), angle.reshape(-1), stream, derive(seed, Purpose.GRID))
    tau_s = np.linspace(grid.tau_s[0], grid.tau_s[1], grid.n_thresholds)
    most_Nmm = moment_most_Nmm(places)
    moments = np.minimum(most_Nmm * np.array(grid.moments_norm), general.bounds[general.moment.start, 1])
    theta = general.level(1.0 / tau_s, moments[:, None])
    flown = fly(places, general.form.name, theta, cells, threads)
    return Map(*edges, tau_s, grid.timing_s, moments, flown)


def best_of(flown: Map) -> Best:
    """Each cell's best threshold, at the moment that is best for all."""
    smoothed = flown.smoothed()
    moment = int(np.argmax(np.mean([s.max(axis=1).mean(axis=-1) for s in smoothed], axis=0)))
    found = [_best_of(o[moment], s[moment], 1.0 / flown.tau_s) for o, s in zip(flown.flown, smoothed, strict=True)]
    vx, vz, threshold, weight = (np.concatenate(parts) for parts in zip(*found, strict=True))
    n_flights = sum(outcomes.size for outcomes in flown.flown)
    return Best(vx, vz, threshold, weight, float(flown.moments_Nmm[moment]), n_flights)


def moment_most_Nmm(places: Sequence[Place]) -> float:
    """What the front motors can do in every place."""
    return float(min(place.world.derived()["pitch_moment_max_Nmm"] for place in places))


def _edges(grid: MapSettings, regions: Sequence[Region]) -> tuple[FloatArray, FloatArray]:
    """Edges of equal cells that cover all regions, along speed and angle."""
    limits = [np.array([getattr(region, name) for region in regions]) for name in ("speeds_mps", "angles_deg")]
    speed, angle = (
        np.linspace(limit[:, 0].min(), limit[:, 1].max(), n + 1)
        for limit, n in zip(limits, (grid.n_speeds, grid.n_angles), strict=True)
    )
    return speed, angle


def smooth(scores: FloatArray, tau_s: FloatArray, timing_s: float) -> FloatArray:
    """Mean of the scores over a normal error of the trigger's instant; thresholds lie along the axis before the last.

    A threshold 1 / tau triggers tau before the ceiling would be reached.
    """
    kernel = np.exp(-0.5 * ((tau_s[:, None] - tau_s[None, :]) / timing_s) ** 2)
    kernel /= kernel.sum(axis=1, keepdims=True)
    return np.asarray(np.einsum("kj,...jc->...kc", kernel, scores))


def _best_of(outcomes: npt.NDArray[np.void], smoothed: FloatArray, thresholds: FloatArray) -> tuple[FloatArray, ...]:
    """Sensed velocities, threshold and score at the best threshold of each cell, of (thresholds, cells)."""
    best = smoothed.argmax(axis=0)
    at = (best, np.arange(smoothed.shape[1]))
    chosen, weight = outcomes[at], smoothed[at]
    good = (weight >= _POSSIBLE) & (chosen["triggered"] == 1)
    d_m = chosen["d_trigger_m"][good]
    vx, vz = -chosen["of_y_trigger"][good] * d_m, chosen["rrev_trigger"][good] * d_m
    return vx, vz, thresholds[best][good], weight[good]


def design(general: General, vx_mps: FloatArray, vz_mps: FloatArray, about_per_s: float) -> FloatArray:
    """How much each parameter of the threshold changes the threshold, shape (n, n_threshold), by asking the core."""
    level = general.level(about_per_s, 0.0)
    base = general.thresholds(level, vx_mps, vz_mps)
    columns = []
    for i in range(general.n_threshold):
        moved = level.copy()
        moved[i] += 1.0
        columns.append(general.thresholds(moved, vx_mps, vz_mps) - base)
    return np.stack(columns, axis=-1)


def fit(general: General, best: Best) -> FloatArray:
    """The policy nearest to the best of the cells, in the instant of the trigger; always go.

    Where no cell has a landing the threshold is drawn, weakly, towards that of the cells nearby.
    """
    middle = float(np.average(best.threshold_per_s, weights=best.weight))
    far_x, far_z = (axis.reshape(-1) for axis in np.meshgrid(np.linspace(0.1, 3.9, 9), np.linspace(0.1, 3.9, 11)))
    distance2 = (far_x[:, None] - best.vx_mps) ** 2 + (far_z[:, None] - best.vz_mps) ** 2
    near = best.weight * np.exp(-0.5 * (distance2 - distance2.min(axis=1, keepdims=True)) / _REACH_MPS**2)
    guessed = near @ best.threshold_per_s / near.sum(axis=1)
    vx, vz = np.append(best.vx_mps, far_x), np.append(best.vz_mps, far_z)
    target = np.append(best.threshold_per_s, guessed)
    weight = np.append(best.weight, np.full(far_x.size, _FAINT)) / target**4  # an error of 1 / R is one in time
    root = np.sqrt(weight / weight.max())
    steps, *_ = np.linalg.lstsq(design(general, vx, vz, middle) * root[:, None], (target - middle) * root, rcond=1e-6)
    theta = general.level(middle, best.moment_Nmm)
    theta[general.threshold] += steps
    lo, hi = general.bounds.T
    return np.clip(theta, lo, hi)
