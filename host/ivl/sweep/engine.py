"""The engine: tasks to a cluster, finished ones to the run folder, until nothing is left.

    if __name__ == "__main__":  # the workers import this file, too
        result = run(load_sweep("sweeps/smoke.yaml"), Path("runs/smoke"))
        print(result.n_trials, result.n_failed)

The client alone writes, each task as soon as it is back: workers share no file system with it, and whatever is cut off
loses the tasks that were running. A task whose worker is lost goes to another one; a trial that raises is reported in
`failures` and flown again by the next `--resume`.
"""

import pickle
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import distributed

from ivl import native, numerics, references
from ivl.errors import NativeError, RolloutError
from ivl.sweep import cluster, folder, plan, schema, store
from ivl.sweep.config import PolicyMap, Sweep
from ivl.sweep.plan import DaskTask
from ivl.sweep.vary import Varied, world_name
from ivl.sweep.work import limit_s, lost, record, run_packed
from ivl.world import World

_dask: Any = distributed  # its calls carry no types
RETRIES = 2
"""A task that raises (not a trial in it) is tried so many times again: it is the machine's fault, not the trials'."""
_AHEAD = 3  # tasks that wait at the scheduler for each that runs, so that no worker is idle
_REFILL_S = 1.0


@dataclass(frozen=True)
class Standing:
    """How far a run is.

    Attributes:
        n_trials: Trials (or map cells) in all.
        n_done: Finished ones, failed ones among them, those of earlier sessions too.
        n_failed: Failed ones of this session.
        n_rollouts: Rollouts of this session.
        n_workers: Workers at the moment.
        elapsed_s: Wall time of this session, since the first task went out.
        left_s: Time to go by this session's throughput, NaN before its first task is back.
    """

    n_trials: int
    n_done: int
    n_failed: int
    n_rollouts: int
    n_workers: int
    elapsed_s: float
    left_s: float


@dataclass(frozen=True)
class Result:
    """What a session did; fields as `Standing`.

    Attributes:
        run: The run folder.
        n_tasks: Tasks of this session.
        n_trials: Trials of the whole run.
        n_failed: Failed ones of this session.
        n_rollouts: Rollouts of this session.
        elapsed_s: Wall time of this session.
        processor_s: Processor time of the workers in this session.
    """

    run: Path
    n_tasks: int
    n_trials: int
    n_failed: int
    n_rollouts: int
    elapsed_s: float
    processor_s: float


def run(
    grid: Sweep | PolicyMap,
    run_folder: Path,
    *,
    resume: bool = False,
    scheduler: str | None = None,
    workers: int | None = None,
    task_size: int | None = None,
    on_standing: Callable[[Standing], None] | None = None,
) -> Result:
    """Fly a sweep or a map, or the rest of it.

    Args:
        grid: What to fly.
        run_folder: Where its tables go; must not hold a run unless `resume`.
        resume: Continue the run in `run_folder`.
        scheduler: See `ivl.sweep.cluster.open_client`.
        workers: Likewise.
        task_size: Trials per task; omitted: as the number of workers suggests. A resumed run keeps its own.
        on_standing: Called before the first task and after each.

    Raises:
        StoreError: The folder cannot be used, or its run is of another configuration.
        ConfigError: A landing gear, the vehicle or the cluster's description is wrong.
        RolloutError: The scheduler is lost; the run can be resumed.
    """
    cluster.check(scheduler, workers)
    worlds = grid.worlds()
    packed, copies = references.pack(grid)
    size = task_size or plan.good_size(grid, workers or cluster.default_workers())
    with closing(folder.open_run(run_folder, packed, _renamed(grid, worlds), size, resume, copies)) as opened:
        tasks = [replace(task, varied=_identities(task.varied)) for task in plan.plan(grid, opened.task_size)]
        done = store.finished_tasks(run_folder)
        session = _Session(run_folder, packed, _renamed(grid, worlds), tasks, done, on_standing)
        session.tell()
        if session.waiting:
            with cluster.open_client(scheduler, workers) as client:
                session.fly(client)
        return session.result()


def _in_words(error: Exception, limit_s: float) -> Exception:
    """What happened to a task that no worker could finish."""
    if not isinstance(error, distributed.KilledWorker):
        return error
    return RolloutError(
        f"its worker died {RETRIES} times or more: of too little memory (use fewer --workers), killed by somebody, or "
        f"because the task took longer than {limit_s:.0f} s"
    )


