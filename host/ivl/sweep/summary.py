"""A run in a few numbers, for people and scripts."""

from typing import Any

from ivl import yamlfile
from ivl.analysis import vehicles
from ivl.analysis.rates import RATE, cell_rates, of_solved_cells
from ivl.family import MEMBER
from ivl.outcome import solved, stuck
from ivl.sweep import plan, schema, store
from ivl.sweep.config import PolicyMap, Sweep
from ivl.sweep.engine import Result
from ivl.sweep.vary import AXES, Value, as_cell, values


def of_plan(grid: Sweep | PolicyMap, task_size: int) -> dict[str, Any]:
    """What would be flown."""
    tasks = plan.plan(grid, task_size)
    n_trials = sum(len(task.trials) for task in tasks)
    report: dict[str, Any] = {
        "name": grid.name,
        "vehicle": grid.vehicle,
        "gear_set": grid.gear_set,
        "gears": list(dict.fromkeys(task.gear for task in tasks)),
        "approaches": len(grid.approaches()),
        "trials": n_trials,
        "tasks": len(tasks),
        "task_size": task_size,
    }
    if others := {path: found for path, found in grid.vary.items() if path not in AXES}:
        report["vary"] = others
    if isinstance(grid, Sweep):
        at_most = sum(len(task.trials) * _rollouts_of(grid.at(task.varied)) for task in tasks)
        return {**report, "learner": ", ".join(grid.learner_names()), "rollouts_at_most": at_most}
    points = len(values(grid.d_ceil_m)) * len(values(grid.moment_Nmm))
    return {**report, "points": n_trials * points, "rollouts": n_trials * points * grid.n_rollouts}


def _rollouts_of(sweep: Sweep) -> int:
    """Rollouts of one trial, at most."""
    return sweep.budget + sweep.check_rollouts


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
    if not len(trials):
        points = store.read_frame(result.run, schema.MAP)
        return {**report, "family": vehicles.of_map(points)} if vehicles.has_family(points) else report
    if vehicles.has_family(trials):
        report["family"] = vehicles.of_trials(trials)
    sweep = yamlfile.validate(Sweep, store.read_manifest(result.run)["sweep"], str(result.run))
    groups = [{**names, "trials": len(part), **_learned(part)} for names, part in by_variant(sweep, trials)]
    return {**report, **_learned(trials), **({"groups": groups} if groups else {})}


def by_variant(sweep: Sweep, trials: Any) -> list[tuple[dict[str, Value], Any]]:
    """The trials of each variant that has any, all members of a family together, with its values by path.

    Nothing if only `AXES` and members are varied.
    """
    found = []
    without_members = (tuple((p, v) for p, v in varied if p != MEMBER) for varied in sweep.variants())
    for varied in filter(None, dict.fromkeys(without_members)):
        part = trials
        for path, value in varied:
            part = part[part[schema.column_of(path)] == as_cell(value)]
        if len(part):
            found.append((dict(varied), part))
    return found


def _learned(trials: Any) -> dict[str, Any]:
    cells, solvable = cell_rates(trials), of_solved_cells(trials)
    by_gear = trials.groupby("gear", observed=True)[RATE].mean()
    return {
        "cells": trials.groupby(schema.cell_columns(trials), observed=True).ngroups,
        "cells_solved_by_one_trial_or_more": int(solved(cells["rate_best_norm"]).sum()),
        "trials_stuck_in_solved_cells": int(stuck(solvable[RATE]).sum()),
        "trials_in_solved_cells": len(solvable),
        "landing_rate_mean": {str(gear): round(float(value), 4) for gear, value in by_gear.items()},
    }
