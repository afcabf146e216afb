"""What to fly and what to recommend: EPHE over rollouts imagined on the belief, with margin.

An imagined rollout is a real one of the simulator: a member drawn from the belief flies a policy drawn from
N(mu, diag sigma^2), with the trigger early or late by `TIMING_S` and the moment off by `MOMENT`, or neither. So its
landing rate is averaged over the belief and over the margin at once. mu and sigma follow by reward-weighted maximum
likelihood, equations (1), (2) and (4) of `ivl.learners.ephe`, with the landing as the reward.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from ivl.belief.bank import Flight
from ivl.learners.base import draw_truncated
from ivl.outcome import four_leg, valid
from ivl.world import World

FloatArray = npt.NDArray[np.float64]

TIMING_S, MOMENT = 0.010, 0.10


def perturbed(theta: FloatArray, timing: FloatArray, moment: FloatArray, bounds: FloatArray) -> FloatArray:
    """Constant policies, shape (..., 2), as if the trigger came `timing` seconds late and the moment were `moment` larger.

    A vehicle that closes at a constant speed reaches RREV_c at the time 1 / RREV_c before the contact.
    """
    ahead_s = np.maximum(1.0 / np.maximum(theta[..., 0], 1e-3) - timing, 1e-3)
    return np.stack(
        [np.clip(1.0 / ahead_s, *bounds[0]), np.clip(theta[..., 1] * (1.0 + moment), *bounds[1])], axis=-1
    )


def imagine(
    worlds: Sequence[World], flight: Flight, mu: FloatArray, sigma: FloatArray, n_each: int, rng: np.random.Generator,
    pool: ThreadPoolExecutor,
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Policies, shape (n, dim), and whether they landed, shape (n,); `n_each` rollouts of each world."""
    lo, hi = flight.bounds.T
    n = len(worlds) * n_each
    theta = draw_truncated(rng, mu, sigma, lo, hi, n)
    timing, moment = rng.integers(-1, 2, n) * TIMING_S, rng.integers(-1, 2, n) * MOMENT
    flown = perturbed(theta, timing, moment, flight.bounds)
    seeds = rng.integers(0, 2**62, len(worlds))

    def fly(i: int) -> npt.NDArray[np.bool_]:
        own = flown[i * n_each : (i + 1) * n_each]
        outcomes = worlds[i].rollouts(
            flight.speed_mps, flight.angle_deg, *own.T, form=flight.form, start=flight.start, seed=int(seeds[i]), threads=1
        )
        return np.asarray(four_leg(outcomes) & valid(outcomes))

    return theta, np.concatenate(list(pool.map(fly, range(len(worlds)))))


def ephe_step(
    theta: FloatArray, reward: FloatArray, mu: FloatArray, sigma: FloatArray, shrink_min: float, floor: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """One update with above-mean weights about the old mean."""
    weights = np.maximum(reward - reward.mean(), 0.0)
    total = weights.sum()
    if total <= 0.0:
        return mu, sigma
    new = weights @ theta / total
    spread = np.sqrt(weights @ (theta - mu) ** 2 / total)
    return new, np.maximum(spread, np.maximum(shrink_min * sigma, floor))
