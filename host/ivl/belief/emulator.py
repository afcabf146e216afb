"""Emulators: what a member would record, and how often it would land, without flying it.

Fitted to a bank (`ivl.belief.bank`). u are the numbers of the member and of the policy, scaled.

    recording     features = A(u) + N(u) + b + e; A all products of two of u, N a small neural network, b of the member,
                  e of the flight; the covariances of b (between members: what the emulator does not know) and e (equal
                  flights) are those of its residuals on members that it was not fitted to
    landing       P(landed | u): a mean of small neural networks (scikit-learn), each from its own seed
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
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
    or name.startswith("swing_")
    or name.endswith(("_050", "_090", "_130", "_170", "_210"))
)
"""Features that are emulated; the others say the same again."""
_USED_INDEX = np.array([recording.NAMES.index(name) for name in USED])
_RIDGE = 3.0
_LEAST_SHARE, _LEAST_BETWEEN = 1e-3, 0.01
_LEAST_SEEN, _UNKNOWN = 40, 1e6
_TESTED_EVERY = 6
"""One member of so many is kept from the fit of the recordings: their residuals give the covariances."""
_REST_HIDDEN, _REST_EPOCHS, _REST_PENALTY, _REST_BATCH, _REST_RATE = (128, 128), 40, 0.01, 200, 2e-3
_OUTLIER = 10.0
"""The network of the recordings; residuals count up to `_OUTLIER` of their typical size (1.48 median |residual|)."""
_MAD = 1.4826
_ROWS_MAX = 1000
"""Rows that are worked on together: their terms stay in the cache of a core."""
_NETS, _HIDDEN, _EPOCHS, _PENALTY = 3, (48, 48, 24), 40, 0.3
_BATCH, _RATE = 400, 1e-3

BATTERY_CHANGES_V = 0.03
"""From a flight to the next one with the same battery, as measured in the hover."""

Rows = npt.NDArray[Any]
"""Rows of numbers in single or double precision, shape (n, ...)."""
Net = Sequence[tuple[FloatArray, FloatArray]]
"""Weights and biases of the layers of a network."""


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

    def conditions(self, quantiles: FloatArray, battery_V: float = np.nan) -> FloatArray:
        """Conditions, shape (n, 2), of quantiles, shape (n, 2): a normal voltage, a uniform overshoot.

        One that no flight of the bank has is unknown. `battery_V` is the voltage of the flight before, if this one has
        the same battery.
        """
        spread = np.stack([ndtri(quantiles[:, 0]), np.sqrt(3.0) * (2.0 * quantiles[:, 1] - 1.0)], axis=1)
        mean, sigma = self.mean.copy(), self.sigma.copy()
        if np.isfinite(battery_V):
            mean[0], sigma[0] = battery_V, min(BATTERY_CHANGES_V, sigma[0])
        return np.asarray(np.where(self.sigma > 0.0, mean + sigma * spread, np.nan))


@dataclass(frozen=True)
class RecordingEmulator:
    """Mean and covariances of recordings.

    Attributes:
        scale: Of policies and conditions.
        weights: Of the terms, shape (n_terms, n_used).
        net: What the terms leave, in units of `spread`; no layers: nothing.
        spread: Shape (n_used,).
        within: Covariance of e, shape (n_used, n_used).
        between: Covariance of b, shape (n_used, n_used).
    """

    scale: Scale
    weights: FloatArray
    net: Net
    spread: FloatArray
    within: FloatArray
    between: FloatArray

    def mean(self, z: FloatArray, theta: FloatArray, conditions: FloatArray) -> FloatArray:
        """Expected features of members z, shape (n, d), in flights, shape (n, ...): shape (n, n_used)."""
        return _in_parts(self._mean, z, theta, conditions)

    def _mean(self, z: FloatArray, theta: FloatArray, conditions: FloatArray) -> FloatArray:
        u: Rows = np.concatenate([z, self.scale(theta, conditions)], axis=1, dtype=np.float32)
        expected: Rows = (_terms(u, theta.shape[1]) @ self.weights.astype(np.float32)).astype(np.float64)
        return expected + self.spread * forward(self.net, u) if self.net else expected


def _in_parts(function: Callable[..., FloatArray], *rows: FloatArray) -> FloatArray:
    """A function of rows, arrays of shape (n, ...), part by part."""
    firsts = range(0, max(len(rows[0]), 1), _ROWS_MAX)
    return np.concatenate([function(*(array[first : first + _ROWS_MAX] for array in rows)) for first in firsts])


def forward(net: Net, u: Rows) -> FloatArray:
    """Output of a network with rectifiers, in single precision, shape (n, n_out)."""
    h: Rows = np.asarray(u, dtype=np.float32)
    for number, (weight, bias) in enumerate(net):
        h = h @ weight
        h += bias
        if number + 1 < len(net):
            np.maximum(h, 0.0, out=h)
    return h.astype(np.float64)


def _layers(net: Any) -> Net:
    """Weights and biases of a fitted network of scikit-learn."""
    pairs = zip(net.coefs_, net.intercepts_, strict=True)
    return [(weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in pairs]


def _terms(u: Rows, dim: int) -> Rows:
    """One, all of u, all products of two, and the cubes of policy and conditions, the last of u; dim of the policy.

    Shape (n, n_terms), of the type of u; a column lies in one piece of memory, since columns are multiplied.
    """
    rows = np.ascontiguousarray(u.T)
    d, n_cubes = len(rows), dim + len(recording.CONDITIONS)
    found = np.empty((1 + d + d * (d + 1) // 2 + n_cubes, len(u)), dtype=u.dtype)
    found[0], found[1 : 1 + d] = 1.0, rows
    first = 1 + d
    for i in range(d):
        np.multiply(rows[i:], rows[i], out=found[first : first + d - i])
        first += d - i
    found[first:] = rows[-n_cubes:] ** 3
    return found.T


def fit_recordings(bank: Bank, scale: Scale, seed: int = 0) -> RecordingEmulator:
    """Ridge regression and a network on the recordings of a bank."""
    n, k = bank.features.shape[:2]
    theta = bank.theta.reshape(n * k, -1)
    y = used(bank.features).reshape(n * k, -1)
    u = np.concatenate(
        [np.repeat(bank.z, k, axis=0), scale(theta, bank.features[..., recording.CONDITIONS].reshape(n * k, -1))],
        axis=1,
    )
    tested = np.arange(n) % _TESTED_EVERY == _TESTED_EVERY - 1
    fitted = np.repeat(~tested, k)
    terms = _terms(u, theta.shape[1])
    weights = _ridge(terms[fitted], y[fitted])
    rest = y - terms @ weights
    spread = _typical(rest[fitted])
    net = _fit_rest(u[fitted], rest[fitted] / spread, seed)
    rest = (rest - spread * forward(net, u)).reshape(n, k, -1)[tested]
    size = _OUTLIER * _typical(rest.reshape(-1, y.shape[1]))
    residual = np.clip(rest, -size, size)
    rare = np.isfinite(residual).sum(axis=(0, 1)) < _LEAST_SEEN
    residual[..., rare] = np.nan  # so few tell nothing of equal flights
    within, between = _covariances(residual)
    return RecordingEmulator(scale, weights, net, spread, within, between)


def _ridge(x: FloatArray, y: FloatArray) -> FloatArray:
    """Weights of each column of y, which may have gaps."""
    weights = np.zeros((x.shape[1], y.shape[1]))
    for column in range(y.shape[1]):
        seen = np.isfinite(y[:, column])
        a = x[seen]
        weights[:, column] = np.linalg.solve(a.T @ a + _RIDGE * np.eye(a.shape[1]), a.T @ y[seen, column])
    return weights


def _typical(residual: FloatArray) -> FloatArray:
    """Typical size of residuals with gaps, shape (n_used,), that outliers do not change; 1 where there are none."""
    size = np.ones(residual.shape[1])
    for column, values in enumerate(residual.T):
        known = np.abs(values[np.isfinite(values)])
        known = known[known > 0.0]
        if len(known):
            size[column] = _MAD * float(np.median(known))
    return size


def _fit_rest(u: FloatArray, rest: FloatArray, seed: int) -> Net:
    """A network on what the terms leave; a gap counts as 0, since it is never asked for where gaps are usual."""
    from sklearn.neural_network import MLPRegressor  # type: ignore[import-untyped]  # takes a second to load

    target = np.where(np.isfinite(rest), np.clip(rest, -_OUTLIER, _OUTLIER), 0.0)
    net = MLPRegressor(
        hidden_layer_sizes=_REST_HIDDEN,
        alpha=_REST_PENALTY,
        batch_size=min(_REST_BATCH, len(u)),
        learning_rate_init=_REST_RATE,
        random_state=seed,
    )
    for _ in range(_REST_EPOCHS):
        net.partial_fit(u, target)
    return _layers(net)


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
    nets: Sequence[Net]

    def inputs(
        self, z: FloatArray, theta: FloatArray, conditions: FloatArray, recorded: FloatArray | None = None
    ) -> FloatArray:
        """Member, flight, and what it is expected to record: the motion decides the landing."""
        s = self.recordings.scale(theta, conditions)
        mean = self.recordings.mean(z, theta, conditions) if recorded is None else recorded
        parts = [z, s, s[:, : theta.shape[1]] ** 2, (mean - self.centre) / self.spread]
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def rate(
        self, z: FloatArray, theta: FloatArray, conditions: FloatArray, recorded: FloatArray | None = None
    ) -> FloatArray:
        """P(landed), shape (n,), of members z, shape (n, d), in flights, shape (n, ...).

        `recorded` is what they are expected to record, shape (n, n_used), if it is known already.
        """
        return _in_parts(self._rate, z, theta, conditions, *(() if recorded is None else (recorded,)))

    def _rate(self, *flights: FloatArray) -> FloatArray:
        u = self.inputs(*flights)
        return np.asarray(np.mean([expit(forward(net, u)[:, 0]) for net in self.nets], axis=0))


def fit_landings(bank: Bank, recordings: RecordingEmulator, seed: int = 0, epochs: int = _EPOCHS) -> LandingEmulator:
    """Neural networks on the landings of a bank."""
    from sklearn.neural_network import MLPClassifier  # takes a second to load

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
        for _ in range(epochs):
            net.partial_fit(x, y, classes=[False, True])
        nets.append(_layers(net))
    return LandingEmulator(recordings, emulator.centre, emulator.spread, nets)


_SCALE, _RECORDING, _LANDING = "scale.", "recording.", "landing."


def arrays(recordings: RecordingEmulator, landings: LandingEmulator) -> dict[str, npt.NDArray[Any]]:
    """Emulators as arrays with names, for a file."""
    found = {_SCALE + f.name: getattr(recordings.scale, f.name) for f in fields(Scale)}
    found |= {_RECORDING + name: getattr(recordings, name) for name in ("weights", "spread", "within", "between")}
    found |= {_LANDING + name: getattr(landings, name) for name in ("centre", "spread")}
    for number, net in enumerate([recordings.net, *landings.nets]):
        for layer, (weight, bias) in enumerate(net):
            found |= {f"net.{number}.{layer}.weight": weight, f"net.{number}.{layer}.bias": bias}
    return found


def of_arrays(data: Mapping[str, npt.NDArray[Any]]) -> tuple[RecordingEmulator, LandingEmulator]:
    """Inverse of `arrays`.

    Raises:
        KeyError: An array is missing.
    """
    scale = Scale(*(data[_SCALE + f.name] for f in fields(Scale)))
    nets: list[Net] = []
    while f"net.{len(nets)}.0.weight" in data:
        number = len(nets)
        net: list[tuple[FloatArray, FloatArray]] = []
        while f"net.{number}.{len(net)}.weight" in data:
            net.append((data[f"net.{number}.{len(net)}.weight"], data[f"net.{number}.{len(net)}.bias"]))
        nets.append(net)
    if len(nets) != 1 + _NETS:
        raise KeyError("net")
    weights, *others = (data[_RECORDING + name] for name in ("weights", "spread", "within", "between"))
    recordings = RecordingEmulator(scale, weights, nets[0], *others)
    return recordings, LandingEmulator(recordings, data[_LANDING + "centre"], data[_LANDING + "spread"], nets[1:])
