"""The engine with real processes: a scheduler over TCP, workers that are killed, clients that are killed."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import dask_jobqueue  # noqa: F401 - brings its defaults into Dask's configuration, which the test then changes
import pytest
from small_sweep import SMALL, same_tables, write

from ivl import native
from ivl.errors import ConfigError, NativeError, RolloutError
from ivl.sweep import cluster, engine, store, work
from ivl.sweep.config import Sweep

HERE = Path(__file__).parent
FAULTS = {"IVL_TEST_BROKEN_CELL": "1", "IVL_TEST_TASK_S": "0.5"}
SLOW = {"DASK_DISTRIBUTED__WORKER__PRELOAD": str(HERE / "fault.py"), "IVL_TEST_TASK_S": "1.5"}
"""So long that a machine that stalls does not finish what is to be cut off in the middle."""
DEADLINE_S = 300.0  # for a machine that is busy; nothing is judged by it


def test_two_local_workers_give_the_tables_of_one_process_in_less_than_a_gibibyte(
    small: Sweep, reference: Path, tmp_path: Path
) -> None:
    seen: list[engine.Standing] = []
    peaks: list[int] = []

    def look(standing: engine.Standing) -> None:
        seen.append(standing)
        peaks.append(memory_bytes(os.getpid()))

    result = engine.run(small, tmp_path / "run", workers=2, task_size=3, on_standing=look)
    assert same_tables(tmp_path / "run", reference)
    assert (result.n_trials, result.n_failed, result.n_rollouts) == (16, 0, 16 * 34)
    assert [s.n_done for s in seen] == sorted(s.n_done for s in seen)
    assert (seen[0].n_done, seen[-1].n_done, seen[-1].left_s) == (0, 16, 0.0)
    assert len(store.read_frame(tmp_path / "run", "tasks")["worker"].unique()) == 2
    assert 0 < max(peaks) < 2**30
    again = engine.run(small, tmp_path / "run", resume=True)
    assert (again.n_tasks, again.n_rollouts) == (0, 0)


def test_a_worker_killed_in_the_middle_costs_nothing_and_a_broken_cell_fails_alone(
    small: Sweep, reference: Path, tmp_path: Path
) -> None:
    run, file = tmp_path / "run", write(tmp_path / "small.yaml", SMALL)
    with tcp_cluster(tmp_path, n_workers=2) as (address, workers):
        client = ivl("sweep", str(file), "--scheduler", address, "--out", str(run), "--task-size", "1", "--json")
        wait_for(lambda: n_parts(run) >= 2, client)
        workers[0].kill()
        assert n_parts(run) < 16
        output, _ = client.communicate(timeout=DEADLINE_S)
    assert client.returncode == 1  # the broken cell
    report = json.loads(output)
    assert (report["trials"], report["failed"]) == (16, 4)
    assert report["first_error"] == "ZeroDivisionError: no such cell"
    failed = store.read_frame(run, "failures")
    assert set(zip(failed["speed_mps"], failed["angle_deg"], strict=True)) == {(2.5, 90.0)}
    expected = store.read_trials(reference)
    broken = (expected["speed_mps"] == 2.5) & (expected["angle_deg"] == 90.0)
    assert store.read_trials(run).equals(expected[~broken].reset_index(drop=True))

    result = engine.run(small, run, resume=True, workers=1)  # without the fault the failed cell is flown again
    assert (result.n_tasks, result.n_failed) == (4, 0)
    assert store.read_frame(run, "failures").empty
    assert same_tables(run, reference)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_client_that_is_cut_off_keeps_what_is_done_and_resumes_to_the_same_tables(
    how: signal.Signals, reference: Path, small: Sweep, tmp_path: Path
) -> None:
    run, file = tmp_path / "run", write(tmp_path / "small.yaml", SMALL)
    client = ivl("sweep", str(file), "--out", str(run), "--workers", "2", "--task-size", "1", slow=True)
    wait_for(lambda: n_parts(run) >= 2, client)
    family = descendants(client.pid)
    os.kill(client.pid, how)
    _, errors = client.communicate(timeout=DEADLINE_S)
    if how is signal.SIGINT:
        assert client.returncode == 130
        assert "--resume" in errors
    wait_for(lambda: not any(alive(pid) for pid in family))
    done = {path: path.stat().st_mtime_ns for path in (run / "tasks").glob("*.parquet")}
    assert 2 <= len(done) < 16
    result = engine.run(small, run, resume=True, workers=1)
    assert result.n_tasks == 16 - len(done)
    assert all(path.stat().st_mtime_ns == then for path, then in done.items())
    assert same_tables(run, reference)


def test_a_scheduler_that_is_not_there_or_nonsense_is_said_to_be(
    monkeypatch: pytest.MonkeyPatch, small: Sweep, tmp_path: Path
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.5)
    with pytest.raises(RolloutError, match=r"tcp://127\.0\.0\.1:9: no scheduler answers there"):
        engine.run(small, tmp_path / "a", scheduler="tcp://127.0.0.1:9")
    with pytest.raises(ConfigError, match="expected an address such as tcp://host:8786, or slurm"):
        engine.run(small, tmp_path / "b", scheduler="localhost")
    with pytest.raises(ConfigError, match="how many workers to ask for"):
        engine.run(small, tmp_path / "c", scheduler="slurm")


def test_a_batch_system_s_workers_fly_the_sweep(
    monkeypatch: pytest.MonkeyPatch, reference: Path, small: Sweep, tmp_path: Path
) -> None:
    """A stand-in for SLURM: `sbatch` starts the job's script at once, on this machine."""
    tools = tmp_path / "bin"
    tools.mkdir()
    script(tools / "sbatch", f'cp "$1" {tmp_path}/job.sh\nbash {tmp_path}/job.sh > {tmp_path}/job.log 2>&1 &\necho $!')
    script(tools / "scancel", 'kill "$1" 2> /dev/null; true')
    monkeypatch.setenv("PATH", f"{tools}:{Path(sys.executable).parent}:{os.environ['PATH']}")
    settings = {"cores": 1, "memory": "400MB", "processes": 1, "interface": "lo", "death-timeout": 30}
    with cluster.dask.config.set({f"jobqueue.slurm.{name}": value for name, value in settings.items()}):
        result = engine.run(small, tmp_path / "run", scheduler="slurm", workers=1, task_size=8)
    assert result.n_failed == 0
    assert same_tables(tmp_path / "run", reference)


