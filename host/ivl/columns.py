"""Fields of the library's records as columns of a table: one column for each element, its name ending with its unit."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.native import Field
from ivl.quantity import Quantity

_SUFFIX = {
    "1": "", "m": "m", "s": "s", "deg": "deg", "m/s": "mps", "rad/s": "radps", "1/s": "per_s", "N": "N", "V": "V",
    "J": "J",
}  # fmt: skip

SHARED = {
    quantity.name: quantity
    for quantity in (
        Quantity("vehicle", "1", "vehicle by name"),
        Quantity("gear_set", "1", "set of landing gears"),
        Quantity("gear", "1", "landing gear by name"),
        Quantity("learner", "1", "learner by name"),
        Quantity("speed_mps", "m/s", "approach speed V"),
        Quantity("angle_deg", "deg", "approach angle phi above the horizontal"),
        Quantity("trial", "1", "number of the trial in its cell"),
        Quantity("run_seed", "1", "seed of the trial: `ivl learn --seed` with it repeats the trial"),
        Quantity("learner_seed", "1", "seed of the learner"),
        Quantity("episode", "1", "number of the episode, from 0"),
        Quantity("idx", "1", "place within the episode"),
        Quantity("stream", "1", "number of the rollout within the seed"),
        Quantity("n_scored", "1", "rollouts that were learned from"),
        Quantity("n_episodes", "1", "episodes flown"),
        Quantity("stopped", "1", "whether the learner itself ended the trial"),
    )
}
"""Columns that the tables of a sweep and the data frames of a run have in common."""

Element = tuple[str, int]
"""Name of a field, and number of one of its elements."""


def columns_of(fields: Mapping[str, Field]) -> dict[str, Element]:
    """Where each column of a table of records comes from; elements of a vector are numbered from 1."""
    columns: dict[str, Element] = {}
    for name, entry in fields.items():
        suffix = _SUFFIX[entry.unit]
        base = name if not suffix or name.endswith(f"_{suffix}") else f"{name}_{suffix}"
        for i in range(entry.count):
            columns[base if entry.count == 1 else f"{base}_{i + 1}"] = (name, i)
    return columns


def values_of(records: npt.NDArray[np.void], element: Element) -> npt.NDArray[Any]:
    """The values of a column, in the shape of the records."""
    name, i = element
    values = records[name]
    return np.asarray(values[..., i] if records.dtype[name].shape else values)


def codes() -> dict[str, dict[int, str]]:
    """Fields whose numbers stand for names, with these names by number."""
    library = native.library()
    return {
        "end_reason": _names(library.outcome_fields["end_reason"], library.end_reason),
        "phase": _names(library.trace_fields["phase"], library.phase_name),
    }


def _names(field: Field, name_of: Callable[[int], str]) -> dict[int, str]:
    return {code: name_of(code) for code in range(int(field.lo), int(field.hi) + 1)}
