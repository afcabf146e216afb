"""A small Gaussian process: squared-exponential kernel with one length per dimension, and white noise. numpy only.

With K_ij = exp(-|(x_i - x_j) / l|^2 / 2) and g the ratio of noise to signal variance:

    y ~ N(0, s^2 (K + g I)),    s^2 = y' (K + g I)^-1 y / n                                              (1)
    log p(y | l, g) = -n/2 log s^2 - 1/2 log det(K + g I) + const                                        (2)

The signal variance has that closed form, so that only the lengths and g are searched, with log-normal priors. A draw of
the function at any set of points needs no factor of their joint covariance: a draw of the prior is corrected by what it
says at the data (Matheron's rule; the prior draw is a sum of random cosines):

    f(x) = f0(x) + k(x, X) (K + g I)^-1 (y - f0(X) - e),    e ~ N(0, s^2 g I)                            (3)

What is only compared between hundreds of candidates is taken in single precision, several times as fast; factors and
likelihoods are in double.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
SingleArray = npt.NDArray[np.float32]

_SEARCH, _FOLLOW = (0.6, 0.3, 0.15), (0.3,)  # steps of a fit's passes over all parameters, in logarithms
_PRIOR_LOG_SD = 1.0  # of each length and of the noise ratio, about their prior values
_JITTER = 1e-8
_N_COSINES = 200  # of a prior draw
_EXPONENT_MIN = -30.0  # no correlation is below 1e-13: products of smaller ones are denormal, a hundred times as slow
_EXPONENT_MAX = 1e-3  # none is above 0 but by rounding, which far away from the data is large in single precision
_TINY = 1e-20  # what is less is zero in single precision, for the same reason
_BLOCK = 40  # largest triangle that is inverted as if it were full


@dataclass(frozen=True)
class Hyper:
    """Hyper-parameters: kernel lengths, shape (dim,), in units of the inputs, and noise ratio g."""

    lengths: FloatArray
    noise: float

    def log(self) -> FloatArray:
        """All of them as one vector of logarithms, shape (dim + 1,)."""
        return np.asarray(np.log(np.append(self.lengths, self.noise)))

    @staticmethod
    def from_log(vector: FloatArray) -> "Hyper":
        """Inverse of `log`."""
        values = np.exp(vector)
        return Hyper(values[:-1], float(values[-1]))


class GaussianProcess:
    """Posterior of a function given noisy values at some points."""

    def __init__(self, x: FloatArray, y: FloatArray, hyper: Hyper) -> None:
        """Condition on the data.

        Args:
            x: Points, shape (n, dim).
            y: Values, shape (n,), standardised by the caller (prior mean 0).
            hyper: Lengths and noise ratio.
        """
        self.x, self.hyper = x, hyper
        noise = hyper.noise + _JITTER
        self._center = x.mean(axis=0)
        points = self._half_exponent(x)
        points[:, -2:] = points[:, :-3:-1]
        self._points32 = points.T
        kernel = _correlation(x, x, hyper.lengths)
        kernel.flat[:: len(x) + 1] += noise
        self._whiten = _inverse_of_lower(np.linalg.cholesky(kernel))
        white = self._whiten @ y
        self._alpha = self._whiten.T @ white
        self.signal_variance = _signal_variance(white)
        self._alpha32 = self._alpha.astype(np.float32)
        self._whiten32 = np.where(np.abs(self._whiten) < _TINY, 0.0, self._whiten).T.astype(np.float32)
        self.fitted = np.asarray(y - noise * self._alpha)
        """Mean at the data, shape (n,)."""

    def predict(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation of the function (without noise) at x, each of shape (m,)."""
        cross = _correlation(x, self.x, self.hyper.lengths)
        reduced = self._whiten @ cross.T
        variance = np.maximum(1.0 - (reduced**2).sum(axis=0), 0.0)
        return np.asarray(cross @ self._alpha), np.sqrt(self.signal_variance * variance)

    def safest(self, x: FloatArray, caution: float) -> int:
        """Index of the largest mean - caution sd at x."""
        kernel = self._kernel32(x)
        reduced = kernel @ self._whiten32
        variance = np.maximum(1.0 - np.einsum("ij,ij->i", reduced, reduced), 0.0)
        sd = np.sqrt(np.float32(self.signal_variance) * variance)
        value = kernel @ self._alpha32 - np.float32(caution) * sd
        return int(value.argmax())

    def sample(self, x: FloatArray, n: int, rng: np.random.Generator) -> SingleArray:
        """Draws of the function at x by equation (3), shape (n, m)."""
        noise_sd = np.sqrt(self.signal_variance * (self.hyper.noise + _JITTER))
        prior = _prior_draws(np.concatenate([self.x, x]), self.hyper.lengths, self.signal_variance, n, rng)
        at_data = prior[:, : len(self.x)] + noise_sd * rng.standard_normal((n, len(self.x)))
        correction = self._alpha - at_data @ self._whiten.T @ self._whiten
        drawn = correction.astype(np.float32) @ self._kernel32(x).T
        return np.asarray(drawn + prior[:, len(self.x) :])

    def _kernel32(self, x: FloatArray) -> SingleArray:
        """Correlations of x with the data, shape (m, n): the whole exponent is one matrix product."""
        kernel = self._half_exponent(x) @ self._points32
        np.clip(kernel, np.float32(_EXPONENT_MIN), np.float32(_EXPONENT_MAX), out=kernel)
        return np.asarray(np.exp(kernel, out=kernel))

    def _half_exponent(self, x: FloatArray) -> SingleArray:
        """Rows (u, -|u|^2 / 2, 1) of scaled points u: such a row times (v, 1, -|v|^2 / 2) is -|u - v|^2 / 2."""
        u = (x - self._center) / self.hyper.lengths
        rows = np.ones((len(x), x.shape[1] + 2), dtype=np.float32)
        rows[:, :-2] = u
        rows[:, -2] = -0.5 * np.einsum("ij,ij->i", u, u)
        return rows


