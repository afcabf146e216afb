"""A film as a video: each picture four times as large, the flow that its reading tells, and the cues beside the truth.

MP4 goes through the encoder that the package imageio-ffmpeg brings along; GIF through Pillow.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from ivl import files
from ivl.camera.film import Film, Truth, status_name
from ivl.camera.film import write as write_pictures
from ivl.errors import ArgumentError, ConfigError
from ivl.optional import needed

SUFFIXES = (".mp4", ".gif")
FRAMES_PER_S = 10
"""Slower than life: a landing is over in a second."""
_WIDTH, _HEIGHT, _STRIP = 640, 480, 160
_ARROW_S = 0.05  # motion that an arrow shows
_GRID = (9, 7)
_GREEN, _RED, _TRUE, _INK, _PAPER = (0, 200, 120), (230, 80, 40), (120, 170, 255), (235, 235, 235), (24, 24, 24)
_RREV_MAX_PER_S = 8.0  # upper end of the curve


def check_suffix(path: Path) -> None:
    """Refuse a path whose kind is unknown, before anything is flown; and an encoder that is missing."""
    if path.suffix not in (*SUFFIXES, ".npz"):
        raise ConfigError(f"--frames {path}: unknown kind of file (allowed {', '.join(SUFFIXES)}, .npz)")
    if path.suffix == ".mp4":
        needed("imageio_ffmpeg", "video")


def write(film: Film, path: Path) -> None:
    """Draw every picture of a film into a video.

    Raises:
        ArgumentError: The film has no pictures.
        ConfigError: The file cannot be written.
        MissingError: The encoder is not installed.
    """
    if film.seen.pictures is None or len(film) < 2:
        raise ArgumentError("a video needs a film with its pictures, two or more")
    try:
        with files.replacing(path) as part:
            if path.suffix == ".gif":
                _gif(film, part)
            else:
                _mp4(film, part)
    except OSError as error:
        raise ConfigError(f"{path}: the video cannot be written: {error}") from error


def _gif(film: Film, path: Path) -> None:
    first, *rest = (Image.fromarray(frame).quantize(64, Image.Quantize.FASTOCTREE) for frame in frames(film))
    first.save(path, save_all=True, append_images=rest, duration=1000 // FRAMES_PER_S, loop=0)


def _mp4(film: Film, path: Path) -> None:
    encoder = needed("imageio_ffmpeg", "video").write_frames(
        str(path), (_WIDTH, _HEIGHT + _STRIP), fps=FRAMES_PER_S, codec="libx264", quality=7, macro_block_size=16
    )
    encoder.send(None)
    try:
        for frame in frames(film):
            encoder.send(frame)
    finally:
        encoder.close()


def save(film: Film, path: Path) -> None:
    """A video, or with the suffix .npz the pictures as they are (`ivl.camera.film.write`)."""
    if path.suffix == ".npz":
        write_pictures(film, path)
    else:
        write(film, path)


def frames(film: Film) -> Iterator[npt.NDArray[np.uint8]]:
    """Each picture as drawn, red, green and blue."""
    truth, curve = film.truth(), film.truth(film.t_s)
    for i in range(len(film)):
        yield frame(film, i, truth, curve)


def frame(film: Film, i: int, truth: Truth, curve: Truth) -> npt.NDArray[np.uint8]:
    """One picture as drawn: `truth` at the instants of the readings, `curve` at those of the pictures."""
    if film.seen.pictures is None:
        raise ArgumentError("this film was made without its pictures")
    picture = Image.fromarray(film.seen.pictures[i]).resize((_WIDTH, _HEIGHT), Image.Resampling.NEAREST)
    canvas = Image.new("RGB", (_WIDTH, _HEIGHT + _STRIP), _PAPER)
    canvas.paste(picture.convert("RGB"), (0, 0))
    draw = ImageDraw.Draw(canvas)
    if film.seen.valid[i]:
        _arrows(draw, film, i)
    _text(draw, film, i, truth)
    _curve(draw, film, i, curve)
    return np.asarray(canvas)


def _motion(film: Film, i: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Normal of the surface, and velocity over distance as the reading tells it, both in the camera's axes."""
    x, y, z, w = film.rows[i, 14:18]
    normal = np.array([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)])
    forward = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    forward /= np.linalg.norm(forward)
    left = np.cross(normal, forward)
    rrev, of_x, of_y = (film.seen.number(name)[i] for name in ("rrev", "of_x", "of_y"))
    return normal, rrev * normal - of_y * forward + of_x * left


