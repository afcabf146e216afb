"""The search from the map's policy on, by any learner of the project.

In each iteration all candidates fly the same new approaches, so that they differ in what they are, not in their luck.
Each place has approaches of its own: with few of them, the same for all vehicles of a family, luck would be in those.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl.learners import Learner, make_learner
from ivl.policy.flying import Place, fly, objective
from ivl.policy.general import GeneralExperiment
from ivl.policy.region import Series
from ivl.policy.shape import FloatArray, General
from ivl.policy.start import Best, design, moment_most_Nmm
from ivl.seeds import Purpose, derive

_REACH = 5.0
"""Bounds of the search, in first spreads."""
_COLUMN_MIN = 0.2
"""A parameter that changes no threshold counts as if it changed them by this part of what the strongest does."""


@dataclass(frozen=True)
class Iteration:
    """Where the search stands.

    Attributes:
        number: Iterations so far.
        theta: Policy that the learner recommends.
        mean: Mean objective of this iteration's candidates.
        best: That of the best candidate.
        n_flights: Flights so far.
    """

    number: int
    theta: FloatArray
    mean: float
    best: float
    n_flights: int


@dataclass(frozen=True)
class Scale:
    """First spreads of the searched parameters, shape (n,), and their bounds, shape (n, 2)."""

    sigma: FloatArray
    bounds: FloatArray


def scale_of(general: General, best: Best, start: FloatArray, spread_per_s: float, spread_moment_Nmm: float) -> Scale:
    """How far a search for threshold and moment goes; the spread of each parameter changes the thresholds alike."""
    middle = float(np.average(best.threshold_per_s, weights=best.weight))
    change = np.sqrt(np.mean(design(general, best.vx_mps, best.vz_mps, middle) ** 2, axis=0))
    change = np.maximum(change, _COLUMN_MIN * change.max())
    sigma = np.append(spread_per_s / np.sqrt(general.n_threshold) / change, np.full(3, spread_moment_Nmm))
    mu = start[general.searched]
    lo, hi = general.bounds[general.searched].T
    bounds = np.stack([np.maximum(lo, mu - _REACH * sigma), np.minimum(hi, mu + _REACH * sigma)], axis=1)
    return Scale(np.minimum(sigma, bounds[:, 1] - bounds[:, 0]), bounds)


def make_search(chosen: GeneralExperiment, general: General, start: FloatArray, best: Best, most_Nmm: float) -> Learner:
    """The learner at its start; it searches threshold and moment, the rest of theta stays as it is."""
    settings = chosen.search
    scale = scale_of(general, best, start, settings.spread_per_s, settings.spread_moment_norm * most_Nmm)
    return make_learner(
        chosen.learner.name,
        start[general.searched],
        scale.sigma,
        bounds=scale.bounds,
        n_rollouts=settings.n_candidates,
        seed=derive(chosen.seed, Purpose.LEARNER),
        **chosen.learner.options,
    )


def run(
    chosen: GeneralExperiment,
    general: General,
    places: Sequence[Place],
    start: FloatArray,
    best: Best,
    on_iteration: Callable[[Iteration], None],
    threads: int | None = None,
) -> None:
    """Search; `on_iteration` is called after each iteration, and keeps the best."""
    settings = chosen.search
    learner = make_search(chosen, general, start, best, moment_most_Nmm(places))
    series = Series(chosen.regions, chosen.seed, Purpose.SEARCH)
    n_flights = 0
    for number in range(1, settings.n_iterations + 1):
        if learner.stop():
            return
        asked = learner.ask()
        theta = _whole(general, start, asked)
        approaches = series.for_each(len(places), settings.n_approaches)
        scores = objective(fly(places, general.form.name, theta, approaches, threads))
        learner.tell(asked, scores)
        n_flights += len(theta) * sum(map(len, approaches))
        recommended = _whole(general, start, learner.result.recommended)
        on_iteration(Iteration(number, recommended, float(scores.mean()), float(scores.max()), n_flights))


def _whole(general: General, start: FloatArray, searched: npt.ArrayLike) -> FloatArray:
    """Policies, shape (..., n), of which the learner knows the searched part."""
    part = np.asarray(searched, dtype=np.float64)
    theta = np.broadcast_to(start, (*part.shape[:-1], start.size)).copy()
    theta[..., general.searched] = part
    return theta
