"""The policy region: where in state and cue space a flip ends in a landing.

Two sources give it. A campaign gives one point per trial, at the mean state in which its policy flips. A policy map
(`ivl map`) starts the flip everywhere, and asks whether any moment lands: no learner is in it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd  # type: ignore[import-untyped]
from scipy import ndimage  # type: ignore[import-untyped]

from ivl import outcome
from ivl.analysis.policy import MOMENT, recommended
from ivl.analysis.rates import RATE
from ivl.outcome import SOLVED_SHARE
from ivl.sweep.schema import TRIAL_KEY

STATE = ("vx_mps", "vz_mps", "d_ceil_m")
FLOW = ("rrev_per_s", "of_y_radps")
AUGMENTED = (*FLOW, "d_ceil_m")
CUE_SETS = {"state": STATE, "flow": FLOW, "augmented": AUGMENTED}
"""Columns of the three spaces: (Vx, Vz, d), (RREV, OF_y), (RREV, OF_y, d)."""

_SETUP = ("vehicle", "gear_set", "gear")
_TRIGGER = {f"trigger_{name}": name for name in (*STATE, *FLOW)}


@dataclass(frozen=True)
class Components:
    """How a set of grid points hangs together.

    Attributes:
        n: Connected parts (neighbours along axes and diagonals).
        largest_share: Share of the set in the largest part; NaN if the set is empty.
        n_holes: Points outside of the set from which no path of steps along the axes leads to the grid's border.
        n_points: Points of the set.
    """

    n: int
    largest_share: float
    n_holes: int
    n_points: int


def trial_points(trials: pd.DataFrame, rate: str = RATE, solved: float = SOLVED_SHARE) -> pd.DataFrame:
    """One point per trial that triggered: the mean state and cues in which its last three episodes flipped.

    Returns:
        Columns of `CELL` and `trial` as given, `STATE`, `FLOW`, `moment_Nmm` (recommended), `rate_norm`, `success`
        (rate at least `solved`) and `condition` (number of the approach (V, phi)).
    """
    points = trials[(trials["n_triggered"] > 0) & trials[rate].notna()].rename(columns=_TRIGGER)
    points = points.assign(
        moment_Nmm=points[recommended(MOMENT)],
        rate_norm=points[rate],
        success=outcome.solved(points[rate], share=solved),
        condition=points.groupby(["speed_mps", "angle_deg"], observed=True).ngroup(),
    )
    return points[[*TRIAL_KEY, *STATE, *FLOW, "moment_Nmm", "rate_norm", "success", "condition"]].reset_index(drop=True)


def map_states(points: pd.DataFrame, solved: float = SOLVED_SHARE) -> pd.DataFrame:
    """States of a policy map, the moments gathered: which of them land.

    Args:
        points: Table of a map: one row per (V, phi, d, M_yd).
        solved: Share of the rollouts of a point from which on its moment counts as landing.

    Returns:
        One row per vehicle, gear and (V, phi, d), sorted: `STATE`, `FLOW`, `success` (some moment lands),
        `n_moments`, `n_landing`, `moment_low_Nmm`, `moment_high_Nmm` (ends of the longest run of neighbouring moments
        that land, NaN without one), `moment_Nmm` (its middle), `condition` (number of the approach).
    """
    keys = [*_SETUP, "speed_mps", "angle_deg", "d_ceil_m"]
    ordered = points.sort_values([*keys, "moment_Nmm"], kind="stable")
    first = ordered.groupby(keys, observed=True, sort=True)
    states = first[["vx_mps", "vz_mps", *FLOW]].first().reset_index()
    rate = ordered["n_four_leg"] / ordered["n"].clip(lower=1)
    runs = [
        _longest_run(part["moment_Nmm"].to_numpy(), outcome.solved(part["rate"].to_numpy(), share=solved))
        for _, part in ordered.assign(rate=rate).groupby(keys, observed=True, sort=True)
    ]
    columns = ["n_moments", "n_landing", "moment_low_Nmm", "moment_high_Nmm"]
    states[columns] = pd.DataFrame(runs, columns=columns, index=states.index)
    states["moment_Nmm"] = (states["moment_low_Nmm"] + states["moment_high_Nmm"]) / 2
    states["success"] = states["n_landing"] > 0
    states["condition"] = states.groupby(["speed_mps", "angle_deg"], observed=True).ngroup()
    return states


def near_region(states: pd.DataFrame, margin: float = 0.25) -> pd.Series:
    """Mask of the states whose RREV lies within the landing states' range, widened by `margin` of it on either side.

    A flip far too early or late fails whatever the other cues say; to count such states makes any set of cues look
    good. This keeps the near misses.
    """
    rrev = states.loc[states["success"], "rrev_per_s"]
    if rrev.empty:
        return pd.Series(False, index=states.index)
    low, high = rrev.min(), rrev.max()
    return states["rrev_per_s"].between(low - margin * (high - low), high + margin * (high - low))


def components(frame: pd.DataFrame, axes: Sequence[str], success: str = "success") -> Components:
    """How the successes hang together on the grid that the columns `axes` span.

    Args:
        frame: One row per grid point; points that are missing count as failures.
        axes: Columns with the grid's coordinates; only their order counts, not their spacing.
        success: Column of bool.
    """
    places = [np.unique(frame[name], return_inverse=True) for name in axes]
    grid = np.zeros([len(values) for values, _ in places], dtype=bool)
    grid[tuple(index for _, index in places)] = frame[success].to_numpy(dtype=bool)
    return grid_components(grid)


def grid_components(grid: npt.NDArray[np.bool_]) -> Components:
    """How the true points of a grid of any dimension hang together."""
    label, n = ndimage.label(grid, structure=np.ones([3] * grid.ndim))
    n_points = int(grid.sum())
    largest = np.bincount(label[grid]).max() / n_points if n_points else float("nan")
    outside, _ = ndimage.label(~np.pad(grid, 1))
    n_holes = int((~np.pad(grid, 1) & (outside != outside[(0,) * grid.ndim])).sum())
    return Components(int(n), float(largest), n_holes, n_points)


def _longest_run(moment_Nmm: npt.NDArray[np.float64], lands: npt.NDArray[np.bool_]) -> tuple[int, int, float, float]:
    """Number of moments, how many land, and the ends of the longest run of neighbours that do."""
    n, n_landing = len(lands), int(lands.sum())
    if not n_landing:
        return n, 0, float("nan"), float("nan")
    edge = np.flatnonzero(np.diff(np.concatenate([[False], lands, [False]])))
    start, stop = edge[::2], edge[1::2]
    longest = int(np.argmax(stop - start))
    return n, n_landing, float(moment_Nmm[start[longest]]), float(moment_Nmm[stop[longest] - 1])