def _arrows(draw: ImageDraw.ImageDraw, film: Film, i: int) -> None:
    """How points of the surface move in the picture, without the body's rotation."""
    normal, speed = _motion(film, i)
    scale = _WIDTH / film.camera.shape[1]
    focal = film.camera["focal"] * scale
    for px in (np.arange(_GRID[0]) + 0.5) * _WIDTH / _GRID[0]:
        for py in (np.arange(_GRID[1]) + 0.5) * _HEIGHT / _GRID[1]:
            u, v = (px - 0.5 * _WIDTH) / focal, (py - 0.5 * _HEIGHT) / focal
            facing = float(normal @ (u, v, 1.0)) * focal * _ARROW_S
            to = (px + facing * (u * speed[2] - speed[0]), py + facing * (v * speed[2] - speed[1]))
            draw.line((px, py, *to), fill=_GREEN, width=2)
            draw.ellipse((to[0] - 3, to[1] - 3, to[0] + 3, to[1] + 3), fill=_GREEN)


def _text(draw: ImageDraw.ImageDraw, film: Film, i: int, truth: Truth) -> None:
    seen, status = film.seen, status_name(film.seen.readings["status"][i])
    lines = [(f"t {film.t_s[i]:.3f} s   d {truth.d_m[i]:.2f} m   picture {i}", _INK)]
    if seen.valid[i]:
        rrev, sigma, of_y = (seen.number(name)[i] for name in ("rrev", "sigma_rrev", "of_y"))
        lines += [
            (f"RREV {rrev:6.3f} +- {sigma:.3f} 1/s   true {truth.rrev_per_s[i]:6.3f}", _GREEN),
            (f"OF_y {of_y:6.3f} rad/s   true {truth.of_y_radps[i]:6.3f}", _GREEN),
            (f"{int(seen.readings['frames'][i])} frames apart   quality {int(seen.readings['quality'][i])}", _INK),
        ]
    else:
        lines += [(f"no reading: {status}", _RED), (f"RREV true {truth.rrev_per_s[i]:6.3f} 1/s", _TRUE)]
    for k, (line, colour) in enumerate(lines):
        draw.text((12, _HEIGHT + 12 + 18 * k), line, fill=colour)


def _curve(draw: ImageDraw.ImageDraw, film: Film, i: int, curve: Truth) -> None:
    """RREV over time: true as a line, readings as dots."""
    left, right, top, bottom = 340, _WIDTH - 12, _HEIGHT + 12, _HEIGHT + _STRIP - 12
    span = max(float(film.t_s[-1] - film.t_s[0]), 1.0e-6)

    def place(t_s: float, rrev: float) -> tuple[float, float]:
        part = min(max(rrev / _RREV_MAX_PER_S, 0.0), 1.0)
        return left + (right - left) * (t_s - film.t_s[0]) / span, bottom - (bottom - top) * part

    draw.rectangle((left, top, right, bottom), outline=(90, 90, 90))
    draw.line([place(t, r) for t, r in zip(film.t_s, curve.rrev_per_s, strict=True)], fill=_TRUE, width=2)
    sampled, rrev = film.sampled_s(), film.seen.number("rrev")
    for k in range(i + 1):
        if film.seen.valid[k]:
            x, y = place(float(sampled[k]), float(rrev[k]))
            draw.ellipse((x - 2, y - 2, x + 2, y + 2), fill=_GREEN)
    draw.text((left + 4, top + 2), f"RREV, 0 to {_RREV_MAX_PER_S:g} 1/s", fill=_INK)
