"""Where tasks run: processes on this machine, any Dask scheduler by its address, or SLURM.

open_client(None)                 one process per processor of this machine
open_client("tcp://host:8786")    a scheduler that is running (`dask scheduler`, `dask worker`)
open_client("slurm", workers=64)  jobs of a batch system, as dask-jobqueue's configuration describes them

A cluster that is started here can be reached by its owner alone: its parts know each other by certificates that exist
in memory only (under SLURM, in files that the owner alone can read), and there is no dashboard.
"""

import importlib
import logging
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import dask
import distributed

from ivl.errors import ConfigError, RolloutError

_dask: Any = distributed  # its calls carry no types
_CONNECT_S = 20.0
WORKER_BYTES = 350 * 2**20
"""Memory that a worker needs."""
ADDRESS_SPACE_BYTES = 1900 * 2**20
"""Address space that each process of a sweep needs; most of it is never used (stacks and heaps of threads)."""
_FILES, _FILES_PER_WORKER = 64, 24
"""Open files that client and scheduler need, and each worker more."""
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
            with _local(workers) as cluster, _dask.Client(cluster) as client:
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
    if scheduler is None:
        _check_limits(workers or default_workers())
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


_NO_PAGES: dict[str, list[str]] = {"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []}
"""Dask tells whoever asks by HTTP what a cluster does, without a certificate: nothing is told."""


def default_workers() -> int:
    """Processes on this machine where nobody says how many: one per processor, as far as there is memory."""
    return max(min(processors(), _memory_bytes() // WORKER_BYTES), 1)


def _memory_bytes() -> int:
    """Memory of this machine, or what is allowed of it."""
    return int(importlib.import_module("distributed.system").memory_limit())


def _local(workers: int | None) -> Any:
    """A cluster of processes on this machine that its owner alone can reach.

    Raises:
        RolloutError: It cannot be started.
        ConfigError: It cannot be started, and the memory of a process is limited.
    """
    n = workers or default_workers()
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)  # what goes wrong at the start is said once, below
    try:
        with dask.config.set(_NO_PAGES):
            cluster = _dask.LocalCluster(
                n_workers=n, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None,
                # Dask opens a port for pages without a dashboard, too: one that is free, or a second sweep meets it
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                security=_security(),
            )  # fmt: skip
    except Exception as error:  # Dask ends in a failed assertion, too, where a process cannot be had
        what = " ".join(str(error).split())[:200] or type(error).__name__
        cannot = f"{n} workers cannot be started: {what}"
        if _address_space_bytes() != resource.RLIM_INFINITY:
            raise ConfigError(f"{cannot}: {_limit_text()}, then --resume") from error
        raise RolloutError(f"{cannot} (try fewer --workers, then --resume)") from error
    logger.setLevel(level)
    return cluster


def _address_space_bytes() -> int:
    """What each process may have, workers too."""
    return resource.getrlimit(resource.RLIMIT_AS)[0]


def _limit_text() -> str:
    allowed, needed = _address_space_bytes(), ADDRESS_SPACE_BYTES
    return (
        f"each process may have {allowed / 2**20:.0f} MiB of address space, a sweep needs about "
        f"{needed / 2**20:.0f} MiB: raise the limit (ulimit -v)"
    )


def _check_limits(n: int) -> None:
    if 0 <= _address_space_bytes() < ADDRESS_SPACE_BYTES:  # -1: no limit
        raise ConfigError(f"--workers {n}: {_limit_text()}")
    memory, needed = _memory_bytes(), n * WORKER_BYTES
    if memory < needed:
        fit = memory // WORKER_BYTES
        advice = f"use --workers {fit}" if fit else "allow more memory (ulimit -m, -v)"
        raise ConfigError(
            f"--workers {n}: needs {needed / 2**20:.0f} MiB of memory, here are {memory / 2**20:.0f} MiB: {advice}"
        )
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    files = _FILES + n * _FILES_PER_WORKER
    if hard != resource.RLIM_INFINITY and hard < files:
        raise ConfigError(f"--workers {n}: needs {files} open files, allowed are {hard}: raise the limit (ulimit -n)")
    if soft != resource.RLIM_INFINITY and soft < files:
        resource.setrlimit(resource.RLIMIT_NOFILE, (files, hard))


def _security() -> Any:
    """Certificates that are made for this cluster alone."""
    return _dask.Security.temporary()


def _slurm(workers: int | None) -> Any:
    try:
        jobqueue: Any = importlib.import_module("dask_jobqueue")
    except ImportError as error:
        raise ConfigError("--scheduler slurm: dask-jobqueue is not installed (extra `cluster`)") from error
    try:
        with dask.config.set(_NO_PAGES):
            cluster = jobqueue.SLURMCluster(
                security=_security(), shared_temp_directory=_shared_folder(), scheduler_options={"dashboard": False}
            )
    except ValueError as error:
        raise ConfigError(f"--scheduler slurm: jobqueue.slurm in Dask's configuration: {error}") from error
    cluster.scale(workers)
    return cluster


def _shared_folder() -> str:
    """Where a batch system's cluster has its certificates: all its machines see this folder, and its owner alone."""
    chosen = dask.config.get("jobqueue.slurm.shared-temp-directory", None)
    if chosen:
        return str(chosen)
    folder = Path.home() / ".cache" / "ivl"
    folder.mkdir(parents=True, exist_ok=True)
    folder.chmod(0o700)
    return str(folder)


def _connect(address: str) -> Any:
    try:
        return _dask.Client(address, timeout=_CONNECT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise RolloutError(f"--scheduler {address}: no scheduler answers there: {error}") from error
