"""Bayesian optimisation: a Gaussian process on the returns, and Thompson sampling for the next episode.

The first episode is drawn from N(mu0, sigma0); after that each proposal is the maximiser of one joint draw from the
posterior over a cloud of candidates (uniform in the box, and near the best point). Recommended is the point of the
largest lower confidence value, mean - caution sd. It needs the fewest crashes of the learners here and more computing
than the others.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from ivl.learners.base import FloatArray, Learner, Meta, Options, draw_truncated
from ivl.learners.gp import GaussianProcess, Hyper, fit

_SEARCH_ROUNDS = 4


class BOOptions(Options):
    """Options of Bayesian optimisation; lengths are in units of the box's width."""

    length: float = Field(default=0.12, gt=0, le=10, description="prior kernel length in each dimension")
    noise: float = Field(default=0.1, gt=0, le=10, description="prior ratio of noise variance to signal variance")
    caution: float = Field(default=0.3, ge=0, le=10, description="recommended = argmax(mean - caution sd)")
    n_uniform: int = Field(default=300, ge=10, le=5000, description="candidates over the whole box")
    n_near: int = Field(default=150, ge=10, le=5000, description="candidates near the best point")
    jitter: float = Field(default=0.04, gt=0, le=1, description="spread of the near candidates")


class BOLearner(Learner):
    """Gaussian process and Thompson sampling."""

    Options: ClassVar[type[Options]] = BOOptions
    needs_bounds: ClassVar[bool] = True
    options: BOOptions

    def _setup(self) -> None:
        self._x = np.empty((0, self.dim))  # in the unit box
        self._rewards = np.empty(0)
        self._prior = Hyper(np.full(self.dim, self.options.length), self.options.noise)
        self._hyper = self._prior
        self._gp: GaussianProcess | None = None
        self._best = self._scale(self.mu0)
        self._spread = self.sigma0.copy()

    def _ask(self, n: int) -> FloatArray:
        if self._gp is None:
            return draw_truncated(self._rng, self.mu0, self.sigma0, self.lo, self.hi, n)
        candidates = self._candidates()
        chosen = candidates[self._gp.sample(candidates, n, self._rng).argmax(axis=1)]
        theta = self._unscale(chosen)
        self._spread = np.asarray(theta.std(axis=0))
        return theta

    def _update(self, theta: FloatArray, rewards: FloatArray, _meta: Meta, /) -> None:
        self._x = np.vstack([self._x, self._scale(theta)])
        self._rewards = np.append(self._rewards, rewards)
        self._hyper = fit(self._x, self._values(), self._prior, self._hyper)
        self._refresh()

    def _refresh(self) -> None:
        """Posterior and recommendation from data and hyper-parameters."""
        self._gp = GaussianProcess(self._x, self._values(), self._hyper)
        self._best = self._safest()

    def _values(self) -> FloatArray:
        """Returns, standardised; all equal gives zeros."""
        scale = self._rewards.std()
        centered = self._rewards - self._rewards.mean()
        return np.asarray(centered / scale) if scale > 0 else centered

    def _candidates(self) -> FloatArray:
        uniform = self._rng.uniform(size=(self.options.n_uniform, self.dim))
        near = self._best + self.options.jitter * self._rng.standard_normal((self.options.n_near, self.dim))
        return np.vstack([uniform, np.clip(near, 0.0, 1.0)])

    def _safest(self) -> FloatArray:
        """Argmax of mean - caution sd.

        The search has a fixed generator of its own, so that reading a result never shifts the next draw.
        """
        assert self._gp is not None
        rng = np.random.Generator(np.random.PCG64(self.seed))
        points = np.vstack([self._x, rng.uniform(size=(1000, self.dim))])
        width = 0.05
        for _ in range(_SEARCH_ROUNDS):
            mean, sd = self._gp.predict(points)
            best = points[int(np.argmax(mean - self.options.caution * sd))]
            cloud = np.clip(best + width * rng.standard_normal((200, self.dim)), 0.0, 1.0)
            points, width = np.vstack([best, cloud]), width / 2
        return np.asarray(best)

    def _scale(self, theta: FloatArray) -> FloatArray:
        return np.asarray((theta - self.lo) / (self.hi - self.lo))

    def _unscale(self, x: FloatArray) -> FloatArray:
        return np.clip(self.lo + x * (self.hi - self.lo), self.lo, self.hi)

    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        return self._recommended(), self._spread

    def _recommended(self) -> FloatArray:
        return self._unscale(self._best)

    def _state(self) -> dict[str, Any]:
        return {
            "x": self._x.tolist(),
            "rewards": self._rewards.tolist(),
            "lengths": self._hyper.lengths.tolist(),
            "noise": self._hyper.noise,
            "spread": self._spread.tolist(),
        }

    def _load(self, state: Mapping[str, Any]) -> None:
        self._setup()
        self._x = np.array(state["x"], dtype=np.float64).reshape(-1, self.dim)
        self._rewards = np.array(state["rewards"], dtype=np.float64)
        self._hyper = Hyper(np.array(state["lengths"], dtype=np.float64), float(state["noise"]))
        self._spread = np.array(state["spread"], dtype=np.float64)
        if self._rewards.size:
            self._refresh()
