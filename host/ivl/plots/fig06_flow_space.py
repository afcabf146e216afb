"""Fig. 6: the same trials in optical-flow space (RREV, OF_y): how far success and failure overlap."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
from matplotlib.axes import Axes

from ivl.plots import campaign, spaces, style
from ivl.plots.campaign import Campaign
from ivl.plots.spaces import RATE_MAP

NAME = "fig06_flow_space"
_ABOVE_PT = 15.0
"""Room between a panel and its title, for the names of the lines."""
_MIDDLE = 0.98
"""Share of the points that the axes show; stray triggers of trials that never learned lie far outside."""


@style.drawing
def draw(data: Campaign, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw one point per trial, in one panel by landing rate, in the other success and failure apart.

    Args:
        data: One vehicle, gear set, gear and learner.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.
    """
    found = campaign.points(data)
    figure = style.new_figure(7.5, 3.5)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    image = left.scatter(
        found["of_y_radps"], found["rrev_per_s"], c=found["rate_norm"], s=8, cmap=RATE_MAP, vmin=0, vmax=1,
        linewidths=0.15, edgecolors=style.GREY,
    )  # fmt: skip
    left.set_title("landing rate of each trial", fontsize=style.NORMAL, pad=_ABOVE_PT)
    good, bad = found[found["success"]], found[~found["success"]]
    right.scatter(
        good["of_y_radps"], good["rrev_per_s"], s=13, facecolors="none", edgecolors=style.BLUE, linewidths=0.8,
        label=f"0.8 or more ({len(good)} trials)",
    )  # fmt: skip
    right.scatter(
        bad["of_y_radps"], bad["rrev_per_s"], s=8, color=style.VERMILION, marker="x", linewidths=0.7,
        label=f"below 0.8 ({len(bad)} trials)",
    )  # fmt: skip
    right.set_title(
        f"success in (RREV, $OF_y$): {campaign.auc_text(found, 'flow')}", fontsize=style.NORMAL, pad=_ABOVE_PT
    )
    legend = right.legend(
        title="landing rate", fontsize=style.SMALL, title_fontsize=style.NORMAL, frameon=False, ncols=2,
        loc="upper center", bbox_to_anchor=(0.5, -0.2),
    )  # fmt: skip
    legend.set_in_layout(False)  # it lies beside the colour bar, for which the layout makes room
    limit(left, found)
    for axis in (left, right):
        _draw_angles(axis)
        spaces.label_2d(axis, "of_y_radps", "rrev_per_s")
    bar = figure.colorbar(image, ax=left, location="bottom", shrink=0.8, aspect=30)
    bar.set_label("landing rate", fontsize=style.NORMAL)
    bar.ax.tick_params(labelsize=style.SMALL)
    figure.suptitle(data.title("gear", "gear_set", "vehicle", "learner"), fontsize=style.NORMAL)
    return style.save(figure, paths, dpi)


def limit(axis: Axes, found: pd.DataFrame) -> None:
    """Axis limits that hold the successes and the middle of the other points, with a margin."""
    for column, setter in (("of_y_radps", axis.set_xlim), ("rrev_per_s", axis.set_ylim)):
        low, high = found[column].quantile([(1 - _MIDDLE) / 2, (1 + _MIDDLE) / 2])
        good = found.loc[found["success"], column]
        low, high = np.nanmin([low, good.min()]), np.nanmax([high, good.max()])
        margin = 0.06 * (high - low) + 0.05
        setter(low - margin, high + margin)


def _draw_angles(axis: Axes) -> None:
    """Lines of equal approach angle: RREV = -OF_y tan(phi)."""
    (x_low, _), (y_low, y_high) = axis.get_xlim(), axis.get_ylim()  # their ends are named outside, clear of the points
    for angle_deg in (20, 30, 40, 60):
        slope = np.tan(np.deg2rad(angle_deg))
        end = max(x_low, -y_high / slope)
        axis.plot([0, end], [0, -end * slope], color=style.GREY, linewidth=0.5, zorder=0, scalex=False, scaley=False)
        if -end * slope < y_low:  # the line passes below this window
            continue
        at_top = end > x_low
        axis.annotate(
            f"{angle_deg}°" if at_top else rf"$\varphi$ = {angle_deg}°", (end, -end * slope),
            xytext=(0, 1) if at_top else (4, 3), textcoords="offset points", fontsize=style.SMALL,
            color=style.DIM, ha="center" if at_top else "left", va="bottom", annotation_clip=False,
        )  # fmt: skip
