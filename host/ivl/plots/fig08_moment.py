"""Fig. 8: the moment M_yd over the successful trials in the augmented space (RREV, OF_y, d)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ivl.analysis.moment import explained
from ivl.analysis.region import AUGMENTED
from ivl.errors import ConfigError
from ivl.plots import campaign, spaces, style
from ivl.plots.augmented import Quantity, draw_space
from ivl.plots.campaign import Campaign

NAME = "fig08_moment"


def draw(data: Campaign, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw one point per successful trial; the title says how much of M_yd the cues explain.

    Args:
        data: One vehicle, gear set, gear and learner.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.

    Raises:
        ConfigError: No trial succeeded.
    """
    found = campaign.points(data)
    found = found[found["success"]]
    if found.empty:
        raise ConfigError("no trial of this part of the run reached a landing rate of 0.8: there is no region to draw")
    moment = found["moment_Nmm"]
    result = explained(found[list(AUGMENTED)], moment, found["condition"])
    title = "one moment alone"
    if np.isfinite(result.linear.value):
        title = (
            f"$M_{{yd}}$ explained by the cues, cross-validated $R^2$: plane {campaign.interval(result.linear, 2)}, "
            f"forest {campaign.interval(result.nonlinear, 2)}"
        )
    limits = (float(np.floor(moment.min())), float(np.ceil(moment.max())))
    return draw_space(
        data, found, Quantity("moment_Nmm", spaces.LABELS["moment_Nmm"], "viridis", limits), title, paths, dpi
    )
