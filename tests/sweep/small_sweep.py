"""Small sweeps that fly in a second or two, and how they are flown without a cluster."""

from pathlib import Path
from typing import Any

from ivl import yamlfile
from ivl.sweep import config, folder, plan, store, work
from ivl.sweep.config import PolicyMap, Sweep

SMALL: dict[str, Any] = {
    "name": "small",
    "doc": "A sweep for tests.",
    "vehicle": "habas2021",
    "gear_set": "as_simulated",
    "gears": ["wide_long", "narrow_short"],
    "speeds_mps": [2.5, 3.5],
    "angles_deg": [60.0, 90.0],
    "trials": 2,
    "policy": {
        "rrev_c_per_s": {"mu0": 4.5, "sigma0": 1.0, "bounds": [0.0, 7.0]},
        "moment_y_Nmm": {"mu0": 7.0, "sigma0": 1.5, "bounds": [0.0, 10.65]},
    },
    "learner": {"name": "ephe"},
    "n_rollouts": 6,
    "budget": 30,
    "check_rollouts": 4,
    "keep_rollouts": True,
}
MAP: dict[str, Any] = {
    **{name: SMALL[name] for name in ("doc", "vehicle", "gear_set", "gears", "speeds_mps", "angles_deg")},
    "name": "small_map",
    "d_ceil_m": [0.3, 0.6],
    "moment_Nmm": [4.0, 7.0, 10.0],
    "n_rollouts": 3,
}


def write(path: Path, data: dict[str, Any]) -> Path:
    path.write_text(yamlfile.dump(data))
    return path


def make(tmp_path: Path, **changes: Any) -> Sweep:
    return config.load_sweep(str(write(tmp_path / "sweep.yaml", {**SMALL, **changes})))


def fly(grid: Sweep | PolicyMap, run: Path, size: int, order: int = 1) -> Path:
    """Every task in this process, without a cluster: what the engine's runs are compared with."""
    worlds = grid.worlds()
    folder.open_run(run, grid, worlds, size, resume=False).close()
    for task in plan.plan(grid, size)[::order]:
        done = work.run_task(grid, worlds[task.world], task)
        store.write_part(run, task.number, {**done.parts, "tasks": work.record(task, done)})
    return run


def same_tables(a: Path, b: Path, kinds: tuple[str, ...] = ("trials", "episodes", "rollouts", "map")) -> bool:
    """Whether two runs have the same tables, bit for bit (NaN equals NaN)."""
    return all(store.read_frame(a, kind).equals(store.read_frame(b, kind)) for kind in kinds)
