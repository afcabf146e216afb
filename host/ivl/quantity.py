"""A number that a table keeps: its name, unit and meaning."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """What a column holds.

    Attributes:
        name: Name of the column, or what stands behind a prefix in it; ends with the unit's suffix, if there is one.
        unit: Unit; "1" for a pure number.
        doc: Meaning, in one line.
    """

    name: str
    unit: str
    doc: str
