"""A small Gaussian process: squared-exponential kernel with one length per dimension, and white noise. numpy only.

With K_ij = exp(-|(x_i - x_j) / l|^2 / 2) and g the ratio of noise to signal variance:

    y ~ N(0, s^2 (K + g I)),    s^2 = y' (K + g I)^-1 y / n                                              (1)
    log p(y | l, g) = -n/2 log s^2 - 1/2 log det(K + g I) + const                                        (2)

The signal variance has that closed form, so that only the lengths and g are searched, with log-normal priors. A draw of
the function at any set of points needs no factor of their joint covariance: a draw of the prior is corrected by what it
says at the data (Matheron's rule; the prior draw is a sum of random cosines):

    f(x) = f0(x) + k(x, X) (K + g I)^-1 (y - f0(X) - e),    e ~ N(0, s^2 g I)                            (3)
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_PRIOR_LOG_SD = 1.0  # of each length and of the noise ratio, about their prior values
_JITTER = 1e-8
_N_COSINES = 200  # of a prior draw


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
        self._whiten = np.linalg.inv(_factor(x, hyper))
        white = self._whiten @ y
        self._alpha = self._whiten.T @ white
        self.signal_variance = _signal_variance(white)

    def predict(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation of the function (without noise) at x, each of shape (m,)."""
        cross = _correlation(x, self.x, self.hyper.lengths)
        reduced = self._whiten @ cross.T
        variance = np.maximum(1.0 - (reduced**2).sum(axis=0), 0.0)
        return np.asarray(cross @ self._alpha), np.sqrt(self.signal_variance * variance)

    def sample(self, x: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
        """Draws of the function at x by equation (3), shape (n, m)."""
        noise_sd = np.sqrt(self.signal_variance * (self.hyper.noise + _JITTER))
        prior = _prior_draws(np.vstack([self.x, x]), self.hyper.lengths, self.signal_variance, n, rng)
        at_data = prior[:, : len(self.x)] + noise_sd * rng.standard_normal((n, len(self.x)))
        correction = self._alpha - at_data @ self._whiten.T @ self._whiten
        return np.asarray(prior[:, len(self.x) :] + correction @ _correlation(self.x, x, self.hyper.lengths))


def log_likelihood(x: FloatArray, y: FloatArray, hyper: Hyper) -> float:
    """Marginal likelihood (2) with the signal variance at its optimum, up to a constant."""
    factor = _factor(x, hyper)
    variance = _signal_variance(np.asarray(np.linalg.solve(factor, y), dtype=np.float64))
    return float(-0.5 * len(x) * np.log(variance) - np.log(np.diag(factor)).sum())


def fit(x: FloatArray, y: FloatArray, prior: Hyper, start: Hyper, noise_min: float = 0.0, n_rounds: int = 3) -> Hyper:
    """Hyper-parameters of the largest posterior density, by a deterministic pattern search from `prior` and `start`.

    Args:
        x: Points, shape (n, dim).
        y: Values, shape (n,), standardised.
        prior: Medians of the log-normal priors; its noise must not be below `noise_min`, nor that of `start`.
        start: Where the search begins, if that is better than `prior`.
        noise_min: Smallest noise ratio.
        n_rounds: Passes over all parameters, each with half the step of the one before.
    """
    center = prior.log()
    floor = np.append(np.full(x.shape[1], -np.inf), np.log(noise_min) if noise_min > 0 else -np.inf)

    def score(vector: FloatArray) -> float:
        penalty = 0.5 * float(((vector - center) ** 2).sum()) / _PRIOR_LOG_SD**2
        return log_likelihood(x, y, Hyper.from_log(vector)) - penalty

    best = max((center, start.log()), key=score)
    best_score, step = score(best), 0.6
    for _ in range(n_rounds):
        for axis in range(len(best)):
            for sign in (-1.0, 1.0):
                trial = best.copy()
                trial[axis] = max(trial[axis] + sign * step, floor[axis])
                trial_score = score(trial)
                if trial_score > best_score:
                    best, best_score = trial, trial_score
                    break
        step /= 2
    return Hyper.from_log(best)


def _factor(x: FloatArray, hyper: Hyper) -> FloatArray:
    noise = (hyper.noise + _JITTER) * np.eye(len(x))
    return np.asarray(np.linalg.cholesky(_correlation(x, x, hyper.lengths) + noise))


def _signal_variance(white: FloatArray) -> float:
    """Equation (1), from L^-1 y; not zero, so that constant values have a likelihood too."""
    return max(float(white @ white) / len(white), 1e-12)


def _correlation(a: FloatArray, b: FloatArray, lengths: FloatArray) -> FloatArray:
    u, v = a / lengths, b / lengths
    square = (u**2).sum(axis=1)[:, None] + (v**2).sum(axis=1) - 2.0 * u @ v.T
    return np.asarray(np.exp(-0.5 * np.maximum(square, 0.0)))


def _prior_draws(x: FloatArray, lengths: FloatArray, variance: float, n: int, rng: np.random.Generator) -> FloatArray:
    """Draws from the prior at x, shape (n, m): sums of random cosines, whose covariance tends to the kernel's."""
    frequency = rng.standard_normal((_N_COSINES, x.shape[1])) / lengths
    phase = rng.uniform(0.0, 2.0 * np.pi, _N_COSINES)
    weight = rng.standard_normal((n, _N_COSINES)) * np.sqrt(2.0 * variance / _N_COSINES)
    return np.asarray(weight @ np.cos(frequency @ x.T + phase[:, None]))
