"""Where tasks run: processes on this machine, any Dask scheduler by its address, or SLURM.

open_client(None)                 one process per processor of this machine
open_client("tcp://host:8786")    a scheduler that is running (`dask scheduler`, `dask worker`)
open_client("slurm", workers=64)  jobs of a batch system, as dask-jobqueue's configuration describes them
"""

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import dask
import distributed

from ivl.errors import ConfigError, RolloutError

_dask: Any = distributed  # its calls carry no types
_CONNECT_S = 20.0
_SETTINGS = {
    # a worker's arrays come and go by the thousand; giving memory back to the system each time doubles the run time
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**28,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 2**28,
    "distributed.worker.daemon": True,
    "distributed.admin.tick.limit": "60s",  # long native calls on a busy machine are no reason for a warning
}


@contextmanager
def open_client(scheduler: str | None, workers: int | None = None) -> Iterator[Any]:
    """A client of the chosen cluster; what was started here ends with the block.

    Args:
        scheduler: None, an address, or "slurm".
        workers: Processes on this machine, or jobs' workers under SLURM; omitted: one per processor.

    Raises:
        ConfigError: The address is of no known form, or dask-jobqueue is missing or not configured.
        RolloutError: No scheduler answers there.
    """
    check(scheduler, workers)
    with dask.config.set(_SETTINGS):
        if scheduler is None:
            with _local(workers or processors()) as cluster, _dask.Client(cluster) as client:
                yield client
        elif scheduler == "slurm":
            with _slurm(workers) as cluster, _dask.Client(cluster) as client:
                yield client
        else:
            with _connect(scheduler) as client:
                yield client


def check(scheduler: str | None, workers: int | None) -> None:
    """Refuse what no cluster can be opened with, before anything is written.

    Raises:
        ConfigError: See `open_client`.
    """
    if scheduler == "slurm" and workers is None:
        raise ConfigError("--scheduler slurm: say how many workers to ask for with --workers")
    if scheduler not in (None, "slurm"):
        if "://" not in scheduler:
            raise ConfigError(f"--scheduler {scheduler}: expected an address such as tcp://host:8786, or slurm")
        if workers is not None:
            raise ConfigError("--workers: a running scheduler has its own workers; leave it out")


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _local(workers: int) -> Any:
    return _dask.LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0")


def _slurm(workers: int | None) -> Any:
    try:
        jobqueue: Any = importlib.import_module("dask_jobqueue")
    except ImportError as error:
        raise ConfigError("--scheduler slurm: dask-jobqueue is not installed (extra `cluster`)") from error
    try:
        cluster = jobqueue.SLURMCluster(scheduler_options={"dashboard_address": ":0"})
    except ValueError as error:
        raise ConfigError(f"--scheduler slurm: jobqueue.slurm in Dask's configuration: {error}") from error
    cluster.scale(workers)
    return cluster


def _connect(address: str) -> Any:
    try:
        return _dask.Client(address, timeout=_CONNECT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise RolloutError(f"--scheduler {address}: no scheduler answers there: {error}") from error
