"""EPHE that remembers: the search distribution is fitted to imagined rollouts on a model of all that was flown.

Plain EPHE forgets each episode and so pays for every look again. Here a Gaussian process remembers the returns of all
rollouts (as in `ivl.learners.bo`, whose exploring before the first successes is used, too). After each episode the
distribution N(mu, diag sigma^2) is updated by reward-weighted maximum likelihood over rollouts imagined on that model:

    theta_k ~ N(mu, diag sigma^2),   f_k = mean(theta_k) - caution sd(theta_k),   w_k = max(0, f_k - mean(f))     (1)
    mu'      = sum(w_k theta_k) / sum(w_k)                                                                        (2)
    sigma'^2 = sum(w_k (theta_k - mu)^2) / sum(w_k), not below `shrink_min` sigma, nor below `floor`              (3)

These are the equations of EPHE with above-mean weights about the old mean (`ivl.learners.ephe`). They are repeated
`iterations` times, from the present distribution or, where the model expects more there, from its best policy: imagined
rollouts cost nothing. Flown are draws from that distribution, and a share of Thompson draws of the whole box, so that
a better landing elsewhere is found. The recommendation is mu, which lies inside a landing window rather than on its
edge, since it is a mean of what lands.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from ivl.learners.base import FloatArray, Meta, Options, draw_truncated
from ivl.learners.bo import BOLearner, BOOptions


class EpheMemoryOptions(BOOptions):
    """Options of EPHE on a memory; lengths are in units of sigma0."""

    n_imagined: int = Field(default=300, ge=20, le=5000, description="imagined rollouts an iteration")
    iterations: int = Field(default=10, ge=1, le=100, description="updates of (mu, sigma) an episode")
    shrink_min: float = Field(default=0.7, ge=0, le=1, description="sigma keeps this share of itself an iteration")
    floor: float = Field(default=0.03, gt=0, le=1, description="smallest sigma, in units of sigma0")


class EpheMemory(BOLearner):
    """EPHE over imagined rollouts on a Gaussian process of the flown ones."""

    Options: ClassVar[type[Options]] = EpheMemoryOptions
    options: EpheMemoryOptions

    def _setup(self) -> None:
        super()._setup()
        self._mu, self._sigma = np.zeros(self.dim), np.ones(self.dim)  # in units of sigma0, about mu0

    def _ask(self, n: int) -> FloatArray:
        if self._gp is None or np.count_nonzero(self._successes()) < self.options.enough:
            return super()._ask(n)
        n_far = round(self.options.roam * n)
        far = super()._ask(n)[:n_far]
        lo, hi = self._box
        return np.vstack([far, self._unscale(draw_truncated(self._rng, self._mu, self._sigma, lo, hi, n - n_far))])

    def _update(self, theta: FloatArray, rewards: FloatArray, meta: Meta, /) -> None:
        super()._update(theta, rewards, meta)
        width = np.minimum(self.options.jitter * self._hyper.lengths, 1.0)
        starts = [(self._mu, np.maximum(self._sigma, width)), (self._best, width)]
        self._mu, self._sigma = max(
            (self._imagine(*start) for start in starts), key=lambda d: self._worth(d[0][None])[0]
        )

    def _imagine(self, mu: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where EPHE goes from a distribution on imagined rollouts, equations (1) to (3)."""
        lo, hi = self._box
        for _ in range(self.options.iterations):
            theta = draw_truncated(self._rng, mu, sigma, lo, hi, self.options.n_imagined)
            worth = self._worth(theta)
            weights = np.maximum(worth - worth.mean(), 0.0)
            total = weights.sum()
            if total <= 0.0:
                break
            spread = np.sqrt(weights @ (theta - mu) ** 2 / total)
            mu = np.clip(weights @ theta / total, lo, hi)
            sigma = np.clip(spread, np.maximum(self.options.shrink_min * sigma, self.options.floor), hi - lo)
        return mu, sigma

    def _worth(self, theta: FloatArray) -> FloatArray:
        """What the model expects, less its doubt, shape (n,)."""
        assert self._gp is not None
        mean, sd = self._gp.predict(theta)
        return np.asarray(mean - self.options.caution * sd)

    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        return self._unscale(self._mu), self._sigma * self.sigma0

    def _recommended(self) -> FloatArray:
        return self._unscale(self._mu)

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), "mu": self._mu.tolist(), "sigma": self._sigma.tolist()}

    def _load(self, state: Mapping[str, Any]) -> None:
        super()._load(state)
        self._mu = np.array(state["mu"], dtype=np.float64)
        self._sigma = np.array(state["sigma"], dtype=np.float64)
