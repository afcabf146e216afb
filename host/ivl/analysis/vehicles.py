"""Landing rates over the vehicles of a family: mean, worst tenth, share of the vehicles that are solved.

The columns are those of the tables of a sweep or map (`ivl.sweep.schema`) that varies `family.member`. Each vehicle
counts once, whatever its number of rollouts; its rate is the mean over the cells.
"""

from typing import Any

import pandas as pd  # type: ignore[import-untyped]

from ivl.analysis.intervals import worst_tenth
from ivl.analysis.rates import RATE
from ivl.family import MEMBER
from ivl.outcome import solved
from ivl.sweep.schema import cell_columns, column_of

_POINT = ["d_ceil_m", "moment_Nmm"]
_MEMBER = column_of(MEMBER)


def has_family(table: pd.DataFrame) -> bool:
    """Whether a table is of several members."""
    return _MEMBER in table


def of_trials(trials: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """What the learner reaches on each vehicle, by landing gear: the rate of the trials' last episodes."""
    return {str(gear): _told(part.groupby(_MEMBER)[RATE].mean()) for gear, part in _by_gear(trials)}


def of_map(points: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """What one flip for all vehicles reaches, by landing gear.

    In each cell it is the distance and the moment with the best mean over the vehicles. `own_best` is the mean over
    the vehicles of what each reaches with its own best flip. Both were chosen by the rollouts that are counted, so
    that few rollouts a point make both look better than they are, `own_best` more so.
    """
    return {str(gear): _of_gear(part) for gear, part in _by_gear(points)}


def _by_gear(table: pd.DataFrame) -> Any:
    return table.groupby("gear", observed=True)


def _of_gear(points: pd.DataFrame) -> dict[str, Any]:
    cell = [name for name in cell_columns(points) if name != _MEMBER]
    flown = points[points["n"] > 0]
    flown = flown.assign(rate=flown["n_four_leg"] / flown["n"])
    means = flown.groupby([*cell, *_POINT], observed=True)["rate"].mean().reset_index()
    best = means.loc[means.groupby(cell, observed=True)["rate"].idxmax(), [*cell, *_POINT]]
    chosen = flown.merge(best, on=[*cell, *_POINT])
    own = flown.groupby([*cell, _MEMBER], observed=True)["rate"].max()
    return {**_told(chosen.groupby(_MEMBER)["rate"].mean()), "own_best": round(float(own.mean()), 4)}


def _told(rates: pd.Series) -> dict[str, Any]:
    """Numbers of the vehicles' rates."""
    return {
        "vehicles": len(rates),
        "mean": round(float(rates.mean()), 4),
        "worst_tenth": round(worst_tenth(rates), 4),
        "share_solved": round(float(solved(rates).mean()), 4),
    }
