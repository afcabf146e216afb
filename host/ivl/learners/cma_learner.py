"""CMA-ES through the `cmaes` package, behind the interface of this project's learners.

The search runs in the coordinates z = (theta - mu0) / sigma0 with unit start step, so that parameters of different
units are treated alike, and minimises -R. `cmaes` wants exactly one population per update; rollouts are collected
until there are that many, in whatever portions they come. The saved state is the history of calls, replayed on load
through the public interface: exact, and independent of how `cmaes` stores itself.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from ivl.learners.base import FloatArray, Learner, Meta, Options


class CmaOptions(Options):
    """Options of the adapter."""

    population: int | None = Field(
        default=None, ge=4, description="rollouts per update; null: n_rollouts, but 4 at least"
    )
    lr_adapt: bool = Field(default=False, description="adapt the learning rate (for noisy returns)")


class CMALearner(Learner):
    """CMA-ES; `recommended` is the mean of its distribution."""

    Options: ClassVar[type[Options]] = CmaOptions
    options: CmaOptions

    def _setup(self) -> None:
        import cmaes  # type: ignore[import-untyped]  # no types; loading it takes longer than loading all the rest

        bounds = None
        if np.isfinite(self.lo).any() or np.isfinite(self.hi).any():
            bounds = np.stack([self.lo - self.mu0, self.hi - self.mu0], axis=1) / self.sigma0[:, None]
        self._cma = cmaes.CMA(
            mean=np.zeros(self.dim),
            sigma=1.0,
            bounds=bounds,
            seed=self.seed % 2**32,
            population_size=self.options.population or max(4, self.n_rollouts),
            lr_adapt=self.options.lr_adapt,
        )
        self._waiting: list[tuple[FloatArray, float]] = []
        self._history: list[dict[str, Any]] = []

    def _ask(self, n: int) -> FloatArray:
        self._history.append({"ask": n})
        z: FloatArray = np.array([self._cma.ask() for _ in range(n)], dtype=np.float64)
        # rounding may leave the box by one unit in the last place
        return np.clip(self.mu0 + self.sigma0 * z, self.lo, self.hi)

    def _update(self, theta: FloatArray, rewards: FloatArray, _meta: Meta, /) -> None:
        self._history.append({"theta": theta.tolist(), "rewards": rewards.tolist()})
        for x, reward in zip(theta, rewards, strict=True):
            self._waiting.append(((x - self.mu0) / self.sigma0, -float(reward)))
            if len(self._waiting) == self._cma.population_size:
                self._cma.tell(self._waiting)
                self._waiting = []

    def stop(self) -> bool:
        """True when `cmaes` says that its distribution has collapsed or broken down."""
        return bool(self._cma.should_stop())

    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        # the package has no public reading of its covariance; its version is pinned and a test watches this line
        spread = self._cma._sigma * np.sqrt(np.diag(self._cma._C))
        return self._recommended(), np.asarray(self.sigma0 * spread)

    def _recommended(self) -> FloatArray:
        return np.asarray(np.clip(self.mu0 + self.sigma0 * self._cma.mean, self.lo, self.hi))

    def _state(self) -> dict[str, Any]:
        return {"history": list(self._history)}

    def _load(self, state: Mapping[str, Any]) -> None:
        self._setup()
        for call in state["history"]:
            if "ask" in call:
                self._ask(int(call["ask"]))
            else:
                self._update(np.array(call["theta"], dtype=np.float64), np.array(call["rewards"], dtype=np.float64), {})
