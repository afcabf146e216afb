"""Fig. 9: landing rate over approach speed (radius) and angle, one quarter disc per landing gear.

Colour is the mean over a cell's trials; a dot marks cells that at least one trial solved although the mean is below
0.8; the title of a disc gives the mean over its cells with a 95 % interval.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd  # type: ignore[import-untyped]

from ivl import model
from ivl.analysis.rates import cell_rates, mean_rate
from ivl.outcome import SOLVED_SHARE, solved
from ivl.plots import campaign, style
from ivl.plots.campaign import Campaign
from ivl.plots.spaces import RATE_MAP

NAME = "fig09_gears"
ORDER = ("extra_narrow_short", "narrow_short", "wide_short", "extra_narrow_long", "narrow_long", "wide_long")


@style.drawing
def draw(data: Campaign, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw every gear of the run.

    Args:
        data: One vehicle, gear set and learner; any number of gears.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.
    """
    present = data.trials["gear"].astype(str).unique()
    gears = [g for g in ORDER if g in present] + sorted(set(present) - set(ORDER))
    n_columns = min(3, len(gears))
    n_rows = -(-len(gears) // n_columns)
    figure = style.new_figure(max(4.5, 2.5 * n_columns), 2.55 * n_rows + 0.75)
    grid: Any = figure.subplots(n_rows, n_columns, subplot_kw={"projection": "polar"}, squeeze=False)
    for axis in grid.flat[len(gears) :]:
        axis.remove()
    for axis, gear in zip(grid.flat, gears, strict=False):
        own = data.trials[data.trials["gear"] == gear]
        image = _draw_disc(axis, cell_rates(own))
        axis.set_title(
            f"{model.gear_title(gear)}\nmean {campaign.interval(mean_rate(own), 2)}", fontsize=style.NORMAL, pad=8
        )
    bar = figure.colorbar(image, ax=grid[:, :], location="bottom", shrink=0.5, aspect=35, pad=0.03)
    bar.set_label("four-leg landing rate, mean of the trials; dot: solved by some trial only", fontsize=style.NORMAL)
    bar.ax.tick_params(labelsize=style.SMALL)
    bar.ax.axvline(SOLVED_SHARE, color="black", linewidth=1)
    figure.suptitle(data.title("gear_set", "vehicle", "learner"), fontsize=style.NORMAL)
    return style.save(figure, paths, dpi)


def _draw_disc(axis: Any, cells: pd.DataFrame) -> Any:
    """One quarter disc."""
    table = cells.pivot_table(index="speed_mps", columns="angle_deg", values="rate_mean_norm", observed=True)
    speed, angle = table.index.to_numpy(float), np.deg2rad(table.columns.to_numpy(float))
    image = axis.pcolormesh(
        _edges(angle), _edges(speed), table.to_numpy(), cmap=RATE_MAP, vmin=0, vmax=1, rasterized=True
    )
    lucky = cells[~solved(cells["rate_mean_norm"]) & (cells["n_solved"] > 0)]
    axis.scatter(np.deg2rad(lucky["angle_deg"]), lucky["speed_mps"], s=2.2, color="white", linewidths=0)
    axis.set_thetalim(0, np.pi / 2)
    axis.set_rlim(0, _edges(speed)[-1])
    axis.set_thetagrids((0, 20, 40, 60, 90), fontsize=style.SMALL)
    axis.set_rgrids(np.arange(1, speed.max() + 0.01, 1.0), labels=[], fontsize=style.SMALL)
    for value in np.arange(1, speed.max() + 0.01, 1.0):
        axis.text(-0.06, value, f"{value:g}", ha="center", va="top", fontsize=style.SMALL)
    axis.text(-0.24, speed.max() / 2, "$V$ (m/s)", ha="center", va="top", fontsize=style.SMALL)
    axis.grid(color="#BBBBBB", linewidth=0.4, alpha=0.6)
    return image


def _edges(centers: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Borders half-way between cells; the outer ones as far out as the next inner one is in."""
    if len(centers) == 1:
        return np.array([0.9 * centers[0], 1.1 * centers[0]])
    middle = (centers[1:] + centers[:-1]) / 2
    ends = 2 * centers[0] - middle[0], 2 * centers[-1] - middle[-1]
    return np.concatenate([ends[:1], middle, ends[1:]], dtype=np.float64)
