"""Approaches to look along: constant velocity, a body that swings, and an attitude estimate with errors."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl.camera.native import ROW_DOUBLES

Vector = npt.NDArray[np.float64]


def multiply(a: Vector, b: Vector) -> Vector:
    """Product of two quaternions x y z w."""
    v = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.array([*v, a[3] * b[3] - a[:3] @ b[:3]])


def from_rotation(v: Vector) -> Vector:
    """Quaternion of a rotation vector."""
    angle = float(np.linalg.norm(v))
    return np.array([*(v * (0.5 * np.sinc(0.5 * angle / np.pi))), np.cos(0.5 * angle)])


@dataclass(frozen=True)
class Approach:
    """A straight approach to a surface.

    Attributes:
        speed_mps: Of the body.
        angle_rad: Of the velocity above the surface: pi/2 is straight at it.
        rrev_per_s: RREV at the first and at the last picture.
        rate_hz: Pictures a second.
        swing_rad: Amplitude of the body's roll and pitch.
        attitude_rad: Standard deviation of the attitude estimate, one error for the whole approach.
        gyro_radps: Standard deviation of the rate at which that error grows.
    """

    speed_mps: float
    angle_rad: float
    rrev_per_s: tuple[float, float] = (1.0, 6.5)
    rate_hz: float = 60.0
    swing_rad: float = 0.15
    attitude_rad: float = 0.01
    gyro_radps: float = 0.005


@dataclass(frozen=True)
class Motion:
    """What is rendered, and what is true.

    Attributes:
        rows: Shape (n, 18) for `native.look`.
        distance_m: At time 0 of `rows`, from the surface.
        velocity_mps: Along x, y and towards the surface.
        forward: Direction of body x along the surface at each picture, shape (n, 2).
    """

    rows: Vector
    distance_m: float
    velocity_mps: Vector
    forward: Vector

    def truth(self, t_s: Vector) -> tuple[Vector, Vector, Vector]:
        """RREV, OF_x and OF_y at instants between pictures."""
        d = self.distance_m - self.velocity_mps[2] * t_s
        fx, fy = (np.interp(t_s, self.rows[:, 0], self.forward[:, i]) for i in (0, 1))
        vx, vy = self.velocity_mps[:2]
        return self.velocity_mps[2] / d, (vy * fx - vx * fy) / d, -(vx * fx + vy * fy) / d


def fly(approach: Approach, rng: np.random.Generator) -> Motion:
    """Draw phase of the clock, swing, side wind and errors, and give the poses of all pictures."""
    v = np.array(
        [
            approach.speed_mps * np.cos(approach.angle_rad),
            0.05 * rng.normal(),
            approach.speed_mps * np.sin(approach.angle_rad),
        ]
    )
    first, last = approach.rrev_per_s
    far, near = v[2] / first, v[2] / last
    n = int((far - near) / v[2] * approach.rate_hz)
    t = (np.arange(n) + rng.uniform()) / approach.rate_hz
    start_m = rng.uniform(-1, 1, 2)
    level, rate = rng.uniform(-0.1, 0.1, 2), rng.uniform(2, 8, 2)
    amplitude, phase = approach.swing_rad * rng.uniform(0, 1, 2), rng.uniform(0, 2 * np.pi, 2)
    error = rng.normal(size=3) * approach.attitude_rad
    drift = rng.normal(size=3) * approach.gyro_radps

    def attitude(at_s: float) -> Vector:
        roll, pitch = level + amplitude * np.sin(rate * at_s + phase)
        return multiply(from_rotation(np.array([0.0, pitch, 0.0])), from_rotation(np.array([roll, 0.0, 0.0])))

    rows, forward = np.zeros((n, ROW_DOUBLES)), np.zeros((n, 2))
    for i, now in enumerate(t):
        q, soon = attitude(now), attitude(now + 1.0e-4)
        rows[i, 0] = now
        rows[i, 1:4] = start_m[0] + v[0] * now, start_m[1] + v[1] * now, -(far - v[2] * now)
        rows[i, 4:8] = q
        rows[i, 8:11] = v
        rows[i, 11:14] = 2.0e4 * multiply(q * np.array([-1, -1, -1, 1]), soon)[:3]
        rows[i, 14:18] = multiply(q, from_rotation(error + drift * now))
        forward[i] = 1 - 2 * (q[1] ** 2 + q[2] ** 2), 2 * (q[0] * q[1] + q[2] * q[3])
    return Motion(rows, far, v, forward / np.linalg.norm(forward, axis=1, keepdims=True))
