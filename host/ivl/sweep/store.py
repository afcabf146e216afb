"""The run folder of a sweep: open columnar files that are there whole or not at all.

A finished task leaves one Parquet part of each kind of table, named after the task; that of `tasks` is written last and
vouches for the others: it carries their digests. Files that no task vouches for are no part of the run. So a run that
was cut off at any moment loses the running tasks and nothing else, and what is done can be read while the rest is still
flown.
"""

import hashlib
import io
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd  # type: ignore[import-untyped]
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]
import xarray as xr

from ivl import files
from ivl.errors import StoreError
from ivl.layout import Layout
from ivl.store import check_version
from ivl.sweep import schema
from ivl.sweep.schema import CELL, KINDS, SCHEMA_VERSION, TASKS, TRIAL_KEY, VERSION_KEY

INDEX_KEY = b"ivl_parts"
"""Key of the metadata of a part of `tasks`: SHA-256 of each other part of the task, by kind, as `sealed` writes it."""
_PART = re.compile(r"\d{6,}\.parquet")

_SORT = {
    schema.TRIALS: TRIAL_KEY,
    schema.EPISODES: (*TRIAL_KEY, "episode"),
    schema.ROLLOUTS: (*TRIAL_KEY, "episode", "idx"),
    schema.MAP: ("vehicle", "gear_set", "gear", "speed_mps", "angle_deg", "d_ceil_m", "moment_Nmm"),
    schema.FAILURES: TRIAL_KEY,
    schema.TASKS: ("task",),
}


def read_manifest(run: Path | str) -> dict[str, Any]:
    """The manifest of a sweep's run folder.

    Raises:
        StoreError: There is none, it cannot be read, or it is of another schema version.
    """
    path = Path(run) / "manifest.json"
    if not path.is_file():
        raise StoreError(f"{run}: holds no sweep (no manifest.json)")
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error
    if not isinstance(manifest, dict) or not {"sweep", "map"} & set(manifest):
        raise StoreError(f"{path}: is not the manifest of a sweep or map")
    check_version(run, manifest, SCHEMA_VERSION)
    return manifest


def read_layout(run: Path | str) -> Layout:
    """What the columns of a run's policies and returns are (errors as `read_manifest`)."""
    return Layout.from_dict(read_manifest(run)["layout"])


def read_table(run: Path | str, kind: str) -> pa.Table:
    """One kind of table of a run (see `schema.KINDS`), its key in ascending order; no rows if nothing was kept.

    Raises:
        StoreError: The folder holds no sweep of this version, or a file cannot be read or has other columns than this
            version writes.
    """
    if kind not in KINDS:
        raise StoreError(f"{run}: no table {kind!r} (allowed {', '.join(KINDS)})")
    wanted = schema.schema(kind, read_layout(run))
    paths, parts = [], []
    for number, index in sorted(_index(Path(run)).items()):
        path = _part(Path(run), kind, number)
        if kind != TASKS and not _is_vouched(path, kind, index):
            continue
        paths.append(path)
        parts.append(_read_part(path, wanted, index.get(kind) if index else None))
    if not parts:
        return wanted.empty_table()
    varied = schema.varied_columns(parts[0].schema.names)
    for path, part in zip(paths, parts, strict=True):
        if schema.varied_columns(part.schema.names) != varied:
            raise StoreError(f"{path}: other varied paths than in {paths[0].name}: {', '.join(varied) or 'none'} there")
    wanted = pa.schema([*wanted, *(parts[0].schema.field(name) for name in varied)], metadata=wanted.metadata)
    plain = pa.schema([f.with_type(pa.string()) if pa.types.is_dictionary(f.type) else f for f in wanted])
    table = pa.concat_tables([part.cast(plain) for part in parts])  # Arrow does not sort dictionaries
    return table.sort_by([(name, "ascending") for name in _key(kind, varied)]).combine_chunks().cast(wanted)


def _key(kind: str, varied: Sequence[str]) -> list[str]:
    """Columns that name a row."""
    return [*varied, *_SORT[kind]]


def read_frame(run: Path | str, kind: str) -> pd.DataFrame:
    """One kind of table as a pandas frame; names are categories, units are in `frame.attrs["units"]`."""
    table = read_table(run, kind)
    frame = table.to_pandas()
    frame.attrs["units"] = {column.name: column.metadata[b"unit"].decode() for column in table.schema}
    return frame


def read_trials(run: Path | str) -> pd.DataFrame:
    """One row per trial; columns as `schema.schema("trials", layout)`."""
    return read_frame(run, schema.TRIALS)


def read_episodes(run: Path | str) -> pd.DataFrame:
    """One row per trial and episode."""
    return read_frame(run, schema.EPISODES)


def read_rollouts(run: Path | str) -> pd.DataFrame:
    """One row per rollout; no rows if the sweep did not keep them."""
    return read_frame(run, schema.ROLLOUTS)


def read_map(run: Path | str) -> pd.DataFrame:
    """One row per point of a policy map."""
    return read_frame(run, schema.MAP)


