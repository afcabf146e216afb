"""The one reader and writer of YAML: every number is what the eye reads, or it is refused.

Plain words are read as YAML 1.2's core schema reads them: `1e-6` is a number, `yes`, `off` and `2026-11-30` are text.
A spelling that YAML 1.1 and 1.2, or the eye, read as different numbers (`060`, `0o17`, `0x1F`, `1_000`, `1:30`) is
refused. Refused are, too: a key given twice, a key that is no word, tags other than those of the core schema, and
what is too large, too deep or multiplied by aliases. `dump` writes so that readers of both versions read the same.
"""

import copy
import difflib
import functools
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, ClassVar, TypeVar, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from ivl.errors import ConfigError

Model = TypeVar("Model", bound=BaseModel)
N_BYTES_MAX = 1_000_000
N_NODES_MAX = 100_000
"""Values of a document, each alias counted as all that it stands for."""
DEPTH_MAX = 40
DIGITS_MAX = 40
_NUMBER_AS_TEXT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_N_TOLD = 3
"""So many problems are told; the others are counted."""
_N_SHOWN = 60
"""So many characters of a value are shown."""

_TAG = "tag:yaml.org,2002:"
_ODD = "tag:ivl:odd-number"
_PLAIN = (
    (f"{_TAG}null", re.compile(r"~|null|Null|NULL|"), ["~", "n", "N", ""]),
    (f"{_TAG}bool", re.compile(r"true|True|TRUE|false|False|FALSE"), list("tTfF")),
    (f"{_TAG}int", re.compile(r"[-+]?(0|[1-9][0-9]*)"), list("-+0123456789")),
    (
        f"{_TAG}float",
        re.compile(
            r"[-+]?(\.[0-9]+|[0-9]+\.[0-9]*|[1-9][0-9]*(?=[eE])|0(?=[eE]))([eE][-+]?[0-9]+)?"
            r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"
        ),
        list("-+0123456789."),
    ),
    (
        _ODD,
        re.compile(
            r"[-+]?(0[0-9]+([eE][-+]?[0-9]+)?|0[oO][0-7_]+|0[xX][0-9a-fA-F_]+|0[bB][01_]+"
            r"|(?=[_.]*[0-9])[0-9_.]*_[0-9_.]*([eE][-+]?[0-9_]+)?|[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?)"
        ),
        list("-+0123456789._"),
    ),
    (f"{_TAG}merge", re.compile(r"<<"), ["<"]),
)


