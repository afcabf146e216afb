"""What flights say of the vehicle that flies: particles over the members of a family.

A flight i with policy theta_i tells a recording y_i (with gaps) and whether it landed. With the emulators m, p:

    y_i = m(z, theta_i) + b + e_i,    b ~ N(0, B + D),    e_i ~ N(0, W)                                     (1)
    Q(z) = sum r_i' W_i^-1 r_i - v' ((B + D)^-1 + sum W_i^-1)^-1 v,    r_i = y_i - m, v = sum W_i^-1 r_i     (2)
    log L_motion = -share (nu + q) / 2 log(1 + Q / nu),    share = min(1, n_full / n)                       (3)
    log L_outcome = sum log((1 - lapse) P_i + lapse / 2),  P_i = p or 1 - p                                 (4)

with W_i the rows and columns of W that flight i has, n the flights that recorded anything, and q the number of all
their values. Where the conditions of a flight are unknown, p is averaged over them. b is what the emulator and the
model get wrong of one vehicle: all its flights share it, so that equal errors of many flights do not add up to
certainty. D is the discrepancy that is allowed to any model; it grows with time after the trigger. The Student-t form
(3) leaves room for errors of unexpected size, its share for errors of unexpected shape.

The posterior over z (prior: standard normal, within the bounds of the family) is sampled by sequential Monte Carlo:
particles are weighted in tempered steps, resampled, and moved in turn by two kinds of Metropolis steps: preconditioned
Crank-Nicolson steps, which leave the prior as it is, and differences of two other particles (differential evolution,
ter Braak, Stat. Comput. 16:239, 2006), which follow a narrow posterior whatever its direction.
"""

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl.belief.emulator import USED, LandingEmulator, RecordingEmulator
from ivl.family import Family

FloatArray = npt.NDArray[np.float64]

_SIZES = {"pitch": 4.0, "rate": 0.8, "fall": 0.005}
_AT_S, _ALIKE_S = 0.2, 0.1
_OTHERS = {"contact_time": 0.004, "contact_distance": 0.005, "closing": 0.03}
_AFTER_CONTACT = {"swing_pitch": 6.0, "swing_rate": 3.0}
_MOVES, _LAST_MOVES = 6, 24
_BETA_START, _BETA_MIN, _BETA_MAX, _ACCEPTED = 0.4, 0.02, 0.8, 0.3
_DIFFERENCE, _JITTER, _WHOLE = 2.38, 0.02, 0.1
"""Difference step: its length times sqrt(2 d), its noise, and the share of steps that are a whole difference."""
_BETA_FACTORS = (0.3, 1.0, 1.7)
_EFFECTIVE, _HALVINGS, _LEAST_STEP = 0.5, 20, 1e-3
RATED = 128
"""Particles that tell landing rates; more of them say the same, and a decision asks for thousands of policies."""
_GOLDEN, _TINY = 0.6180339887498949, 1e-6
_N_CONDITIONS, _P_MIN = 9, 1e-6


@dataclass(frozen=True)
class Trust:
    """How far flights are trusted; see equations (1), (3) and (4).

    Attributes:
        nu: Degrees of freedom.
        n_full: Flights whose motion counts in full; more of them count like so many.
        lapse: Probability that an outcome says nothing.
        discrepancy: Factor on the standard deviations of D.
    """

    nu: float = 10.0
    n_full: float = 3.0
    lapse: float = 0.05
    discrepancy: float = 1.0


@dataclass(frozen=True)
class Evidence:
    """Flights: policies, shape (n, dim), recordings (n, n_used), landings (n,), conditions (n, 2)."""

    theta: FloatArray
    features: FloatArray
    landed: npt.NDArray[np.bool_]
    conditions: FloatArray


