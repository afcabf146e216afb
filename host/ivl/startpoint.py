"""The start point: where a vehicle hovers before its approach, so that it has the room to reach its speed."""

import math

from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.world import World

HEIGHT_M_MIN = 0.3

Point = tuple[float, float, float]
"""x, y, z in W, m."""


def path_m(world: World, experiment: Experiment) -> float:
    """Length of the path on which a vehicle reaches its approach speed at `approach_accel`, and then holds it, m."""
    record, _ = world.native_model.config()
    speed_mps, accel_mps2 = experiment.speed_mps, float(record["ivl.approach_accel"][0])
    return 0.5 * speed_mps**2 / accel_mps2 + speed_mps * float(world.params.values["start.hold_time"])


def start_point(world: World, experiment: Experiment) -> Point:
    """Where an approach has to begin so that full speed is held before the ceiling, and x = 0 is reached at it.

    `start.room` can lower the start, not move it along x: an approach of shape `region` chooses its own direction.

    Raises:
        ConfigError: That is below the floor.
    """
    record, _ = world.native_model.config()
    h_ceil_m, length_m = float(record["ivl.h_ceil"][0]), path_m(world, experiment)
    speed_mps, angle_rad = experiment.speed_mps, math.radians(experiment.angle_deg)
    drop_m = max(length_m * math.sin(angle_rad), float(world.params.values["start.room"]))
    start = (-length_m * math.cos(angle_rad), 0.0, h_ceil_m - drop_m)
    if start[2] < HEIGHT_M_MIN:
        raise ConfigError(
            f"speed_mps: value {speed_mps:g} m/s at {experiment.angle_deg:g} degrees needs {drop_m:.2f} m below a "
            f"ceiling at {h_ceil_m:.2f} m: the start would be {start[2]:.2f} m above the floor (allowed from "
            f"{HEIGHT_M_MIN} m)"
        )
    return start
