"""Pictures that were taken elsewhere, with times, attitudes and truth, and how wrong the estimator is with them.

    film = bench.read(Path("rail/"))
    bench.figures([film])

A file `.npz` is what `ivl rollout --frames FILE.npz` writes. A folder has `camera.yaml`, the numbers of the camera that
are not its defaults (`width: 320`), and `frames.csv`, a row for each picture; its columns are `COLUMNS`.

Axes of the surface: x forward along it, y left, z into it; so the distance is -z. Attitudes turn vectors of the body
into these axes; their components stand in the order x, y, z, w.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import numpy.typing as npt

from ivl.camera import fit, native, study
from ivl.camera.film import Film
from ivl.camera.native import ROW_DOUBLES, Camera
from ivl.errors import ArgumentError, ConfigError
from ivl.flight import table
from ivl.settings import read_mapping

TABLE, CAMERA = "frames.csv", "camera.yaml"
_TRUE = ("t_s", "p_x_m", "p_y_m", "p_z_m", "q_x", "q_y", "q_z", "q_w", "v_x_mps", "v_y_mps", "v_z_mps")
_TOLD = ("told_q_x", "told_q_y", "told_q_z", "told_q_w")
COLUMNS = ("file", *_TRUE, *_TOLD)
"""Columns of `frames.csv`: the picture, the middle of its exposure, true place, attitude and velocity of the vehicle,
and the attitude that the estimator gets."""
_FILES_MAX_BYTES = 2**30
_LEAST = 3  # pictures: the first pair has nothing to compare with
_NORM_SLACK = 0.1
_LARGEST = 1e7  # of seconds, metres, and their rates

Grey = npt.NDArray[np.uint8]
Rows = npt.NDArray[np.float64]


def read(path: Path) -> Film:
    """Read a sequence and let the estimator look at its pictures.

    Args:
        path: A file `.npz` or a folder.

    Raises:
        ConfigError: It is none; the message names the file, the place in it, and what is wrong there.
    """
    camera, pictures, rows = _of_folder(path) if path.is_dir() else _of_file(path)
    if len(rows) < _LEAST:
        raise ConfigError(f"{path}: has {len(rows)} pictures (needed {_LEAST} or more)")
    if not (rows[:, 3] < 0.0).all():
        raise ConfigError(
            f"{path}: picture {int(np.argmax(rows[:, 3] >= 0.0)) + 1}: p_z_m must be below 0: z is into the surface"
        )
    try:
        return Film(camera, rows, native.estimate(camera, pictures, rows))
    except ArgumentError as error:
        raise ConfigError(f"{path}: {error}") from error


def figures(films: Sequence[Film], name: str) -> study.Figures:
    """How wrong valid readings are: those whose true RREV is within `study.RREV_RANGE`, or all if none is.

    Raises:
        ConfigError: There is no reading.
    """
    every = fit.of_films(list(films))
    rows = np.column_stack(
        [every.rrev_per_s, every.valid, every.rrev_per_s + every.error_per_s, every.sigma_per_s, every.of_y_error_radps]
    )
    low, high = study.RREV_RANGE
    inside = rows[(rows[:, 0] >= low) & (rows[:, 0] <= high)]
    chosen = inside if len(inside) else rows
    if not len(chosen):
        raise ConfigError(f"{name}: has no reading to judge")
    return replace(study.figures(study.Case(name, ""), chosen), failed=())


def model(films: Sequence[Film]) -> fit.Model:
    """The noise model of the readings, as `ivl camera fit` makes it of rendered ones.

    Raises:
        ArgumentError: There are too few valid readings.
    """
    step_s = np.concatenate([np.diff(film.t_s) for film in films])
    rate_hz = float(1.0 / np.median(step_s))
    return fit.of_errors(fit.of_films(list(films)), rate_hz, 0.5 / rate_hz)


def _of_file(path: Path) -> tuple[Camera, Grey, Rows]:
    if path.suffix != ".npz":
        raise ConfigError(f"{path}: is no sequence of pictures (allowed: a folder with {TABLE}, or a file .npz)")
    arrays = table.read_arrays(path)
    for name in ("pictures", "rows"):
        if name not in arrays:
            raise ConfigError(f"{path}: array {name!r} is missing; there are {table.shorten(', '.join(arrays), 100)}")
    pictures, rows = arrays.pop("pictures"), arrays.pop("rows")
    if pictures.dtype != np.uint8 or pictures.ndim != 3:
        raise ConfigError(f"{path}: pictures: {pictures.dtype} of shape {pictures.shape} (needed uint8, 3 dimensions)")
    if rows.dtype.kind != "f" or rows.shape != (len(pictures), ROW_DOUBLES) or not np.isfinite(rows).all():
        needed = f"{len(pictures)} x {ROW_DOUBLES} finite numbers"
        raise ConfigError(f"{path}: rows: must be {needed}, not {rows.dtype} of shape {rows.shape}")
    if not (np.diff(rows[:, 0]) > 0.0).all():
        raise ConfigError(f"{path}: rows: times must rise")
    numbers = {name.removeprefix("camera_"): value for name, value in arrays.items() if name.startswith("camera_")}
    for name, value in numbers.items():
        if value.shape != () or value.dtype.kind not in "iuf":
            raise ConfigError(f"{path}: camera_{name}: must be one number")
    return _camera(path, {name: float(value) for name, value in numbers.items()}), pictures, _unit(path, rows)


def _of_folder(folder: Path) -> tuple[Camera, Grey, Rows]:
    told = table.read_csv(folder / TABLE)
    told.need(COLUMNS, "a sequence of pictures")
    numbers = read_mapping(folder / CAMERA) if (folder / CAMERA).exists() else {}
    camera = _camera(folder / CAMERA, numbers)
    rows = np.zeros((len(told), ROW_DOUBLES))
    rows[:, 0] = table.clock(told, "t_s", 1.0)
    for i, name in enumerate(_TRUE[1:], 1):
        rows[:, i] = told.numbers(name, needed=True)
    for i, name in enumerate(_TOLD, ROW_DOUBLES - len(_TOLD)):
        rows[:, i] = told.numbers(name, needed=True)
    if len(told) * camera.shape[0] * camera.shape[1] > _FILES_MAX_BYTES:
        raise ConfigError(f"{folder / TABLE}: {len(told)} pictures are too many (allowed {_FILES_MAX_BYTES} pixels)")
    pictures = np.empty((len(told), *camera.shape), dtype=np.uint8)
    for i, name in enumerate(told.text("file")):
        if name != Path(name).name:
            raise told.fault(i, "file", f"{table.shorten(name)!r}: must be a name in this folder")
        pictures[i] = _picture(folder / name, camera.shape)
    return camera, pictures, _unit(folder / TABLE, rows)


def _picture(path: Path, shape: tuple[int, int]) -> Grey:
    try:
        image = np.asarray(matplotlib.image.imread(path))
    except (OSError, ValueError, SyntaxError) as error:
        raise ConfigError(f"{path}: is no picture: {table.shorten(str(error), 100)}") from error
    if image.shape[:2] != shape:
        raise ConfigError(
            f"{path}: has {image.shape[1]} x {image.shape[0]} pixels, the camera has {shape[1]} x {shape[0]}"
        )
    whole = image.astype(np.float64) * (1.0 if image.dtype == np.uint8 else 255.0)
    grey = whole if whole.ndim == 2 else whole[..., :3].mean(axis=2)
    return np.clip(np.rint(grey), 0.0, 255.0).astype(np.uint8)


def _camera(path: Path, numbers: dict[str, Any]) -> Camera:
    for name, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ConfigError(f"{path}: {name}: must be a number, not {table.shorten(str(value))!r}")
    try:
        return Camera(**numbers)
    except ArgumentError as error:
        raise ConfigError(f"{path}: {error}") from error


def _unit(path: Path, rows: Rows) -> Rows:
    """Rows whose quaternions have the length 1, and whose numbers are of this world."""
    rows = rows.copy()
    huge = np.abs(rows) > _LARGEST
    if huge.any():
        row, column = np.argwhere(huge)[0]
        raise ConfigError(f"{path}: picture {row + 1}: {rows[row, column]:g} is beyond {_LARGEST:g}")
    for first, what in ((4, "q"), (ROW_DOUBLES - 4, "told_q")):
        norm = np.linalg.norm(rows[:, first : first + 4], axis=1)
        bad = np.abs(norm - 1.0) > _NORM_SLACK
        if bad.any():
            row = int(np.argmax(bad))
            raise ConfigError(
                f"{path}: picture {row + 1}: {what}: a quaternion of length {norm[row]:.3g}, it must be 1"
            )
        rows[:, first : first + 4] /= norm[:, None]
    return rows
