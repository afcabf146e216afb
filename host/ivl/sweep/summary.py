"""A run in a few numbers, for people and scripts."""

from typing import Any

from ivl.analysis.rates import RATE, cell_rates, of_solved_cells
from ivl.outcome import solved, stuck
from ivl.sweep import plan, schema, store
from ivl.sweep.config import PolicyMap, Sweep, values
from ivl.sweep.engine import Result


def of_plan(grid: Sweep | PolicyMap, task_size: int) -> dict[str, Any]:
    """What would be flown."""
    tasks = plan.plan(grid, task_size)
    n_trials = sum(len(task.trials) for task in tasks)
    report = {
        "name": grid.name,
        "vehicle": grid.vehicle,
        "gear_set": grid.gear_set,
        "gears": grid.gear_names(),
        "approaches": len(grid.approaches()),
        "trials": n_trials,
        "tasks": len(tasks),
        "task_size": task_size,
    }
    if isinstance(grid, Sweep):
        each = grid.budget + grid.check_rollouts
        return {**report, "learner": grid.learner.name, "rollouts_at_most": n_trials * each}
    points = len(values(grid.d_ceil_m)) * len(values(grid.moment_y_Nmm))
    return {**report, "points": n_trials * points, "rollouts": n_trials * points * grid.n_rollouts}


def of_run(result: Result) -> dict[str, Any]:
    """What was flown, and how it went."""
    failed = store.read_table(result.run, schema.FAILURES)
    report: dict[str, Any] = {
        "run": str(result.run),
        "trials": result.n_trials,
        "failed": failed.num_rows,
        "tasks_flown": result.n_tasks,
        "rollouts_flown": result.n_rollouts,
        "elapsed_s": round(result.elapsed_s, 3),
        "rollouts_per_s": round(result.n_rollouts / result.elapsed_s, 1) if result.n_tasks else None,
        "processor_s": round(result.processor_s, 3),
    }
    if failed.num_rows:
        report["first_error"] = failed["error"][0].as_py()
    trials = store.read_frame(result.run, schema.TRIALS)
    return {**report, **_learned(trials)} if len(trials) else report


def _learned(trials: Any) -> dict[str, Any]:
    cells, solvable = cell_rates(trials), of_solved_cells(trials)
    by_gear = trials.groupby("gear", observed=True)[RATE].mean()
    return {
        "cells": trials.groupby(list(schema.CELL), observed=True).ngroups,
        "cells_solved_by_one_trial_or_more": int(solved(cells["rate_best_norm"]).sum()),
        "trials_stuck_in_solved_cells": int(stuck(solvable[RATE]).sum()),
        "trials_in_solved_cells": len(solvable),
        "landing_rate_mean": {str(gear): round(float(value), 4) for gear, value in by_gear.items()},
    }
