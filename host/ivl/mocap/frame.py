"""From the axes of a tracking system to the flight frame W, which is turned about z and moved along the floor."""

import math
from dataclasses import dataclass

from ivl.mocap.watch import Pose


@dataclass(frozen=True)
class FlightFrame:
    """Where W is.

    Attributes:
        origin_m: Its origin on the floor, x and y in the axes of the tracking system, m.
        heading_rad: Its x axis, from the x axis of the tracking system towards the y axis there.
    """

    origin_m: tuple[float, float] = (0.0, 0.0)
    heading_rad: float = 0.0

    def into(self, pose: Pose) -> Pose:
        """A pose in the axes of the tracking system, in W; with no turn and no move it keeps its bits."""
        if not self.heading_rad and not any(self.origin_m):
            return pose
        x, y, z = pose.p_W_m
        x, y = x - self.origin_m[0], y - self.origin_m[1]
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        half_cos, half_sin = math.cos(0.5 * self.heading_rad), -math.sin(0.5 * self.heading_rad)
        qx, qy, qz, qw = pose.q_WB
        turned = (
            half_cos * qx - half_sin * qy,
            half_cos * qy + half_sin * qx,
            half_cos * qz + half_sin * qw,
            half_cos * qw - half_sin * qz,
        )
        return Pose((cos * x + sin * y, cos * y - sin * x, z), turned)
