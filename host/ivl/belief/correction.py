"""What outcomes say of the landing rate that no member of the family explains: a local correction.

    logit P(theta) = logit Pbar(theta) + g(theta),    g ~ GP(0, s^2 exp(-|theta - theta'|_l^2 / 2))            (1)

Pbar is the rate that the belief expects, l the lengths of the window of a landing. g is found from the outcomes of all
flights by Laplace's method (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, algorithm 3.1), with
logit Pbar as an offset. Where nothing was flown g is 0 and the belief decides; where flights fail again and again that
it expects to land, g sinks, and the next flight goes elsewhere.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import expit, logit  # type: ignore[import-untyped]

FloatArray = npt.NDArray[np.float64]

_P_MIN = 0.01
_NEWTON_STEPS, _SETTLED = 30, 1e-6


@dataclass(frozen=True)
class Correction:
    """g of equation (1), given flights.

    Attributes:
        theta: Policies flown, shape (n, dim).
        lengths: l, shape (dim,).
        size: s.
        weights: K^-1 g at the flights, shape (n,).
    """

    theta: FloatArray
    lengths: FloatArray
    size: float
    weights: FloatArray

    def __call__(self, theta: FloatArray, rate: FloatArray) -> FloatArray:
        """Corrected rates of policies, shape (m, dim), that the belief gives the rates `rate`, shape (m,)."""
        if not len(self.theta):
            return rate
        g = _kernel(theta, self.theta, self.lengths, self.size) @ self.weights
        return np.asarray(expit(logit(np.clip(rate, _P_MIN, 1.0 - _P_MIN)) + g))


def fit(
    theta: FloatArray, landed: npt.NDArray[np.bool_], rate: FloatArray, lengths: FloatArray, size: float
) -> Correction:
    """The correction of flights.

    Args:
        theta: Policies flown, shape (n, dim).
        landed: Whether each landed, shape (n,).
        rate: What the belief expects of them now, shape (n,).
        lengths: l, shape (dim,).
        size: s.
    """
    n = len(theta)
    offset = logit(np.clip(rate, _P_MIN, 1.0 - _P_MIN))
    kernel = _kernel(theta, theta, lengths, size)
    g, weights = np.zeros(n), np.zeros(n)
    for _ in range(_NEWTON_STEPS):
        p = expit(offset + g)
        root = np.sqrt(p * (1.0 - p))
        b = root**2 * g + (landed - p)
        inner = np.eye(n) + root[:, None] * kernel * root
        weights = b - root * np.linalg.solve(inner, root * (kernel @ b))
        before, g = g, kernel @ weights
        if np.abs(g - before).max(initial=0.0) < _SETTLED:
            break
    return Correction(theta, lengths, size, weights)


def _kernel(a: FloatArray, b: FloatArray, lengths: FloatArray, size: float) -> FloatArray:
    difference = (a[:, None] - b[None]) / lengths
    return np.asarray(size**2 * np.exp(-0.5 * (difference**2).sum(axis=-1)))
