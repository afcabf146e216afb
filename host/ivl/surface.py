"""The plane that a vehicle lands on, as the library has it: a ceiling is a level one.

    gap_m = world.surface.gap_m(rows.p_WB_m, rows.t_s)
    picture = world.surface.seen(rows.p_WB_m, rows.t_s)  # along the surface, across, and above it

A surface has a frame S of its own that moves along with it: its origin is the surface's point, x is forward along the
surface, y is left, z is the normal. The normal points from the room into the surface, so points of the room have a
negative z. Of a level ceiling the axes of S are those of W. Points and velocities are arrays of shape (..., 3) in W;
times are arrays that broadcast with (...).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.errors import ArgumentError

FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float]

_UNIT_SLACK = 1e-9


@dataclass(frozen=True)
class Surface:
    """A plane, at rest or moving at a constant velocity.

    Attributes:
        point_W_m: A point of it at time 0, m.
        normal_W: Unit vector into the surface.
        velocity_W_mps: Its velocity, m/s.
    """

    point_W_m: Vector
    normal_W: Vector
    velocity_W_mps: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Refuse values that do not describe a plane.

        Raises:
            ArgumentError: A component is not finite, or the normal is no unit vector.
        """
        for name in native.library().surface_fields:
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ArgumentError(f"surface: {name}: value {getattr(self, name)!r}: three finite numbers are needed")
        length = float(np.linalg.norm(self.normal_W))
        if not abs(length - 1.0) <= _UNIT_SLACK:
            raise ArgumentError(f"surface: normal_W: length {length:g} (allowed 1 +- {_UNIT_SLACK:g}: a unit vector)")

    @classmethod
    def of(cls, model: native.NativeModel) -> Self:
        """The surface that a model lands on."""
        record = model.surface()[0]
        return cls(**{name: tuple(record[name].tolist()) for name in record.dtype.names or ()})

    @cached_property
    def axes_W(self) -> FloatArray:
        """Forward, left and normal as rows, shape (3, 3): the rotation matrix from W to S."""
        forward = native.library().surface_forward(self._record())
        normal = np.array(self.normal_W)
        return np.stack([forward, np.cross(normal, forward), normal])

    @property
    def q_WS(self) -> FloatArray:
        """Attitude of the surface in the world, unit quaternion x, y, z, w."""
        m = self.axes_W.T
        # 4 q q^T; its longest row is q without loss of digits
        outer = np.array(
            [
                [1 + m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
                [m[0, 1] + m[1, 0], 1 - m[0, 0] + m[1, 1] - m[2, 2], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
                [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 1 - m[0, 0] - m[1, 1] + m[2, 2], m[1, 0] - m[0, 1]],
                [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1 + m[0, 0] + m[1, 1] + m[2, 2]],
            ]
        )
        row = outer[int(np.argmax(np.diag(outer)))]
        return np.asarray(row / np.linalg.norm(row))

    @property
    def is_level(self) -> bool:
        """Whether it is a ceiling: the normal is up."""
        return self.normal_W == (0.0, 0.0, 1.0)

    @property
    def moves(self) -> bool:
        """Whether it has a velocity."""
        return any(self.velocity_W_mps)

    def place_W_m(self, t_s: npt.ArrayLike = 0.0) -> FloatArray:
        """Where the surface's point is, shape (..., 3), m."""
        times = np.asarray(t_s, dtype=np.float64)[..., None]
        return np.asarray(np.array(self.point_W_m) + times * np.array(self.velocity_W_mps))

    def seen(self, p_W_m: npt.ArrayLike, t_s: npt.ArrayLike = 0.0) -> FloatArray:
        """Points in S: x forward along the surface, y left, z above it (negative in the room), m."""
        return np.asarray((np.asarray(p_W_m, dtype=np.float64) - self.place_W_m(t_s)) @ self.axes_W.T)

    def gap_m(self, p_W_m: npt.ArrayLike, t_s: npt.ArrayLike = 0.0) -> FloatArray:
        """Distance of points from the surface, shape (...); negative behind it."""
        return np.asarray((self.place_W_m(t_s) - np.asarray(p_W_m, dtype=np.float64)) @ np.array(self.normal_W))

    def nearest_W_m(self, p_W_m: npt.ArrayLike, t_s: npt.ArrayLike = 0.0) -> FloatArray:
        """The points of the surface that are nearest to points, m."""
        place, normal = self.place_W_m(t_s), np.array(self.normal_W)
        away = np.asarray(p_W_m, dtype=np.float64) - place
        return np.asarray(place + (away - (away @ normal)[..., None] * normal))

    def closing_mps(self, v_W_mps: npt.ArrayLike) -> FloatArray:
        """Speed at which points that move at v come nearer, shape (...)."""
        return np.asarray(self._relative(v_W_mps) @ np.array(self.normal_W))

    def tangential_W_mps(self, v_W_mps: npt.ArrayLike) -> FloatArray:
        """Velocity of such points along the surface, as seen from there, in W."""
        relative, normal = self._relative(v_W_mps), np.array(self.normal_W)
        return np.asarray(relative - (relative @ normal)[..., None] * normal)

    def turned(self, q_WB: npt.ArrayLike) -> FloatArray:
        """Attitudes q_WB, shape (..., 4), as seen from S: q_SB."""
        x, y, z, w = np.moveaxis(np.asarray(q_WB, dtype=np.float64), -1, 0)
        a, b, c, d = self.q_WS * np.array([-1.0, -1.0, -1.0, 1.0])
        return np.stack(
            [
                d * x + a * w + b * z - c * y,
                d * y - a * z + b * w + c * x,
                d * z + a * y - b * x + c * w,
                d * w - a * x - b * y - c * z,
            ],
            axis=-1,
        )

    def _relative(self, v_W_mps: npt.ArrayLike) -> FloatArray:
        return np.asarray(np.asarray(v_W_mps, dtype=np.float64) - np.array(self.velocity_W_mps))

    def _record(self) -> npt.NDArray[np.void]:
        record = np.zeros(1, dtype=native.library().surface_dtype)
        for name in native.library().surface_fields:
            record[name] = getattr(self, name)
        return record
