"""Camera, surface and estimator of the native library; names, ranges and offsets come from its own tables."""

import ctypes
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.errors import ArgumentError, NativeError

ROW_DOUBLES = (
    18  # of a motion: time, position, quaternion x y z w, velocity, rates, quaternion as the estimator gets it
)
ONE_Q16 = 65536.0  # the estimator's unit
STATUS = ("valid", "first", "input", "texture", "residual", "range", "uncertain")  # ivl_vision_status_t
_RESULTS = ("", "the estimator refuses this camera", "there is not enough memory")


@cache
def _c() -> Any:
    c = native.library().c
    ptr, size, c_int, u64 = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_uint64
    for name, restype, argtypes in (
        ("ivl_sil_texture_create", ptr, (ptr, ctypes.c_uint32, ctypes.c_double)),
        ("ivl_sil_texture_free", None, (ptr,)),
        ("ivl_sil_camera_run", c_int, (ptr, ptr, ptr, size, u64, u64, ptr, ptr)),
        ("ivl_sil_vision_run", c_int, (ptr, ptr, ptr, size, ptr)),
    ):
        function = getattr(c, name)
        function.restype, function.argtypes = restype, list(argtypes)
    return c


@cache
def parameters() -> Mapping[str, native.Field]:
    """The numbers of a camera, by name, with unit, range and default."""
    return native.library().table_of("ivl_sil_camera_table")[0]


@cache
def reading_dtype() -> np.dtype[np.void]:
    """What the estimator says to a picture (ivl_vision_out_t)."""
    return native.library().table_of("ivl_sil_vision_table")[1]


class Camera:
    """A camera with lens, mount, light, and the estimator that knows its calibration."""

    def __init__(self, **numbers: float) -> None:
        """Take the library's defaults, and these numbers instead of some of them.

        Raises:
            ArgumentError: There is no such number, or it is out of its range.
        """
        values = {name: field.default for name, field in parameters().items()}
        for name, value in numbers.items():
            field = parameters().get(name)
            if field is None:
                raise ArgumentError(f"a camera has no number {name!r}; it has {', '.join(parameters())}")
            if not field.lo <= value <= field.hi:
                raise ArgumentError(
                    f"camera: {name} = {value:g} is not within {field.lo:g} .. {field.hi:g} {field.unit}"
                )
            values[name] = float(value)
        self.values = np.array([values[name] for name in parameters()], dtype=np.float64)

    def __getitem__(self, name: str) -> float:
        """One of the numbers."""
        return float(self.values[list(parameters()).index(name)])

    @property
    def names(self) -> tuple[str, ...]:
        """Its numbers by name."""
        return tuple(parameters())

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of a picture."""
        width = 320 if self["width"] > 240.0 else 160
        return width * 3 // 4, width


class Texture:
    """The look of a surface: a square that repeats."""

    def __init__(self, brightness: npt.NDArray[np.float64], length_m: float) -> None:
        """Keep a copy.

        Args:
            brightness: 0 .. 1, shape (n, n) with n a power of two; rows are y, columns x.
            length_m: Side of the square.

        Raises:
            ArgumentError: The shape is another.
        """
        texels = np.ascontiguousarray(np.clip(brightness, 0.0, 1.0) * 65535.0, dtype=np.uint16)
        if texels.ndim != 2 or texels.shape[0] != texels.shape[1]:
            raise ArgumentError(f"a surface is a square, not {texels.shape}")
        handle = _c().ivl_sil_texture_create(texels.ctypes.data, texels.shape[0], float(length_m))
        if not handle:
            raise ArgumentError(
                f"a surface of {texels.shape[0]} pixels and {length_m:g} m: neither a power of two, nor a length"
            )
        self.handle = ctypes.c_void_p(handle)
        weakref.finalize(self, _c().ivl_sil_texture_free, self.handle)


@dataclass(frozen=True)
class Seen:
    """Pictures along a motion and what the estimator said to them.

    Attributes:
        readings: One record of `reading_dtype()` a picture.
        pictures: Shape (n, rows, columns), or None if nobody asked for them.
    """

    readings: npt.NDArray[np.void]
    pictures: npt.NDArray[np.uint8] | None

    @property
    def valid(self) -> npt.NDArray[np.bool_]:
        """Which readings are cues."""
        return np.asarray(self.readings["status"] == 0)

    def number(self, name: str) -> npt.NDArray[np.float64]:
        """A cue or its standard deviation, 1/s or rad/s: `rrev`, `of_x`, `of_y`, `sigma_rrev`, `sigma_of`."""
        return np.asarray(self.readings[name] / ONE_Q16, dtype=np.float64)


def _check(result: int) -> None:
    if result:
        raise NativeError(f"camera: {_RESULTS[result]}")


def _rows(rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    rows = np.ascontiguousarray(rows, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != ROW_DOUBLES:
        raise ArgumentError(f"a motion has {ROW_DOUBLES} numbers a row, not the shape {rows.shape}")
    return rows


def look(
    camera: Camera,
    texture: Texture,
    rows: npt.NDArray[np.float64],
    *,
    seed: int = 0,
    stream: int = 0,
    pictures: bool = False,
) -> Seen:
    """Render a motion and let the estimator look at it.

    Args:
        camera: The camera.
        texture: The surface.
        rows: The motion, shape (n, 18), in the axes of the surface.
        seed: Of the noise.
        stream: Number of the motion among those of the seed.
        pictures: Whether to return the pictures, too.
    """
    rows = _rows(rows)
    readings = np.zeros(len(rows), dtype=reading_dtype())
    grey = np.zeros((len(rows), *camera.shape), dtype=np.uint8) if pictures else None
    _check(
        _c().ivl_sil_camera_run(
            camera.values.ctypes.data,
            texture.handle,
            rows.ctypes.data,
            len(rows),
            seed,
            stream,
            None if grey is None else grey.ctypes.data,
            readings.ctypes.data,
        )
    )
    return Seen(readings, grey)


def estimate(camera: Camera, pictures: npt.NDArray[np.uint8], rows: npt.NDArray[np.float64]) -> Seen:
    """Let the estimator look at pictures that are there; of `rows` only time and told attitude count.

    Raises:
        ArgumentError: The pictures have another shape than the camera's.
    """
    rows = _rows(rows)
    pictures = np.ascontiguousarray(pictures, dtype=np.uint8)
    if pictures.shape != (len(rows), *camera.shape):
        raise ArgumentError(f"pictures of the shape {pictures.shape}, the camera's are {(len(rows), *camera.shape)}")
    readings = np.zeros(len(rows), dtype=reading_dtype())
    _check(
        _c().ivl_sil_vision_run(
            camera.values.ctypes.data, pictures.ctypes.data, rows.ctypes.data, len(rows), readings.ctypes.data
        )
    )
    return Seen(readings, pictures)
