"""Synthetic campaigns with known answers, in the columns of the sweep's tables."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ivl.layout import layout_of
from ivl.sweep import config, folder, plan, schema, store, work

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))

LAYOUT = layout_of(config.load_sweep("sweeps/paper.yaml"))
Rate = Callable[[pd.DataFrame], np.ndarray]
"""Landing rates from a table with the columns v (m/s), phi (deg) and k (trial)."""


def make_trials(
    speeds: tuple[float, ...] = (1.0, 2.0, 3.0),
    angles: tuple[float, ...] = (30.0, 60.0, 90.0),
    n_trials: int = 5,
    rate: Rate = lambda c: np.full(len(c), 0.5),
    rrev: float = 5.0,
    **names: str,
) -> pd.DataFrame:
    """A complete table of trials: every column of the schema, landing rates from a function of V, phi and trial."""
    v, phi, trial = (a.ravel() for a in np.meshgrid(speeds, angles, range(n_trials), indexing="ij"))
    vx, vz = v * np.cos(np.deg2rad(phi)), v * np.sin(np.deg2rad(phi))
    d, landed = vz / rrev, np.asarray(rate(pd.DataFrame({"v": v, "phi": phi, "k": trial})), dtype=np.float64)
    frame = pd.DataFrame({f.name: np.zeros(len(v)) for f in schema.schema(schema.TRIALS, LAYOUT)})
    names = {"vehicle": "habas2021", "gear_set": "table1", "gear": "wide_short", "learner": "bo", **names}
    values = {
        **names,
        "speed_mps": v,
        "angle_deg": phi,
        "trial": trial,
        "n_recent": 24,
        "landing_rate_four_leg_norm": landed,
        "landing_rate_clean_norm": landed / 2,
        "n_check": 100,
        "check_rate_four_leg_norm": landed,
        "check_rate_clean_norm": landed / 2,
        "n_triggered": 24,
        "n_rollouts": 160,
        "n_episodes": 20,
        "trigger_vx_mps": vx,
        "trigger_vz_mps": vz,
        "trigger_d_ceil_m": d,
        "trigger_rrev_per_s": vz / d,
        "trigger_of_y_radps": -vx / d,
        "mu_rrev_c_per_s": rrev,
        "mu_moment_y_Nmm": 8.0,
        "recommended_rrev_c_per_s": rrev,
        "recommended_moment_y_Nmm": 8.0,
        "n_attached": 24,
        "fore_legs_first_norm": 1.0,
        "swing_completed_norm": 0.9,
    }
    return frame.assign(**values)


def fly_sweep(grid: config.Sweep | config.PolicyMap, run: Path) -> Path:
    """A run folder, flown in this process."""
    worlds = {gear: grid.make_world(gear) for gear in grid.gear_names()}
    folder.open_run(run, grid, worlds, 8, resume=False).close()
    for task in plan.plan(grid, 8):
        done = work.run_task(grid, worlds[task.gear], task)
        store.write_part(run, task.number, {**done.parts, schema.TASKS: work.record(task, done)})
    return run


@pytest.fixture
def fly() -> Callable[[config.Sweep | config.PolicyMap, Path], Path]:
    return fly_sweep


@pytest.fixture
def trials() -> Callable[..., pd.DataFrame]:
    return make_trials
