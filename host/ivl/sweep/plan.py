"""Dask tasks: which trials one worker flies together. A task without that word is what is flown (`ivl.task`).

Trials differ in cost up to sevenfold (a slow, flat approach presses its plates along the ceiling for a second), so they
are dealt to the tasks in a fixed shuffled order: tasks cost about the same, and what is done tells how long the rest
takes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ivl.sweep.config import PolicyMap, Sweep
from ivl.sweep.trials import Trial
from ivl.sweep.vary import Varied, world_name

TASKS_PER_WORKER = 8  # at least so many if there are trials enough, so that the last ones end together
SIZE_MIN, SIZE_MAX = 4, 32
"""Trials of a task on a few workers: fewer do not fill a native batch, more only make a lost worker cost more."""
OVERHEAD_PER_TRIAL = 0.1
"""Time that a task costs client and scheduler, as a share of the time of a trial (measured: docs/SCALING.md)."""


@dataclass(frozen=True)
class DaskTask:
    """Some trials (or map cells) of one landing gear and one variant.

    Attributes:
        number: Number of the task in its run; names its files.
        gear: Landing gear.
        trials: The trials; of a map the cells, as trial 0.
        varied: Value of each varied path.
    """

    number: int
    gear: str
    trials: tuple[Trial, ...]
    varied: Varied = ()

    @property
    def world(self) -> str:
        """Name of the world that it is flown in."""
        return world_name(self.gear, self.varied)


def plan(grid: Sweep | PolicyMap, size: int) -> list[DaskTask]:
    """All tasks, `size` trials each but for the last of a gear and variant; the same for the same arguments, always."""
    n_trials = grid.trials if isinstance(grid, Sweep) else 1
    names = [Trial(speed, angle, k) for speed, angle in grid.approaches() for k in range(n_trials)]
    shuffled = [names[i] for i in np.random.Generator(np.random.PCG64(0)).permutation(len(names))]
    tasks: list[DaskTask] = []
    for varied in grid.variants():
        for gear in grid.at(varied).gear_names():
            for part in _chunks(shuffled, size):
                tasks.append(DaskTask(len(tasks), gear, tuple(part), varied))
    return tasks


def good_size(grid: Sweep | PolicyMap, n_workers: int) -> int:
    """Trials per task that keep `n_workers` busy to the end, with tasks that are neither too small nor too many.

    The client takes tasks back one by one. Tasks of k trials end every k t / n_workers seconds, and each costs it o
    seconds: from k = n_workers o / t on it keeps up. Where there are too few trials for that, sqrt(n o / t) balances
    what all tasks cost the client against the length of the last one.
    """
    n_trials = len(grid.approaches()) * grid.n_gears() * (grid.trials if isinstance(grid, Sweep) else 1)
    shared = np.clip(n_trials // (TASKS_PER_WORKER * max(n_workers, 1)), SIZE_MIN, SIZE_MAX)
    kept_up = min(n_workers * OVERHEAD_PER_TRIAL, np.sqrt(n_trials * OVERHEAD_PER_TRIAL))
    return int(np.ceil(max(shared, kept_up)))


def _chunks(items: Sequence[Trial], size: int) -> list[Sequence[Trial]]:
    return [items[first : first + size] for first in range(0, len(items), size)]
