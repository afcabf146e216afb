"""A small Gaussian process: squared-exponential kernel with one length per dimension, and white noise. numpy only.

With R the kernel's correlation matrix and g the ratio of noise to signal variance, y ~ N(0, s^2 (R + g I)). The
signal variance has the closed form s^2 = y' (R + g I)^-1 y / n, so that only the lengths and g are searched (log
posterior with log-normal priors).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_PRIOR_LOG_SD = 1.0  # of each length and of the noise ratio, about their prior values
_JITTER = 1e-8


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
        self._chol = np.linalg.cholesky(_correlation(x, x, hyper.lengths) + (hyper.noise + _JITTER) * np.eye(len(x)))
        self._white = np.linalg.solve(self._chol, y)
        self._alpha = np.linalg.solve(self._chol.T, self._white)
        self.signal_variance = max(float(self._white @ self._white) / len(x), 1e-12)

    def log_likelihood(self) -> float:
        """Marginal likelihood with the signal variance at its optimum, up to a constant."""
        n = len(self.x)
        return float(-0.5 * n * np.log(self.signal_variance) - np.log(np.diag(self._chol)).sum())

    def predict(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation of the function (without noise) at x, each of shape (m,)."""
        cross = _correlation(x, self.x, self.hyper.lengths)
        reduced = np.linalg.solve(self._chol, cross.T)
        variance = np.maximum(1.0 - (reduced**2).sum(axis=0), 0.0)
        return cross @ self._alpha, np.sqrt(self.signal_variance * variance)

    def sample(self, x: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
        """Joint draws of the function at x, shape (n, m)."""
        cross = _correlation(x, self.x, self.hyper.lengths)
        reduced = np.linalg.solve(self._chol, cross.T)
        covariance = _correlation(x, x, self.hyper.lengths) - reduced.T @ reduced
        root = _root(covariance)
        draws = rng.standard_normal((n, len(x))) @ root.T
        return np.asarray(cross @ self._alpha + np.sqrt(self.signal_variance) * draws)


def fit(x: FloatArray, y: FloatArray, prior: Hyper, start: Hyper, n_rounds: int = 4) -> Hyper:
    """Hyper-parameters of the largest posterior density, by a deterministic pattern search from `prior` and `start`."""
    center = prior.log()

    def score(vector: FloatArray) -> float:
        penalty = 0.5 * float(((vector - center) ** 2).sum()) / _PRIOR_LOG_SD**2
        return GaussianProcess(x, y, Hyper.from_log(vector)).log_likelihood() - penalty

    best = max((center, start.log()), key=score)
    best_score, step = score(best), 0.8
    for _ in range(n_rounds):
        for axis in range(len(best)):
            for sign in (-1.0, 1.0):
                trial = best.copy()
                trial[axis] += sign * step
                trial_score = score(trial)
                if trial_score > best_score:
                    best, best_score = trial, trial_score
        step /= 2
    return Hyper.from_log(best)


def _correlation(a: FloatArray, b: FloatArray, lengths: FloatArray) -> FloatArray:
    difference = (a[:, None, :] - b[None, :, :]) / lengths
    return np.asarray(np.exp(-0.5 * (difference**2).sum(axis=2)))


def _root(covariance: FloatArray) -> FloatArray:
    """Cholesky factor; where rounding has made the matrix indefinite, with the smallest jitter that repairs it."""
    jitter = _JITTER
    while True:
        try:
            return np.asarray(np.linalg.cholesky(covariance + jitter * np.eye(len(covariance))), dtype=np.float64)
        except np.linalg.LinAlgError:
            jitter *= 10.0
