"""A better start for the search, found on the map alone: its flights tell what became of every threshold and moment.

A fit to each cell's best threshold goes between two ridges of landings where neighbouring cells have their best on
different ones. Looked up in the map, a policy's whole surface counts, and thousands of policies cost no flight.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.learners import make_learner
from ivl.outcome import Outcomes
from ivl.policy.search import scale_of
from ivl.policy.shape import FloatArray, General
from ivl.policy.start import Best, Map
from ivl.seeds import Purpose, derive

_N_ITERATIONS, _N_CANDIDATES = 120, 16
_SPREAD_PER_S, _SPREAD_MOMENT_NORM = 0.6, 0.1
_ON_THE_WAY = (0.2, 0.4, 0.6, 0.8)
"""Parts of the speed that an approach goes through, at which no policy may flip yet."""
_SPEED_MPS_MIN = 0.05


class OnMap:
    """The score of a policy over the cells of a map, from the flights of the map."""

    def __init__(self, general: General, flown: Map, timing_s: float) -> None:
        """Look up in a map that is smoothed over `timing_s` of the trigger's instant."""
        self._general = general
        self._moments_Nmm = flown.moments_Nmm
        self._scores = np.stack(flown.smoothed(timing_s))  # (places, moments, thresholds, cells)
        seen = [_seen(outcomes[0], flown.tau_s) for outcomes in flown.flown]
        self._flies = np.stack([flies for _, flies in seen])
        cues = np.stack([points for points, _ in seen])  # (places, thresholds and parts of the speed, cells, 3)
        self._shape = cues.shape[:3]
        self._cues = np.ascontiguousarray(cues.reshape(-1, 3))

    def __call__(self, theta: FloatArray) -> float:
        """Mean score over cells and places; a cell in which the policy flips on the way to its speed has none."""
        form = self._general.form
        actions = native.library().decide(form.number, form.to_si(theta), self._cues).reshape(*self._shape, -1)
        flips, moment_Nmm = actions[..., 0] > 0.5, 1e3 * actions[..., 2]
        n = len(_ON_THE_WAY)
        early, flips = flips[:, :n].any(axis=1), flips[:, n:]
        # thresholds of an approach are reached in the order of falling tau: the last that flips is the first in time
        last = flips.shape[1] - 1 - np.argmax(flips[:, ::-1], axis=1)
        place, cell = np.indices(last.shape)
        at = np.interp(moment_Nmm[place, n + last, cell], self._moments_Nmm, np.arange(len(self._moments_Nmm)))
        low = np.minimum(at.astype(np.intp), max(len(self._moments_Nmm) - 2, 0))
        high = np.minimum(low + 1, len(self._moments_Nmm) - 1)
        between = (1.0 - at + low) * self._scores[place, low, last, cell]
        between += (at - low) * self._scores[place, high, last, cell]
        return float(np.where(flips.any(axis=1) & ~early & self._flies, between, 0.0).mean())


def _seen(outcomes: Outcomes, tau_s: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Distance, RREV and OF_y of the parts of the speed and of each threshold, and whether a cell ever triggers.

    Where a threshold is never reached, the velocities are those of the nearest that is.
    """
    triggered = outcomes["triggered"] == 1
    d_m = np.where(triggered, outcomes["d_trigger_m"], 0.0)
    vx = np.where(triggered, -outcomes["of_y_trigger"] * d_m, 0.0)
    vz = np.where(triggered, outcomes["rrev_trigger"] * d_m, 0.0)
    flies = triggered.any(axis=0)
    number = np.arange(len(tau_s))
    for cell in np.flatnonzero(flies):
        good = np.flatnonzero(triggered[:, cell])
        near = good[np.abs(good[:, None] - number).argmin(axis=0)]
        vx[:, cell], vz[:, cell] = vx[near, cell], vz[near, cell]
    part = np.array(_ON_THE_WAY)[:, None]
    speeds = [np.vstack([part * np.median(v, axis=0), v]) for v in (vx, vz)]
    # a slower approach is farther away: its RREV is below the smallest of the map by its part of the speed, at least
    rrev = np.vstack(
        [np.broadcast_to(part / tau_s[-1], (len(part), vx.shape[1])), np.tile(1 / tau_s, (vx.shape[1], 1)).T]
    )
    closing = np.maximum(speeds[1], _SPEED_MPS_MIN)
    return np.stack([closing / rrev, rrev, -speeds[0] * rrev / closing], axis=-1), flies


def polish(
    general: General, flown: Map, best: Best, theta: FloatArray, most_Nmm: float, timing_s: Sequence[float], seed: int
) -> list[FloatArray]:
    """Policies from `theta` on that score more on the map, one for each error of the trigger's instant.

    Args:
        general: The form.
        flown: The map.
        best: The best of its cells.
        theta: Where the search on the map begins.
        most_Nmm: Moment that the front motors can do.
        timing_s: Errors over which the map is smoothed.
        seed: Of the search.
    """
    return [_polished(general, OnMap(general, flown, timing), best, theta, most_Nmm, seed) for timing in timing_s]


def _polished(general: General, on_map: OnMap, best: Best, theta: FloatArray, most_Nmm: float, seed: int) -> FloatArray:
    scale = scale_of(general, best, theta, _SPREAD_PER_S, _SPREAD_MOMENT_NORM * most_Nmm)
    learner = make_learner(
        "cmaes", theta[general.searched], scale.sigma, bounds=scale.bounds, n_rollouts=_N_CANDIDATES,
        seed=derive(seed, Purpose.START),
    )  # fmt: skip
    found, most = theta, on_map(theta)
    for _ in range(_N_ITERATIONS):
        if learner.stop():
            break
        asked = learner.ask()
        policies = np.tile(theta, (len(asked), 1))
        policies[:, general.searched] = asked
        scores = np.array([on_map(policy) for policy in policies])
        learner.tell(asked, scores)
        if scores.max() > most:
            found, most = policies[int(scores.argmax())], float(scores.max())
    return found
