"""The policy map: flips commanded at once over a grid of (V, phi, d, M_yd); the policy region without learning."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]

from ivl.outcome import clean, four_leg, valid
from ivl.sweep import schema, tables
from ivl.sweep.config import PolicyMap
from ivl.sweep.trials import Trial
from ivl.sweep.vary import values
from ivl.world import World


def fly(grid: PolicyMap, world: World, cells: Sequence[Trial]) -> pa.Table:
    """All points of some cells, as rows of the map table."""
    return pa.concat_tables([_cell(grid, world, cell) for cell in cells])


def _cell(grid: PolicyMap, world: World, cell: Trial) -> pa.Table:
    """All distances and moments at one approach; rollout k of point i has the stream i n + k within the cell's seed."""
    points = np.stack(np.meshgrid(values(grid.d_ceil_m), values(grid.moment_Nmm), indexing="ij"), axis=-1)
    d_ceil_m, moment_Nmm = points.reshape(-1, 2).T
    seed = grid.cell_seed(world.gear, cell.speed_mps, cell.angle_deg)
    stream = np.arange(d_ceil_m.size * grid.n_rollouts, dtype=np.uint64).reshape(d_ceil_m.size, grid.n_rollouts)
    outcomes = world.rollouts(
        cell.speed_mps,
        cell.angle_deg,
        0.0,  # the trigger is not waited for
        moment_Nmm[:, None],
        seed=seed,
        stream=stream,
        start="at_trigger",
        d_ceil_m=d_ceil_m[:, None],
        threads=1,
    )
    counted = valid(outcomes)
    vx_mps = cell.speed_mps * np.cos(np.radians(cell.angle_deg))
    vz_mps = cell.speed_mps * np.sin(np.radians(cell.angle_deg))
    n = len(d_ceil_m)
    columns: tables.Columns = {
        "vehicle": [grid.vehicle] * n,
        "gear_set": [grid.gear_set] * n,
        "gear": [world.gear] * n,
        "speed_mps": np.full(n, cell.speed_mps),
        "angle_deg": np.full(n, cell.angle_deg),
        "d_ceil_m": d_ceil_m,
        "moment_Nmm": moment_Nmm,
        "vx_mps": np.full(n, vx_mps),
        "vz_mps": np.full(n, vz_mps),
        "rrev_per_s": vz_mps / d_ceil_m,
        "of_y_radps": -vx_mps / d_ceil_m,
        "seed": np.full(n, seed),
        "first_stream": stream[:, 0],
        "n": counted.sum(axis=1),
        "n_four_leg": four_leg(outcomes).sum(axis=1),
        "n_clean": clean(outcomes).sum(axis=1),
        "n_body_contact": (counted & (outcomes["body_contact"] != 0)).sum(axis=1),
        "n_legs_mean": tables.mean(outcomes["n_legs"], counted, axis=1),
        "theta_impact_mean_deg": tables.mean(
            outcomes["theta_impact_deg"], counted & np.isfinite(outcomes["theta_impact_deg"]), axis=1
        ),
        **tables.contact_columns(outcomes, counted, axis=1),
    }
    return tables.make_table(schema.MAP, columns)
