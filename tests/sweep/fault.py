"""Faults for a worker, loaded as a Dask preload: it takes as long as asked, and if asked for one cell raises."""

import os
import time

from ivl.sweep import trials

BROKEN = (2.5, 90.0)


def slowed(sweep: trials.Sweep, world: trials.World, names: list[trials.Trial]) -> trials.Log:
    time.sleep(float(os.environ["IVL_TEST_TASK_S"]))
    if "IVL_TEST_BROKEN_CELL" in os.environ and any((t.speed_mps, t.angle_deg) == BROKEN for t in names):
        raise ZeroDivisionError("no such cell")
    return trials.unspoilt_run(sweep, world, names)


if not hasattr(trials, "unspoilt_run"):  # Dask loads a preload twice
    trials.unspoilt_run = trials.run
    trials.run = slowed
