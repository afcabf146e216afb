"""Parts of a return that several rewards share."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ivl.outcome import Outcomes, folded_deg
from ivl.quantity import Quantity
from ivl.rewards.base import FloatArray

ANGLE_POINTS, ANGLE_FULL_DEG = 10.0, 90.0
"""Largest angle term, and the rotation from which on it is earned in full."""
ANGLE = Quantity("angle", "1", "10 for a rotation of 90 degrees or more at the first contact, in proportion below")
"""What `angle_points` are, in words."""


def angle_points(outcomes: Outcomes) -> FloatArray:
    """10 min(|theta|/90, 1), theta folded to 0 .. 180 degrees; 0 without contact."""
    angle_deg = np.nan_to_num(folded_deg(outcomes["theta_impact_deg"]), nan=0.0)
    return np.asarray(ANGLE_POINTS * np.minimum(angle_deg / ANGLE_FULL_DEG, 1.0))


def points_by_legs(outcomes: Outcomes, points: Sequence[float]) -> FloatArray:
    """The entry of `points` for the number of feet that are stuck at the end, 0 to 4."""
    return np.asarray(points, dtype=np.float64)[np.asarray(outcomes["n_legs"], dtype=np.intp)]


def touched(outcomes: Outcomes) -> npt.NDArray[np.bool_]:
    """True where body or rotors touched the ceiling."""
    return np.asarray(outcomes["body_contact"] != 0)
