"""Landing rate over (V, phi) of the paper's policy, the one shown and the best of each cell, on the same approaches."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.patches import Rectangle

from ivl.analysis.intervals import share_of
from ivl.outcome import Outcomes, four_leg
from ivl.plots import spaces, style
from ivl.plots.spaces import RATE_MAP
from ivl.policy.region import BOX
from ivl.policy.survey import Survey

NAME = "policy_rates"
_MOSTLY = 0.5


@style.drawing
def draw(found: Survey, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw three panels with one colour scale; crosses mark the cells that the policy's go / no-go mostly refuses.

    Args:
        found: The flights.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.
    """
    rrev, moment = found.constant
    panels = (
        (f"constant: {rrev:.2f} 1/s, {moment:.2f} N mm", found.by_constant),
        (f"{found.general.form.name}: every approach flown", found.by_policy),
        ("best (RREV$_c$, M$_{yd}$) of each cell", found.by_best),
    )
    figure = style.new_figure(8.4, 3.9)
    axes = figure.subplots(1, 3, sharex=True, sharey=True)
    speed, angle = found.best.cells.speed_edges_mps, found.best.cells.angle_edges_deg
    for axis, (title, flown) in zip(axes, panels, strict=True):
        image = axis.pcolormesh(angle, speed, found.rates(flown), cmap=RATE_MAP, vmin=0, vmax=1, rasterized=True)
        (v_lo, v_hi), (a_lo, a_hi) = BOX.speeds_mps, BOX.angles_deg
        box = Rectangle((a_lo, v_lo), a_hi - a_lo, v_hi - v_lo, fill=False, edgecolor=style.VERMILION, linewidth=1.2)
        axis.add_patch(box)
        axis.set_title(f"{title}\n{_told(flown)}", fontsize=style.SMALL)
        spaces.label_2d(axis, "angle_deg", "speed_mps")
    for axis in axes[1:]:
        axis.set_ylabel("")
    i, j = np.nonzero(np.nan_to_num(found.refused()) > _MOSTLY)
    axes[1].scatter(0.5 * (angle[j] + angle[j + 1]), 0.5 * (speed[i] + speed[i + 1]), s=16, marker="x",
                    color=style.VERMILION, linewidths=1.0)  # fmt: skip
    bar = figure.colorbar(image, ax=list(axes), location="bottom", shrink=0.5, aspect=40)
    bar.set_label(
        "landing rate (three or four legs); frame: box; x: its go / no-go refuses most of the cell",
        fontsize=style.SMALL,
    )
    bar.ax.tick_params(labelsize=style.SMALL)
    figure.suptitle(
        f"{len(found.approaches)} fresh approaches over the plane, the same for each", fontsize=style.NORMAL
    )
    return style.save(figure, paths, dpi)


def _told(flown: Sequence[Outcomes]) -> str:
    share = share_of(np.concatenate([four_leg(outcomes) for outcomes in flown]))
    return f"{100 * share.value:.1f} % land ({100 * share.low:.1f} to {100 * share.high:.1f})"
