"""Bayesian optimisation: a Gaussian process on the returns, and Thompson sampling for the next episode.

Every rollout counts for as long as it is remembered, failed ones too: they tell where the landing is not. In units of
the start's spread, z = (theta - mu0) / sigma0, with y the returns shifted and scaled to mean 0 and variance 1:

    first episode     theta ~ N(mu0, diag sigma0^2), truncated to the bounds                             (1)
    model             y = f(z) + noise, f a Gaussian process (see `ivl.learners.gp`), refitted after each episode:
                      its lengths and noise ratio are searched up to `settled` rollouts, then followed; they are
                      searched again while the model expects of no policy what a success is worth
    later episodes    theta_n = argmax over the candidates of f_n, f_n a draw of the posterior           (2)
    before success    while fewer than `enough` rollouts were successes, a share of an episode explores:
                      theta_i = argmax over the box of (calm + contrast(z)) distance(z)                  (4)
    after it          only a share of the draws of (2) is sought in the whole box, the others near what was best
    recommended       argmax(mean(z) - caution sd(z))                                                    (3)

Candidates are uniform in the box and normal about the best remembered policies and the recommended one, spread by a
share of the kernel's lengths. Draws differ where the returns are uncertain and agree where they are known, so that the
search turns from exploring to repeating by itself: no spread shrinks by rule, so none collapses on a shelf beside the
target. The noise ratio has a floor: at the edge of a landing region equal policies end differently, and a model without
noise explains that by ever shorter lengths, until it takes every lone landing for a peak.

Returns alone lead to the nearest shelf: for many approaches flips that are far too early score better than misses, and
a landing is a narrow ridge at the shelf's foot. What no return has shown, a model of the returns cannot expect; hence
the search does not settle before it has seen successes. What is one is told with the returns, as `landed`; where nobody
tells, a success is a return in the upper half of the range of all that are remembered. Either way a factor on all
returns changes nothing. A success is worth half the way from the mean return of the failures to that of the successes.
Exploring goes where the box is empty and where neighbouring policies
differ in their returns: the distance of (4) is that to the nearest policy flown, in widths of the box, and contrast is
the range of the returns of the `n_nearest` policies, as a share of the range of all. (The idea, to weigh empty space
with local variation, is that of LOLA-Voronoi designs: Crombecq et al., SIAM J. Sci. Comput. 33, 2011.) A landing lies
between too early and too late, which the returns tell apart by a step, and mostly at large moments: hence `margin`, by
which candidates overshoot the box and are moved onto its bounds.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from ivl.learners.base import LANDED, FloatArray, Learner, Meta, Options, draw_truncated
from ivl.learners.gp import GaussianProcess, Hyper, fit

_SEARCH_ROUNDS = 3


class BOOptions(Options):
    """Options of Bayesian optimisation; lengths are in units of sigma0."""

    length: float = Field(default=0.5, gt=0, le=100, description="prior kernel length in each dimension")
    noise: float = Field(default=0.2, gt=0, le=10, description="prior ratio of noise variance to signal variance")
    noise_min: float = Field(default=0.05, gt=0, le=10, description="least such ratio, not above `noise`")
    caution: float = Field(default=0.5, ge=0, le=10, description="recommended = argmax(mean - caution sd)")
    n_uniform: int = Field(default=400, ge=10, le=5000, description="candidates over the whole box")
    n_near: int = Field(default=300, ge=10, le=5000, description="candidates near what was best")
    n_elite: int = Field(default=20, ge=1, le=1000, description="policies that count as best")
    jitter: float = Field(default=0.5, gt=0, le=10, description="spread of the near candidates, in kernel lengths")
    spread: float = Field(default=0.75, ge=0, le=1, description="share of an episode that explores before that")
    enough: int = Field(default=4, ge=1, le=1000, description="successes that end that exploration")
    roam: float = Field(default=0.25, ge=0, le=1, description="share of an episode that seeks the whole box after that")
    calm: float = Field(default=0.1, gt=0, le=10, description="weight of exploring where the returns around agree")
    n_nearest: int = Field(default=4, ge=2, le=100, description="neighbours whose returns are compared for that")
    margin: float = Field(default=0.2, ge=0, le=1, description="exploring overshoots the box by so many of its widths")
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
        self._landed = np.empty(0)  # 1 or 0, NaN where nobody told
        self._box = self._scale(np.stack([self.lo, self.hi]))
        self._prior = Hyper(np.full(self.dim, self.options.length), self.options.noise)
        self._hyper = self._prior
        self._gp: GaussianProcess | None = None
        self._best = np.zeros(self.dim)
        self._expected = -np.inf  # largest return that the model expects of a flown policy
        self._spread = self.sigma0.copy()

    def _ask(self, n: int) -> FloatArray:
        if self._gp is None:
            return draw_truncated(self._rng, self.mu0, self.sigma0, self.lo, self.hi, n)  # (1)
        candidates = self._candidates(self._gp)
        settles = np.count_nonzero(self._successes()) >= self.options.enough
        n_far = 0 if settles else round(self.options.spread * n)
        drawn = self._gp.sample(candidates, n - n_far, self._rng)
        if settles:
            drawn[round(self.options.roam * n) :, : self.options.n_uniform] = -np.inf
        chosen = candidates[drawn.argmax(axis=1)]  # (2)
        theta = self._unscale(np.vstack([chosen, self._explore(n_far, chosen)]))
        self._spread = np.asarray(theta.std(axis=0))
        return theta

    def _update(self, theta: FloatArray, rewards: FloatArray, meta: Meta, /) -> None:
        landed = np.asarray(meta.get(LANDED, np.full(len(rewards), np.nan)), dtype=np.float64)
        self._x = np.vstack([self._x, self._scale(theta)])[-self.options.memory :]
        self._rewards = np.append(self._rewards, rewards)[-self.options.memory :]
        self._landed = np.append(self._landed, landed)[-self.options.memory :]
        follow = len(self._x) > self.options.settled and not self._doubted()
        self._hyper = fit(self._x, self._values(), self._prior, self._hyper, self.options.noise_min, follow)
        self._refresh()

    def _refresh(self) -> None:
        """Posterior, recommendation and largest expected return of a flown policy, from data and hyper-parameters."""
        self._gp = GaussianProcess(self._x, self._values(), self._hyper)
        self._best = self._safest(self._gp)
        self._expected = float(self._rewards.mean() + self._rewards.std() * self._gp.fitted.max())

    def _successes(self) -> npt.NDArray[np.bool_]:
        """Which of the remembered rollouts were successes: as told, else those in the upper half of the returns."""
        guessed = self._rewards > (self._rewards.min() + self._rewards.max()) / 2
        return np.asarray(np.where(np.isnan(self._landed), guessed, self._landed == 1))

    def _doubted(self) -> bool:
        """Whether the model, before it is refitted, expects of no policy what a success is worth."""
        success = self._successes()
        if not success.any() or success.all():
            return False
        worth = (self._rewards[success].mean() + self._rewards[~success].mean()) / 2
        return bool(self._expected < worth)

    def _values(self) -> FloatArray:
        """Returns, standardised; all equal gives zeros."""
        if np.ptp(self._rewards) == 0:  # rounding of the mean leaves a spread, which must not pass for one of returns
            return np.zeros(len(self._rewards))
        return np.asarray((self._rewards - self._rewards.mean()) / self._rewards.std())

    def _candidates(self, gp: GaussianProcess) -> FloatArray:
        uniform = self._uniform(self.options.n_uniform, self._rng)
        elite = np.argsort(-gp.fitted, kind="stable")[: self.options.n_elite]
        centers = np.vstack([self._x[elite], np.tile(self._best, (len(elite), 1))])
        chosen = self._rng.integers(len(centers), size=self.options.n_near)
        near = self._cloud(centers[chosen], self.options.n_near, 1.0, self._rng)
        return np.vstack([uniform, near])

    def _explore(self, n: int, chosen: FloatArray) -> FloatArray:
        """N points of the box, each with the largest weighted distance to the nearest one flown or taken before.

        Distances are in widths of the box. The weight is `calm` plus the contrast of the returns around the point.
        """
        if not n:
            return np.empty((0, self.dim))
        margin = self.options.margin * (self._box[1] - self._box[0])
        points = self._uniform(self.options.n_uniform, self._rng, margin)
        square = self._square_distances(points, self._x)
        weight = (self.options.calm + self._contrast(square)) ** 2
        gap = np.hstack([square, self._square_distances(points, chosen)]).min(axis=1)
        taken = np.empty((n, self.dim))
        for i in range(n):
            taken[i] = points[(gap * weight).argmax()]
            gap = np.minimum(gap, self._square_distances(points, taken[i, None])[:, 0])
        return taken

    def _contrast(self, square: FloatArray) -> FloatArray:
        """Range of the returns of the nearest policies as a share of that of all; `square` has one row per point."""
        k, whole = min(self.options.n_nearest, square.shape[1]), np.ptp(self._rewards)
        nearest = np.argpartition(square, k - 1, axis=1)[:, :k]
        return np.asarray(np.ptp(self._rewards[nearest], axis=1) / whole) if whole > 0 else np.zeros(len(square))

    def _square_distances(self, a: FloatArray, b: FloatArray) -> FloatArray:
        u, v = a / (self._box[1] - self._box[0]), b / (self._box[1] - self._box[0])
        return np.asarray(sum((u[:, [axis]] - v[:, axis]) ** 2 for axis in range(self.dim)))

    def _safest(self, gp: GaussianProcess) -> FloatArray:
        """Equation (3).

        The search has its own fixed generator, so that reading a result never shifts the next draw.
        """
        rng = np.random.Generator(np.random.PCG64(self.seed))
        points = np.vstack([self._x, self._uniform(300, rng)])
        for halvings in range(_SEARCH_ROUNDS + 1):
            best = points[gp.safest(points, self.options.caution)]
            if halvings < _SEARCH_ROUNDS:
                points = np.concatenate([best[None], self._cloud(best, 120, 0.5**halvings, rng)])
        return np.asarray(best)

    def _uniform(self, n: int, rng: np.random.Generator, margin: FloatArray | float = 0.0) -> FloatArray:
        """Draw n points of the box, those that fall into a margin around it moved onto its bounds."""
        drawn = rng.uniform(self._box[0] - margin, self._box[1] + margin, (n, self.dim))
        return np.asarray(np.clip(drawn, self._box[0], self._box[1]))

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
            "landed": [None if np.isnan(value) else int(value) for value in self._landed],
            "lengths": self._hyper.lengths.tolist(),
            "noise": self._hyper.noise,
            "spread": self._spread.tolist(),
        }

    def _load(self, state: Mapping[str, Any]) -> None:
        self._setup()
        self._x = np.array(state["z"], dtype=np.float64).reshape(-1, self.dim)
        self._rewards = np.array(state["rewards"], dtype=np.float64)
        self._landed = np.array([np.nan if value is None else value for value in state["landed"]], dtype=np.float64)
        self._hyper = Hyper(np.array(state["lengths"], dtype=np.float64), float(state["noise"]))
        self._spread = np.array(state["spread"], dtype=np.float64)
        if self._rewards.size:
            self._refresh()
