"""CMA-ES through the `cmaes` package, behind the interface of this project's learners.

The search runs in the coordinates z = (theta - mu0) / sigma0 with unit start step, so that parameters of different
units are treated alike, and minimises -R. `cmaes` wants exactly one population per update; rollouts are collected
until there are that many, in whatever portions they come.

Policies at a bound are those that left the box, moved back to it. They are flown there, so that returns near a bound
tell the package to go further out, and its step would grow without end: after each update the centre is moved back
into the box, and the spread is at most the width of the box.

The saved state is that of the package's object, number by number. The package has no public form of it that goes on
with the same draws; its version is pinned, and a test watches that a loaded search goes on bit for bit.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from ivl.errors import LearnerError
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
        self._cma._funhist_values[:] = 0.0  # the package leaves there whatever was in the memory
        self._waiting: list[tuple[FloatArray, float]] = []

    def _ask(self, n: int) -> FloatArray:
        z: FloatArray = np.array([self._cma.ask() for _ in range(n)], dtype=np.float64)
        # rounding may leave the box by one unit in the last place
        return np.clip(self.mu0 + self.sigma0 * z, self.lo, self.hi)

    def _update(self, theta: FloatArray, rewards: FloatArray, _meta: Meta, /) -> None:
        before = self._state()
        with np.errstate(all="ignore"):  # what breaks down is refused as a whole
            for x, reward in zip(theta, rewards, strict=True):
                self._waiting.append(((x - self.mu0) / self.sigma0, -float(reward)))
                if len(self._waiting) == self._cma.population_size:
                    self._cma.tell(self._waiting)
                    self._waiting = []
                    self._stay_in_the_box()
        if not self._is_sound():
            self._load(before)
            raise LearnerError(
                "tell: these policies leave CMA-ES no distribution that it could draw from (are they all the same?)"
            )

    def _stay_in_the_box(self) -> None:
        lo, hi = (self.lo - self.mu0) / self.sigma0, (self.hi - self.mu0) / self.sigma0
        self._cma._mean = np.clip(self._cma._mean, lo, hi)
        spread = self._cma._sigma * np.sqrt(np.diag(self._cma._C))
        self._cma._sigma *= min(1.0, float(np.min((hi - lo) / spread)))

    def _is_sound(self) -> bool:
        """Whether every number of the search is one, and policies can be drawn."""
        values = [v for v in vars(self._cma).values() if isinstance(v, (float, np.ndarray))]
        return all(np.isfinite(v).all() for v in values) and self._cma._sigma > 0.0

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
        waiting = [[x.tolist(), value] for x, value in self._waiting]
        return {"cma": {name: _plain(value) for name, value in vars(self._cma).items()}, "waiting": waiting}

    def _load(self, state: Mapping[str, Any]) -> None:
        self._setup()
        now, saved = vars(self._cma), state["cma"]
        if set(now) != set(saved):
            raise ValueError(f"another version of cmaes has {', '.join(sorted(set(now) ^ set(saved)))}")
        for name, value in saved.items():
            now[name] = _as_before(value)
        self._waiting = [(np.array(x, dtype=np.float64), float(value)) for x, value in state["waiting"]]


def _plain(value: Any) -> Any:
    """A number, an array or a generator as plain data for JSON."""
    if isinstance(value, np.ndarray):
        return {"array": value.tolist()}
    if isinstance(value, np.random.RandomState):
        kind, key, *rest = value.get_state(legacy=True)
        return {"generator": [kind, np.asarray(key).tolist(), *rest]}
    return value.item() if isinstance(value, np.generic) else value


def _as_before(value: Any) -> Any:
    """Inverse of `_plain`."""
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return np.array(value["array"], dtype=np.float64)
    generator = np.random.RandomState()
    kind, key, *rest = value["generator"]
    generator.set_state((kind, np.array(key, dtype=np.uint32), *rest))
    return generator
