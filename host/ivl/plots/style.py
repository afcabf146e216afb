"""What the figures share: colours that colour-blind readers can tell apart (Okabe and Ito), settings, writing of files.

Every function that makes a figure is decorated with `drawing`: inside, matplotlib's settings are its own defaults and
nobody else's, so that a picture has the same bytes in a notebook, under a user's matplotlibrc, and here; outside,
nothing of it is left.
"""

from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ivl import files
from ivl.errors import ConfigError

BLUE, ORANGE, GREEN, VERMILION = "#0072B2", "#E69F00", "#009E73", "#D55E00"
SKY, PURPLE, GREY, DIM = "#56B4E9", "#CC79A7", "#7F7F7F", "#555555"
SMALL, NORMAL = 8.0, 9.0
DPI = 200
_NO_DATE: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
_depth = 0


def drawing(draw: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Let a function draw with matplotlib's own defaults, whatever the settings around it are."""

    @wraps(draw)
    def drawn(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        global _depth  # noqa: PLW0603 - as global as the settings that it tells of
        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams["svg.hashsalt"] = "ivl"
            _depth += 1
            try:
                return draw(*args, **kwargs)
            finally:
                _depth -= 1

    return drawn


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure, without a window; only inside a function that is decorated with `drawing`."""
    if not _depth:
        raise RuntimeError("a figure is made outside of a function that is decorated with ivl.plots.style.drawing")
    return Figure(figsize=(width_in, height_in), layout="constrained")


def finish(axis: Axes) -> None:
    """Give an axis the project's looks."""
    axis.spines[["top", "right"]].set_visible(False)
    axis.tick_params(labelsize=SMALL)
    for label in (axis.xaxis.label, axis.yaxis.label):
        label.set_fontsize(NORMAL)


def make_folder(folder: Path) -> None:
    """Make a folder for figures, if it is not there.

    Raises:
        ConfigError: It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: the folder cannot be made: {error}") from error


def save(figure: Figure, paths: Sequence[Path], dpi: int = DPI) -> list[Path]:
    """Write the figure to each path, in the format of its suffix; equal figures become equal files.

    Args:
        figure: The figure.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.

    Raises:
        ConfigError: A file cannot be written, or its kind is unknown.
    """
    for path in paths:
        try:
            with files.replacing(path) as part:
                figure.savefig(part, dpi=dpi, metadata=_NO_DATE.get(path.suffix))
        except OSError as error:
            raise ConfigError(f"{path}: the figure cannot be written: {files.reason(error)}") from error
        except ValueError as error:
            raise ConfigError(f"{path}: the figure cannot be written: {error}") from error
    return list(paths)
