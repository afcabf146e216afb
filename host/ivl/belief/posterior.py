"""What flights say of the vehicle that flies: particles over the members of a family.

A flight i with policy theta_i tells a recording y_i (with gaps) and whether it landed. With the emulators m, p:

    y_i = m(z, theta_i) + b + e_i,    b ~ N(0, B + D),    e_i ~ N(0, W)                                     (1)
    Q(z) = sum r_i' W_i^-1 r_i - v' ((B + D)^-1 + sum W_i^-1)^-1 v,    r_i = y_i - m, v = sum W_i^-1 r_i     (2)
    log L_motion = -share (nu + q) / 2 log(1 + Q / nu),    share = min(1, n_full / n)                       (3)
    log L_outcome = sum log((1 - lapse) P_i + lapse / 2),  P_i = p or 1 - p                                 (4)

b is what the emulator and the model get wrong of one vehicle: all its flights share it, so that equal errors of many
flights do not add up to certainty. D is the discrepancy that is allowed to any model: it grows with time after the
trigger. The Student-t form (3) leaves room for errors of unexpected size, its share for errors of unexpected shape.

The posterior over z (prior: standard normal, within the bounds of the family) is sampled by sequential Monte Carlo:
particles are weighted in tempered steps, resampled, and moved by preconditioned Crank-Nicolson steps, which leave the
prior as it is.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri  # type: ignore[import-untyped]

from ivl.belief.emulator import USED, LandingEmulator, RecordingEmulator

FloatArray = npt.NDArray[np.float64]

_PITCH_DEG, _RATE_RADPS, _FALL_M, _AT_S, _ALIKE_S = 4.0, 0.8, 0.005, 0.2, 0.1
_CONTACT_S, _CLOSING_MPS = 0.004, 0.03
_MOVES, _BETA_START = 4, 0.4
_ESS_SHARE = 0.5


@dataclass(frozen=True)
class Trust:
    """How far flights are trusted; see equations (3) and (4)."""

    nu: float = 10.0
    n_full: float = 3.0
    lapse: float = 0.05
    discrepancy: float = 1.0


def discrepancy(scale: float) -> FloatArray:
    """D, shape (n_used, n_used): 4 degrees, 0.8 rad/s and 5 mm at 200 ms, growing as the square of time, smooth."""
    sizes = {"pitch": _PITCH_DEG, "rate": _RATE_RADPS, "fall": _FALL_M}
    n = len(USED)
    d = np.zeros((n, n))
    split = [(name.rsplit("_", 1)[0], float(name.rsplit("_", 1)[1]) / 1000) if name[-1].isdigit() else (name, 0.0) for name in USED]
    for i, (a, ta) in enumerate(split):
        for j, (b, tb) in enumerate(split):
            if a != b:
                continue
            if a in sizes:
                d[i, j] = (sizes[a] * (ta / _AT_S) ** 2) * (sizes[a] * (tb / _AT_S) ** 2) * np.exp(-abs(ta - tb) / _ALIKE_S)
            else:
                d[i, j] = (_CONTACT_S if a == "contact_time" else _CLOSING_MPS) ** 2
    return scale**2 * d


@dataclass
class Evidence:
    """Flights so far: policies, shape (n, dim), recordings, shape (n, n_used), and landings, shape (n,)."""

    theta: FloatArray
    features: FloatArray
    landed: npt.NDArray[np.bool_]
    battery_V: FloatArray


class Belief:
    """Particles over the members of a family."""

    def __init__(
        self, recordings: RecordingEmulator, landings: LandingEmulator, n_dimensions: int, inside: Callable[[FloatArray], npt.NDArray[np.bool_]],
        n_particles: int, rng: np.random.Generator, trust: Trust,
    ) -> None:
        self._recordings, self._landings, self._inside, self._trust, self._rng = recordings, landings, inside, trust, rng
        z = rng.standard_normal((8 * n_particles, n_dimensions))
        self.z = z[inside(z)][:n_particles]
        self._evidence: Evidence | None = None
        self._beta = _BETA_START
        self._prior_b = np.linalg.inv(recordings.between + discrepancy(trust.discrepancy))
        self._loglik = np.zeros(len(self.z))

    def log_likelihood(self, z: FloatArray, evidence: Evidence) -> FloatArray:
        """Equations (1) to (4), shape (len(z),)."""
        n, n_z = len(evidence.theta), len(z)
        zz = np.repeat(z[:, None], n, axis=1).reshape(n_z * n, -1)
        tt = np.tile(evidence.theta, (n_z, 1))
        bb = np.tile(evidence.battery_V, n_z)
        mean = self._recordings.mean(zz, tt, bb).reshape(n_z, n, -1)
        total, v, information, q = np.zeros(n_z), np.zeros((n_z, len(USED))), self._prior_b.copy(), 0
        for i in range(n):
            seen = np.isfinite(evidence.features[i])
            if not seen.any():
                continue
            inverse = np.linalg.inv(self._recordings.within[np.ix_(seen, seen)])
            r = evidence.features[i][seen] - mean[:, i, seen]
            weighted = r @ inverse
            total += np.einsum("na,na->n", weighted, r)
            v[:, seen] += weighted
            information[np.ix_(seen, seen)] += inverse
            q += int(seen.sum())
        trust = self._trust
        result = np.zeros(n_z)
        if q:
            total -= np.einsum("na,na->n", v @ np.linalg.inv(information), v)
            share = min(1.0, trust.n_full / n)
            result -= share * 0.5 * (trust.nu + q) * np.log1p(np.maximum(total, 0.0) / trust.nu)
        p = self._landings.rate(zz, tt, bb).reshape(n_z, n)
        right = np.where(evidence.landed, p, 1.0 - p)
        return np.asarray(result + np.log((1.0 - trust.lapse) * right + trust.lapse / 2).sum(axis=1))

    def update(self, evidence: Evidence) -> None:
        """Sample the posterior of all flights so far."""
        old = self._loglik
        new = self.log_likelihood(self.z, evidence)
        done, step = 0.0, 0
        while done < 1.0:
            share = self._next_share(new - old, done)
            weights = np.exp((share - done) * (new - old) - ((share - done) * (new - old)).max())
            chosen = self._resample(weights / weights.sum())
            self.z, new, old = self.z[chosen], new[chosen], old[chosen]
            done = share
            new, old = self._move(evidence, new, old, done)
            step += 1
        self._evidence, self._loglik = evidence, new

    def _next_share(self, gain: FloatArray, done: float) -> float:
        """The largest step of the tempering that leaves half of the particles effective."""
        def effective(share: float) -> float:
            w = np.exp((share - done) * gain - ((share - done) * gain).max())
            return float(w.sum() ** 2 / (w**2).sum())
        if effective(1.0) >= _ESS_SHARE * len(gain):
            return 1.0
        lo, hi = done, 1.0
        for _ in range(20):
            mid = 0.5 * (lo + hi)
            lo, hi = (mid, hi) if effective(mid) >= _ESS_SHARE * len(gain) else (lo, mid)
        return max(lo, done + 1e-3)

    def _resample(self, weights: FloatArray) -> npt.NDArray[np.intp]:
        n = len(weights)
        return np.minimum(np.searchsorted(np.cumsum(weights), (np.arange(n) + self._rng.random()) / n), n - 1)

    def _move(self, evidence: Evidence, new: FloatArray, old: FloatArray, done: float) -> tuple[FloatArray, FloatArray]:
        for _ in range(_MOVES):
            beta = np.minimum(self._beta * self._rng.choice([0.3, 1.0, 1.7], (len(self.z), 1)), 0.95)
            proposal = np.sqrt(1.0 - beta**2) * self.z + beta * self._rng.standard_normal(self.z.shape)
            ok = self._inside(proposal)
            before = self._evidence
            proposed_new = self.log_likelihood(proposal, evidence)
            proposed_old = self.log_likelihood(proposal, before) if before is not None else np.zeros(len(proposal))
            gain = (1 - done) * (proposed_old - old) + done * (proposed_new - new)
            accept = ok & (np.log(self._rng.random(len(gain))) < gain)
            self.z[accept], new[accept], old[accept] = proposal[accept], proposed_new[accept], proposed_old[accept]
            rate = accept.mean()
            self._beta = float(np.clip(self._beta * np.exp(rate - 0.3), 0.02, 0.8))
        return new, old

    def rates(self, theta: FloatArray, n: int | None = None) -> FloatArray:
        """Landing rate of policies, shape (m, dim), for each particle: shape (n, m)."""
        z = self.z[:n]
        zz = np.repeat(z, len(theta), axis=0)
        scale = self._recordings.scale
        battery = scale.battery_V + scale.battery_sigma_V * ndtri((np.arange(len(z)) + 0.5) / len(z))
        bb = np.repeat(battery, len(theta))
        return self._landings.rate(zz, np.tile(theta, (len(z), 1)), bb).reshape(len(z), len(theta))
