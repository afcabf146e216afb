"""A learner around an optimiser with `ask` and `tell` that cannot save its state.

    class Mine(Replayed):
        def make(self) -> Optimiser:
            return ...          # something with ask(n) and tell(theta, returns), seeded with self.seed

The state that a run keeps is the list of all calls. To go on, a new optimiser is made and the calls are repeated. So a
run continues bit for bit if the optimiser is a function of its seed and its calls, and no code is ever read from a run
folder, as a pickled optimiser would be.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

import numpy as np

from ivl.errors import LearnerError
from ivl.learners.base import FloatArray, Learner, Meta

_BEST_SHARE, _BEST_MIN = 0.1, 3


class Optimiser(Protocol):
    """What an adapter makes of an optimiser; policies are in the units of the experiment."""

    def ask(self, n: int) -> FloatArray:
        """The next n policies, shape (n, dim); those outside the bounds are moved to them."""
        ...

    def tell(self, theta: FloatArray, returns: FloatArray) -> None:
        """Returns, shape (n,), >= 0 and to be maximised, of policies as flown, shape (n, dim).

        They may be fewer than those asked for, and others, since an operator can discard a flight or change a policy.
        """
        ...


class Replayed(Learner):
    """Base of such learners; a subclass has `make`, and may have `recommend`."""

    needs_bounds: ClassVar[bool] = True

    @abstractmethod
    def make(self) -> Optimiser:
        """A new optimiser for `self.mu0`, `self.sigma0`, `self.lo`, `self.hi`, `self.options` and `self.seed`."""

    def recommend(self, theta: FloatArray, returns: FloatArray) -> FloatArray:
        """The policy to fly if learning ended now: the mean of the tenth of the policies with the largest returns.

        A single best return is often luck, since a landing scatters.

        Args:
            theta: Policies flown so far, at least one, shape (n, dim).
            returns: Their returns, shape (n,).
        """
        n = max(_BEST_MIN, round(_BEST_SHARE * len(returns)))
        best = np.argsort(-returns, kind="stable")[:n]
        mean: FloatArray = theta[best].mean(axis=0)
        return mean

    def _setup(self) -> None:
        self._optimiser = self.make()
        self._calls: list[dict[str, Any]] = []
        self._asked = self.mu0[None, :]
        self._theta, self._returns = np.zeros((0, self.dim)), np.zeros(0)

    def _ask(self, n: int) -> FloatArray:
        asked = np.asarray(self._optimiser.ask(n), dtype=np.float64)
        if asked.shape != (n, self.dim) or not np.isfinite(asked).all():
            raise LearnerError(f"{type(self).__name__}: asked for shape {(n, self.dim)}, got {asked.shape}: {asked!r}")
        self._calls.append({"ask": n})
        self._asked = np.clip(asked, self.lo, self.hi)
        return self._asked.copy()

    def _update(self, theta: FloatArray, rewards: FloatArray, meta: Meta, /) -> None:  # noqa: ARG002 - returns suffice
        self._optimiser.tell(theta, rewards)
        self._calls.append({"tell": theta.tolist(), "returns": rewards.tolist()})
        self._theta, self._returns = np.vstack([self._theta, theta]), np.append(self._returns, rewards)

    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        if not self._calls:
            return self.mu0, self.sigma0
        return self._asked.mean(axis=0), self._asked.std(axis=0)

    def _recommended(self) -> FloatArray:
        if not self._returns.size:
            return self.mu0
        return np.clip(self.recommend(self._theta, self._returns), self.lo, self.hi)

    def _state(self) -> dict[str, Any]:
        return {"calls": self._calls}

    def _load(self, state: Mapping[str, Any]) -> None:
        self._setup()
        for call in state["calls"]:
            if "ask" in call:
                self._ask(int(call["ask"]))
            else:
                self._update(np.array(call["tell"]), np.array(call["returns"]), {})
