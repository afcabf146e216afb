"""The augmented space (RREV, OF_y, d) as one view in space and slices by distance: shared by Figs. 7 and 8."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from ivl.plots import spaces, style
from ivl.plots.campaign import Campaign
from ivl.plots.fig05_state_space import scatter_3d
from ivl.plots.fig06_flow_space import limit

N_SLICES = 4


@dataclass(frozen=True)
class Quantity:
    """What the colour shows."""

    column: str
    label: str
    color_map: str
    limits: tuple[float, float]


@style.drawing
def draw_space(
    data: Campaign, found: pd.DataFrame, quantity: Quantity, title: str, paths: Sequence[Path], dpi: int
) -> list[Path]:
    """Points in space on the left; on the right the same points in slices of d that hold as many points each."""
    figure = style.new_figure(7.5, 4.1)
    space, place = spaces.space_and_planes(figure, 0.5)
    shown = _inner(found)
    image = scatter_3d(
        space,
        shown,
        ("of_y_radps", "rrev_per_s", "d_ceil_m"),
        shown[quantity.column],
        quantity.color_map,
        quantity.limits,
    )
    space.view_init(elev=18, azim=-55)
    spaces.color_bar(figure, image, place, quantity.label)
    axes = figure.subplots(2, 2).flat
    for i, (axis, (low_m, high_m, part)) in enumerate(zip(axes, _slices(shown), strict=False)):
        axis.scatter(
            part["of_y_radps"], part["rrev_per_s"], c=part[quantity.column], s=9, cmap=quantity.color_map,
            vmin=quantity.limits[0], vmax=quantity.limits[1], linewidths=0.15,
            edgecolors=style.GREY,
        )  # fmt: skip
        limit(axis, shown)
        spaces.label_2d(axis, "of_y_radps", "rrev_per_s")
        axis.set_title(f"$d$ = {low_m:.2f} to {high_m:.2f} m", fontsize=style.SMALL)
        if i % 2:
            axis.set_ylabel("")
            axis.tick_params(labelleft=False)
        if i < 2:
            axis.set_xlabel("")
            axis.tick_params(labelbottom=False)
    figure.suptitle(f"{data.title('gear', 'gear_set', 'vehicle', 'learner')}\n{title}", fontsize=style.NORMAL)
    return style.save(figure, paths, dpi)


def _inner(found: pd.DataFrame) -> pd.DataFrame:
    """Successes, and the failures that are not stray: within the limits that Fig. 6 uses."""
    keep = np.ones(len(found), dtype=bool)
    for column in ("of_y_radps", "rrev_per_s", "d_ceil_m"):
        keep &= found[column].between(*found[column].quantile([0.01, 0.99]))
    return found[keep | found["success"]]


def _slices(found: pd.DataFrame) -> list[tuple[float, float, pd.DataFrame]]:
    """At most `N_SLICES` slices by distance with as many points each: (from, to, points)."""
    d_m = found["d_ceil_m"]
    edges = np.unique(d_m.quantile(np.linspace(0, 1, N_SLICES + 1)))
    if len(edges) < 2:
        return [(float(d_m.min()), float(d_m.max()), found)]
    index = np.clip(np.searchsorted(edges, d_m, side="right") - 1, 0, len(edges) - 2)
    return [(float(edges[k]), float(edges[k + 1]), found[index == k]) for k in range(len(edges) - 1)]
