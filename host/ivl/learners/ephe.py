"""EPHE: policy search by weighted maximum likelihood (Wang, Uchibe, Doya 2016, DOI 10.1007/s10015-015-0260-7).

With theta_n ~ N(mu, diag sigma^2), returns R_n >= 0 and weights w_n:

    mu'      = sum(w_n theta_n) / sum(w_n)                                            (1)
    sigma'^2 = sum(w_n (theta_n - c)^2) / sum(w_n)                                    (2)

    weight "return":     w_n = R_n, over the K best of N                              (3, EPHE-K)
    weight "above_mean": w_n = max(0, R_n - mean(R)), over the K best of N            (4, EPHE-AB)
    sigma_ref "old":     c = mu,  as in the published robot code: sigma keeps the way that the mean has just gone
    sigma_ref "new":     c = mu', as in the first author's slides: sigma collapses faster

Old and new are two different algorithms, so the choice is explicit. Two guards, off in the faithful mode, make the
robust one:

    sigma'' = max(sigma', shrink_min sigma, sigma_floor)                              (5)

All weights zero: no update. Fewer rollouts than K: all of them count. The code of 2021 adds 0.001 to the denominators
against a division by zero, which pulls mu towards zero by a few parts in a million; it is left out here, since it would
tie the search to the scale of the returns.
"""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from ivl.learners.base import FloatArray, Learner, Meta, Options, draw_truncated


class EpheOptions(Options):
    """Options of EPHE; the defaults are the faithful mode with K = 3 about the old mean."""

    n_best: int | None = Field(default=3, ge=1, description="K: rollouts that count; null: all")
    weight: Literal["return", "above_mean"] = Field(default="return", description="equation (3) or (4)")
    sigma_ref: Literal["new", "old"] = Field(default="old", description="mean that sigma is taken about")
    shrink_min: float = Field(
        default=0.0, ge=0, le=1, description="sigma keeps at least this share of itself per episode"
    )
    sigma_floor: float = Field(default=0.0, ge=0, description="smallest sigma, in each parameter's own unit")


class RobustOptions(EpheOptions):
    """The same options with the defaults of the robust mode."""

    n_best: int | None = Field(default=None, ge=1, description="K: rollouts that count; null: all")
    weight: Literal["return", "above_mean"] = Field(default="above_mean", description="equation (3) or (4)")
    shrink_min: float = Field(
        default=0.85, ge=0, le=1, description="sigma keeps at least this share of itself per episode"
    )
    sigma_floor: float = Field(default=0.05, ge=0, description="smallest sigma, in each parameter's own unit")


class EPHE(Learner):
    """EM-based policy hyper-parameter exploration, faithful by default; bounds by redraw (a truncated normal)."""

    Options: ClassVar[type[Options]] = EpheOptions
    options: EpheOptions

    def _setup(self) -> None:
        self._mu, self._sigma = self.mu0.copy(), self.sigma0.copy()

    def _ask(self, n: int) -> FloatArray:
        return draw_truncated(self._rng, self._mu, self._sigma, self.lo, self.hi, n)

    def _update(self, theta: FloatArray, rewards: FloatArray, _meta: Meta, /) -> None:
        options = self.options
        best = np.argsort(-rewards, kind="stable")[: options.n_best]
        weights = (above_mean(rewards) if options.weight == "above_mean" else rewards)[best]
        if not weights.any():
            return
        mu, sigma = most_likely(theta[best], weights, None if options.sigma_ref == "new" else self._mu)
        sigma = np.maximum(sigma, np.maximum(options.shrink_min * self._sigma, options.sigma_floor))  # (5)
        # neither line acts on policies that were drawn here, but others may have been told
        self._mu = np.clip(mu, self.lo, self.hi)
        self._sigma = np.minimum(sigma, self.hi - self.lo)

    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        return self._mu, self._sigma

    def _recommended(self) -> FloatArray:
        return self._mu

    def _state(self) -> dict[str, Any]:
        return {"mu": self._mu.tolist(), "sigma": self._sigma.tolist()}

    def _load(self, state: Mapping[str, Any]) -> None:
        self._mu, self._sigma = np.array(state["mu"], dtype=np.float64), np.array(state["sigma"], dtype=np.float64)


class RobustEPHE(EPHE):
    """EPHE with weights above the mean return, over all rollouts, and guards against an early collapse of sigma."""

    Options: ClassVar[type[Options]] = RobustOptions


def most_likely(theta: FloatArray, weights: FloatArray, center: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    """Equations (1) and (2): mean and spread, shape (dim,) each, of weighted policies, shape (n, dim).

    `center` is c of equation (2); None: the new mean. At least one weight is above 0.
    """
    total = weights.sum()
    mu = weights @ theta / total
    return mu, np.sqrt(weights @ (theta - (mu if center is None else center)) ** 2 / total)


def above_mean(rewards: FloatArray) -> FloatArray:
    """Weights of equation (4) over all rollouts, shape (n,)."""
    if np.ptp(rewards) == 0:  # rounding of the mean must not make weights of equal returns
        return np.zeros(len(rewards))
    return np.asarray(np.maximum(0.0, rewards - rewards.mean()))


def imagine(
    reward: Callable[[FloatArray], FloatArray],
    mu: FloatArray,
    sigma: FloatArray,
    bounds: FloatArray,
    rng: np.random.Generator,
    n: int,
    iterations: int,
    shrink_min: float,
    floor: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Where EPHE goes from (mu, sigma), with above-mean weights about the old mean, if rollouts cost nothing.

    Args:
        reward: Return of policies, shape (n, dim): shape (n,).
        mu: Centre, shape (dim,).
        sigma: Spread, shape (dim,).
        bounds: Box of the policies, shape (dim, 2).
        rng: Of the policies.
        n: Policies of an update.
        iterations: Updates; it ends earlier once all policies have the same return.
        shrink_min: Share of itself that sigma keeps at least in an update.
        floor: Smallest sigma, shape (dim,).
    """
    lo, hi = bounds.T
    for _ in range(iterations):
        theta = draw_truncated(rng, mu, sigma, lo, hi, n)
        weights = above_mean(reward(theta))
        if not weights.any():
            break
        mean, spread = most_likely(theta, weights, mu)
        mu, sigma = mean, np.clip(spread, np.maximum(shrink_min * sigma, floor), hi - lo)
    return mu, sigma
