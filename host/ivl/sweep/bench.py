"""How fast a sweep is, and what a task costs beside its flights: measured, for `make bench` and docs/SCALING.md."""

import os
import pickle
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ivl.sweep import cluster, config, engine, folder, plan, schema, store, work
from ivl.sweep.config import Sweep
from ivl.sweep.plan import DaskTask
from ivl.sweep.work import Done

_SIZE = 32


@dataclass(frozen=True)
class Measured:
    """What was measured.

    Attributes:
        learner: Learner of the sweep.
        load_before: Programs that wanted a processor in the minute before (load average): other work falsifies rates.
        trials: Trials flown with each number of workers.
        rollouts_per_s_1: Rollouts per second with one worker, learning and storing included.
        rollouts_per_s_2: With two workers.
        efficiency: Speed-up by the second worker, divided by two.
        trial_processor_s: Processor time of a trial.
        task_overhead_s: Time that a task costs client and scheduler: hand out, take back, write durably.
        task_bytes: Size of a task as sent.
        trial_bytes: Size of a trial's result.
        trial_bytes_with_rollouts: The same with every rollout kept.
    """

    learner: str
    load_before: float
    trials: int
    rollouts_per_s_1: float
    rollouts_per_s_2: float
    efficiency: float
    trial_processor_s: float
    task_overhead_s: float
    task_bytes: int
    trial_bytes: float
    trial_bytes_with_rollouts: float

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


def measure(learner: str, n_cells: int = 240) -> Measured:
    """Fly some cells of the paper's campaign with one worker and with two.

    Args:
        learner: Learner by name.
        n_cells: Cells, one trial each.
    """
    load_before = os.getloadavg()[0]
    settings = ["trials=1", "gears=[wide_long]", f"angles_deg={{first: 20.0, last: 90.0, count: {n_cells // 16}}}"]
    sweep = config.load_sweep("sweeps/paper.yaml", settings, learner=learner)
    with tempfile.TemporaryDirectory() as scratch:
        one, two = (
            engine.run(sweep, Path(scratch) / f"{n}", workers=n, task_size=min(_SIZE, n_cells // 8)) for n in (1, 2)
        )
        tasks = store.read_frame(one.run, schema.TASKS)
        overhead_s = _overhead_s(sweep, Path(scratch) / "overhead")
    rates = [result.n_rollouts / result.elapsed_s for result in (one, two)]
    return Measured(
        learner=learner,
        load_before=load_before,
        trials=one.n_trials,
        rollouts_per_s_1=rates[0],
        rollouts_per_s_2=rates[1],
        efficiency=rates[1] / rates[0] / 2,
        trial_processor_s=one.processor_s / one.n_trials,
        task_overhead_s=overhead_s,
        task_bytes=_task_bytes(sweep),
        trial_bytes=float(tasks["result_bytes"].sum() / one.n_trials),
        trial_bytes_with_rollouts=_bytes_with_rollouts(sweep),
    )


def _overhead_s(sweep: Sweep, scratch: Path, n_tasks: int = 200) -> float:
    """Time per task with nothing to fly: through scheduler and worker, back, and durably into the folder."""
    worlds = {"wide_long": sweep.make_world("wide_long")}
    done = work.run_task(sweep, worlds["wide_long"], plan.plan(sweep, 2)[0])
    folder.open_run(scratch, sweep, worlds, 1, resume=False).close()
    task, packed = plan.plan(sweep, _SIZE)[0], pickle.dumps(worlds["wide_long"])
    with cluster.open_client(None, 1) as client:
        client.submit(_nothing, sweep, packed, task, done, pure=False).result()
        began = time.monotonic()
        futures = [client.submit(_nothing, sweep, packed, task, done, pure=False) for _ in range(n_tasks)]
        for number, future in enumerate(futures):
            back = future.result()
            store.write_part(scratch, number, {**back.parts, schema.TASKS: work.record(task, back)})
        return (time.monotonic() - began) / n_tasks


def _nothing(_sweep: Sweep, _world: bytes, _task: DaskTask, done: Done) -> Done:
    return done


def _task_bytes(sweep: Sweep) -> int:
    return len(pickle.dumps((sweep, pickle.dumps(sweep.make_world("wide_long")), plan.plan(sweep, _SIZE)[0])))


def _bytes_with_rollouts(sweep: Sweep) -> float:
    kept = sweep.model_copy(update={"keep_rollouts": True})
    task = plan.plan(kept, 16)[0]
    done = work.run_task(kept, kept.make_world(task.gear), task)
    return sum(len(part) for part in done.parts.values()) / len(task.trials)