def to_xarray(run: Path | str, kind: str = schema.TRIALS) -> xr.Dataset:
    """A run as a labelled array: dimensions are the key of the table, variables have `units` and `long_name`.

    Vehicle, gear set, learner and varied paths become dimensions only if the run has more than one of them, else
    attributes. Cells that are missing are NaN, which makes floats of whole numbers: seeds for a replay come from
    `read_trials`.
    """
    table = read_table(run, kind)
    frame, columns, varied = table.to_pandas(), table.schema, schema.varied_columns(table.schema.names)
    key = _key(kind, varied)
    names = (*varied, "vehicle", "gear_set", "learner")
    single = [name for name in names if name in key and frame[name].nunique() <= 1]
    attributes = {name: str(frame[name].iloc[0]) for name in single if len(frame)}
    for name in (*CELL, *varied):
        if name in frame and isinstance(frame[name].dtype, pd.CategoricalDtype):
            frame[name] = frame[name].astype(object)
    indexed = frame.drop(columns=single).set_index([name for name in key if name not in single])
    data = xr.Dataset.from_dataframe(indexed)
    for name in [*data.data_vars, *data.coords]:
        field = columns.field(str(name))
        data[name].attrs = {"units": field.metadata[b"unit"].decode(), "long_name": field.metadata[b"doc"].decode()}
    data.attrs = {**attributes, "schema_version": SCHEMA_VERSION}
    return data


def _part(run: Path, kind: str, number: int) -> Path:
    return run / kind / f"{number:06d}.parquet"


def _index(run: Path) -> dict[int, dict[str, str] | None]:
    """Digests of the parts by kind, by number of the finished task; None for a run that was written without them.

    Raises:
        StoreError: The record of a task cannot be read, or is that of another task.
    """
    return {int(path.stem): _vouched(path) for path in _records(run)}


def _records(run: Path) -> list[Path]:
    return sorted(path for path in (run / TASKS).glob("*.parquet") if _PART.fullmatch(path.name))


def _vouched(path: Path) -> dict[str, str] | None:
    try:
        table = pq.read_table(io.BytesIO(path.read_bytes()))
        numbers = table.column("task").to_pylist()
        text = (table.schema.metadata or {}).get(INDEX_KEY)
        index = None if text is None else json.loads(text)
        if index is not None and sealed(table, index["parts"]) != text:
            raise ValueError("it is not as it was written")
    except (OSError, pa.ArrowException, KeyError, ValueError, TypeError) as error:
        raise StoreError(f"{path}: cannot be read: {error}; continue the run with --resume") from error
    if numbers != [int(path.stem)]:
        raise StoreError(f"{path}: is the record of task {numbers}: remove it, then continue the run with --resume")
    if index is None and read_manifest(path.parents[1]).get("vouched"):
        raise StoreError(f"{path}: is not as it was written; continue the run with --resume")
    return None if index is None else dict(index["parts"])


def sealed(table: pa.Table, parts: Mapping[str, str]) -> bytes:
    """Digests of the parts of a task, with one of themselves and of the record `table` that carries them."""
    rows = json.dumps([dict(parts), table.to_pylist()], sort_keys=True)
    seal = {"parts": dict(parts), "sha256": hashlib.sha256(rows.encode()).hexdigest()}
    return json.dumps(seal, sort_keys=True).encode()


def _is_vouched(path: Path, kind: str, index: Mapping[str, str] | None) -> bool:
    return kind in index if index is not None else path.exists()


def _read_part(path: Path, wanted: pa.Schema, sha256: str | None) -> pa.Table:
    try:
        data = path.read_bytes()
        if sha256 is not None and hashlib.sha256(data).hexdigest() != sha256:
            raise StoreError(f"{path}: is not as it was written; --resume flies its task again")
        table = pq.read_table(io.BytesIO(data))
    except (OSError, pa.ArrowException, ValueError, KeyError) as error:
        raise StoreError(f"{path}: cannot be read: {error}; --resume flies its task again") from error
    version = (table.schema.metadata or {}).get(VERSION_KEY, b"?").decode()
    if version != str(SCHEMA_VERSION):
        raise StoreError(f"{path}: schema version {version}, this program reads {SCHEMA_VERSION}")
    varied = schema.varied_columns(table.schema.names)
    if table.schema.names != [*wanted.names, *varied]:
        odd = sorted(set(table.schema.names) - set(varied) ^ set(wanted.names))
        raise StoreError(f"{path}: other columns than this version's: {', '.join(odd) or 'in another order'}")
    return table


def finished_tasks(run: Path) -> set[int]:
    """Numbers of the tasks whose results are in the run folder, whole and without failures."""
    return {int(path.stem) for path in _records(run) if _is_whole(run, path)}


def _is_whole(run: Path, record: Path) -> bool:
    """Whether all that a task sent back is there as it was written, and nothing of it failed."""
    try:
        index = _vouched(record)
    except StoreError:
        return False  # it is flown again
    if index is None:
        return not (run / schema.FAILURES / record.name).exists()
    return schema.FAILURES not in index and all(
        _sha256(run / kind / record.name) == sha256 for kind, sha256 in index.items()
    )


def _sha256(path: Path) -> str:
    """Digest of a file; empty if it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


def clear_unfinished(run: Path) -> None:
    """Remove parts of tasks that were cut off or had failures, so that they can be flown again."""
    keep = finished_tasks(run)
    for kind in (TASKS, *(k for k in KINDS if k != TASKS)):  # the record first, so that a cut in here is harmless
        for path in (run / kind).glob("*"):
            stale = _PART.fullmatch(path.name) and int(path.stem) not in keep
            if stale or files.is_leftover(path.name):
                path.unlink()


def write_part(run: Path, task: int, parts: Mapping[str, bytes]) -> None:
    """Store what a task sent back; `parts` are Parquet files by kind, that of `tasks` is written last.

    Raises:
        StoreError: The folder cannot be written; the task is flown again by `--resume`.
    """
    try:
        for kind in (*(k for k in parts if k != TASKS), TASKS):
            path = _part(run, kind, task)
            path.parent.mkdir(parents=True, exist_ok=True)
            files.write(path, parts[kind])
    except OSError as error:
        raise StoreError(f"{run}: cannot be written: {files.reason(error)}; then continue with --resume") from error
