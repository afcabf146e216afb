"""No search: the same policy again and again, for a policy that is to be flown as it is over a grid or by a vehicle."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ivl.learners.base import FloatArray, Learner, Meta


class Fixed(Learner):
    """Asks for its start, whatever it is told; sigma0 means nothing."""

    def _setup(self) -> None:
        """Nothing is kept."""

    def _ask(self, n: int) -> FloatArray:
        return np.tile(self.mu0, (n, 1))

    def _update(self, theta: FloatArray, rewards: FloatArray, meta: Meta, /) -> None:
        """Nothing is learned."""

    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        return self.mu0, np.zeros_like(self.mu0)

    def _recommended(self) -> FloatArray:
        return self.mu0

    def _state(self) -> dict[str, Any]:
        return {"mu0": self.mu0.tolist()}

    def _load(self, state: Mapping[str, Any]) -> None:
        if state["mu0"] != self.mu0.tolist():
            raise ValueError(f"it began at {state['mu0']}")