def script(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


@contextmanager
def tcp_cluster(folder: Path, n_workers: int) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """`dask scheduler` and `dask worker` as one starts them by hand, with the faults of fault.py."""
    dask, file = str(Path(sys.executable).parent / "dask"), folder / "scheduler.json"
    common = ["--scheduler-file", str(file), "--no-dashboard"]
    started = [start(dask, "scheduler", "--host", "127.0.0.1", "--port", "0", *common)]
    try:
        wait_for(file.exists, started[0])
        options = ["--nthreads", "1", "--no-nanny", "--preload", str(HERE / "fault.py")]
        workers = [start(dask, "worker", *options, *common, **FAULTS) for _ in range(n_workers)]
        started += workers
        wait_for(lambda: bool(address_in(file)))
        yield address_in(file), workers
    finally:
        for process in reversed(started):
            process.kill()
            process.communicate()


def address_in(file: Path) -> str:
    try:
        return str(json.loads(file.read_text())["address"])
    except (ValueError, KeyError):
        return ""


def ivl(*arguments: str, slow: bool = False) -> "subprocess.Popen[str]":
    """The command line in a process of its own; `slow` makes its workers take their time."""
    return start(sys.executable, "-c", "from ivl.cli import main; main()", *arguments, **(SLOW if slow else {}))


def start(*command: str, **environment: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, **environment}
    )


def wait_for(ready: Callable[[], Any], process: "subprocess.Popen[str] | None" = None) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not ready():
        if process is not None and process.poll() is not None:
            pytest.fail(f"{process.args} ended early: {process.communicate()}")
        if time.monotonic() > deadline:
            pytest.fail(f"nothing happened for {DEADLINE_S:g} s")
        time.sleep(0.02)


def n_parts(run: Path) -> int:
    return len(list((run / "tasks").glob("*.parquet")))


