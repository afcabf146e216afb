"""What the figures share: colours that colour-blind readers can tell apart (Okabe and Ito), and writing of files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ivl.errors import ConfigError

BLUE, ORANGE, GREEN, VERMILION = "#0072B2", "#E69F00", "#009E73", "#D55E00"
SKY, PURPLE, GREY, DIM = "#56B4E9", "#CC79A7", "#7F7F7F", "#555555"
SMALL, NORMAL = 8.0, 9.0
DPI = 200


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure, without a window and without matplotlib's global state."""
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
    settings: Any = {"svg.hashsalt": "ivl"}
    for path in paths:
        metadata = {"Date": None} if path.suffix == ".svg" else None
        try:
            with mpl.rc_context(settings):
                figure.savefig(path, dpi=dpi, metadata=metadata)
        except (OSError, ValueError) as error:
            raise ConfigError(f"{path}: the figure cannot be written: {error}") from error
    return list(paths)
