"""The paper's policy in the tables of a sweep: names of the columns that its claims are about."""

from ivl import forms

THRESHOLD, MOMENT = 0, 1
"""Places of the two parameters in the paper's form."""


def recommended(place: int) -> str:
    """Column of a recommended parameter of the paper's form."""
    return f"recommended_{forms.by_name(forms.PAPER).names[place]}"
