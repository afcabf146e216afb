"""Surfaces to look at: squares of 2 m that repeat, with 2 mm a texel."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ivl.camera.native import Texture
from ivl.errors import ArgumentError

Image = npt.NDArray[np.float64]
N_TEXELS = 1024
LENGTH_M = 2.0


def _noise(rng: np.random.Generator, contrast: float) -> Image:
    """Grain of every size from 8 mm to 0.5 m, as much contrast in each octave; `contrast` is its standard deviation."""
    waves = np.fft.fftfreq(N_TEXELS) * N_TEXELS
    k = np.hypot(*np.meshgrid(waves, waves))
    inside = (k >= LENGTH_M / 0.5) & (k < LENGTH_M / 0.008)
    amplitude = np.where(inside, 1.0 / np.maximum(k, 1.0), 0.0)
    grain = np.fft.ifft2(np.fft.fft2(rng.normal(size=(N_TEXELS, N_TEXELS))) * amplitude).real
    return np.asarray(0.5 + contrast * grain / grain.std())


def _cells(length_m: float) -> npt.NDArray[np.int64]:
    """Number of the cell that each texel of a row is in."""
    return np.arange(N_TEXELS) * round(LENGTH_M / length_m) // N_TEXELS


def noise(rng: np.random.Generator) -> Image:
    """Plaster with grain of every size, 0.18 of the mean brightness's range."""
    return _noise(rng, 0.18)


def low_contrast(rng: np.random.Generator) -> Image:
    """The same with a sixth of the contrast: 6 grey values of 200."""
    return _noise(rng, 0.03)


def dots(rng: np.random.Generator) -> Image:
    """500 dark dots of 12 to 40 mm radius a square, at random."""
    image = np.full((N_TEXELS, N_TEXELS), 0.7)
    for _ in range(500):
        x, y, radius = *rng.uniform(0, N_TEXELS, 2), rng.uniform(6, 20)
        reach = np.arange(-int(radius) - 1, int(radius) + 2)
        inside = (int(y) + reach - y)[:, None] ** 2 + (int(x) + reach - x)[None] ** 2 < radius**2
        rows, columns = np.ix_((int(y) + reach) % N_TEXELS, (int(x) + reach) % N_TEXELS)
        image[rows, columns] = np.where(inside, 0.2, image[rows, columns])
    return image


def panels(rng: np.random.Generator) -> Image:
    """Panels of 0.2 m, each of its own grey within 12 %, with dark seams of 6 mm and nothing else."""
    cell = _cells(0.2)
    grey = 0.55 + 0.12 * rng.uniform(-1, 1, (cell[-1] + 1, cell[-1] + 1))
    seam = (np.arange(N_TEXELS) * (cell[-1] + 1) % N_TEXELS) < 3 * (cell[-1] + 1)
    image = grey[cell][:, cell]
    return np.where(seam[:, None] | seam[None], 0.15, image)


def checks(rng: np.random.Generator) -> Image:
    """A chess-board of 0.1 m; it looks the same after 0.2 m."""
    del rng
    cell = _cells(0.1)
    return np.where((cell[:, None] + cell[None]) % 2 == 1, 0.75, 0.3)


def lines(rng: np.random.Generator) -> Image:
    """Stripes of 50 mm along x, in which no motion along x can be seen."""
    del rng
    return np.where(_cells(0.05)[:, None] % 2 == 1, 0.75, 0.3) * np.ones((1, N_TEXELS))


def white(rng: np.random.Generator) -> Image:
    """A plain wall."""
    del rng
    return np.full((N_TEXELS, N_TEXELS), 0.7)


TEXTURES: dict[str, Callable[[np.random.Generator], Image]] = {
    "noise": noise,
    "dots": dots,
    "low_contrast": low_contrast,
    "panels": panels,
    "checks": checks,
    "white": white,
    "lines": lines,
}


def from_picture(path: Path, length_m: float = LENGTH_M) -> Texture:
    """A surface of a picture: cut to a square in its middle, and resampled to a power of two.

    Raises:
        ArgumentError: The file is no picture.
    """
    import matplotlib.image

    try:
        image = np.asarray(matplotlib.image.imread(path), dtype=np.float64)
    except (OSError, ValueError, SyntaxError) as error:
        raise ArgumentError(f"{path}: not a picture ({error})") from error
    image = image / 255.0 if image.max() > 1.0 else image
    grey = image if image.ndim == 2 else image[..., :3] @ np.array([0.299, 0.587, 0.114])
    side = min(grey.shape)
    top, left = (grey.shape[0] - side) // 2, (grey.shape[1] - side) // 2
    at = np.arange(N_TEXELS) * side // N_TEXELS
    return Texture(grey[top + at][:, left + at], length_m)


@cache
def make(name: str, length_m: float = LENGTH_M, seed: int = 0) -> Texture:
    """A surface by its name, or of a picture file (`.png`, `.jpg`), as a square of this side that repeats.

    Raises:
        ArgumentError: There is no surface of that name, and no such file.
    """
    if Path(name).suffix.lower() in (".png", ".jpg", ".jpeg"):
        return from_picture(Path(name), length_m)
    if name not in TEXTURES:
        raise ArgumentError(f"no surface {name!r}: {', '.join(TEXTURES)}, or a picture (.png)")
    return Texture(TEXTURES[name](np.random.default_rng([seed, list(TEXTURES).index(name)])), length_m)
