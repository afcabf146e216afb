"""Axes that several figures share: labels, the view in space with planes beside it, the colours of a rate."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ivl.plots import style

RATE_MAP = "cividis_r"
"""Landing rate: even in lightness, the same to readers with and without colour vision; much ink is much success."""
LABELS = {
    "vx_mps": "$V_x$ (m/s)",
    "vz_mps": "$V_z$ (m/s)",
    "d_ceil_m": "$d$ (m)",
    "rrev_per_s": "RREV (1/s)",
    "of_y_radps": "$OF_y$ (rad/s)",
    "moment_Nmm": "$M_{yd}$ (N mm)",
    "speed_mps": "$V$ (m/s)",
    "angle_deg": r"$\varphi$ (°)",
}


def space_and_planes(figure: Figure, from_x: float) -> tuple[Any, Any]:
    """A three-dimensional axis at the left and a place for a colour bar below it; the layout gets the rest.

    The automatic layout leaves wide margins around three-dimensional axes, so these are placed by hand.

    Args:
        figure: The figure.
        from_x: Where the rest begins, as a share of the width.
    """
    engine: Any = figure.get_layout_engine()
    engine.set(rect=(from_x, 0.0, 1.0 - from_x, 1.0))
    space: Any = figure.add_axes((0.0, 0.16, from_x - 0.02, 0.75), projection="3d")
    return space, figure.add_axes((0.2 * from_x, 0.11, 0.6 * from_x, 0.025))


def label_3d(axis: Any, columns: tuple[str, str, str]) -> None:
    """Labels, ticks and looks of a three-dimensional axis."""
    for name, column in zip("xyz", columns, strict=True):
        getattr(axis, f"set_{name}label")(LABELS[column], fontsize=style.NORMAL, labelpad=1)
        one = getattr(axis, f"{name}axis")
        one.set_pane_color((1.0, 1.0, 1.0, 1.0))
        one._axinfo["grid"].update(color="#E0E0E0", linewidth=0.5)
        one.set_major_locator(MaxNLocator(4))
    axis.tick_params(labelsize=style.SMALL, pad=0)
    axis.set_box_aspect((1, 1, 0.85), zoom=0.95)


def label_2d(axis: Axes, x: str, y: str) -> None:
    """Labels and looks of a plane axis."""
    axis.set_xlabel(LABELS[x])
    axis.set_ylabel(LABELS[y])
    style.finish(axis)


def color_bar(figure: Figure, image: Any, place: Axes, label: str) -> None:
    """A horizontal colour bar."""
    bar = figure.colorbar(image, cax=place, orientation="horizontal")
    bar.set_label(label, fontsize=style.NORMAL)
    bar.ax.tick_params(labelsize=style.SMALL)
