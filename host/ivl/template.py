"""New files to begin with: an experiment with a comment for each field, vehicles, gears, and schemas for editors."""

import json
import re
import textwrap
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from ivl import experiment, files, model, references, yamlfile
from ivl.errors import ConfigError
from ivl.experiment import Experiment

_WIDTH = 118
_FIRST = ("name", "doc", "vehicle", "gear", "gear_set", "speed_mps", "angle_deg", "start")
"""Fields that people change first; the others follow in the order of the model."""


def write_experiment(path: Path, base: str) -> Experiment:
    """Write a new experiment with comments, which flies what another one flies.

    Args:
        path: File to write, which must not exist; the experiment is called as the file.
        base: Experiment to begin with, as `ivl.experiment.load` takes it.

    Raises:
        ConfigError: The file exists or cannot be written, its name is none for an experiment, or the base is wrong.
    """
    _check_new(path)
    data = {**experiment.load(base).model_dump(), "name": path.stem, "flown": []}
    chosen = experiment.from_data(data, path.name)
    head = (
        f"A copy of {base}, to be changed: ivl learn {path}. Each parameter of the world (ivl list params) can stand "
        "under overrides, with value, unit and source. An editor completes and checks this file by the schema that "
        "`ivl schema experiment` prints."
    )
    _write(path, f"{_comment(head)}\n{commented(chosen)}")
    return chosen


def write_vehicle(path: Path, base: str) -> None:
    """Write a copy of a vehicle's file, with its sources and comments, under the name of the new file.

    Raises:
        ConfigError: The file exists or cannot be written, or there is no such vehicle.
    """
    _check_new(path)
    model.load_vehicle(base)
    _write_copy(path, base, model.VEHICLES_DIR)


def write_gear_set(path: Path, base: str) -> None:
    """Write a copy of a file of landing gears, likewise.

    Raises:
        ConfigError: The file exists or cannot be written, or there is no such set.
    """
    _check_new(path)
    model.list_gears(base)
    _write_copy(path, base, model.GEARS_DIR)


def _write_copy(path: Path, base: str, folder: Path) -> None:
    """Copy a file of the package, or one that was given by its path; only its name changes."""
    source = Path(base) if references.is_path(base) else folder / f"{base}.yaml"
    name = f"name: {json.dumps(path.stem, ensure_ascii=False)}"  # in quotes: a file may be called yes.yaml
    text, n = re.subn(r"^name: .*$", lambda _: name, source.read_text(encoding="utf-8"), count=1, flags=re.M)
    if n != 1:
        raise ConfigError(f"{base}: has no line with its name")
    _write(path, text)


def _check_new(path: Path) -> None:
    if path.exists():
        raise ConfigError(f"{path}: exists already: choose another name")
    if path.suffix not in (".yaml", ".yml"):
        raise ConfigError(f"{path}: is to be a YAML file: call it {path.with_suffix('.yaml')}")


def _write(path: Path, text: str) -> None:
    try:
        files.write(path, text)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {files.reason(error)}") from error


def commented(model: BaseModel) -> str:
    """A model as YAML, the description of each field before it."""
    data = model.model_dump(mode="json")
    fields = type(model).model_fields
    order = [name for name in _FIRST if name in data] + [name for name in data if name not in _FIRST]
    parts = []
    for name in order:
        description = fields[name].description if name in fields else None
        parts.append(_comment(_sentence(description)) if description else "")
        nested = isinstance(data[name], (dict, list)) and data[name]
        parts.append(yamlfile.dump({name: data[name]}, flow=None if nested else False))
    return "".join(parts)


def schema(kind: str) -> dict[str, Any]:
    """The JSON schema of a kind of file.

    Raises:
        ConfigError: There is no such kind.
    """
    models = _models()
    if kind not in models:
        raise ConfigError(
            f"schema: no kind {kind!r} (allowed {', '.join(models)}){yamlfile.did_you_mean(kind, models)}"
        )
    found = models[kind].model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found}


def kinds() -> list[str]:
    """Kinds of files that have a schema."""
    return list(_models())


def _models() -> dict[str, type[BaseModel]]:
    from ivl.landing import LandingSpec
    from ivl.site.file import SiteFile
    from ivl.sweep.config import PolicyMap, Sweep

    return {"experiment": Experiment, "sweep": Sweep, "map": PolicyMap, "landing": LandingSpec, "site": SiteFile}


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}{'' if text.endswith('.') else '.'}"


def _comment(text: str) -> str:
    return "".join(f"# {line}\n" for line in textwrap.wrap(text, _WIDTH))
