"""What counts as success, of a rollout and of a policy: the project's only definitions, on whole arrays.

A rollout has *landed* if `four_leg` says so, the paper's landing (its reward pools three and four legs); `clean` is
that without body or rotor contact. A rollout that is not `valid` (the simulation broke down, the policy was refused) is
no landing, whatever it says.

A policy, or a trial that ends with it, has a landing rate. It has *solved* its task from a share of the possible rate
on, and is *stuck* below another. What is possible is the best rate of any policy, where a search has found it
(`ivl.assess`); where nobody has looked for it (a sweep), it counts as 1, and a trial is called stuck only in a cell
that another trial has solved (`ivl.analysis.rates.of_solved_cells`).
"""

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.errors import NativeError

FOUR_LEG_MIN = 3
INVALID_ENDS = ("refused", "not_finite", "step_limit")
"""Names of the ends after which an outcome says nothing about the policy."""

SOLVED_SHARE, STUCK_SHARE = 0.8, 0.5
"""Shares of the possible landing rate from which on a task is solved, and below which a policy is stuck."""
RECENT_EPISODES = 3
"""The landing rate of a trial while it learns is that of its last three episodes (as in the paper)."""

_P_TOLD_MIN = 0.01

BoolArray = npt.NDArray[np.bool_]
Outcomes = npt.NDArray[np.void]
"""Record array of the library's outcome table, any shape."""


def valid(outcomes: Outcomes) -> BoolArray:
    """True where the rollout came to an end that means something."""
    return np.asarray(~np.isin(outcomes["end_reason"], _invalid_codes()))


def four_leg(outcomes: Outcomes) -> BoolArray:
    """True where at least three feet are stuck at the end."""
    return np.asarray((outcomes["n_legs"] >= FOUR_LEG_MIN) & valid(outcomes))


def clean(outcomes: Outcomes) -> BoolArray:
    """True where at least three feet are stuck and neither body nor rotor touched the ceiling."""
    return np.asarray(four_leg(outcomes) & (outcomes["body_contact"] == 0))


def solved(rate: Any, possible: Any = 1.0, share: float = SOLVED_SHARE) -> Any:
    """Whether landing rates (a number, array or column) reach a share of the possible rate; NaN does not.

    Where no landing is possible, nothing is solved.
    """
    return (rate >= share * possible) & (possible > 0)


def stuck(rate: Any, possible: Any = 1.0) -> Any:
    """Whether landing rates (a number, array or column) are below half of the possible rate; NaN is not."""
    return rate < STUCK_SHARE * possible


def folded_deg(angle_deg: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """An unwrapped angle as its magnitude in 0 .. 180 degrees; NaN stays NaN."""
    turned = np.mod(np.abs(np.asarray(angle_deg, dtype=np.float64)), 360.0)
    return np.minimum(turned, 360.0 - turned)


def as_dict(outcome: Any, end_reason: str) -> dict[str, Any]:
    """One outcome record as plain data for JSON: NaN becomes None, `end_reason` its name."""
    result: dict[str, Any] = {}
    for name in outcome.dtype.names:
        value = np.asarray(outcome[name]).tolist()
        result[name] = None if isinstance(value, float) and not np.isfinite(value) else value
    result["end_reason"] = end_reason
    return result


def verdict(outcome: Any) -> str:
    """One outcome record in words: feet and contact; of a no-go its probability, and how near the ceiling came.

    The distance is that of the body's origin, as in `d_min_m`.
    """
    touched = bool(outcome["body_contact"] or outcome["base_contact"])
    contact = ", body contact" if touched else ""
    if outcome["no_go"]:
        p = float(outcome["p_land"])
        told = f"= {p:.2f}" if p >= _P_TOLD_MIN else f"below {_P_TOLD_MIN}"
        return f"no_go at P {told}, closest {1000 * float(outcome['d_min_m']):.0f} mm to the ceiling{contact}"
    if not outcome["n_legs"]:
        return f"no foot stuck{contact}"
    return f"{int(outcome['n_legs'])} feet stuck{contact or ', clean'}"


def end_code(name: str) -> int:
    """Code of an end by its name.

    Raises:
        NativeError: The library has none of that name.
    """
    library = native.library()
    for code in range(int(library.outcome_fields["end_reason"].hi) + 1):
        if library.end_reason(code) == name:
            return code
    raise NativeError(f"the library has no end called {name}")


@cache
def _invalid_codes() -> tuple[int, ...]:
    """Codes of `INVALID_ENDS` in the library."""
    return tuple(end_code(name) for name in INVALID_ENDS)
