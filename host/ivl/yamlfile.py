"""Strict reading of YAML: no duplicate keys, and one line of text for whatever pydantic finds wrong.

PyYAML reads `1e-6` as text and `1.0e-6` as a number. Text where a number belongs is refused, with that hint, never
converted.
"""

import difflib
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from ivl.errors import ConfigError

Model = TypeVar("Model", bound=BaseModel)
_NUMBER_AS_TEXT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_N_TOLD = 3
"""So many problems are told; the others are counted."""
_N_SHOWN = 60
"""So many characters of a value are shown."""


class _StrictLoader(yaml.SafeLoader):
    """SafeLoader that refuses a key given twice in one mapping (plain YAML keeps the last one silently)."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                raise yaml.constructor.ConstructorError(None, None, f"key {key!r} is given twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep=deep)


def parse(text: str, label: str) -> Any:
    """Parse YAML text; `label` names it in errors."""
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise ConfigError(f"{label}: {where}{error.problem}") from error
    except (yaml.YAMLError, TypeError) as error:
        raise ConfigError(f"{label}: not YAML: {' '.join(str(error).split())}") from error


def read(path: Path) -> Any:
    """Read and parse a YAML file."""
    try:
        return parse(path.read_text(encoding="utf-8"), path.name)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error


def dump(data: Any) -> str:
    """YAML text of plain data, keys in the given order, floats so that they read back as the same number."""
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120)


def validate(model: type[Model], data: Any, label: str) -> Model:
    """Check `data` against `model`; all that is wrong comes out as one line that starts with `label`."""
    if not isinstance(data, dict):
        raise ConfigError(f"{label}: expected a mapping of fields, got {type(data).__name__}")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ConfigError(f"{label}: {explain(error, paths(model))}") from error


def paths(model: type[BaseModel]) -> dict[str, bool]:
    """Dotted path of every field of a model and of the models in it; whether a field is a mapping with free keys."""
    found: dict[str, bool] = {}
    for name, field in model.model_fields.items():
        kinds = list(_kinds(field.annotation))
        found[name] = dict in kinds
        for kind in kinds:
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                found |= {f"{name}.{path}": free for path, free in paths(kind).items()}
    further = getattr(model, "further_paths", None)  # of a model whose other fields follow from what it holds
    return found | further() if further else found


def _kinds(annotation: Any) -> Iterable[Any]:
    """The types that an annotation is made of; a list is one value, whatever is in it."""
    origin = get_origin(annotation)
    if origin in (list, dict, None):
        yield origin or annotation
        return
    for argument in get_args(annotation):
        yield from _kinds(argument)


def did_you_mean(name: str, known: Iterable[str], at_any_distance: bool = False) -> str:
    """The known name that is nearest to one with a slip in it, as the end of a sentence; empty if none is near.

    Args:
        name: The name that is not known.
        known: Those that are.
        at_any_distance: Tell the nearest even if it is none that one would mistype so.
    """
    names = list(known)
    if close := difflib.get_close_matches(name, names, n=1):
        return f", did you mean {close[0]!r}?"
    nearest = difflib.get_close_matches(name, names, n=1, cutoff=0.0) if at_any_distance else []
    return f" (the nearest is {nearest[0]})" if nearest else ""


def explain(error: ValidationError, known: Iterable[str] = ()) -> str:
    """The first problems as `field: value ...: what is wrong`, with the number of further ones.

    Unknown keys come first: a name with a slip in it is what makes the right one missing. `known` are the paths that
    there are, of which the nearest is offered.
    """
    problems = sorted(error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden")
    told = "; ".join(_complaint(problem, known) for problem in problems[:_N_TOLD])
    more = f" (and {len(problems) - _N_TOLD} more)" if len(problems) > _N_TOLD else ""
    return told + more


def number_hint(value: Any) -> str:
    """Advice for a number that YAML took as text; empty for anything else."""
    if isinstance(value, str) and _NUMBER_AS_TEXT.fullmatch(value.strip()):
        return "; YAML reads this as text: write numbers as 1.0e-6, with a point and a signed exponent"
    return ""


def _complaint(problem: ErrorDetails, known: Iterable[str]) -> str:
    """One problem; one of the model as a whole has no field of its own and names the field in its message."""
    kind, value, message = problem["type"], problem["input"], problem["msg"].removeprefix("Value error, ")
    field = ".".join(str(part) for part in problem["loc"])
    if not field:
        return message
    if kind == "missing":
        return f"{field}: is missing"
    if kind == "extra_forbidden":
        return f"{field}: unknown key (value {_short(value)}){did_you_mean(field, known)}"
    return f"{field}: value {_short(value)}: {message}{number_hint(value)}"


def _short(value: Any) -> str:
    """A value as people wrote it, cut where it would hide the rest of the line."""
    text = repr(value)
    return text if len(text) <= _N_SHOWN else f"{text[:_N_SHOWN]}..."
