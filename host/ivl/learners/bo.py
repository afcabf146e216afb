"""Bayesian optimisation: a Gaussian process on the returns, and Thompson sampling for the next episode.

Every rollout counts for as long as it is remembered, failed ones too: they tell where the landing is not. In units of
the start's spread, z = (theta - mu0) / sigma0, with y the returns shifted and scaled to mean 0 and variance 1:

    first episode     theta ~ N(mu0, diag sigma0^2), truncated to the bounds                             (1)
    model             y = f(z) + noise, f a Gaussian process (see `ivl.learners.gp`), refitted after each episode:
                      its lengths and noise ratio are searched up to `settled` rollouts, then followed
    later episodes    theta_n = argmax over the candidates of f_n, f_n a draw of the posterior           (2)
    before success    while no return has reached `aim`, a share of an episode goes where the box is emptiest
    recommended       argmax(mean(z) - caution sd(z))                                                    (3)

Candidates are uniform in the box and normal about the best remembered policies and the recommended one, spread by a
share of the kernel's lengths. Draws differ where the returns are uncertain and agree where they are known, so that the
search turns from exploring to repeating by itself: no spread shrinks by rule, so none collapses on a shelf beside the
target. The noise ratio has a floor: at the edge of a landing region equal policies end differently, and a model without
noise explains that by ever shorter lengths, until it takes every lone landing for a peak.

Returns alone lead to the nearest shelf: for many approaches flips that are far too early score better than misses, and
a landing is a narrow ridge at the shelf's foot. What no return has shown, a model of the returns cannot expect; hence
`aim`, below which the search does not settle.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from ivl.learners.base import FloatArray, Learner, Meta, Options, draw_truncated
from ivl.learners.gp import GaussianProcess, Hyper, fit

_SEARCH_ROUNDS = 4


class BOOptions(Options):
    """Options of Bayesian optimisation; lengths are in units of sigma0."""

    length: float = Field(default=0.5, gt=0, le=100, description="prior kernel length in each dimension")
    noise: float = Field(default=0.2, gt=0, le=10, description="prior ratio of noise variance to signal variance")
    noise_min: float = Field(default=0.05, gt=0, le=10, description="least such ratio, not above `noise`")
    caution: float = Field(default=0.5, ge=0, le=10, description="recommended = argmax(mean - caution sd)")
    n_uniform: int = Field(default=400, ge=10, le=5000, description="candidates over the whole box")
    n_near: int = Field(default=300, ge=10, le=5000, description="candidates near what was best")
    n_elite: int = Field(default=20, ge=1, le=1000, description="policies that count as best")
    jitter: float = Field(default=0.25, gt=0, le=10, description="spread of the near candidates, in kernel lengths")
    aim: float = Field(default=75.0, ge=0, description="return that is worth settling for: a landing with body contact")
    spread: float = Field(default=0.75, ge=0, le=1, description="share of an episode that explores before that")
    settled: int = Field(default=32, ge=0, le=4000, description="rollouts from which on a fit follows the one before")
    memory: int = Field(default=400, ge=8, le=4000, description="latest rollouts that the model is made from")

    @model_validator(mode="after")
    def _floor_below_prior(self) -> Self:
        if self.noise_min > self.noise:
            raise ValueError(f"noise_min {self.noise_min} must not be above noise {self.noise}")
        return self


class BOLearner(Learner):
    """Gaussian process and Thompson sampling; `mu` is the recommended policy, `sigma` the spread of the proposals."""

    Options: ClassVar[type[Options]] = BOOptions
    needs_bounds: ClassVar[bool] = True
    options: BOOptions

    def _setup(self) -> None:
        self._x = np.empty((0, self.dim))  # z of the module's text
        self._rewards = np.empty(0)
        self._box = self._scale(np.stack([self.lo, self.hi]))
        self._prior = Hyper(np.full(self.dim, self.options.length), self.options.noise)
        self._hyper = self._prior
        self._gp: GaussianProcess | None = None
        self._best = np.zeros(self.dim)
        self._spread = self.sigma0.copy()

    def _ask(self, n: int) -> FloatArray:
        if self._gp is None:
            return draw_truncated(self._rng, self.mu0, self.sigma0, self.lo, self.hi, n)  # (1)
        candidates = self._candidates(self._gp)
        n_far = round(self.options.spread * n) if self._rewards.max() < self.options.aim else 0
        chosen = candidates[self._gp.sample(candidates, n - n_far, self._rng).argmax(axis=1)]  # (2)
        theta = self._unscale(np.vstack([chosen, self._farthest(n_far, np.vstack([self._x, chosen]))]))
        self._spread = np.asarray(theta.std(axis=0))
        return theta

    def _update(self, theta: FloatArray, rewards: FloatArray, _meta: Meta, /) -> None:
        self._x = np.vstack([self._x, self._scale(theta)])[-self.options.memory :]
        self._rewards = np.append(self._rewards, rewards)[-self.options.memory :]
        follow = len(self._x) > self.options.settled
        self._hyper = fit(self._x, self._values(), self._prior, self._hyper, self.options.noise_min, follow)
        self._refresh()

    def _refresh(self) -> None:
        """Posterior and recommendation from data and hyper-parameters."""
        self._gp = GaussianProcess(self._x, self._values(), self._hyper)
        self._best = self._safest(self._gp)

    def _values(self) -> FloatArray:
        """Returns, standardised; all equal gives zeros."""
        scale = self._rewards.std()
        centered = self._rewards - self._rewards.mean()
        return np.asarray(centered / scale) if scale > 0 else centered

    def _candidates(self, gp: GaussianProcess) -> FloatArray:
        uniform = self._uniform(self.options.n_uniform, self._rng)
        elite = np.argsort(-gp.fitted, kind="stable")[: self.options.n_elite]
        centers = np.vstack([self._x[elite], np.tile(self._best, (len(elite), 1))])
        chosen = self._rng.integers(len(centers), size=self.options.n_near)
        near = self._cloud(centers[chosen], self.options.n_near, 1.0, self._rng)
        return np.vstack([uniform, near])

    def _farthest(self, n: int, taken: FloatArray) -> FloatArray:
        """Points of the box, each as far as can be from all before it; distances in widths of the box."""
        width = self._box[1] - self._box[0]
        points = self._uniform(self.options.n_uniform, self._rng) if n else np.empty((0, self.dim))
        gap = (((points[:, None] - taken) / width) ** 2).sum(axis=-1).min(axis=1, initial=np.inf)
        far = np.empty((n, self.dim))
        for i in range(n):
            far[i] = points[gap.argmax()]
            gap = np.minimum(gap, (((points - far[i]) / width) ** 2).sum(axis=-1))
        return far

    def _safest(self, gp: GaussianProcess) -> FloatArray:
        """Equation (3).

        The search has its own fixed generator, so that reading a result never shifts the next draw.
        """
        rng = np.random.Generator(np.random.PCG64(self.seed))
        points = np.vstack([self._x, self._uniform(500, rng)])
        for halvings in range(_SEARCH_ROUNDS + 1):
            best = points[gp.safest(points, self.options.caution)]
            if halvings < _SEARCH_ROUNDS:
                points = np.concatenate([best[None], self._cloud(best, 150, 0.5**halvings, rng)])
        return np.asarray(best)

    def _uniform(self, n: int, rng: np.random.Generator) -> FloatArray:
        return rng.uniform(self._box[0], self._box[1], (n, self.dim))

    def _cloud(self, centers: FloatArray, n: int, share: float, rng: np.random.Generator) -> FloatArray:
        """Draw n normal points, about one centre or each its own, `share` of the jitter wide, moved into the box."""
        width = np.minimum(share * self.options.jitter * self._hyper.lengths, self._box[1] - self._box[0])
        return np.asarray(np.clip(centers + width * rng.standard_normal((n, self.dim)), self._box[0], self._box[1]))

    def _scale(self, theta: FloatArray) -> FloatArray:
        return np.asarray((theta - self.mu0) / self.sigma0)

    def _unscale(self, z: FloatArray) -> FloatArray:
        return np.asarray(np.clip(self.mu0 + self.sigma0 * z, self.lo, self.hi))

    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        return self._recommended(), self._spread

    def _recommended(self) -> FloatArray:
        return self._unscale(self._best)

    def _state(self) -> dict[str, Any]:
        return {
            "z": self._x.tolist(),
            "rewards": self._rewards.tolist(),
            "lengths": self._hyper.lengths.tolist(),
            "noise": self._hyper.noise,
            "spread": self._spread.tolist(),
        }

    def _load(self, state: Mapping[str, Any]) -> None:
        self._setup()
        self._x = np.array(state["z"], dtype=np.float64).reshape(-1, self.dim)
        self._rewards = np.array(state["rewards"], dtype=np.float64)
        self._hyper = Hyper(np.array(state["lengths"], dtype=np.float64), float(state["noise"]))
        self._spread = np.array(state["spread"], dtype=np.float64)
        if self._rewards.size:
            self._refresh()
