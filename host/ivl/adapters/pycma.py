"""CMA-ES of pycma, by the author of the method, as a learner."""

import math
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from ivl.adapters.replayed import Optimiser, Replayed
from ivl.learners.base import FloatArray, Options
from ivl.optional import needed

_POPULATION_MIN = 4


class PyCMAOptions(Options):
    """Options of the strategy."""

    active: bool = Field(default=True, description="also learn from the worst of a generation")


class PyCMA(Replayed):
    """CMA-ES of pycma, in a box of unit size; a generation is one episode, or so many that it has 4 policies."""

    Options: ClassVar[type[Options]] = PyCMAOptions
    options: PyCMAOptions

    def make(self) -> Optimiser:
        """A new strategy."""
        return _Strategy(self)


class _Strategy:
    """pycma's strategy with random numbers of its own; waits until a generation is complete."""

    def __init__(self, learner: PyCMA) -> None:
        cma = needed("cma", "optimisers")
        self._lo, self._width = learner.lo, learner.hi - learner.lo
        rng = np.random.Generator(np.random.PCG64(learner.seed))
        spread = learner.sigma0 / self._width
        settings: dict[str, Any] = {
            # whole episodes, so that pycma, which wants one `ask` for each `tell`, gets it
            "popsize": learner.n_rollouts * math.ceil(_POPULATION_MIN / learner.n_rollouts),
            "bounds": [0, 1],
            "CMA_stds": (spread / spread.mean()).tolist(),
            "CMA_active": learner.options.active,
            "seed": math.nan,  # pycma would seed numpy's global generator, which belongs to everybody
            "randn": lambda *shape: rng.standard_normal(shape),
            "verbose": -9,
        }
        start = (learner.mu0 - self._lo) / self._width
        self._strategy: Any = cma.CMAEvolutionStrategy(start.tolist(), float(spread.mean()), settings)
        self._drawn: list[Any] = []
        self._sent: dict[bytes, Any] = {}
        self._waiting: list[tuple[Any, float]] = []

    def ask(self, n: int) -> FloatArray:
        """Draw policies, generation by generation."""
        while len(self._drawn) < n:
            self._drawn.extend(self._strategy.ask())
        points, self._drawn = self._drawn[:n], self._drawn[n:]
        theta: FloatArray = np.clip(np.array(points) * self._width + self._lo, self._lo, self._lo + self._width)
        self._sent = {row.tobytes(): point for row, point in zip(theta, points, strict=True)}
        return theta

    def tell(self, theta: FloatArray, returns: FloatArray) -> None:
        """Update the distribution with each complete generation."""
        for row, value in zip(theta, returns.tolist(), strict=True):
            self._waiting.append((self._sent.get(row.tobytes(), (row - self._lo) / self._width), -value))
            if len(self._waiting) == self._strategy.popsize:
                points, values = zip(*self._waiting, strict=True)
                self._strategy.tell(list(points), list(values))
                self._waiting = []
