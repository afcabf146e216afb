"""What people add to the package without editing it: rewards, learners and sites of their own, found by name.

A name in an experiment or after an option is one of three:

    ephe                  of this package
    my_learner            of another package that is installed, which says so by an entry point (group `ivl.learners`)
    my_package.mine:Mine  `module:name` of anything that Python can import

A run keeps the name, so it can be reported and resumed wherever the name can be imported.

The current folder is searched as Python searches it: in a notebook, by `python -m ivl`, or with PYTHONPATH set. The
command `ivl` does not search it by itself, since a run folder that somebody has mailed names modules, too.
"""

import hashlib
import importlib
import inspect
import sys
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

from ivl import yamlfile
from ivl.errors import ConfigError

T = TypeVar("T")

_PATH_HINT = "is its folder on PYTHONPATH?"
_MAIN = "__main__"


class Registry(dict[str, T]):
    """Things of one kind by name; those of the package are the items, others are found when they are asked for."""

    def __init__(self, kind: str, make: Callable[[str, Any], T], own: Mapping[str, T]) -> None:
        """Begin with what the package has.

        Args:
            kind: What they are, in one word; `ivl.KINDs` is the group of entry points.
            make: Makes one of a name and of what was found there.
            own: Those of the package.
        """
        super().__init__(own)
        self.kind, self._make = kind, make

    @property
    def group(self) -> str:
        """Group of entry points by which other packages give more of them."""
        return f"ivl.{self.kind}s"

    def __missing__(self, name: str) -> T:
        """One that the package does not have itself.

        Raises:
            ConfigError: There is none; the message says what there is.
        """
        if ":" in name:
            return self._make(name, imported(name, self.kind))
        points = self._entry_points()
        if name in points:
            try:
                found = points[name].load()
            except (ImportError, AttributeError) as error:
                raise ConfigError(f"{self.kind} {name!r}: {points[name].value} cannot be imported: {error}") from error
            return self._make(name, found)
        near = yamlfile.did_you_mean(name, self.names())
        allowed = ", ".join(self.names())
        raise ConfigError(f"no {self.kind} {name!r} (allowed {allowed}, or module:name of your own){near}")

    def names(self) -> list[str]:
        """Names of those of the package, and of those that installed packages add."""
        return [*self, *(name for name in sorted(self._entry_points()) if name not in self)]

    def found(self) -> dict[str, T]:
        """All that have a name of their own; one that cannot be loaded is refused, and says why.

        Raises:
            ConfigError: An installed package names one that cannot be imported.
        """
        return {name: self[name] for name in self.names()}

    def _entry_points(self) -> dict[str, metadata.EntryPoint]:
        return {point.name: point for point in metadata.entry_points(group=self.group)}


def imported(name: str, kind: str) -> Any:
    """What `module:name` stands for.

    Raises:
        ConfigError: It cannot be imported, or is not there.
    """
    module_name, _, path = name.partition(":")
    if not module_name or not all(part.isidentifier() for part in [*module_name.split("."), *path.split(".")]):
        raise ConfigError(f"{kind} {name!r}: expected module:name, for example my_package.mine:Mine")
    try:
        found: Any = importlib.import_module(module_name)
    except ImportError as error:
        hint = "" if module_name in sys.modules else f" ({_PATH_HINT})"
        raise ConfigError(f"{kind} {name!r}: {module_name} cannot be imported: {error}{hint}") from error
    for part in path.split("."):
        if not hasattr(found, part):
            known = [other for other in vars(found) if not other.startswith("_")] if hasattr(found, "__dict__") else []
            near = yamlfile.did_you_mean(part, known)
            raise ConfigError(f"{kind} {name!r}: {module_name} has no {path!r}{near}")
        found = getattr(found, part)
    return found


def name_of(thing: Any, registry: Registry[Any]) -> str:
    """The name by which something can be found again.

    Args:
        thing: A name, something that is registered, or a class, function or module-level object of one's own.
        registry: Of things of its kind.

    Raises:
        ConfigError: Nobody could import it.
    """
    if isinstance(thing, str):
        return thing
    for name, known in registry.items():
        if known is thing:
            return name
    home, own = getattr(thing, "__module__", None), getattr(thing, "__qualname__", None)
    if own is None:
        home, own = _home(thing)
    if home is None or own is None or not all(part.isidentifier() for part in own.split(".")):
        raise ConfigError(
            f"{registry.kind} {thing!r}: cannot be imported: define it at the top level of a module or of the notebook"
        )
    full = f"{home}:{own}"
    if imported(full, registry.kind) is not thing:
        raise ConfigError(f"{registry.kind} {full}: is another object than the one that was given")
    return full


def _home(thing: Any) -> tuple[str | None, str | None]:
    """Module and name of an object that is neither a class nor a function."""
    near = getattr(getattr(thing, "compute", None), "__module__", None)
    for module_name in dict.fromkeys([near, _MAIN]):
        for name, value in vars(sys.modules[module_name]).items() if module_name in sys.modules else ():
            if value is thing:
                return module_name, name
    return None, None


def title(name: str) -> str:
    """A name as one component of a path, short: what follows the colon."""
    return name.rpartition(":")[2]


def refuse_main(field: str, name: Any) -> None:
    """Refuse a name that only this program can import, where other processes have to.

    Raises:
        ConfigError: It is one.
    """
    if isinstance(name, str) and name.partition(":")[0] == _MAIN:
        raise ConfigError(
            f"{field} {name}: worker processes cannot import it: put it into a file of its own, and import that"
        )


def described(names: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """What a manifest keeps of names that are not of this package, by the field that has them.

    A file's digest says whether the source is still the same one.
    """
    found: dict[str, dict[str, Any]] = {}
    for field, name in names.items():
        if ":" in name:
            found[field] = {"name": name, "sha256": _digest(sys.modules.get(name.partition(":")[0]))}
        else:
            for point in metadata.entry_points(group=f"ivl.{field}s", name=name):
                version = None if point.dist is None else f"{point.dist.name} {point.dist.version}"
                found[field] = {"name": name, "package": version, "sha256": _digest(sys.modules.get(point.module))}
    return found


def _digest(module: Any) -> str | None:
    """SHA-256 of a module's file; None if it has none, such as a notebook."""
    try:
        path = inspect.getsourcefile(module) if module is not None else None
        return None if path is None else hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except (TypeError, OSError):
        return None
