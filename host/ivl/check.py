"""One check before a flight: what was found, what is allowed, and what to do about it."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Check:
    """One line of a table of checks.

    Attributes:
        name: What was looked at.
        ok: Whether it is as it must be.
        found: What was found.
        needed: What is allowed.
        remedy: What to do if it is not.
    """

    name: str
    ok: bool
    found: str
    needed: str
    remedy: str

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


def failures(found: Iterable[Check]) -> str:
    """The checks that failed, in one line; empty if none did."""
    return "; ".join(f"{c.name}: {c.found} (needed: {c.needed}): {c.remedy}" for c in found if not c.ok)
