"""Who touches first, and whether the swing completes: from the contact counts of trials or map points."""

from dataclasses import dataclass

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from ivl.analysis.intervals import Estimate, stratified_mean

_CONDITION = ("speed_mps", "angle_deg")


@dataclass(frozen=True)
class Contact:
    """Order of contact; intervals over conditions of equal weight, `n` is their number.

    Attributes:
        fore_first: Share of the rollouts with a stuck foot in which a fore leg (1 or 4) stuck first.
        swing_completed: Share of those in which a hind leg (2 or 3) stuck later.
        n_rollouts: Rollouts with a stuck foot.
    """

    fore_first: Estimate
    swing_completed: Estimate
    n_rollouts: int


def contact_order(rows: pd.DataFrame) -> Contact:
    """Order of contact over trials (or map points).

    Args:
        rows: Columns `speed_mps`, `angle_deg`, `n_attached`, `fore_legs_first_norm`, `swing_completed_norm`.
    """
    return Contact(
        fore_first=_share(rows, "fore_legs_first_norm"),
        swing_completed=_share(rows, "swing_completed_norm"),
        n_rollouts=int(rows["n_attached"].sum()),
    )


def _share(rows: pd.DataFrame, column: str) -> Estimate:
    """Mean of a share over conditions, among the rows that have it."""
    known = rows[rows[column].notna() & (rows["n_attached"] > 0)]
    mean = stratified_mean(known[column], known.groupby(list(_CONDITION), observed=True).ngroup())
    low, high = np.clip([mean.low, mean.high], 0.0, 1.0)
    return Estimate(mean.value, float(low), float(high), mean.n)