def log_likelihood(x: FloatArray, y: FloatArray, hyper: Hyper) -> float:
    """Marginal likelihood (2) with the signal variance at its optimum, up to a constant."""
    return _Likelihood(x, y)(hyper)


class _Likelihood:
    """Equation (2) of fixed data for any hyper-parameters.

    One Cholesky factor of K + g I with y as one more row gives both terms: its last row is L^-1 y.
    """

    def __init__(self, x: FloatArray, y: FloatArray) -> None:
        self._n = len(x)
        difference = x.T[:, :, None] - x.T[:, None, :]
        self._half_square = -0.5 * (difference**2).reshape(x.shape[1], -1)  # (dim, n n)
        self._exponent, self._bordered = np.empty(self._n**2), np.zeros((self._n + 1, self._n + 1))
        self._y, self._y_square = y, float(y @ y)

    def __call__(self, hyper: Hyper) -> float:
        noise, n, bordered = hyper.noise + _JITTER, self._n, self._bordered
        exponent = np.matmul(hyper.lengths**-2.0, self._half_square, out=self._exponent)
        np.maximum(exponent, _EXPONENT_MIN, out=exponent)
        np.exp(exponent.reshape(n, n), out=bordered[:n, :n])
        bordered.reshape(-1)[:: n + 2] += noise
        bordered[n, :n] = self._y
        bordered[n, n] = 2.0 * self._y_square / noise + 1.0  # above y' (K + g I)^-1 y: the bordered matrix is positive
        factor = np.linalg.cholesky(bordered)
        variance = _signal_variance(factor[n, :n])
        return float(-0.5 * n * np.log(variance) - np.log(np.diag(factor)[:n]).sum())


def fit(
    x: FloatArray, y: FloatArray, prior: Hyper, start: Hyper, noise_min: float = 0.0, follow: bool = False
) -> Hyper:
    """Hyper-parameters of the largest posterior density, by a deterministic pattern search from `prior` and `start`.

    Args:
        x: Points, shape (n, dim).
        y: Values, shape (n,), standardised.
        prior: Medians of the log-normal priors; its noise must not be below `noise_min`, nor that of `start`.
        start: Where the search begins, if that is better than `prior`.
        noise_min: Smallest noise ratio.
        follow: One pass from `start` alone, for data that have grown a little since it was found.
    """
    center = prior.log()
    floor = np.append(np.full(x.shape[1], -np.inf), np.log(noise_min) if noise_min > 0 else -np.inf)
    likelihood = _Likelihood(x, y)

    def score(vector: FloatArray) -> float:
        penalty = 0.5 * float(((vector - center) ** 2).sum()) / _PRIOR_LOG_SD**2
        return likelihood(Hyper.from_log(vector)) - penalty

    candidates = (start.log(),) if follow else (center, start.log())
    best_score, best = max(((score(vector), vector) for vector in candidates), key=lambda pair: pair[0])
    for step in _FOLLOW if follow else _SEARCH:
        for axis in range(len(best)):
            for sign in (-1.0, 1.0):
                trial = best.copy()
                trial[axis] = max(trial[axis] + sign * step, floor[axis])
                if trial[axis] == best[axis]:
                    continue
                trial_score = score(trial)
                if trial_score > best_score:
                    best, best_score = trial, trial_score
                    break
    return Hyper.from_log(best)


def _inverse_of_lower(factor: npt.NDArray[Any]) -> FloatArray:
    """Inverse of a lower triangle, by halves: numpy has none that leaves out the zeros."""
    n = len(factor)
    if n <= _BLOCK:
        return np.asarray(np.linalg.inv(factor))
    half, inverse = n // 2, np.zeros_like(factor)
    inverse[:half, :half] = _inverse_of_lower(factor[:half, :half])
    inverse[half:, half:] = _inverse_of_lower(factor[half:, half:])
    inverse[half:, :half] = -inverse[half:, half:] @ factor[half:, :half] @ inverse[:half, :half]
    return inverse


def _signal_variance(white: npt.NDArray[Any]) -> float:
    """Equation (1), from L^-1 y; not zero, so that constant values have a likelihood too."""
    return max(float(white @ white) / len(white), 1e-12)


def _correlation(a: FloatArray, b: FloatArray, lengths: FloatArray) -> FloatArray:
    u, v = a / lengths, b / lengths
    square = (u**2).sum(axis=1)[:, None] + (v**2).sum(axis=1) - 2.0 * u @ v.T
    return np.asarray(np.exp(np.clip(-0.5 * square, _EXPONENT_MIN, 0.0)))


def _prior_draws(x: FloatArray, lengths: FloatArray, variance: float, n: int, rng: np.random.Generator) -> SingleArray:
    """Draws from the prior at x, shape (n, m): sums of random cosines, whose covariance tends to the kernel's."""
    frequency = rng.standard_normal((_N_COSINES, x.shape[1])) / lengths
    phase = rng.uniform(0.0, 2.0 * np.pi, (_N_COSINES, 1))
    weight = rng.standard_normal((n, _N_COSINES)) * np.sqrt(2.0 * variance / _N_COSINES)
    waves = (
        np.hstack([frequency, phase]).astype(np.float32) @ np.column_stack([x, np.ones(len(x))]).astype(np.float32).T
    )
    return np.asarray(weight.astype(np.float32) @ np.cos(waves, out=waves))