def descendants(pid: int) -> list[int]:
    """The process and all that it started, directly or not."""
    parents = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rpartition(")")[2].split()
        except OSError:
            continue  # ended in between
        parents[int(status.parent.name)] = int(fields[1])
    family = [pid]
    for member in family:
        family.extend(child for child, parent in parents.items() if parent == member)
    return family


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def memory_bytes(pid: int) -> int:
    """Memory that a process and all it started hold together, pages that they share counted once."""
    total_kib = 0
    for member in descendants(pid):
        try:
            lines = Path(f"/proc/{member}/smaps_rollup").read_text().splitlines()
        except OSError:
            continue  # ended in between
        total_kib += sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return total_kib * 1024


def test_a_local_cluster_is_its_owner_s_alone() -> None:
    """Nobody without the certificates, which are in the owner's memory, gets a word in; there is no dashboard."""
    with cluster.open_client(None, 1) as client:
        assert client.submit(int, "7").result(DEADLINE_S) == 7
        address = client.scheduler.address
        assert address.startswith("tls://127.0.0.1:")
        assert client.cluster.dashboard_link in ("", None) or "http" not in str(client.scheduler_info()["services"])
        with cluster.open_client(None, 1):  # a second one on this machine disturbs nothing
            pages = client.cluster.scheduler.http_server
        for path in ("health", "info/main/workers.html", "json/counts.json", "metrics", "statics/css/base.css", ""):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(f"http://127.0.0.1:{pages.port}/{path}", timeout=DEADLINE_S)
        code = (
            "import sys, distributed\n"
            "distributed.Client(sys.argv[1], timeout=3, security=distributed.Security.temporary())\n"
        )
        for stranger in (address, address.replace("tls://", "tcp://")):
            command = [sys.executable, "-c", code, stranger]
            done = subprocess.run(command, capture_output=True, text=True, check=False, cwd="/")
            assert done.returncode != 0
        assert client.submit(int, "8").result(DEADLINE_S) == 8


@pytest.mark.parametrize(
    ("limit", "workers", "message"),
    [
        ((resource.RLIMIT_NOFILE, 40), 2, "--workers 2: needs 112 open files, allowed are 40: raise the limit"),
        (
            (resource.RLIMIT_AS, 900 * 2**20),
            8,
            "--workers 8: each process may have 900 MiB of address space, a sweep needs about 1900 MiB: raise",
        ),
        ((resource.RLIMIT_RSS, 2**30), 8, "--workers 8: needs 2800 MiB of memory, here are 1024 MiB: use --workers 2"),
    ],
)
def test_what_a_cluster_needs_is_said_before_it_starts(
    limit: tuple[int, int], workers: int, message: str, tmp_path: Path
) -> None:
    command = [sys.executable, "-c", "from ivl.cli import main; main()", "sweep", "sweeps/smoke.yaml"]
    command += ["--workers", str(workers), "--out", str(tmp_path / "run")]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False,
        preexec_fn=lambda: resource.setrlimit(limit[0], (limit[1], limit[1])),
    )  # fmt: skip
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("fault", [AssertionError("Status.init"), OSError(12, "Cannot allocate memory"), MemoryError()])
def test_a_cluster_that_cannot_be_started_is_one_line(monkeypatch: pytest.MonkeyPatch, fault: Exception) -> None:
    def refuse(**_: Any) -> None:
        raise fault

    monkeypatch.setattr(cluster._dask, "LocalCluster", refuse)
    with pytest.raises(RolloutError, match=r"2 workers cannot be started: .*\(try fewer --workers, then --resume\)"):
        cluster._local(2)
    monkeypatch.setattr(cluster, "_address_space_bytes", lambda: 2**31)
    with pytest.raises(ConfigError, match=r"2 workers cannot be started: .* 2048 MiB of address space, .*ulimit -v"):
        cluster._local(2)


def test_a_task_that_never_ends_is_given_up_with_a_clear_word() -> None:
    code = (
        "import time\n"
        "from ivl.sweep import work\n"
        "work.run_task = lambda *_: time.sleep(1000)\n"
        "from ivl import native, numerics\n"
        "task = type('T', (), {'number': 3})()\n"
        "work.run_packed(None, b'N.', task, native.library().digest(), numerics.kernel(), 0.2)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == os.EX_TEMPFAIL
    assert "task 3 takes longer than 0 s: its worker ends" in done.stderr


def test_workers_that_compute_otherwise_are_refused(small: Sweep) -> None:
    with pytest.raises(
        NativeError, match=r"this worker computes with .*, the client with another: results would differ"
    ):
        work.run_packed(small, b"", None, native.library().digest(), "another", 60.0)
