"""The level ceiling seen from another frame is another plane: the same worlds and landings but for the frame."""

from typing import Any

import numpy as np
import numpy.typing as npt

import ivl
from ivl.surface import Surface
from ivl.world import rotation

FloatArray = npt.NDArray[np.float64]

NORMALS = {
    "level": (0.0, 0.0, 1.0),
    "slope": (np.sin(0.6), 0.0, np.cos(0.6)),
    "sideways": (0.0, -np.sin(0.9), np.cos(0.9)),
    "wall": (1.0, 0.0, 0.0),
    "corner": (-2 / 3, 1 / 3, -2 / 3),
}
MOVING = (0.4, -0.3, 0.2)


def shortest_turn(normal: FloatArray) -> FloatArray:
    """Unit quaternion x, y, z, w of the shortest turn from z up to the normal."""
    q = np.array([-normal[1], normal[0], 0.0, 1.0 + normal[2]])
    return np.asarray(q / np.linalg.norm(q))


def product(p: FloatArray, q: FloatArray) -> FloatArray:
    """The rotation q, then p; q of shape (..., 4)."""
    u, v, a, b = p[:3], q[..., :3], p[3], q[..., 3:]
    return np.concatenate([a * v + b * u + np.cross(u, v), a * b - (v @ u)[..., None]], axis=-1)


class Seen:
    """A world and its landings from a frame that is turned by the shortest turn to `normal`, shifted, and moves.

    What is at p in the level world is at turn p + shift + velocity t.
    """

    def __init__(self, world: ivl.World, normal: Any, velocity_W_mps: Any = (0.0, 0.0, 0.0)) -> None:
        self.q = shortest_turn(np.array(normal))
        self.turn, self.shift_m = rotation(self.q), np.array([0.3, -0.2, 0.1])
        self.velocity = np.array(velocity_W_mps)
        self.world = world.changed()
        point = self.turn @ np.array(world.surface.point_W_m) + self.shift_m
        self.world.surface = Surface(tuple(point), tuple(self.turn[:, 2]), tuple(velocity_W_mps))

    def points(self, p_W_m: FloatArray, t_s: FloatArray) -> FloatArray:
        """Points of shape (n, k, 3) at the times t, shape (n,)."""
        return np.asarray(p_W_m @ self.turn.T + self.shift_m + (t_s[:, None] * self.velocity)[:, None])

    def point(self, p_W_m: Any) -> tuple[float, float, float]:
        """A point at time 0."""
        return tuple(self.points(np.array([[p_W_m]]), np.zeros(1))[0, 0].tolist())

    def direction(self, axis_W: Any) -> tuple[float, float, float]:
        """A direction."""
        return tuple((self.turn @ axis_W).tolist())

    def rows(self, rows: Any) -> Any:
        """Rows of a trace: pose and feet as seen from the frame, all else as it was."""
        seen = rows.copy()
        seen.p_WB_m = self.points(rows.p_WB_m[:, None], rows.t_s)[:, 0]
        seen.foot_W_m = self.points(rows.foot_W_m.reshape(-1, 4, 3), rows.t_s).reshape(-1, 12)
        seen.q_WB = product(self.q, rows.q_WB)
        return seen
