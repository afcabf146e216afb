"""Rewards by name: one registry for the experiments, the stores, the reports and the command line.

A new reward of this package is one file here (see `paper.py`) and one row in `REWARDS`. One of your own needs neither:
`module:name` of a `Reward`, or of a function of outcomes, is found too (`ivl.plugins`).
"""

import inspect
from typing import Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializeAsAny,
    ValidationInfo,
    field_validator,
)

from ivl.errors import ConfigError
from ivl.outcome import Outcomes
from ivl.plugins import Registry
from ivl.rewards import authors_code, paper
from ivl.rewards.base import TOTAL, FloatArray, Options, Reward, Terms
from ivl.table import Rollouts

__all__ = ["REWARDS", "TOTAL", "Options", "Reward", "RewardChoice", "by_name"]


def _made(name: str, found: Any) -> Reward:
    """A reward of one's own: a `Reward`, or a function from outcomes to returns.

    Raises:
        ConfigError: It is neither.
    """
    if isinstance(found, Reward):
        return found
    if not callable(found) or inspect.isclass(found):
        raise ConfigError(
            f"reward {name!r}: is of the kind {type(found).__name__}, expected a Reward or a function of outcomes"
        )

    def compute(outcomes: Outcomes, _options: Options) -> Terms:
        return {TOTAL: found(outcomes.view(Rollouts))}

    lines = (inspect.getdoc(found) or "a reward of your own").splitlines()
    return Reward(name, lines[0], (), compute)


REWARDS: Registry[Reward] = Registry(
    "reward",
    _made,
    {
        "paper": paper.REWARD,
        "authors_code": authors_code.REWARD,
    },
)


def by_name(name: str) -> Reward:
    """The reward called `name`.

    Raises:
        ConfigError: There is none.
    """
    return REWARDS[name]


class RewardChoice(BaseModel):
    """A reward by name, with its own options; what is left out has the reward's defaults."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    name: str = "paper"
    options: SerializeAsAny[Options] = Field(default={}, validate_default=True)

    @field_validator("name")
    @classmethod
    def _known(cls, name: str) -> str:
        try:
            by_name(name)
        except ConfigError as error:
            raise ValueError(str(error)) from error
        return name

    @field_validator("options", mode="before")
    @classmethod
    def _own(cls, options: Any, info: ValidationInfo) -> Any:
        """Options of the chosen reward; those of a reward that does not exist are not looked at."""
        if "name" not in info.data:
            return Options()
        reward = REWARDS[info.data["name"]]
        own = reward.options_type
        checked = options if isinstance(options, own) else own.model_validate(options)
        reward.check_weights(checked)
        return checked

    @classmethod
    def further_paths(cls) -> dict[str, bool]:
        """Paths of the options that any reward has, as `yamlfile.paths` tells them; one of your own has others."""
        own = {f"options.{name}": False for reward in REWARDS.values() for name in reward.options_type.model_fields}
        return {"options": True, **own, "options.weights": True}

    @property
    def reward(self) -> Reward:
        """The reward itself."""
        return REWARDS[self.name]

    def score(self, outcomes: Outcomes) -> dict[str, FloatArray]:
        """Terms and `total` of outcomes of any shape, with these options."""
        return self.reward.score(outcomes, self.options)
