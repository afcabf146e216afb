"""Go / no-go: share of landings over the estimated probability (reliability diagram), with a histogram."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ivl.analysis.intervals import wilson
from ivl.plots import style
from ivl.policy import go
from ivl.policy.survey import Survey

NAME = "policy_go"


@style.drawing
def draw(found: Survey, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw the shares with Wilson's 95 % intervals, and below them the numbers of landings and failures.

    Args:
        found: The flights; every approach was flown, whatever was decided.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.
    """
    p, landed = found.decided()
    figure = style.new_figure(4.6, 5.2)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    bins = go.binned(p, landed)
    some = bins.count > 0
    low, high = wilson(bins.landed[some], bins.count[some])
    share = bins.landed[some]
    top.plot([0, 1], [0, 1], color=style.GREY, linewidth=0.8, linestyle="--", label="as estimated")
    top.errorbar(bins.p[some], share, yerr=(share - low, high - share), fmt="o", color=style.BLUE, markersize=4,
                 capsize=2, linewidth=1.0, label="flown (95 % interval)")  # fmt: skip
    top.set_ylabel("share that lands")
    top.set_ylim(-0.03, 1.03)
    counts = [np.histogram(p[kind], bins.edges)[0] for kind in (landed, ~landed)]
    middle, width = 0.5 * (bins.edges[1:] + bins.edges[:-1]), np.diff(bins.edges)
    bottom.bar(middle, counts[0], width, color=style.BLUE, label="lands")
    bottom.bar(middle, counts[1], width, bottom=counts[0], color=style.ORANGE, label="does not")
    bottom.set_ylabel("flights")
    bottom.set_xlabel("estimated probability of a landing at the decision")
    for axis, label in ((top, f"refused below {found.p_min:g}"), (bottom, None)):
        axis.axvline(found.p_min, color=style.VERMILION, linewidth=1.0, label=label)
        style.finish(axis)
    top.legend(fontsize=style.SMALL, frameon=False, loc="upper left")
    bottom.legend(fontsize=style.SMALL, frameon=False, loc="upper center")
    figure.suptitle(
        f"{len(p)} decisions; AUC {go.auc(p, landed):.3f}, calibration error {go.calibration_error(p, landed):.3f}",
        fontsize=style.NORMAL,
    )
    return style.save(figure, paths, dpi)
