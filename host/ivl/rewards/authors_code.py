"""The reward of the authors' simulation code (September 2021).

    R = 10 z_max/h + 10 min(|theta|/90, 1) + legs
    legs: 150 (3 or 4 feet), 50 (2), 10 (1), 0 (none); on body contact 100, 25, 10, 0

z_max is the height of the closest approach, never below the floor; theta as in the paper's reward. Every term is >= 0.
"""

import numpy as np
from pydantic import Field

from ivl.outcome import Outcomes
from ivl.quantity import Quantity
from ivl.rewards import base
from ivl.rewards.base import Reward, Terms
from ivl.rewards.parts import ANGLE, angle_points, points_by_legs, touched

LEGS_FREE = (0.0, 10.0, 50.0, 150.0, 150.0)
LEGS_TOUCHED = (0.0, 10.0, 25.0, 100.0, 100.0)


class Options(base.Options):
    """Options of the authors' reward."""

    h_ceil_m: float = Field(default=2.10, gt=0, le=100, description="ceiling height h of the authors' simulator")


def compute(outcomes: Outcomes, options: Options) -> Terms:
    """Terms and return, for outcomes of any shape."""
    z_max_m = np.clip(options.h_ceil_m - np.asarray(outcomes["d_min_m"], dtype=np.float64), 0.0, options.h_ceil_m)
    height, angle = 10.0 * z_max_m / options.h_ceil_m, angle_points(outcomes)
    legs = np.where(touched(outcomes), points_by_legs(outcomes, LEGS_TOUCHED), points_by_legs(outcomes, LEGS_FREE))
    return {"height": height, "angle": angle, "legs": legs, "total": height + angle + legs}


REWARD = Reward(
    name="authors_code",
    doc="The reward of the authors' code.",
    terms=(
        Quantity("height", "1", "10 times the height of the closest approach over that of the ceiling"),
        ANGLE,
        Quantity("legs", "1", "150 for three or four feet, 50 for two, 10 for one; 100, 25 and 10 on body contact"),
    ),
    compute=compute,
    options_type=Options,
)
