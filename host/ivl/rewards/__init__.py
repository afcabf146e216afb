"""Rewards by name: one registry for the experiments, the stores, the reports and the command line.

A new reward is one file here (see `paper.py`) and one row in `REWARDS`.
"""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, SerializeAsAny, ValidationInfo, field_validator

from ivl.errors import ConfigError
from ivl.outcome import Outcomes
from ivl.rewards import authors_code, paper
from ivl.rewards.base import TOTAL, FloatArray, Options, Reward

__all__ = ["REWARDS", "TOTAL", "Options", "Reward", "RewardChoice", "by_name"]

REWARDS: dict[str, Reward] = {
    "paper": paper.REWARD,
    "authors_code": authors_code.REWARD,
}


def by_name(name: str) -> Reward:
    """The reward called `name`.

    Raises:
        ConfigError: There is none.
    """
    if name not in REWARDS:
        raise ConfigError(f"reward: no reward {name!r} (allowed {', '.join(REWARDS)})")
    return REWARDS[name]


class RewardChoice(BaseModel):
    """A reward by name, with its own options; what is left out has the reward's defaults."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    name: str = "paper"
    options: SerializeAsAny[Options] = Field(default={}, validate_default=True)

    @field_validator("name")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in REWARDS:
            raise ValueError(f"no reward {name!r} (allowed {', '.join(REWARDS)})")
        return name

    @field_validator("options", mode="before")
    @classmethod
    def _own(cls, options: Any, info: ValidationInfo) -> Any:
        """Options of the chosen reward; those of a reward that does not exist are not looked at."""
        if "name" not in info.data:
            return Options()
        own = REWARDS[info.data["name"]].options_type
        return options if isinstance(options, own) else own.model_validate(options)

    @classmethod
    def further_paths(cls) -> dict[str, bool]:
        """Paths of the options that any reward has, as `yamlfile.paths` tells them."""
        return {f"options.{name}": False for reward in REWARDS.values() for name in reward.options_type.model_fields}

    @property
    def reward(self) -> Reward:
        """The reward itself."""
        return REWARDS[self.name]

    def score(self, outcomes: Outcomes) -> dict[str, FloatArray]:
        """Terms and `total` of outcomes of any shape, with these options."""
        return self.reward.score(outcomes, self.options)
