"""What every reward is: terms by name, options of its own, and a pure function from outcomes to returns.

    terms = reward.score(outcomes, reward.options_type())
    terms["total"]          # the return, what a learner is told
    terms["legs"]           # one of the terms that the reward declares

Whatever stores or shows rewards takes the names, units and meanings of the terms from here.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from ivl.errors import ConfigError
from ivl.outcome import Outcomes
from ivl.quantity import Quantity

FloatArray = npt.NDArray[np.float64]
Terms = Mapping[str, FloatArray]
"""Arrays by the names of a reward's terms, and `total`, each in the shape of the outcomes."""

TOTAL = "total"
"""Name of the return itself: finite and >= 0 for every rollout that may be learned from."""


Weight = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Options(BaseModel):
    """Base of the options of a reward: checked strictly, unknown names refused."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    weights: dict[str, Weight] = Field(default={}, description="factors on terms of the return, by name; else 1")


@dataclass(frozen=True)
class Reward:
    """A reward: what it is made of, and how it is computed.

    Attributes:
        name: Name in experiments and on the command line.
        doc: What `ivl list rewards` says, in one line.
        terms: What the return is made of; `total` is not among them.
        compute: The function of outcomes (any shape) and options; see `score`.
        options_type: Class of the reward's own options.
    """

    name: str
    doc: str
    terms: tuple[Quantity, ...]
    compute: Callable[[Outcomes, Any], Terms]
    options_type: type[Options] = Options

    def __post_init__(self) -> None:
        """Refuse names that cannot be columns."""
        names = [term.name for term in self.terms]
        if len({TOTAL, *names}) <= len(names) or not all(re.fullmatch(r"[a-z]\w*", name) for name in names):
            raise ValueError(f"reward {self.name}: terms {names} must be different names of columns, none {TOTAL!r}")

    def check_weights(self, options: Options) -> None:
        """Refuse weights of terms that the reward does not have.

        Raises:
            ValueError: There is one.
        """
        names = [term.name for term in self.terms]
        for name in options.weights:
            if name not in names:
                raise ValueError(
                    f"weights.{name}: no such term (the reward {self.name} has {', '.join(names) or 'none'})"
                )

    def score(self, outcomes: Outcomes, options: Options) -> dict[str, FloatArray]:
        """The declared terms in their order, weighted, and `total`, for outcomes of any shape.

        A weight w on a term changes the return by (w - 1) times the term, so that a return which is the sum of its
        terms becomes the sum of the weighted terms.

        Raises:
            ConfigError: What the function gives is not what the reward declares.
        """
        found = self.compute(outcomes, options)
        names = [TOTAL, *(term.name for term in self.terms)]
        if set(found) != set(names):
            raise ConfigError(f"reward {self.name}: gives {sorted(found)}, declares {sorted(names)}")
        scored = {name: self._array(name, found[name], outcomes) for name in names}
        for name, weight in options.weights.items():
            scored[TOTAL] = scored[TOTAL] + (weight - 1.0) * scored[name]
            scored[name] = weight * scored[name]
        return scored

    def _array(self, name: str, values: Any, outcomes: Outcomes) -> FloatArray:
        """The values of a term, one number for each outcome."""
        try:
            array = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"reward {self.name}: {name}: expected numbers: {error}") from error
        if array.shape != outcomes.shape:
            raise ConfigError(
                f"reward {self.name}: {name}: shape {array.shape} (expected {outcomes.shape}: a number a rollout)"
            )
        return array