class _Loader(yaml.SafeLoader):
    """The core schema of YAML 1.2 with merge keys, within limits."""

    yaml_implicit_resolvers: dict[Any, Any] = {}  # noqa: RUF012 - as PyYAML declares it
    yaml_constructors: ClassVar[dict[Any, Any]] = {}

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = self._n_nodes = 0
        self._weights: dict[int, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Compose a node unless the document becomes too deep or too large."""
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        self._depth += 1
        if self._depth > DEPTH_MAX:
            raise _fault(event, f"nested deeper than {DEPTH_MAX}")
        node: Any = super().compose_node(parent, index)
        self._depth -= 1
        if isinstance(event, yaml.AliasEvent):
            if id(node) not in self._weights:
                raise _fault(event, f"*{event.anchor} contains itself")
            self._n_nodes += self._weights[id(node)]
        else:
            self._n_nodes += 1
        if self._n_nodes > N_NODES_MAX:
            raise _fault(event, f"more than {N_NODES_MAX} values, aliases counted as what they stand for")
        return node

    def compose_scalar_node(self, anchor: Any) -> Any:
        """A single value."""
        node = super().compose_scalar_node(anchor)
        self._weights[id(node)] = 1
        return node

    def compose_sequence_node(self, anchor: Any) -> Any:
        """A list."""
        before = self._n_nodes
        node = super().compose_sequence_node(anchor)
        self._weights[id(node)] = self._n_nodes - before + 1
        return node

    def compose_mapping_node(self, anchor: Any) -> Any:
        """A mapping, whose keys are words, each given once: plain YAML keeps the last one silently."""
        before, seen = self._n_nodes, set()
        node: Any = super().compose_mapping_node(anchor)
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _fault(key, "a key must be a single word")
            word = self.construct_object(key) if key.tag != f"{_TAG}merge" else "<<"
            if word in seen:
                raise _fault(key, f"key {_short(word)} is given twice")
            seen.add(word)
        self._weights[id(node)] = self._n_nodes - before + 1
        return node


for _tag, _pattern, _first in _PLAIN:
    _Loader.add_implicit_resolver(_tag, re.compile(rf"(?:{_pattern.pattern})\Z"), _first)


def _fault(node: Any, what: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=what, problem_mark=node.start_mark)


def _bool(loader: Any, node: Any) -> bool:
    text = loader.construct_scalar(node)
    if text.lower() not in ("true", "false"):
        raise _fault(node, f"{_short(text)} is neither true nor false")
    return bool(text.lower() == "true")


def _null(loader: Any, node: Any) -> None:
    if not _PLAIN[0][1].fullmatch(loader.construct_scalar(node)):
        raise _fault(node, "a null must be empty, null or ~")


def _int(loader: Any, node: Any) -> int:
    text = loader.construct_scalar(node)
    if not _PLAIN[2][1].fullmatch(text):
        raise _odd(node, text)
    if len(text) > DIGITS_MAX:
        raise _fault(node, f"the number {_short(text)} has more than {DIGITS_MAX} digits")
    return int(text)


def _float(loader: Any, node: Any) -> float:
    text = loader.construct_scalar(node)
    if not _PLAIN[3][1].fullmatch(text) and not _PLAIN[2][1].fullmatch(text):
        raise _odd(node, text)
    word = text.lower().lstrip("+-")
    if word in (".inf", ".nan"):
        return -math.inf if text[0] == "-" else float(word[1:])
    value = float(text)
    if math.isinf(value):
        raise _fault(node, f"the number {_short(text)} is too large (write .inf for infinity)")
    return value


def _refuse_number(loader: Any, node: Any) -> Any:
    raise _odd(node, loader.construct_scalar(node))


def _odd(node: Any, text: str) -> yaml.MarkedYAMLError:
    what = "a number must be decimal, without leading zeros, underscores or colons; text needs quotes"
    return _fault(node, f"value {_short(text)} is ambiguous: {what}")


def _refuse_tag(loader: Any, node: Any) -> Any:  # noqa: ARG001 - PyYAML's own interface
    raise _fault(node, f"tag {_short(node.tag)} is not allowed (write the value without it)")


for _name, _make in {"bool": _bool, "null": _null, "int": _int, "float": _float}.items():
    _Loader.add_constructor(f"{_TAG}{_name}", _make)
_SAFE: Any = yaml.SafeLoader
for _name in ("str", "seq", "map"):
    _Loader.add_constructor(f"{_TAG}{_name}", _SAFE.yaml_constructors[f"{_TAG}{_name}"])
_Loader.add_constructor(f"{_TAG}merge", _SAFE.yaml_constructors[f"{_TAG}str"])
_Loader.add_constructor(_ODD, _refuse_number)
_Loader.add_constructor(None, _refuse_tag)


class _Dumper(yaml.SafeDumper):
    """Quotes each text that a reader of YAML 1.1 or of 1.2 would take for something else."""


for _tag, _pattern, _first in _PLAIN:
    _Dumper.add_implicit_resolver(_tag, re.compile(rf"(?:{_pattern.pattern})\Z"), _first)


@functools.lru_cache(maxsize=32)
def _load(text: str) -> Any:
    """What a text says; a vehicle takes 20 ms to read, and programs make many worlds of few files."""
    return yaml.load(text, Loader=_Loader)


def parse(text: str, label: str) -> Any:
    """Parse YAML text; `label` names it in errors."""
    if len(text) > N_BYTES_MAX:
        raise ConfigError(f"{label}: {len(text)} characters (allowed {N_BYTES_MAX})")
    try:
        return copy.deepcopy(_load(text))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise ConfigError(f"{label}: {where}{error.problem}") from error
    except (yaml.YAMLError, TypeError, ValueError, RecursionError) as error:
        raise ConfigError(f"{label}: not YAML: {' '.join(str(error).split())}") from error


def read(path: Path) -> Any:
    """Read and parse a YAML file of UTF-8 text."""
    try:
        size = path.stat().st_size
        if size > N_BYTES_MAX:
            raise ConfigError(f"{path}: has {size} bytes (allowed {N_BYTES_MAX})")
        with path.open("rb") as file:
            text = file.read(N_BYTES_MAX + 1).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: cannot be read: byte {error.start + 1} is no UTF-8 text") from error
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    return parse(text, path.name)


def dump(data: Any, width: int = 120, flow: bool | None = False) -> str:
    """YAML text of plain data, keys in the given order, floats so that they read back as the same number.

    Args:
        data: Mappings, lists, text, numbers.
        width: Longest line that is not a single word.
        flow: Write all in braces (True), nothing (False), or the innermost mappings and lists (None).
    """
    options = {"sort_keys": False, "allow_unicode": True, "width": width, "default_flow_style": flow}
    return str(yaml.dump(data, Dumper=_Dumper, **options))  # type: ignore[call-overload]


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
    """Advice for a number in quotes; empty for anything else."""
    if isinstance(value, str) and _NUMBER_AS_TEXT.fullmatch(value.strip()):
        return "; in quotes this is text: write the number without them"
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
    text = repr(value[: _N_SHOWN + 1] if isinstance(value, (str, list, bytes)) else value)
    return text if len(text) <= _N_SHOWN else f"{text[:_N_SHOWN]}..."