def discrepancy(factor: float) -> FloatArray:
    """D, shape (n_used, n_used): 4 degrees, 0.8 rad/s and 5 mm at 200 ms, growing as the square of time, smooth.

    After the contact 6 degrees and 3 rad/s at any time: contacts are modelled less well than the flight before them.
    """
    split = [name.rpartition("_") for name in USED]
    in_time = _SIZES | _AFTER_CONTACT
    signal = [stem if stem in in_time else name for (stem, _, _), name in zip(split, USED, strict=True)]
    time_s = np.array([float(end) / 1000.0 if stem in in_time else 0.0 for stem, _, end in split])
    flat = _OTHERS | _AFTER_CONTACT
    size = np.array(
        [flat[s] if s in flat else _SIZES[s] * (t / _AT_S) ** 2 for s, t in zip(signal, time_s, strict=True)]
    )
    same = np.array([[a == b for b in signal] for a in signal])
    alike = np.where(same, np.exp(-np.abs(time_s[:, None] - time_s) / _ALIKE_S), 0.0)
    return np.asarray(factor**2 * np.outer(size, size) * alike)


class Belief:
    """Particles over the members of a family."""

    def __init__(
        self,
        recordings: RecordingEmulator,
        landings: LandingEmulator,
        kin: Family,
        n_particles: int,
        rng: np.random.Generator,
        trust: Trust,
    ) -> None:
        """Before any flight: the family itself.

        Args:
            recordings: Emulator of what a flight records.
            landings: Emulator of the landing rate.
            kin: The family.
            n_particles: Number of particles.
            rng: Of everything that is drawn, also later.
            trust: How far flights are trusted.
        """
        self._recordings, self._landings, self._kin, self._trust, self._rng = recordings, landings, kin, trust, rng
        # particles, shape (n_particles, n_dimensions)
        self._prior_b = np.linalg.inv(recordings.between + discrepancy(trust.discrepancy))
        self._beta = _BETA_START
        self.evidence: Evidence | None = None
        self.battery_V = np.nan
        """Voltage with which the next flight is expected; NaN: any, spread as in the bank."""
        self.z = np.array([kin.draw(rng)[0] for _ in range(n_particles)])

    def log_likelihood(self, z: FloatArray, evidence: Evidence | None) -> FloatArray:
        """Equations (1) to (4), shape (len(z),)."""
        return np.zeros(len(z)) if evidence is None else self._both(z, evidence, 0)[0]

    def _both(self, z: FloatArray, evidence: Evidence, n_old: int) -> tuple[FloatArray, FloatArray]:
        """Log-likelihood of all flights, and of the first `n_old` of them, shape (len(z),) each."""
        n, n_z = len(evidence.theta), len(z)
        flights = np.repeat(z, n, axis=0), np.tile(evidence.theta, (n_z, 1)), np.tile(evidence.conditions, (n_z, 1))
        recorded = self._recordings.mean(*flights)
        residual = evidence.features[None] - recorded.reshape(n_z, n, -1)
        p = self._expected(flights, recorded).reshape(n_z, n)
        right = np.where(evidence.landed, p, 1.0 - p)
        outcome = np.log((1.0 - self._trust.lapse) * right + self._trust.lapse / 2.0)
        parts = [outcome[:, :k].sum(axis=1) + self._motion(residual[:, :k]) if k else np.zeros(n_z) for k in (n, n_old)]
        return np.asarray(parts[0]), np.asarray(parts[1])

    def _expected(self, flights: tuple[FloatArray, FloatArray, FloatArray], recorded: FloatArray) -> FloatArray:
        """Landing rate in flights, shape (n,): averaged over conditions that are unknown."""
        z, theta, conditions = flights
        p = self._landings.rate(z, theta, conditions, recorded)
        unknown = ~np.isfinite(conditions[:, self._recordings.scale.sigma > 0.0]).all(axis=1)
        if unknown.any():
            at = (np.arange(_N_CONDITIONS) + 0.5) / _N_CONDITIONS
            drawn = self._recordings.scale.conditions(np.stack([at, (at * _N_CONDITIONS * _GOLDEN) % 1.0], axis=1))
            rates = []
            for one in drawn:
                filled = np.where(np.isfinite(conditions[unknown]), conditions[unknown], one)
                rates.append(self._landings.rate(z[unknown], theta[unknown], filled))
            p[unknown] = np.mean(rates, axis=0)
        return np.asarray(np.clip(p, _P_MIN, 1.0 - _P_MIN))

    def _motion(self, residual: FloatArray) -> FloatArray:
        """Equations (2) and (3) of residuals with gaps, shape (n_z, n, n_used)."""
        n_z, n, _ = residual.shape
        square, v, information = np.zeros(n_z), np.zeros((n_z, len(USED))), self._prior_b.copy()
        n_recorded = q = 0
        for i in range(n):
            seen = np.isfinite(residual[0, i])
            if not seen.any():
                continue
            inverse = np.linalg.inv(self._recordings.within[np.ix_(seen, seen)])
            r = residual[:, i, seen]
            weighted = r @ inverse
            square += np.einsum("na,na->n", weighted, r)
            v[:, seen] += weighted
            information[np.ix_(seen, seen)] += inverse
            n_recorded, q = n_recorded + 1, q + int(seen.sum())
        if not q:
            return np.zeros(n_z)
        square -= np.einsum("na,na->n", v @ np.linalg.inv(information), v)
        share, nu = min(1.0, self._trust.n_full / n_recorded), self._trust.nu
        return np.asarray(-share * 0.5 * (nu + q) * np.log1p(np.maximum(square, 0.0) / nu))

    def update(self, evidence: Evidence) -> None:
        """Sample the posterior of all flights so far: those of the last update, and new ones behind them."""
        n_old = 0 if self.evidence is None else len(self.evidence.theta)
        new, old = self._both(self.z, evidence, n_old)
        done = 0.0
        while done < 1.0:
            share = _next_share(new - old, done)
            chosen = self._resample((share - done) * (new - old))
            self.z, new, old, done = self.z[chosen], new[chosen], old[chosen], share
            for number in range(_MOVES if done < 1.0 else _LAST_MOVES):
                new, old = self._move(evidence, n_old, new, old, done, number % 2 == 1)
        self.evidence = evidence

    def _resample(self, log_weights: FloatArray) -> npt.NDArray[np.intp]:
        weights = np.exp(log_weights - log_weights.max())
        n, cumulative = len(weights), np.cumsum(weights) / weights.sum()
        chosen = np.minimum(np.searchsorted(cumulative, (np.arange(n) + self._rng.random()) / n), n - 1)
        return self._rng.permutation(chosen)  # `rates` gives each place in the list conditions of its own

    def _move(
        self, evidence: Evidence, n_old: int, new: FloatArray, old: FloatArray, done: float, by_difference: bool
    ) -> tuple[FloatArray, FloatArray]:
        """One step of each particle towards the tempered posterior; log-likelihoods after and before the flights."""
        proposal, gain = self._by_difference() if by_difference else self._by_noise()
        to_new, to_old = self._both(proposal, evidence, n_old)
        gain = gain + (1.0 - done) * (to_old - old) + done * (to_new - new)
        accepted = self._kin.inside(proposal) & (np.log(self._rng.random(len(gain))) < gain)
        self.z = np.where(accepted[:, None], proposal, self.z)
        if not by_difference:
            self._beta = float(np.clip(self._beta * np.exp(accepted.mean() - _ACCEPTED), _BETA_MIN, _BETA_MAX))
        return np.where(accepted, to_new, new), np.where(accepted, to_old, old)

    def _by_noise(self) -> tuple[FloatArray, FloatArray]:
        """Crank-Nicolson proposals, and what the prior gains, which the step itself has taken into account: 0."""
        beta = np.minimum(self._beta * self._rng.choice(_BETA_FACTORS, (len(self.z), 1)), _BETA_MAX)
        proposal = np.sqrt(1.0 - beta**2) * self.z + beta * self._rng.standard_normal(self.z.shape)
        return proposal, np.zeros(len(proposal))

    def _by_difference(self) -> tuple[FloatArray, FloatArray]:
        """Proposals along the differences of two others, and what the prior gains by them."""
        n, d = self.z.shape
        one, other = (self.z[(np.arange(n) + self._rng.integers(1, n, n)) % n] for _ in range(2))
        length = np.where(self._rng.random((n, 1)) < _WHOLE, 1.0, _DIFFERENCE / np.sqrt(2.0 * d))
        proposal = self.z + length * (one - other) + _JITTER * self._rng.standard_normal((n, d))
        return proposal, 0.5 * (self.z**2 - proposal**2).sum(axis=1)

    def rates(self, theta: FloatArray, n_most: int = RATED) -> FloatArray:
        """Landing rate of policies, shape (m, dim), of particles, shape (at most `n_most`, m).

        Each particle flies under other conditions, spread as in the bank, or about `battery_V`.
        """
        n = min(len(self.z), n_most)
        at = np.arange(n)
        quantiles = np.stack([(at + 0.5) / n, (0.5 + at * _GOLDEN) % 1.0], axis=1)
        conditions = np.repeat(self._recordings.scale.conditions(quantiles, self.battery_V), len(theta), axis=0)
        flights = np.repeat(self.z[:n], len(theta), axis=0), np.tile(theta, (n, 1)), conditions
        return self._landings.rate(*flights).reshape(n, len(theta))

    def rates_under(self, theta: FloatArray, conditions: FloatArray) -> FloatArray:
        """Landing rates of policies, shape (m, dim), each under conditions of its own, shape (m, 2): shape (m,)."""
        n, m = min(len(self.z), RATED), len(theta)
        flights = np.repeat(self.z[:n], m, axis=0), np.tile(theta, (n, 1)), np.tile(conditions, (n, 1))
        return np.asarray(self._landings.rate(*flights).reshape(n, m).mean(axis=0))

    def rate_of_one(self, theta: FloatArray) -> FloatArray:
        """Landing rate of policies, shape (m, dim), each of one particle under drawn conditions: shape (m,)."""
        chosen = self._rng.integers(len(self.z), size=len(theta))
        quantiles = self._rng.uniform(_TINY, 1.0 - _TINY, (len(theta), 2))
        conditions = self._recordings.scale.conditions(quantiles, self.battery_V)
        return self._landings.rate(self.z[chosen], theta, conditions)

    def digest(self) -> str:
        """Of the emulators: with others a search would not continue with the same bits."""
        arrays = [self._recordings.weights, self._recordings.within, self._recordings.between]
        arrays += [array for net in (self._recordings.net, *self._landings.nets) for layer in net for array in layer]
        return hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()

    def state(self) -> dict[str, Any]:
        """Particles and step, plain data; the evidence is the learner's, the generator too."""
        return {"z": self.z.tolist(), "beta": self._beta}

    def load(self, state: dict[str, Any], evidence: Evidence | None) -> None:
        """Inverse of `state`."""
        self.z, self._beta, self.evidence = np.array(state["z"], dtype=np.float64), float(state["beta"]), evidence


def _next_share(gain: FloatArray, done: float) -> float:
    """The largest step of the tempering that leaves half of the particles effective."""

    def effective(share: float) -> float:
        weights = np.exp((share - done) * (gain - gain.max()))
        return float(weights.sum() ** 2 / (weights**2).sum())

    if effective(1.0) >= _EFFECTIVE * len(gain):
        return 1.0
    lo, hi = done, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (lo + hi)
        lo, hi = (middle, hi) if effective(middle) >= _EFFECTIVE * len(gain) else (lo, middle)
    return max(lo, min(done + _LEAST_STEP, 1.0))
