"""What every reward is: terms by name, options of its own, and a pure function from outcomes to returns.

    terms = reward.score(outcomes, reward.options_type())
    terms["total"]          # the return, what a learner is told
    terms["legs"]           # one of the terms that the reward declares

Whatever stores or shows rewards takes the names, units and meanings of the terms from here.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict

from ivl.outcome import Outcomes
from ivl.quantity import Quantity

FloatArray = npt.NDArray[np.float64]
Terms = Mapping[str, FloatArray]
"""Arrays by the names of a reward's terms, and `total`, each in the shape of the outcomes."""

TOTAL = "total"
"""Name of the return itself: finite and >= 0 for every rollout that may be learned from."""


class Options(BaseModel):
    """Base of the options of a reward: checked strictly, unknown names refused."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


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

    def score(self, outcomes: Outcomes, options: Options) -> dict[str, FloatArray]:
        """The declared terms in their order, and `total`, for outcomes of any shape.

        Raises:
            ValueError: The function's terms are not those that the reward declares.
        """
        found = self.compute(outcomes, options)
        names = [TOTAL, *(term.name for term in self.terms)]
        if set(found) != set(names):
            raise ValueError(f"reward {self.name}: gives {sorted(found)}, declares {sorted(names)}")
        return {name: np.asarray(found[name], dtype=np.float64) for name in names}