def _identities(varied: Varied) -> Varied:
    """The values of a variant, files by what stands for them in a run."""
    return tuple((path, references.identity(value) if path in references.FIELDS else value) for path, value in varied)


def _renamed(grid: Sweep | PolicyMap, worlds: dict[str, World]) -> dict[str, World]:
    """The worlds by names in which files are called by what stands for them in a run."""
    found = {}
    for varied in grid.variants():
        for gear in grid.at(varied).gear_names():
            found[world_name(gear, _identities(varied))] = worlds[world_name(gear, varied)]
    return found


class _Session:
    """One session of a run: the tasks that are left, and the figures of those that came back."""

    def __init__(
        self,
        run_folder: Path,
        grid: Sweep | PolicyMap,
        worlds: dict[str, World],
        tasks: list[DaskTask],
        done: set[int],
        on_standing: Callable[[Standing], None] | None,
    ) -> None:
        self._run, self._grid = run_folder, grid
        self._worlds = {name: pickle.dumps(world) for name, world in worlds.items()}
        self.waiting = [task for task in tasks if task.number not in done]
        self._n_trials = sum(len(task.trials) for task in tasks)
        self._n_before = sum(len(task.trials) for task in tasks if task.number in done)
        self._n_done = self._n_failed = self._n_rollouts = self._n_tasks = self._n_workers = 0
        self._processor_s = 0.0
        self._on_standing = on_standing
        self._id = uuid.uuid4().hex
        self._library_sha256 = native.library().digest()
        self._began = self._counted = time.monotonic()

    def fly(self, client: Any) -> None:
        """Keep the cluster busy until every task is back."""
        self._began = time.monotonic()
        self._count_workers(client)
        tasks: dict[str, DaskTask] = {}
        futures = _dask.as_completed()
        source = iter(self.waiting)
        self._refill(client, futures, tasks, source)
        for future in futures:
            self._keep(tasks.pop(future.key), future)
            if time.monotonic() - self._counted > _REFILL_S:
                self._count_workers(client)
            self._refill(client, futures, tasks, source)
            self.tell()

    def result(self) -> Result:
        """Figures of the session."""
        elapsed_s = time.monotonic() - self._began
        return Result(
            self._run, self._n_tasks, self._n_trials, self._n_failed, self._n_rollouts, elapsed_s, self._processor_s
        )

    def _count_workers(self, client: Any) -> None:
        self._n_workers = sum(client.nthreads().values())
        self._counted = time.monotonic()

    def _refill(self, client: Any, futures: Any, tasks: dict[str, DaskTask], source: Iterator[DaskTask]) -> None:
        """Hand out tasks until enough of them wait: not all at once, a scheduler's memory is finite too."""
        while len(tasks) < (1 + _AHEAD) * max(self._n_workers, 1) and (task := next(source, None)):
            future = client.submit(
                run_packed,
                self._grid,
                self._worlds[task.world],
                task,
                self._library_sha256,
                numerics.kernel(),
                limit_s(self._grid, task),
                key=f"{self._grid.name}-{self._id}-{task.number}",
                retries=RETRIES,
                pure=False,
            )
            tasks[future.key] = task
            futures.add(future)

    def _keep(self, task: DaskTask, future: Any) -> None:
        """Write what came back, whatever it is."""
        if future.cancelled():
            raise RolloutError("the scheduler dropped its tasks; continue with --resume")
        error = future.exception()
        if error is None:
            done = future.result()
        elif isinstance(error, NativeError):
            raise error
        else:
            done = lost(self._grid, task, _in_words(error, limit_s(self._grid, task)))
        store.write_part(self._run, task.number, {**done.parts, schema.TASKS: record(task, done)})
        self._n_tasks += 1
        self._n_done += len(task.trials)
        self._n_failed += done.n_failed
        self._n_rollouts += done.n_rollouts
        self._processor_s += done.processor_s

    def tell(self) -> None:
        """Report how far the run is."""
        if self._on_standing is None:
            return
        elapsed_s = time.monotonic() - self._began
        n_left = self._n_trials - self._n_before - self._n_done
        self._on_standing(
            Standing(
                n_trials=self._n_trials,
                n_done=self._n_before + self._n_done,
                n_failed=self._n_failed,
                n_rollouts=self._n_rollouts,
                n_workers=self._n_workers,
                elapsed_s=elapsed_s,
                left_s=elapsed_s * n_left / self._n_done if self._n_done else float("nan"),
            )
        )
