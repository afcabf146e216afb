"""Emulators: what a member would record, and how often it would land, without flying it.

Fitted to a bank (`ivl.belief.bank`). u are the numbers of the member and of the policy, scaled.

    recording     features = A(u) + b + e; A all products of two of u, b of the member, e of the flight;
                  the covariances of b (between members: what the emulator does not know) and e (equal flights) are
                  those of its residuals
    landing       P(landed | u): a mean of small neural networks (scikit-learn), each from its own seed
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import expit, ndtri  # type: ignore[import-untyped]

from ivl.belief import recording
from ivl.belief.bank import Bank

FloatArray = npt.NDArray[np.float64]

USED = tuple(
    name
    for name in recording.NAMES
    if name in ("closing", "contact_time", "contact_distance")
    or name.endswith(("_050", "_090", "_130", "_170", "_210"))
)
"""Features that are emulated; the others say the same again."""
_USED_INDEX = np.array([recording.NAMES.index(name) for name in USED])
_RIDGE = 3.0
_LEAST_SHARE, _LEAST_BETWEEN = 1e-3, 0.01
_LEAST_SEEN, _UNKNOWN = 40, 1e6
_NETS, _HIDDEN, _EPOCHS, _PENALTY = 3, (48, 48, 24), 30, 0.3
_BATCH, _RATE = 400, 2e-3


def used(features: FloatArray) -> FloatArray:
    """The emulated features of recordings, shape (..., len(USED))."""
    return np.asarray(features[..., _USED_INDEX])


@dataclass(frozen=True)
class Scale:
    """What is known of a flight, as numbers of size one: its policy and its conditions.

    Attributes:
        lo: Lower bounds of the policies, shape (dim,).
        hi: Upper bounds, shape (dim,).
        mean: Mean of the conditions, shape (2,); 0 of one that no flight has.
        sigma: Their standard deviations, shape (2,); 0 of one that no flight has, or that is always the same.
    """

    lo: FloatArray
    hi: FloatArray
    mean: FloatArray
    sigma: FloatArray

    @staticmethod
    def of(bank: Bank, bounds: FloatArray) -> "Scale":
        """The scale of a bank."""
        given = bank.features[..., recording.CONDITIONS].reshape(-1, len(recording.CONDITIONS))
        known = [column[np.isfinite(column)] for column in given.T]
        mean = np.array([column.mean() if len(column) else 0.0 for column in known])
        sigma = np.array([column.std() if len(column) else 0.0 for column in known])
        return Scale(bounds[:, 0], bounds[:, 1], mean, sigma)

    def __call__(self, theta: FloatArray, conditions: FloatArray) -> FloatArray:
        """Policies, shape (n, dim), with conditions, shape (n, 2), as shape (n, dim + 2); NaN is the mean."""
        policy = 4.0 * (theta - self.lo) / (self.hi - self.lo) - 2.0
        others = (conditions - self.mean) / np.where(self.sigma > 0.0, self.sigma, 1.0)
        return np.concatenate([policy, np.where(np.isfinite(others), others, 0.0)], axis=1)

    def conditions(self, quantiles: FloatArray) -> FloatArray:
        """Conditions, shape (n, 2), of quantiles, shape (n, 2): a normal voltage, a uniform overshoot.

        One that no flight of the bank has is unknown.
        """
        spread = np.stack([ndtri(quantiles[:, 0]), np.sqrt(3.0) * (2.0 * quantiles[:, 1] - 1.0)], axis=1)
        return np.asarray(np.where(self.sigma > 0.0, self.mean + self.sigma * spread, np.nan))


@dataclass(frozen=True)
class RecordingEmulator:
    """Mean and covariances of recordings.

    Attributes:
        weights: Of the terms, shape (n_terms, n_used).
        within: Covariance of e, shape (n_used, n_used).
        between: Covariance of b, shape (n_used, n_used).
    """

    scale: Scale
    weights: FloatArray
    within: FloatArray
    between: FloatArray

    def mean(self, z: FloatArray, theta: FloatArray, conditions: FloatArray) -> FloatArray:
        """Expected features of members z, shape (n, d), in flights, shape (n, ...): shape (n, n_used)."""
        return _terms(z, self.scale(theta, conditions)) @ self.weights


def _terms(z: FloatArray, s: FloatArray) -> FloatArray:
    """One, all of u, all products of two, and the cubes of policy and conditions."""
    u = np.concatenate([z, s], axis=1)
    i, j = np.triu_indices(u.shape[1])
    return np.concatenate([np.ones((len(u), 1)), u, u[:, i] * u[:, j], s**3], axis=1)


def fit_recordings(bank: Bank, scale: Scale) -> RecordingEmulator:
    """Ridge regression on the recordings of a bank."""
    n, k = bank.features.shape[:2]
    z = np.repeat(bank.z, k, axis=0)
    theta = bank.theta[:, :k].reshape(n * k, -1)
    y = used(bank.features).reshape(n * k, -1)
    x = _terms(z, scale(theta, bank.features[..., recording.CONDITIONS].reshape(n * k, -1)))
    weights = np.zeros((x.shape[1], y.shape[1]))
    for column in range(y.shape[1]):
        seen = np.isfinite(y[:, column])
        a = x[seen]
        weights[:, column] = np.linalg.solve(a.T @ a + _RIDGE * np.eye(a.shape[1]), a.T @ y[seen, column])
    residual = (y - x @ weights).reshape(n, k, -1)
    rare = np.isfinite(residual).sum(axis=(0, 1)) < _LEAST_SEEN
    residual[..., rare] = np.nan  # so few tell nothing of equal flights
    within, between = _covariances(residual)
    return RecordingEmulator(scale, weights, within, between)


def _covariances(residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Covariance within members and between them, of residuals with gaps, shape (n, k, q)."""
    seen = np.isfinite(residual)
    count = seen.sum(axis=1)
    mean = np.where(seen, residual, 0.0).sum(axis=1) / np.maximum(count, 1)
    inner = np.where(seen, residual - mean[:, None], 0.0)
    pairs = np.einsum("nka,nkb->ab", seen.astype(float), seen.astype(float))
    lost = np.einsum("na,nb->ab", (count > 0).astype(float), (count > 0).astype(float))
    within = np.einsum("nka,nkb->ab", inner, inner) / np.maximum(pairs - lost, 1.0)
    rich = count >= np.maximum(2, residual.shape[1] // 3)
    outer = np.where(rich, mean, 0.0)
    number = np.einsum("na,nb->ab", rich.astype(float), rich.astype(float))
    average = np.einsum("na,nb->ab", rich / np.maximum(count, 1), rich.astype(float)) / np.maximum(number, 1.0)
    between = np.einsum("na,nb->ab", outer, outer) / np.maximum(number, 1.0) - within * np.minimum(average, average.T)
    # what was never seen twice by one member says nothing: its errors are as large as any
    inner_variance = np.where(np.diag(pairs) - np.diag(lost) > 0.0, np.diag(within), _UNKNOWN)
    least = _LEAST_BETWEEN * inner_variance
    return _positive(within, inner_variance), _positive(between, np.maximum(np.diag(between), least))


def _positive(matrix: FloatArray, variance: FloatArray) -> FloatArray:
    """A covariance with these variances near an estimate with gaps, which may be none."""
    spread = np.sqrt(variance)
    correlation = np.clip(matrix / np.outer(spread, spread), -1.0, 1.0)
    np.fill_diagonal(correlation, 1.0)
    values, vectors = np.linalg.eigh(correlation)
    values = np.maximum(values, _LEAST_SHARE * values.max())
    return np.asarray((vectors * values) @ vectors.T * np.outer(spread, spread))


@dataclass(frozen=True)
class LandingEmulator:
    """Landing rate of members with policies."""

    recordings: RecordingEmulator
    centre: FloatArray
    spread: FloatArray
    nets: Sequence[Sequence[tuple[FloatArray, FloatArray]]]

    def inputs(self, z: FloatArray, theta: FloatArray, conditions: FloatArray) -> FloatArray:
        """Member, flight, and what it is expected to record: the motion decides the landing."""
        s = self.recordings.scale(theta, conditions)
        expected = (self.recordings.mean(z, theta, conditions) - self.centre) / self.spread
        return np.concatenate([z, s, s[:, : theta.shape[1]] ** 2, expected], axis=1)

    def rate(self, z: FloatArray, theta: FloatArray, conditions: FloatArray) -> FloatArray:
        """P(landed), shape (n,), of members z, shape (n, d), in flights, shape (n, ...)."""
        u = self.inputs(z, theta, conditions).astype(np.float32)
        total = np.zeros(len(u))
        for net in self.nets:
            h: npt.NDArray[Any] = u
            for number, (weight, bias) in enumerate(net):
                h = h @ weight + bias
                if number + 1 < len(net):
                    h = np.maximum(h, 0.0)
            total += expit(h[:, 0].astype(np.float64))
        return np.asarray(total / len(self.nets))


def fit_landings(bank: Bank, recordings: RecordingEmulator, seed: int = 0) -> LandingEmulator:
    """Neural networks on the landings of a bank."""
    from sklearn.neural_network import MLPClassifier  # type: ignore[import-untyped]  # takes a second to load

    n, m = bank.landed.shape
    flights = (
        np.repeat(bank.z, m, axis=0),
        bank.theta.reshape(n * m, -1),
        bank.features[..., recording.CONDITIONS].reshape(n * m, -1),
    )
    expected = recordings.mean(*flights)
    spread = expected.std(axis=0)
    emulator = LandingEmulator(recordings, expected.mean(axis=0), np.where(spread > 0.0, spread, 1.0), [])
    x, y = emulator.inputs(*flights), bank.landed.ravel()
    nets = []
    for number in range(_NETS):
        net = MLPClassifier(
            _HIDDEN,
            alpha=_PENALTY,
            batch_size=min(_BATCH, len(y)),
            learning_rate_init=_RATE,
            random_state=seed + number,
        )
        for _ in range(_EPOCHS):
            net.partial_fit(x, y, classes=[False, True])
        nets.append(
            [(w.astype(np.float32), b.astype(np.float32)) for w, b in zip(net.coefs_, net.intercepts_, strict=True)]
        )
    return LandingEmulator(recordings, emulator.centre, emulator.spread, nets)
