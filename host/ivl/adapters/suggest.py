"""A learner from a single function: all that was flown in, the next policies out, as with BoTorch or GPyTorch.

    class Mine(Suggest):
        def suggest(self, theta, returns, n, rng):
            model = fit(theta, returns)                        # both in the unit box, returns of mean 0 and deviation 1
            return optimise(acquisition(model), n)

The function is called with the same numbers after a run was cut off as without, so it continues bit for bit if the
function is one of its arguments. `examples/suggest_gp.py` does it with a Gaussian process.
"""

from abc import abstractmethod
from typing import ClassVar

import numpy as np
from pydantic import Field

from ivl.adapters.replayed import Optimiser, Replayed
from ivl.learners.base import FloatArray, Options, draw_truncated


class SuggestOptions(Options):
    """Options of every such learner."""

    n_start: int = Field(default=16, ge=1, description="policies drawn near the start before the function is asked")


class Suggest(Replayed):
    """Base of such learners; a subclass has `suggest`."""

    Options: ClassVar[type[Options]] = SuggestOptions
    options: SuggestOptions

    @abstractmethod
    def suggest(self, theta: FloatArray, returns: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
        """The next policies.

        Args:
            theta: Policies flown so far in the unit box, shape (m, dim), m >= 1; 0 and 1 are the bounds.
            returns: Their returns, less the mean, over the standard deviation, shape (m,).
            n: How many policies are wanted.
            rng: Random numbers, which belong to this learner.

        Returns:
            Policies in the unit box, shape (n, dim).
        """

    def make(self) -> Optimiser:
        """The function with its memory."""
        return _Memory(self)


class _Memory:
    """All that was flown, in the unit box."""

    def __init__(self, learner: Suggest) -> None:
        self._learner = learner
        self._rng = np.random.Generator(np.random.PCG64(learner.seed))
        self._lo, self._width = learner.lo, learner.hi - learner.lo
        self._theta, self._returns = np.zeros((0, learner.dim)), np.zeros(0)

    def ask(self, n: int) -> FloatArray:
        """Near the start, or what the function suggests."""
        learner = self._learner
        if self._returns.size < learner.options.n_start:
            return draw_truncated(self._rng, learner.mu0, learner.sigma0, learner.lo, learner.hi, n)
        spread = self._returns.std()
        scaled = (self._returns - self._returns.mean()) / (spread if spread > 0 else 1.0)
        return learner.suggest(self._theta, scaled, n, self._rng) * self._width + self._lo

    def tell(self, theta: FloatArray, returns: FloatArray) -> None:
        """Remember."""
        self._theta = np.vstack([self._theta, (theta - self._lo) / self._width])
        self._returns = np.append(self._returns, returns)
