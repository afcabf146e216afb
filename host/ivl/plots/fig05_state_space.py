"""Fig. 5: the policy region in state space (Vx, Vz, d), coloured by landing rate, with two plane views."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd  # type: ignore[import-untyped]
from matplotlib.axes import Axes

from ivl.analysis.region import STATE
from ivl.plots import campaign, spaces, style
from ivl.plots.campaign import Campaign
from ivl.plots.spaces import RATE_MAP

NAME = "fig05_state_space"


@style.drawing
def draw(data: Campaign, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw one point per trial.

    Args:
        data: One vehicle, gear set, gear and learner.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.
    """
    found = campaign.points(data)
    figure = style.new_figure(7.5, 3.9)
    space, place = spaces.space_and_planes(figure, 0.58)
    image = scatter_3d(space, found, STATE, found["rate_norm"], RATE_MAP, (0.0, 1.0))
    space.view_init(elev=20, azim=-120)
    axes = figure.subplots(2, 1)
    for axis, (x, y) in zip(axes, (("vx_mps", "vz_mps"), ("vz_mps", "d_ceil_m")), strict=True):
        scatter_2d(axis, found, x, y)
    spaces.color_bar(figure, image, place, "landing rate of the trial")
    figure.suptitle(
        f"{data.title('gear', 'gear_set', 'vehicle', 'learner')}; success (rate ≥ 0.8) in $(V_x, V_z, d)$: "
        f"{campaign.auc_text(found, 'state')}",
        fontsize=style.NORMAL,
    )
    return style.save(figure, paths, dpi)


def scatter_3d(
    axis: Any,
    found: pd.DataFrame,
    columns: tuple[str, str, str],
    color: Any,
    color_map: str,
    limits: tuple[float, float],
) -> Any:
    """Points in space, failures small; returns what a colour bar needs."""
    size = found["success"].map({True: 11.0, False: 5.0}).astype(float)
    image = axis.scatter(
        *(found[c] for c in columns), c=color, s=size, cmap=color_map, vmin=limits[0], vmax=limits[1],
        depthshade=False, linewidths=0.15, edgecolors=style.GREY,
    )  # fmt: skip
    spaces.label_3d(axis, columns)
    return image


def scatter_2d(axis: Axes, found: pd.DataFrame, x: str, y: str) -> None:
    """Points in a plane, coloured by landing rate."""
    size = found["success"].map({True: 9.0, False: 4.0}).astype(float)
    axis.scatter(
        found[x], found[y], c=found["rate_norm"], s=size, cmap=RATE_MAP, vmin=0, vmax=1, linewidths=0.15,
        edgecolors=style.GREY,
    )  # fmt: skip
    spaces.label_2d(axis, x, y)
