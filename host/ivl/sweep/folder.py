"""The run folder of a sweep, begun or continued: its manifest, and the check that a resumed run is the same one."""

import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import ivl
from ivl import files, native, numerics, references, yamlfile
from ivl.errors import ConfigError, StoreError
from ivl.layout import EMPTY, layout_of
from ivl.run import git_commit
from ivl.store import lock_folder, write_json
from ivl.sweep import schema, store
from ivl.sweep.config import PolicyMap, Sweep
from ivl.world import World

_PACKAGES = ("numpy", "pyarrow", "dask", "distributed")
_LEFT_BY_A_CREATION = {"lock", "sweep.yaml", "map.yaml", references.FOLDER}


@dataclass(frozen=True)
class OpenRun:
    """A run folder that this process keeps for itself until it is closed.

    Attributes:
        task_size: Trials per task, fixed when the run began: it decides which trials a part file holds.
        lock: Descriptor that keeps the folder.
    """

    task_size: int
    lock: int

    def close(self) -> None:
        """Release the folder."""
        os.close(self.lock)


def open_run(
    run: Path,
    grid: Sweep | PolicyMap,
    worlds: Mapping[str, World],
    task_size: int,
    resume: bool,
    copies: Mapping[str, bytes] | None = None,
) -> OpenRun:
    """Begin a run, or continue one; grid and copies are those of `ivl.references.pack`.

    Raises:
        StoreError: The folder holds something else, nothing to resume, another run, or is in use.
    """
    if resume and not (run / "manifest.json").exists():
        raise StoreError(f"{run}: there is no run to resume")
    try:
        run.mkdir(parents=True, exist_ok=True)
        lock = lock_folder(run)
    except OSError as error:
        raise StoreError(f"{run}: cannot be written: {files.reason(error)}") from error
    try:
        manifest = make_manifest(grid, worlds, task_size)
        if resume:
            _check_same(run, manifest)
            store.clear_unfinished(run)
        else:
            _check_empty(run)
            references.save(copies or {}, run)
            files.write(run / f"{_kind(grid)}.yaml", grid.to_yaml())
            write_json(run / "manifest.json", manifest)
        return OpenRun(int(store.read_manifest(run)["task_size"]), lock)
    except OSError as error:
        os.close(lock)
        raise StoreError(f"{run}: cannot be written: {files.reason(error)}") from error
    except BaseException:
        os.close(lock)
        raise


def make_manifest(grid: Sweep | PolicyMap, worlds: Mapping[str, World], task_size: int) -> dict[str, Any]:
    """What identifies a run: resolved file, hashes, versions, seed, units."""
    kinds = (schema.MAP,) if isinstance(grid, PolicyMap) else (schema.TRIALS, schema.EPISODES, schema.ROLLOUTS)
    layout = EMPTY if isinstance(grid, PolicyMap) else layout_of(grid)
    return {
        "schema_version": schema.SCHEMA_VERSION,
        "vouched": True,
        _kind(grid): grid.model_dump(mode="json"),
        "vehicle": grid.vehicle,
        "gear_set": grid.gear_set,
        "gears": list(dict.fromkeys(world.gear for world in worlds.values())),
        "learner": ", ".join(grid.learner_names()) if isinstance(grid, Sweep) else None,
        "seed": grid.seed,
        "task_size": task_size,
        "model_sha256": {name: world.params.digest() for name, world in worlds.items()},
        "parameters": {name: _finite(world.params.values) for name, world in worlds.items()},
        "library_sha256": native.library().digest(),
        "ivl_version": ivl.__version__,
        "git_commit": git_commit(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in _PACKAGES},
        "numerics": numerics.kernel(),
        "platform": platform.platform(),
        "created_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "units": {kind: schema.units(kind, layout) for kind in kinds},
        "layout": layout.to_dict(),
    }


def _kind(grid: Sweep | PolicyMap) -> str:
    return "map" if isinstance(grid, PolicyMap) else "sweep"


def _finite(values: Mapping[str, float]) -> dict[str, float | None]:
    """JSON has no infinity: None stands for it."""
    return {name: value if abs(value) < float("inf") else None for name, value in values.items()}


def _resolved(kind: str, data: dict[str, Any]) -> dict[str, Any]:
    """The fields of a manifest, those that its version did not have yet at their defaults."""
    try:
        return yamlfile.validate(PolicyMap if kind == "map" else Sweep, data, kind).model_dump(mode="json")
    except ConfigError:
        return data


def _check_empty(run: Path) -> None:
    if (run / "manifest.json").exists():
        raise StoreError(f"{run}: holds a run already: continue it with --resume, or choose another --out")
    foreign = sorted(
        path.name for path in run.iterdir() if path.name not in _LEFT_BY_A_CREATION and not files.is_leftover(path.name)
    )
    if foreign:
        raise StoreError(f"{run}: is not empty ({foreign[0]} ...) and holds no run: choose another --out")


def _check_same(run: Path, new: Mapping[str, Any]) -> None:
    """Refuse to mix two configurations, models or libraries in one run."""
    old = store.read_manifest(run)
    for kind in ("sweep", "map"):
        then, now = _resolved(kind, old.get(kind) or {}), new.get(kind) or {}
        for field in sorted({*then, *now}):
            if then.get(field) != now.get(field):
                what = f"{field}: it has {then.get(field)!r}, now {now.get(field)!r}"
                raise StoreError(f"{run}: cannot be resumed: {what}")
    for key, what in (("model_sha256", "vehicle or gear files"), ("library_sha256", "native library")):
        if old.get(key) != new[key]:
            raise StoreError(
                f"{run}: cannot be resumed: the {what} changed since it began, so its tables would mix two models"
            )
    if old.get("numerics", new["numerics"]) != new["numerics"]:
        raise StoreError(
            f"{run}: cannot be resumed: it was computed by {old['numerics']}, here is {new['numerics']} "
            f"({numerics.ADVICE})"
        )
