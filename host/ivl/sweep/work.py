"""What a worker does with a task: fly it, make tables of it, send them back as Parquet files.

A worker needs this package and the native library, and nothing of the client's files: the world comes with the task.
"""

import hashlib
import os
import pickle
import platform
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import pyarrow as pa  # type: ignore[import-untyped]
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from ivl import native, numerics
from ivl.errors import NativeError
from ivl.sweep import policymap, schema, tables, trials
from ivl.sweep.config import PolicyMap, Sweep
from ivl.sweep.plan import DaskTask
from ivl.sweep.store import INDEX_KEY, sealed
from ivl.sweep.trials import Trial
from ivl.sweep.vary import as_cell
from ivl.world import World

Tables = dict[str, pa.Table]
LIMIT_S_MIN, SLOW_S_PER_ROLLOUT = 600.0, 0.1
_POINTS_MAX = 1000  # points of a map's cell, as far as its limit of time is concerned


@dataclass(frozen=True)
class Done:
    """A finished task.

    Attributes:
        parts: Parquet file of each kind of table.
        n_trials: Trials (or map cells) that were finished.
        n_failed: Trials that were not.
        n_rollouts: Rollouts flown.
        processor_s: Processor time.
        wall_s: Wall time.
        worker: Host and process.
    """

    parts: dict[str, bytes]
    n_trials: int
    n_failed: int
    n_rollouts: int
    processor_s: float
    wall_s: float
    worker: str


def run_packed(
    grid: Sweep | PolicyMap, packed_world: bytes, task: DaskTask, library_sha256: str, kernel: str, limit_s: float
) -> Done:
    """`run_task` on a worker, with the world pickled: it cannot be unpacked by another native library.

    A task that takes longer than `limit_s` ends its worker, since native code cannot be interrupted otherwise.

    Raises:
        NativeError: This worker computes otherwise than the client, so that its bits would differ.
    """
    if _library_sha256() != library_sha256:
        raise NativeError(f"{native.library().path}: this worker's native library is not that of the client")
    if numerics.kernel() != kernel:
        raise NativeError(
            f"this worker computes with {numerics.kernel()}, the client with {kernel}: results would differ in their "
            f"last bits ({numerics.ADVICE})"
        )
    watchdog = threading.Timer(limit_s, _give_up, (task.number, limit_s))
    watchdog.daemon = True
    watchdog.start()
    try:
        return run_task(grid, pickle.loads(packed_world), task)
    finally:
        watchdog.cancel()


def limit_s(grid: Sweep | PolicyMap, task: DaskTask) -> float:
    """How long a task may take: a hundred times what it takes on a slow processor, and not less than ten minutes."""
    n_each = grid.budget + grid.check_rollouts if isinstance(grid, Sweep) else grid.n_rollouts * _POINTS_MAX
    return max(LIMIT_S_MIN, SLOW_S_PER_ROLLOUT * n_each * len(task.trials))


def _give_up(number: int, limit_s: float) -> None:
    print(f"task {number} takes longer than {limit_s:.0f} s: its worker ends", file=sys.stderr, flush=True)
    os._exit(os.EX_TEMPFAIL)


def run_task(grid: Sweep | PolicyMap, world: World, task: DaskTask) -> Done:
    """Fly a task on one thread; trials that raise are reported in `failures`, the others are not touched by it."""
    began, processor = time.monotonic(), time.process_time()
    at = grid.at(task.varied)
    with threadpool_limits(1):  # the number of BLAS threads changes the last bits of a search
        flown, failed = _fly_all_or_each(at, world, task.trials)
        found = [one for one, _ in flown]
        merged = {kind: pa.concat_tables([one[kind] for one in found]) for kind in (found[0] if found else ())}
        if failed:
            merged[schema.FAILURES] = tables.failures_table(at, task.gear, task.number, failed)
        parts = {kind: tables.encode(_with_varied(table, task)) for kind, table in merged.items()}
    return Done(
        parts=parts,
        n_trials=len(task.trials) - len(failed),
        n_failed=len(failed),
        n_rollouts=sum(n for _, n in flown),
        processor_s=time.process_time() - processor,
        wall_s=time.monotonic() - began,
        worker=f"{platform.node()}:{os.getpid()}",
    )


def lost(grid: Sweep | PolicyMap, task: DaskTask, error: Exception) -> Done:
    """A task that no worker could finish: all its trials failed."""
    failed = [(trial, error) for trial in task.trials]
    table = tables.failures_table(grid.at(task.varied), task.gear, task.number, failed)
    parts = {schema.FAILURES: tables.encode(_with_varied(table, task))}
    return Done(parts, 0, len(failed), 0, 0.0, 0.0, "")


def record(task: DaskTask, done: Done) -> bytes:
    """The row of the `tasks` table, as a Parquet file that vouches for the task's other parts."""
    columns = {
        "task": [task.number],
        "n_trials": [done.n_trials],
        "n_failed": [done.n_failed],
        "n_rollouts": [done.n_rollouts],
        "processor_s": [done.processor_s],
        "wall_s": [done.wall_s],
        "result_bytes": [sum(len(part) for part in done.parts.values())],
        "worker": [done.worker],
    }
    table = tables.make_table(schema.TASKS, columns)
    index = {kind: hashlib.sha256(part).hexdigest() for kind, part in done.parts.items()}
    return tables.encode(table.replace_schema_metadata({**table.schema.metadata, INDEX_KEY: sealed(table, index)}))


def _with_varied(table: pa.Table, task: DaskTask) -> pa.Table:
    """The table with a column for each varied path that has none of its own."""
    for path, value in task.varied:
        if path not in schema.COLUMN_OF:
            cell = as_cell(value)
            field = schema.varied_field(path, isinstance(cell, float))
            table = table.append_column(field, pa.array([cell] * table.num_rows).cast(field.type))
    return table


def _fly_all_or_each(
    grid: Sweep | PolicyMap, world: World, names: Sequence[Trial]
) -> tuple[list[tuple[Tables, int]], list[tuple[Trial, Exception]]]:
    """Everything in one go; if that raises, one after the other, so that only those fail that must."""
    try:
        return [_fly(grid, world, names)], []
    except Exception:  # noqa: BLE001 - whoever raises it again below is reported
        flown, failed = [], []
        for name in names:
            try:
                flown.append(_fly(grid, world, [name]))
            except Exception as error:  # noqa: BLE001 - a cell fails alone, whatever it raises, and is reported
                failed.append((name, error))
        return flown, failed


def _fly(grid: Sweep | PolicyMap, world: World, names: Sequence[Trial]) -> tuple[Tables, int]:
    """Tables of some trials or map cells, and how many rollouts they took."""
    if isinstance(grid, PolicyMap):
        table = policymap.fly(grid, world, names)
        return {schema.MAP: table}, table.num_rows * grid.n_rollouts
    log = trials.run(grid, world, names)
    made = {
        schema.TRIALS: tables.trials_table(grid, world.gear, log),
        schema.EPISODES: tables.episodes_table(grid, world.gear, log),
    }
    if grid.keep_rollouts:
        made[schema.ROLLOUTS] = tables.rollouts_table(grid, world.gear, log)
    return made, log.n_rollouts


@cache
def _library_sha256() -> str:
    return native.library().digest()
