"""The paper's reward (Habas et al., equations 4 to 6).

    R = 1/d_min + 10 min(|theta|/90, 1) + legs
    legs: 150 (3 or 4 feet), 50 (1 or 2), 0 (none), halved on body contact

theta is the rotation about b_y at first contact, folded to 0 .. 180 degrees. Every term is >= 0, so every return is.
"""

import numpy as np
from pydantic import Field

from ivl.outcome import Outcomes
from ivl.quantity import Quantity
from ivl.rewards import base
from ivl.rewards.base import Reward, Terms
from ivl.rewards.parts import ANGLE, angle_points, points_by_legs, touched

LEGS = (0.0, 50.0, 50.0, 150.0, 150.0)


class Options(base.Options):
    """Options of the paper's reward."""

    d_floor_m: float = Field(
        default=0.05, gt=0, le=1, description="1/d uses max(d_min, d_floor_m), so that it stays finite (at most 20)"
    )


def compute(outcomes: Outcomes, options: Options) -> Terms:
    """Terms and return, for outcomes of any shape."""
    d_min_m = np.maximum(np.asarray(outcomes["d_min_m"], dtype=np.float64), options.d_floor_m)
    legs = points_by_legs(outcomes, LEGS)
    distance, angle = 1.0 / d_min_m, angle_points(outcomes)
    legs = np.where(touched(outcomes), legs / 2, legs)
    return {"distance": distance, "angle": angle, "legs": legs, "total": distance + angle + legs}


REWARD = Reward(
    name="paper",
    doc="The paper's reward.",
    terms=(
        Quantity("distance", "1", "one over the smallest distance to the ceiling in metres"),
        ANGLE,
        Quantity("legs", "1", "150 for three or four feet, 50 for one or two, half of it on body contact"),
    ),
    compute=compute,
    options_type=Options,
)
