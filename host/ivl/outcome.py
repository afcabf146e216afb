"""What a rollout's outcome means: the project's definitions of success, on whole record arrays.

`four_leg` is the paper's landing (its reward pools three and four legs); `clean` is that without body or rotor contact.
A rollout that is not `valid` (the simulation broke down, the policy was refused) is no landing, whatever it says.
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


@cache
def _invalid_codes() -> tuple[int, ...]:
    """Codes of `INVALID_ENDS` in the library."""
    library = native.library()
    codes = range(int(library.outcome_fields["end_reason"].hi) + 1)
    found = tuple(code for code in codes if library.end_reason(code) in INVALID_ENDS)
    if len(found) != len(INVALID_ENDS):
        raise NativeError(f"the library has no end called {' or '.join(INVALID_ENDS)}")
    return found
