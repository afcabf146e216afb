"""Files that a file names: vehicle, gear set, sensor set, site.

A relative path is relative to the file that names it, or to the working directory if it was typed as an option. A run
folder carries a copy of each such file under `files/NAME-DIGEST.yaml`, and its configuration names the copy. So the
identity of a file, from which random numbers and tables follow, is its own name and content, however it was spelled,
and a run can be moved, and read or resumed when the original is gone.
"""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from ivl import files, yamlfile
from ivl.errors import ConfigError

FIELDS = ("vehicle", "gear_set", "sensing", "site")
"""Fields of a task or an experiment that may name a file; all but a site, in place of a name in the package."""
FOLDER = "files"
_DIGITS = 12
_BYTES_MAX = yamlfile.N_BYTES_MAX

Model = TypeVar("Model", bound=BaseModel)


def is_path(text: str) -> bool:
    """Whether this is a path; otherwise it is a name that ships with the package."""
    return text.endswith((".yaml", ".yml")) or "/" in text


def absolute(value: Any, base: Path) -> Any:
    """A path relative to `base` as an absolute one, links kept as they are; anything else as it is."""
    if not isinstance(value, str) or not is_path(value):
        return value
    return os.path.normpath(base.absolute() / value)


def resolve(data: dict[str, Any], base: Path) -> None:
    """Make the paths in raw data of a file absolute, in place; `base` is the folder of the file."""
    for name in FIELDS:
        if name in data:
            data[name] = absolute(data[name], base)
    vary, tasks = data.get("vary"), data.get("tasks")
    if isinstance(vary, dict):
        data["vary"] = {
            name: [absolute(value, base) for value in values] if name in FIELDS and isinstance(values, list) else values
            for name, values in vary.items()
        }
    for task in tasks if isinstance(tasks, list) else ():
        if isinstance(task, dict):
            resolve(task, base)


def title(text: str) -> str:
    """A name, or the own name of a file, as one component of a path."""
    return Path(text).stem if is_path(text) else text


def identity(value: Any) -> Any:
    """What stands for a file in random numbers and tables; a name, and what is an identity already, as it is.

    Raises:
        ConfigError: The file cannot be read.
    """
    if not isinstance(value, str) or not is_path(value) or not Path(value).is_absolute():
        return value
    return _copy(Path(value), {})


def pack(chosen: Model) -> tuple[Model, dict[str, bytes]]:
    """An experiment or a sweep that names copies of its files, and the copies by their paths in the run folder.

    Raises:
        ConfigError: A file cannot be read.
    """
    copies: dict[str, bytes] = {}

    def named(value: Any) -> Any:
        if not isinstance(value, str) or not is_path(value) or _is_copy(value):
            return value
        return _copy(Path(value), copies)

    present = [name for name in FIELDS if name in type(chosen).model_fields]
    changes: dict[str, Any] = {name: named(getattr(chosen, name)) for name in present}
    if vary := getattr(chosen, "vary", None):
        changes["vary"] = {p: list(map(named, values)) if p in FIELDS else values for p, values in vary.items()}
    return chosen.model_copy(update=changes), copies


def save(copies: Mapping[str, bytes], folder: Path) -> None:
    """Write the copies of `pack` into a run folder.

    Raises:
        OSError: They cannot be written.
    """
    for name, content in copies.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        files.write(path, content)


def check(folder: Path) -> None:
    """Refuse copies in a run folder that are not as they were written.

    Raises:
        ConfigError: One is damaged, or cannot be read.
    """
    for path in sorted((folder / FOLDER).glob("*.y*ml")):
        try:
            digest = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise ConfigError(f"{path}: cannot be read: {files.reason(error)}") from error
        if not path.stem.endswith(f"-{digest[:_DIGITS]}"):
            raise ConfigError(f"{path}: is not as it was written")


def _is_copy(text: str) -> bool:
    return text.startswith(f"{FOLDER}/")


def _copy(path: Path, copies: dict[str, bytes]) -> str:
    """Add a file, and the files that it includes, to the copies; its own path there."""
    try:
        content = path.read_bytes()[: _BYTES_MAX + 1]
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    content = _with_own_files(path, content, copies)
    digest = hashlib.sha256(content).hexdigest()[:_DIGITS]
    stem = path.stem if path.stem.endswith(f"-{digest}") else f"{path.stem}-{digest}"
    name = f"{FOLDER}/{stem}{path.suffix}"
    copies[name] = content
    return name


def _with_own_files(path: Path, content: bytes, copies: dict[str, bytes]) -> bytes:
    """The content of a sensor set or a site, which names copies of the files that it names; of any other file as it is.

    A copy is named by its own name: it lies beside this one.
    """
    if b"includes" not in content and b"vehicle" not in content:
        return content
    data = yamlfile.read(path)
    if not isinstance(data, dict):
        return content

    def named(one: Any) -> Any:
        if not isinstance(one, str) or not is_path(one):
            return one
        return Path(_copy(Path(absolute(one, path.parent)), copies)).name

    changed = dict(data)
    if isinstance(data.get("includes"), list):
        changed["includes"] = [named(one) for one in data["includes"]]
    if "vehicle" in data:
        changed["vehicle"] = named(data["vehicle"])
    return content if changed == data else yamlfile.dump(changed).encode()
