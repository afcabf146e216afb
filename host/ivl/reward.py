"""The return of a rollout, by name, as pure functions of outcome arrays.

    paper         R = 1/d_min + 10 min(|theta|/90, 1) + legs
                  legs: 150 (3 or 4 feet), 50 (1 or 2), 0 (none), halved on body contact
                  (Habas et al., equations 4-6)
    authors_code  R = 10 z_max/h + 10 min(|theta|/90, 1) + legs
                  legs: 150 (3 or 4 feet), 50 (2), 10 (1), 0 (none); on body contact 100, 25, 10, 0
                  (the authors' simulation code, September 2021)

theta is the rotation about b_y at first contact, folded to 0 .. 180 degrees; a rollout without contact earns no angle
term. Every term is >= 0, so every return is.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from ivl.errors import ConfigError
from ivl.outcome import Outcomes, folded_deg

FloatArray = npt.NDArray[np.float64]


class RewardOptions(BaseModel):
    """Constants of the rewards."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    d_floor_m: float = Field(
        default=0.05,
        gt=0,
        le=1,
        description="paper: 1/d uses max(d_min, d_floor_m), so that it stays finite (at most 20)",
    )
    h_ceil_m: float = Field(
        default=2.10, gt=0, le=100, description="authors_code: ceiling height h of the authors' simulator"
    )


@dataclass(frozen=True)
class Reward:
    """Terms of the return, each in the shape of the outcomes; `total` is their sum."""

    distance: FloatArray
    angle: FloatArray
    legs: FloatArray

    @property
    def total(self) -> FloatArray:
        """The return R, dimensionless, >= 0."""
        return self.distance + self.angle + self.legs


RewardFunction = Callable[[Outcomes, RewardOptions], Reward]


def paper(outcomes: Outcomes, options: RewardOptions) -> Reward:
    """The paper's reward."""
    d_min_m = np.maximum(np.asarray(outcomes["d_min_m"], dtype=np.float64), options.d_floor_m)
    legs = _by_legs(outcomes, (0.0, 50.0, 50.0, 150.0, 150.0))
    return Reward(1.0 / d_min_m, _angle_term(outcomes), np.where(_body(outcomes), legs / 2, legs))


def authors_code(outcomes: Outcomes, options: RewardOptions) -> Reward:
    """The reward of the authors' code; z_max is the height of the closest approach, never below the floor."""
    z_max_m = np.clip(options.h_ceil_m - np.asarray(outcomes["d_min_m"], dtype=np.float64), 0.0, options.h_ceil_m)
    free = _by_legs(outcomes, (0.0, 10.0, 50.0, 150.0, 150.0))
    hit = _by_legs(outcomes, (0.0, 10.0, 25.0, 100.0, 100.0))
    return Reward(10.0 * z_max_m / options.h_ceil_m, _angle_term(outcomes), np.where(_body(outcomes), hit, free))


REWARDS: dict[str, RewardFunction] = {"paper": paper, "authors_code": authors_code}


def by_name(name: str) -> RewardFunction:
    """The reward function called `name`.

    Raises:
        ConfigError: There is none.
    """
    if name not in REWARDS:
        raise ConfigError(f"reward: no reward {name!r} (allowed {', '.join(REWARDS)})")
    return REWARDS[name]


def _angle_term(outcomes: Outcomes) -> FloatArray:
    angle_deg = np.nan_to_num(folded_deg(outcomes["theta_impact_deg"]), nan=0.0)
    return 10.0 * np.minimum(angle_deg / 90.0, 1.0)


def _by_legs(outcomes: Outcomes, value_by_count: tuple[float, float, float, float, float]) -> FloatArray:
    return np.asarray(value_by_count)[np.asarray(outcomes["n_legs"], dtype=np.intp)]


def _body(outcomes: Outcomes) -> npt.NDArray[np.bool_]:
    return np.asarray(outcomes["body_contact"] != 0)
