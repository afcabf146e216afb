"""What the camera of a landing saw: pictures, readings, the poses from which they were taken, and what is true.

    film = film.shoot(world, 2.5, 90.0, 4.8, 8.0, start="flown", pictures=True)
    film.errors()

A film is made by flying the landing again with the same arguments: the same bits as `World.rollouts` gives.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline  # type: ignore[import-untyped]

from ivl import files
from ivl.camera.native import ROW_DOUBLES, STATUS, Camera, Seen, reading_dtype
from ivl.errors import ArgumentError, ConfigError
from ivl.world import World

Vector = npt.NDArray[np.float64]
PICTURES_MAX = 2000
"""More than a landing has: 5 s at 250 Hz."""


@dataclass(frozen=True)
class Truth:
    """What is true at the instants of readings.

    Attributes:
        rrev_per_s: RREV.
        of_y_radps: OF_y.
        d_m: Distance from the surface.
    """

    rrev_per_s: Vector
    of_y_radps: Vector
    d_m: Vector


@dataclass(frozen=True)
class Film:
    """A landing as its camera saw it, up to the flip.

    Attributes:
        camera: The camera.
        rows: Shape (n, 18), as for `ivl.camera.native.look`: from where each picture was taken, and the attitude as
            told.
        seen: Readings and, if they were asked for, pictures.
        outcome: Outcome of the landing.
    """

    camera: Camera
    rows: Vector
    seen: Seen
    outcome: np.record | None = None

    def __len__(self) -> int:
        """Number of pictures."""
        return len(self.rows)

    @property
    def t_s(self) -> Vector:
        """Middle of each picture's exposure."""
        return np.asarray(self.rows[:, 0])

    def sampled_s(self) -> Vector:
        """Instant that each reading belongs to; that of its picture if it is not valid."""
        return np.where(self.seen.valid, self.seen.readings["t"] * 1.0e-6, self.t_s)

    def truth(self, t_s: Vector | None = None) -> Truth:
        """What is true at some instants; omitted: those of the readings."""
        at = self.sampled_s() if t_s is None else t_s
        if len(self) < 2:
            raise ArgumentError("a film of less than two pictures has no motion")
        way = CubicHermiteSpline(self.t_s, self.rows[:, 1:4], self.rows[:, 8:11])
        p, v = way(at), way(at, 1)
        q = self.rows[:, 4:8]
        body_x = np.column_stack([1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2), 2 * (q[:, 0] * q[:, 1] + q[:, 2] * q[:, 3])])
        forward = np.column_stack([np.interp(at, self.t_s, body_x[:, i]) for i in (0, 1)])
        forward /= np.linalg.norm(forward, axis=1, keepdims=True)
        d_m = -p[:, 2]
        return Truth(v[:, 2] / d_m, -(v[:, :2] * forward).sum(axis=1) / d_m, d_m)


def shoot(
    world: World,
    speed_mps: float,
    angle_deg: float,
    *theta: float,
    pictures: bool = False,
    **arguments: Any,
) -> Film:
    """Fly a landing and keep what its camera saw.

    Args:
        world: With a sensor set that has a camera.
        speed_mps: As for `World.rollouts`, and so are the angle, the policy, and what follows.
        angle_deg: Likewise.
        *theta: Likewise.
        pictures: Whether to keep the pictures, too.
        **arguments: Those of `World.trace`.

    Raises:
        ConfigError: The sensor set has no camera.
        ArgumentError: An argument is wrong.
    """
    if not world.params.values["camera.rate"] > 0.0:
        raise ConfigError(f"sensors {world.sensing or 'of the vehicle'}: there is no camera that takes pictures")
    camera = of_world(world)
    spec = world.specification(speed_mps, angle_deg, *theta, **arguments)
    rows, readings, grey, outcome = world.native_model.film(
        spec, PICTURES_MAX, ROW_DOUBLES, reading_dtype(), camera.shape if pictures else None
    )
    return Film(camera, rows, Seen(readings, grey), outcome.view(np.recarray)[0])


def of_world(world: World) -> Camera:
    """The camera of a world, to look at pictures with it elsewhere."""
    return Camera(**{name: world.params.values[f"camera.{name}"] for name in Camera().names})


def write(film: Film, path: Path) -> None:
    """Pictures, times, attitudes and truth as a file for `ivl camera bench` (.npz).

    Raises:
        ArgumentError: The film has no pictures.
        ConfigError: The file cannot be written.
    """
    if film.seen.pictures is None:
        raise ArgumentError("this film was made without its pictures")
    numbers = {f"camera_{name}": film.camera[name] for name in film.camera.names}
    try:
        with files.replacing(path) as part, part.open("wb") as archive:
            np.savez_compressed(archive, pictures=film.seen.pictures, rows=film.rows, **numbers)  # type: ignore[arg-type]
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {files.reason(error)}") from error


def status_name(code: int) -> str:
    """Why a reading is not valid, or `valid`."""
    return STATUS[int(code)]
