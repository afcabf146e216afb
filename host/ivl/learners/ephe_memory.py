"""EPHE with a memory: the search distribution is fitted to imagined rollouts on a model of all that was flown.

Plain EPHE forgets each episode and so pays for every look again. Here a Gaussian process remembers the returns of all
rollouts, as in `ivl.learners.bo`, whose exploring before the first successes is used, too. After each episode the
distribution N(mu, diag sigma^2) is fitted to rollouts imagined on that model. With mean and sd those of the model:

    spread   s = max(sigma, reach l), l the lengths of the kernel; what `reach` lengths away is like, nobody knows
    imagined theta_k ~ N(mu, diag s^2), moved onto the bounds, returns f_k = mean(theta_k) - caution sd(theta_k) (1)
    weight   w_k = max(0, f_k - mean(f))                                                                      (2)
    mu'      = sum(w_k theta_k) / sum(w_k)                                                                    (3)
    sigma'^2 = sum(w_k (theta_k - mu)^2) / sum(w_k), not below (shrink_min s)^2                               (4)

(2) to (4) are EPHE with above-mean weights about the old mean (`ivl.learners.ephe`). They are repeated `iterations`
times with sigma' for s, since imagined rollouts cost nothing: once from the present mu, once from the model's best
policy, and the end of which the model expects more is kept. If that is less than the mean return of all that was flown,
the imagined rollouts have missed a peak that is narrow for their number; then mu is the model's best policy. Before the
next episode the same distribution imagines rollouts once more. Each rollout that is flown is the best of them for its
own draw f_n of the posterior:

    theta_n = argmax over the imagined theta_k of f_n                                                         (5)

A share `roam` of an episode takes its maximum over the whole box in place of that, so that a better landing elsewhere
is found. The recommendation is mu. It lies inside a landing window rather than on its edge, since it is a mean of what
lands. Imagined rollouts are moved onto the bounds and not drawn again: else no mean could reach a bound, where the best
policy often is.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from ivl.learners.base import FloatArray, Meta
from ivl.learners.bo import BOLearner, BOOptions
from ivl.learners.ephe import above_mean, most_likely


class EpheMemoryOptions(BOOptions):
    """Options of EPHE with a memory, beside those of its model; lengths are in units of sigma0."""

    n_imagined: int = Field(default=300, ge=20, le=5000, description="imagined rollouts an iteration")
    iterations: int = Field(default=10, ge=1, le=100, description="updates of (mu, sigma) an episode")
    shrink_min: float = Field(default=0.7, gt=0, le=1, description="sigma keeps this share of itself an iteration")
    reach: float = Field(default=1.5, gt=0, le=10, description="least spread of an episode, in kernel lengths")


class EpheMemory(BOLearner):
    """EPHE over imagined rollouts on a Gaussian process of the flown ones; `mu` is the recommended policy."""

    Options: ClassVar[type[BOOptions]] = EpheMemoryOptions
    options: EpheMemoryOptions

    def _setup(self) -> None:
        super()._setup()
        self._mu, self._sigma = np.zeros(self.dim), np.ones(self.dim)  # in units of sigma0, about mu0

    def _ask(self, n: int) -> FloatArray:
        asked = super()._ask(n)
        n_far = round(self.options.roam * n)  # these seek the whole box already
        if self._gp is None or np.count_nonzero(self._successes()) < self.options.enough or n_far == n:
            return asked
        imagined = self._imagined(self._mu, self._wide())
        chosen = self._gp.sample(imagined, n - n_far, self._rng).argmax(axis=1)  # (5)
        return np.vstack([asked[:n_far], self._unscale(imagined[chosen])])

    def _update(self, theta: FloatArray, rewards: FloatArray, meta: Meta, /) -> None:
        super()._update(theta, rewards, meta)
        ends = [self._fitted(start, self._wide()) for start in (self._mu, self._best)]
        self._mu, self._sigma = max(ends, key=lambda end: self._worth(end[0][None])[0])
        if self._worth(self._mu[None])[0] < 0.0 < self._worth(self._best[None])[0]:  # lost, as many dimensions allow
            self._mu, self._sigma = self._best, self._wide()

    def _wide(self) -> FloatArray:
        """Spread that an episode begins with, s of the module's text."""
        wide = np.maximum(self._sigma, self.options.reach * self._hyper.lengths)
        return np.asarray(np.minimum(wide, np.ptp(self._box, axis=0)))

    def _imagined(self, mu: FloatArray, sigma: FloatArray) -> FloatArray:
        """Policies of equation (1), shape (n_imagined, dim)."""
        drawn = self._rng.normal(mu, sigma, (self.options.n_imagined, self.dim))
        return np.asarray(np.clip(drawn, *self._box))

    def _fitted(self, mu: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where equations (1) to (4) lead from a distribution."""
        for _ in range(self.options.iterations):
            theta = self._imagined(mu, sigma)
            weights = above_mean(self._worth(theta))
            if not weights.any():
                break
            mean, spread = most_likely(theta, weights, mu)
            mu, sigma = mean, np.maximum(spread, self.options.shrink_min * sigma)
        return mu, sigma

    def _worth(self, theta: FloatArray) -> FloatArray:
        """Imagined returns of equation (1), shape (n,)."""
        assert self._gp is not None  # only asked after an update
        mean, sd = self._gp.predict(theta)
        return np.asarray(mean - self.options.caution * sd)

    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        return self._recommended(), self._sigma * self.sigma0

    def _recommended(self) -> FloatArray:
        return self._unscale(self._mu)

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), "mu": self._mu.tolist(), "sigma": self._sigma.tolist()}

    def _load(self, state: Mapping[str, Any]) -> None:
        super()._load(state)
        self._mu = np.array(state["mu"], dtype=np.float64)
        self._sigma = np.array(state["sigma"], dtype=np.float64)
