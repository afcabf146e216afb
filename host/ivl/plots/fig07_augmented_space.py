"""Fig. 7: the trials in the augmented space (RREV, OF_y, d), coloured by landing rate; slices by distance beside it."""

from collections.abc import Sequence
from pathlib import Path

from ivl.plots import campaign, style
from ivl.plots.augmented import Quantity, draw_space
from ivl.plots.campaign import Campaign
from ivl.plots.spaces import RATE_MAP

NAME = "fig07_augmented_space"


def draw(data: Campaign, paths: Sequence[Path], dpi: int = style.DPI) -> list[Path]:
    """Draw one point per trial.

    Args:
        data: One vehicle, gear set, gear and learner.
        paths: Files to write.
        dpi: Dots per inch of pictures made of dots.
    """
    found = campaign.points(data)
    title = f"success in (RREV, $OF_y$, $d$): {campaign.auc_text(found, 'augmented')}"
    return draw_space(
        data, found, Quantity("rate_norm", "landing rate of the trial", RATE_MAP, (0.0, 1.0)), title, paths, dpi
    )
