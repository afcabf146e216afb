"""CSV as Bitcraze's client writes a log block: `Timestamp` in whole milliseconds, then log variables by their names.

Units and signs are those of the Crazyflie's log variables: angles in degrees, `stabilizer.pitch` positive nose up (the
opposite of a rotation about body y), gyro in deg/s, accelerometer in g. `ivl.*` are the log variables of the app.
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from ivl import files
from ivl.export.flight import Flight, FloatArray

_G_MPS2 = 9.80665


def write(flight: Flight, path: Path) -> None:
    """Write a flight; raises OSError if the file cannot be written."""
    table = columns(flight)
    lines = [",".join(table)]
    lines += [",".join(f"{value:.9g}" for value in row) for row in zip(*table.values(), strict=True)]
    files.write(path, "\n".join(lines) + "\n")


def columns(flight: Flight) -> dict[str, npt.NDArray[np.float64]]:
    """Log variables by name, each of shape (n,), in the Crazyflie's units."""
    table = {"Timestamp": np.rint(1000 * flight.t_s)}
    table |= _named("stateEstimate", "x y z", flight.vector("p_WB_m", 3))
    table |= _named("stateEstimate", "vx vy vz", flight.vector("v_WB_mps", 3))
    table |= _named("stateEstimate", "qx qy qz qw", flight.vector("q_WB", 4))
    table |= _named("stabilizer", "roll pitch yaw", euler_deg(flight.vector("q_WB", 4)))
    table |= _named("gyro", "x y z", np.rad2deg(flight.vector("w_B_radps", 3)))
    if "f_B_mps2_1" in flight.columns:
        table |= _named("acc", "x y z", flight.vector("f_B_mps2", 3) / _G_MPS2)
    table |= _named("ivl", "thrust1 thrust2 thrust3 thrust4", flight.vector("thrust_cmd_N", 4))
    logs = {"phase": "phase", "d_ceil": "d_sensed_m", "rrev": "rrev_per_s", "of_y": "of_y_radps"}
    cues = np.column_stack([np.nan_to_num(flight.columns[name].astype(np.float64)) for name in logs.values()])
    return table | _named("ivl", " ".join(logs), cues)


def euler_deg(q: FloatArray) -> FloatArray:
    """Roll, pitch and yaw as the Crazyflie logs them, degrees.

    Args:
        q: Attitude, shape (n, 4): x, y, z, w.
    """
    x, y, z, w = q.T
    roll = np.arctan2(2 * (y * z + w * x), w * w - x * x - y * y + z * z)
    pitch = np.arcsin(np.clip(2 * (x * z - w * y), -1, 1))
    yaw = np.arctan2(2 * (x * y + w * z), w * w + x * x - y * y - z * z)
    return np.asarray(np.rad2deg(np.column_stack([roll, pitch, yaw])))


def _named(group: str, names: str, values: FloatArray) -> dict[str, npt.NDArray[np.float64]]:
    return {f"{group}.{name}": column for name, column in zip(names.split(), values.T, strict=True)}
