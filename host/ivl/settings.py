"""Values by their dotted path: in YAML, after `--set a.b=c` and after `--vary a.b=x,y`.

A path is a field of an experiment or a sweep (`learner.name`), or a parameter of the world (`sense.latency`), which
goes into the overrides with its unit.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from ivl import model, native, references, yamlfile
from ivl.errors import ConfigError

PACKAGE_DIR = Path(__file__).parent

Finite = Annotated[float, Field(allow_inf_nan=False)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$", max_length=64)]
"""What something calls itself: run folders are named after it, so it is one component of a path, and no hidden one."""


class Strict(BaseModel):
    """Base of what is read from YAML: no conversion, no unknown key, no change afterwards."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class Setting(Strict):
    """A world parameter that differs from what vehicle, gear and sensor set say."""

    value: float
    unit: str = Field(min_length=1)
    source: str = Field(min_length=1)


def locate(path: str, shipped: Sequence[str]) -> Path:
    """A file as given, else inside this package, where its bare name is enough; `shipped` are the names that there are.

    Raises:
        ConfigError: There is no such file.
    """
    named = [name for name in shipped if path in (Path(name).stem, Path(name).name)]
    for candidate in (Path(path), PACKAGE_DIR / path, *(PACKAGE_DIR / name for name in named)):
        if candidate.is_file():
            return candidate
    stems = [Path(name).stem for name in shipped]
    near = yamlfile.did_you_mean(Path(path).stem, stems)
    raise ConfigError(f"{path}: no such file, neither here nor in the package (shipped: {', '.join(shipped)}){near}")


def read_mapping(file: Path) -> dict[str, Any]:
    """The fields of a YAML file, not checked yet; the files that it names by absolute paths."""
    data = yamlfile.read(file)
    if not isinstance(data, dict):
        raise ConfigError(f"{file.name}: expected a mapping of fields, got {type(data).__name__}")
    references.resolve(data, file.parent)
    return data


def parse_setting(setting: str) -> tuple[str, Any]:
    """Split "name=value"; the value is read as YAML."""
    name, equals, text = setting.partition("=")
    if not equals or not name.strip():
        raise ConfigError(f"--set {setting!r}: expected name=value, for example sense.latency=0.01")
    return name.strip(), yamlfile.parse(text, f"--set {setting}")


def apply_setting(data: dict[str, Any], setting: str, kind: type[BaseModel], label: str) -> None:
    """Write one setting into raw data.

    Args:
        data: Fields as read from a file.
        setting: "a.b=value".
        kind: What the data is to become: its fields, and the parameters of the world, are the paths there are.
        label: File that errors name.
    """
    path, value = parse_setting(setting)
    apply_value(data, path, value, kind, label, "set on the command line", f"--set {setting}")


def apply_value(
    data: dict[str, Any], path: str, value: Any, kind: type[BaseModel], label: str, source: str, said: str
) -> None:
    """Write one value into raw data.

    Args:
        data: As for `apply_setting`, and so are `kind` and `label`.
        path: Dotted path.
        value: The value.
        kind: What the data is to become.
        label: File that errors name.
        source: Where the value comes from; stands beside an override.
        said: How it was said, for errors.
    """
    check_path(path, kind, label)
    value = references.absolute(value, Path.cwd()) if path in references.FIELDS else value
    put(data, path, value, source, f"{label}: {said}")


def check_path(path: str, kind: type[BaseModel], label: str, forbidden: Sequence[str] = ()) -> None:
    """Refuse a path that is neither a field nor a parameter of the world, nor below a field that is one value.

    Args:
        path: Dotted path.
        kind: Model with the fields.
        label: File (and place in it) that errors name.
        forbidden: Fields of the model that are not to be had here.

    Raises:
        ConfigError: One line naming the path and the nearest valid one.
    """
    parameters = native.library().params
    known = {name: free for name, free in yamlfile.paths(kind).items() if name.split(".")[0] not in forbidden}
    free = any(path.startswith(f"{name}.") for name, free in known.items() if free)
    if path in known or path in parameters or free:
        return
    parent = path.rpartition(".")[0]
    if parent in known and not any(name.startswith(f"{parent}.") for name in known):
        raise ConfigError(f"{label}: {path}: {parent} is a value, it has no field {path.rpartition('.')[2]!r}")
    group = path.partition(".")[0]
    of_world = group not in known and any(name.startswith(f"{group}.") for name in parameters)
    what = "unknown parameter" if of_world else "unknown key"
    names = list(parameters) if of_world else [*known, *parameters]
    raise ConfigError(f"{label}: {path}: {what}{yamlfile.did_you_mean(path, names, at_any_distance=True)}")


def put(data: dict[str, Any], path: str, value: Any, source: str, label: str) -> None:
    """Write one value into raw data; a parameter of the world becomes an override with its unit.

    Args:
        data: Fields of a file, changed in place (its overrides are replaced, not changed).
        path: Dotted path, checked by `check_path`.
        value: The value.
        source: Where it comes from; stands beside an override.
        label: What errors name.
    """
    parameter = native.library().params.get(path)
    if parameter is not None:
        setting = {"value": _checked(path, value, label), "unit": parameter.unit, "source": source}
        data["overrides"] = {**(data.get("overrides") or {}), path: setting}
        return
    *parents, last = _keys(path)
    for key in parents:
        data[key] = {} if data.get(key) is None else data[key]
        if not isinstance(data[key], dict):
            raise ConfigError(f"{label}: {path}: {key} is a value, it has no field {last!r}")
        data[key] = dict(data[key])
        data = data[key]
    if parents and last == "name" and data.get(last) != value:
        data.pop("options", None)  # they belong to the reward or learner of the old name
    data[last] = value


def _keys(path: str) -> list[str]:
    """The keys of a path; the dotted name of a parameter within it is one key, as in `family.parameters.body.mass`."""
    keys: list[str] = []
    for part in path.split("."):
        if keys and f"{keys[-1]}.{part}" in native.library().params:
            keys[-1] += f".{part}"
        else:
            keys.append(part)
    return keys


def _checked(name: str, value: Any, label: str) -> float:
    try:
        return model.check_override(name, value)
    except ConfigError as error:
        raise ConfigError(f"{label}: {error}") from error


def check_overrides(overrides: Mapping[str, Setting], label: str) -> None:
    """Check names, values and units of overrides; `label` names their file in errors."""
    for name, setting in overrides.items():
        _checked(name, setting.value, label)
        unit = native.library().params[name].unit
        if setting.unit != unit:
            raise ConfigError(
                f"{label}: override: {name}: value {setting.value!r} has unit {setting.unit!r}, not {unit!r}"
            )
