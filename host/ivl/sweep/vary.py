"""Values of varied paths: as lists in a file, after `--vary a.b=x,y`, and as text in names and tables."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeGuard

import numpy as np
from pydantic import Field, ValidationError

from ivl import native, references, yamlfile
from ivl.errors import ConfigError
from ivl.settings import Finite, Strict
from ivl.task import Task

COUNT_MAX = 100_000

Value = str | bool | int | float | None
"""What a varied path may take; None is YAML's null."""
Varied = tuple[tuple[str, Value], ...]
"""One value of each varied path, the paths in order; those of `AXES` are not among them."""

AXES = {"gear": "gears", "speed_mps": "speeds_mps", "angle_deg": "angles_deg"}
"""Paths that every sweep has an axis of, and the field that is short for varying them."""


class Range(Strict):
    """Equally spaced values, both ends included."""

    first: Finite
    last: Finite
    count: int = Field(ge=1, le=COUNT_MAX)


Axis = Annotated[list[Finite], Field(min_length=1, max_length=COUNT_MAX)] | Range


def plain(value: Any) -> Any:
    """A number or text of numpy as Python's own; anything else as it is."""
    return value.item() if isinstance(value, np.generic) else value


def values(axis: list[float] | Range) -> list[float]:
    """The values of an axis, rounded to what a person would have typed."""
    if isinstance(axis, Range):
        return [round(float(x), 9) for x in np.linspace(axis.first, axis.last, axis.count)]
    return [float(x) for x in axis]


def is_flown(path: str) -> bool:
    """Whether a path is part of the task: a field of it, or a parameter of the world."""
    return path.split(".")[0] in Task.model_fields or path in native.library().params


def world_name(gear: str, varied: Varied) -> str:
    """Name of a world in a run: the landing gear and whatever else is varied of what is flown."""
    return "|".join([gear, *(f"{path}={text_of(value)}" for path, value in varied if is_flown(path))])


def text_of(value: Value) -> str:
    """A value as YAML has it."""
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)


def as_cell(value: Value) -> float | str:
    """A value as the tables have it: a number, or text."""
    return float(value) if _is_number(value) else text_of(value)


def _is_number(value: Any) -> TypeGuard[int | float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def listed(path: str, given: Any) -> list[Any]:
    """Values of a varied path, from a list or a range.

    Raises:
        ValueError: They are no list of single values of one kind, each given once.
    """
    where = f"vary.{path}"
    if isinstance(given, Range) or (isinstance(given, dict) and set(given) == set(Range.model_fields)):
        try:
            return list(values(Range.model_validate(given)))
        except ValidationError as error:
            raise ValueError(f"{where}: {yamlfile.explain(error)}") from error
    if not isinstance(given, list) or not given:
        what = "the list is empty" if given == [] else f"value {given!r}"
        raise ValueError(f"{where}: {what}: expected a list of values, or first, last and count")
    given = [plain(value) for value in given]
    for value in given:
        if not isinstance(value, Value):
            raise ValueError(f"{where}: value {value!r} is not a single value")
    if 0 < sum(map(_is_number, given)) < len(given):
        raise ValueError(f"{where}: numbers and other values are mixed{_hint(given)}")
    as_float = path in native.library().params or path in ("speed_mps", "angle_deg")
    found = [float(value) if as_float and _is_number(value) else value for value in given]
    if len({(isinstance(value, bool), value) for value in found}) < len(found):
        raise ValueError(f"{where}: a value is given twice")
    return found


def _hint(given: list[Any]) -> str:
    """Advice for the first number that YAML took as text."""
    return next((hint for value in given if (hint := yamlfile.number_hint(value))), "")


def refuse_varied(data: dict[str, Any], name: str, what: str) -> None:
    """Refuse to give one value to a path that is varied: it would do nothing."""
    vary = data.get("vary")
    if isinstance(vary, dict) and name in vary:
        raise ConfigError(f"{what}: {name} is varied (--vary {name}=... replaces its values)")


def apply_vary(data: dict[str, Any], vary: Sequence[str], label: str) -> None:
    """Write the texts of `--vary` into raw data, in place of what the file says of the same paths."""
    given: dict[str, Any] = {}
    for text in vary:
        name, equals, rest = text.partition("=")
        name = name.strip()
        if not equals or not name:
            raise ConfigError(f"{label}: --vary {text!r}: expected path=values, for example learner.name=ephe,bo")
        if name in given:
            raise ConfigError(f"{label}: --vary {text}: {name} is given twice")
        found = yamlfile.parse(f"[{rest}]", f"{label}: --vary {text}")
        given[name] = found[0] if len(found) == 1 and isinstance(found[0], (dict, list)) else found
    put_varied(data, given, label)


def put_varied(data: dict[str, Any], given: Mapping[str, Any], label: str) -> None:
    """Write values of varied paths into raw data, in place of what it says of the same paths.

    Raises:
        ConfigError: What the data says of varied paths is no mapping.
    """
    before = data.get("vary") or {}
    if not isinstance(before, dict):
        raise ConfigError(f"{label}: vary: value {before!r}: expected a mapping from path to values")
    found = dict(given)
    for name, values_of_path in given.items():
        if name in references.FIELDS and isinstance(values_of_path, list):
            found[name] = [references.absolute(value, Path.cwd()) for value in values_of_path]
        for same in (name, AXES[name]) if name in AXES else ():
            data.pop(same, None)
    if found:
        data["vary"] = {**before, **found}
