"""Landing rates of policies over a belief, with margin, and EPHE over rollouts imagined on it.

What the belief expects of a policy is corrected by what flights near it did (`ivl.belief.correction`).

The margin rate of a policy is its landing rate averaged over the belief, over a trigger that comes up to `TIMING_S`
early or late, and over a moment up to `MOMENT` smaller or larger, both uniform; by Gauss-Legendre quadrature with
three points each.

EPHE on a belief: imagined rollouts theta_k ~ N(mu, diag sigma^2) have as reward r_k the landing rate of one particle
with one timing and one moment out of the margin, and

    w_k = max(0, r_k - mean(r)),   mu' = sum(w_k theta_k) / sum(w_k),   sigma'^2 = sum(w_k (theta_k - mu)^2) / sum(w_k)

which is `ivl.learners.ephe.imagine` with the returns of `imagined`.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RegularGridInterpolator  # type: ignore[import-untyped]

from ivl.belief.correction import Correction
from ivl.belief.posterior import Belief

FloatArray = npt.NDArray[np.float64]

TIMING_S, MOMENT = 0.010, 0.10
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_N_RREV, _N_MOMENT, _N_NEAR = 57, 12, 30
_LEAST_AHEAD_S = 1e-3
_N_FIRST, _HOPELESS = 16, 0.01
"""A first look with so many particles leaves out the policies whose rate is below this."""


def perturbed(theta: FloatArray, late_s: npt.ArrayLike, moment: npt.ArrayLike, bounds: FloatArray) -> FloatArray:
    """Constant policies, shape (..., 2), as if the trigger came late and the moment were larger by a share.

    A vehicle that closes at a constant speed is 1 / RREV before the contact.
    """
    ahead_s = 1.0 / np.maximum(theta[..., 0], 1e-3) - np.asarray(late_s)
    rrev_per_s = np.clip(1.0 / np.maximum(ahead_s, _LEAST_AHEAD_S), *bounds[0])
    return np.stack(
        np.broadcast_arrays(rrev_per_s, np.clip(theta[..., 1] * (1.0 + np.asarray(moment)), *bounds[1])), axis=-1
    )


def around(theta: FloatArray, bounds: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The nine points of the margin of policies, shape (9, n, 2), and their weights, shape (9,)."""
    late, moment = np.meshgrid(TIMING_S * _NODES, MOMENT * _NODES, indexing="ij")
    points = [perturbed(theta, a, b, bounds) for a, b in zip(late.ravel(), moment.ravel(), strict=True)]
    return np.array(points), np.outer(_WEIGHTS, _WEIGHTS).ravel() / 4.0


def rate(belief: Belief, corrected: Correction, theta: FloatArray) -> FloatArray:
    """Landing rate of policies, shape (n, 2), over the belief, corrected: shape (n,)."""
    return corrected(theta, belief.rates(theta).mean(axis=0))


def margin_rate(belief: Belief, corrected: Correction, theta: FloatArray, bounds: FloatArray) -> FloatArray:
    """Margin rate of policies, shape (n, 2): shape (n,)."""
    points, weights = around(theta, bounds)
    return np.asarray(weights @ rate(belief, corrected, points.reshape(-1, 2)).reshape(len(weights), -1))


def safest(
    belief: Belief, corrected: Correction, bounds: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, float]:
    """The policy of the largest margin rate, shape (2,), and that rate."""
    sizes = (_N_RREV, _N_MOMENT)
    axes = tuple(np.linspace(lo, hi, size) for (lo, hi), size in zip(bounds.tolist(), sizes, strict=True))
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    flat = corrected(grid, belief.rates(grid, _N_FIRST).mean(axis=0))
    likely = flat >= min(_HOPELESS, float(flat.max()))
    flat[likely] = rate(belief, corrected, grid[likely])
    surface = flat.reshape(_N_RREV, _N_MOMENT)
    points, weights = around(grid, bounds)
    smooth = weights @ RegularGridInterpolator(axes, surface)(points.reshape(-1, 2)).reshape(len(weights), -1)
    best = grid[int(smooth.argmax())]
    steps = np.array([axis[1] - axis[0] for axis in axes])
    near = np.clip(best + 0.5 * steps * rng.standard_normal((_N_NEAR, 2)), *bounds.T)
    near[0] = best
    rates = margin_rate(belief, corrected, near, bounds)
    top = int(rates.argmax())
    return near[top], float(rates[top])


def imagined(
    belief: Belief, corrected: Correction, bounds: FloatArray, rng: np.random.Generator
) -> Callable[[FloatArray], FloatArray]:
    """Returns of imagined rollouts of policies, shape (n, 2): each of one particle, with errors out of the margin."""

    def reward(theta: FloatArray) -> FloatArray:
        n = len(theta)
        late, moment = rng.uniform(-TIMING_S, TIMING_S, n), rng.uniform(-MOMENT, MOMENT, n)
        flown = perturbed(theta, late, moment, bounds)
        return corrected(flown, belief.rate_of_one(flown))

    return reward
