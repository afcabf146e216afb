"""New files to begin with: an experiment with a comment for each field, and schemas for editors."""

import textwrap
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from ivl import experiment, files, yamlfile
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
    if path.exists():
        raise ConfigError(f"{path}: exists already: choose another name")
    if path.suffix not in (".yaml", ".yml"):
        raise ConfigError(f"{path}: is to be a YAML file: call it {path.with_suffix('.yaml')}")
    data = {**experiment.load(base).model_dump(), "name": path.stem, "flown": []}
    chosen = experiment.from_data(data, path.name)
    head = (
        f"A copy of {base}, to be changed: ivl learn {path}. Each parameter of the world (ivl list params) can stand "
        "under overrides, with value, unit and source. An editor completes and checks this file by the schema that "
        "`ivl schema experiment` prints."
    )
    try:
        files.write(path, f"{_comment(head)}\n{commented(chosen)}")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {files.reason(error)}") from error
    return chosen


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
