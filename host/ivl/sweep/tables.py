"""What some trials did, as the rows of `ivl.sweep.schema`."""

import traceback
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from ivl.layout import EMPTY, Layout, layout_of
from ivl.outcome import Outcomes, clean, four_leg
from ivl.sweep import schema
from ivl.sweep.config import PolicyMap, Sweep
from ivl.sweep.trials import Log, Trial, landed

FORE_LEGS, HIND_LEGS = (1, 4), (2, 3)
_TRIGGER = {
    "trigger_vx_mps": "vx_trigger_mps",
    "trigger_vz_mps": "vz_trigger_mps",
    "trigger_d_ceil_m": "d_trigger_m",
    "trigger_rrev_per_s": "rrev_trigger",
    "trigger_of_y_radps": "of_y_trigger",
}
Columns = dict[str, npt.ArrayLike]
BoolArray = npt.NDArray[np.bool_]


def trials_table(sweep: Sweep, gear: str, log: Log) -> pa.Table:
    """One row per trial."""
    every, layout = np.arange(len(log.trials)), layout_of(sweep)
    last = log.n_episodes - 1
    four, spotless = landed(log)
    recent = log.recent[:, :, None] & log.scored
    columns: Columns = {
        **_key(sweep, gear, log.trials),
        "run_seed": log.run_seed,
        "seed": log.world_seed,
        "learner_seed": log.learner_seed,
        "n_rollouts": log.n_episodes * sweep.n_rollouts,
        "n_episodes": log.n_episodes,
        "n_discarded": (log.flown[:, :, None] & ~log.scored).sum(axis=(1, 2)),
        "stopped": log.stopped,
        "landing_rate_four_leg_norm": share(four, recent),
        "landing_rate_clean_norm": share(spotless, recent),
        "n_recent": recent.sum(axis=(1, 2)),
        "reward_mean": mean(log.reward, recent),
        **{name: mean(log.terms[term], recent) for term, name in layout.term_columns("reward_mean").items()},
        **_policy(layout, "mu0", log.mu0),
        **_policy(layout, "mu", log.mu[every, last]),
        **_policy(layout, "sigma", log.sigma[every, last]),
        **_policy(layout, "recommended", log.recommended[every, last]),
        "n_check": np.full(len(every), log.check.shape[1]),
        "check_rate_four_leg_norm": _rate(four_leg(log.check)),
        "check_rate_clean_norm": _rate(clean(log.check)),
        "n_failed_landings": (log.scored & ~four).sum(axis=(1, 2)),
        "n_body_contacts": (log.scored & (log.outcomes["body_contact"] != 0)).sum(axis=(1, 2)),
        **_at_trigger(log.outcomes, recent),
        **contact_columns(log.outcomes, recent, axis=(1, 2)),
        **_best(sweep, layout, log),
    }
    return make_table(schema.TRIALS, columns, layout)


def episodes_table(sweep: Sweep, gear: str, log: Log) -> pa.Table:
    """One row per trial and episode flown."""
    layout = layout_of(sweep)
    trial, episode = np.nonzero(log.flown)
    four, spotless = landed(log)
    scored = log.scored[trial, episode]
    columns: Columns = {
        **_key(sweep, gear, [log.trials[i] for i in trial.tolist()]),
        "episode": episode,
        "n_scored": scored.sum(axis=1),
        **_policy(layout, "mu", log.mu[trial, episode]),
        **_policy(layout, "sigma", log.sigma[trial, episode]),
        **_policy(layout, "recommended", log.recommended[trial, episode]),
        "reward_mean": mean(log.reward[trial, episode], scored, axis=1),
        **{
            name: mean(log.terms[term][trial, episode], scored, axis=1)
            for term, name in layout.term_columns("reward_mean").items()
        },
        "landing_rate_four_leg_norm": share(four[trial, episode], scored, axis=1),
        "landing_rate_clean_norm": share(spotless[trial, episode], scored, axis=1),
    }
    return make_table(schema.EPISODES, columns, layout)


def rollouts_table(sweep: Sweep, gear: str, log: Log) -> pa.Table:
    """One row per rollout of the trials; those that only check recommendations are not among them."""
    layout = layout_of(sweep)
    flown = np.broadcast_to(log.flown[:, :, None], log.scored.shape)
    trial, episode, idx = np.nonzero(flown)
    outcomes = log.outcomes[trial, episode, idx]
    columns: Columns = {
        **_key(sweep, gear, [log.trials[i] for i in trial.tolist()]),
        "episode": episode,
        "idx": idx,
        "seed": log.world_seed[trial],
        "stream": episode * sweep.n_rollouts + idx,
        **_policy(layout, "", log.theta[trial, episode, idx]),
        "scored": log.scored[trial, episode, idx],
        "reward": log.reward[trial, episode, idx],
        **{name: log.terms[term][trial, episode, idx] for term, name in layout.term_columns().items()},
    }
    for column, (name, element) in schema.outcome_columns().items():
        values = outcomes[name]
        columns[column] = values if values.ndim == 1 else values[:, element]
    return make_table(schema.ROLLOUTS, columns, layout)


def failures_table(
    grid: Sweep | PolicyMap, gear: str, task: int, failed: Sequence[tuple[Trial, Exception]]
) -> pa.Table:
    """One row per trial (or map cell) that could not be finished."""
    errors = [error for _, error in failed]
    columns: Columns = {
        **_key(grid, gear, [trial for trial, _ in failed]),
        "task": np.full(len(failed), task),
        "error": [f"{type(error).__name__}: {error}" for error in errors],
        "traceback": ["".join(traceback.format_exception(error)) for error in errors],
    }
    return make_table(schema.FAILURES, columns)


def contact_columns(outcomes: Outcomes, counted: BoolArray, axis: int | tuple[int, ...]) -> Columns:
    """Which legs stuck first and whether the others followed, over the counted rollouts.

    Args:
        outcomes: Outcome records, any shape.
        counted: Which of them count, same shape.
        axis: Axes over which shares are taken.
    """
    order = outcomes["leg_order"]
    attached = counted & (order[..., 0] > 0)
    fore_first = attached & np.isin(order[..., 0], FORE_LEGS)
    followed = fore_first & np.isin(order, HIND_LEGS).any(axis=-1)
    return {
        "n_attached": attached.sum(axis=axis),
        "fore_legs_first_norm": share(fore_first, attached, axis),
        "swing_completed_norm": share(followed, fore_first, axis),
    }


def encode(table: pa.Table) -> bytes:
    """The table as a Parquet file."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return bytes(sink.getvalue())


def make_table(kind: str, columns: Mapping[str, Any], layout: Layout = EMPTY) -> pa.Table:
    """Columns by name as a table of one kind; every column of the schema, and no other, must be given."""
    wanted = schema.schema(kind, layout)
    if set(columns) != set(wanted.names):
        raise ValueError(f"{kind}: columns {sorted(set(columns) ^ set(wanted.names))} are missing or unknown")
    arrays = [_array(columns[field.name], field.type) for field in wanted]
    return pa.Table.from_arrays(arrays, schema=wanted)


def _array(values: Any, kind: pa.DataType) -> pa.Array:
    if pa.types.is_dictionary(kind) or pa.types.is_string(kind):
        return pa.array(values, type=pa.string()).cast(kind)
    return pa.array(np.ascontiguousarray(values)).cast(kind)


def _key(grid: Sweep | PolicyMap, gear: str, trials: Sequence[Trial]) -> Columns:
    n = len(trials)
    return {
        "vehicle": [grid.vehicle] * n,
        "gear_set": [grid.gear_set] * n,
        "gear": [gear] * n,
        "learner": [grid.learner.name if isinstance(grid, Sweep) else ""] * n,
        "speed_mps": np.array([t.speed_mps for t in trials], dtype=np.float64),
        "angle_deg": np.array([t.angle_deg for t in trials], dtype=np.float64),
        "trial": np.array([t.number for t in trials], dtype=np.int32),
    }


def _policy(layout: Layout, prefix: str, theta: npt.NDArray[np.float64]) -> Columns:
    return {name: theta[..., i] for i, name in enumerate(layout.policy_columns(prefix))}


def _at_trigger(outcomes: Outcomes, counted: BoolArray) -> Columns:
    triggered = counted & (outcomes["triggered"] != 0)
    means = {column: mean(outcomes[name], triggered) for column, name in _TRIGGER.items()}
    return {"n_triggered": triggered.sum(axis=(1, 2)), **means}


def _best(sweep: Sweep, layout: Layout, log: Log) -> Columns:
    """The rollout of each trial with the largest return; its first one if none was scored."""
    every = np.arange(len(log.trials))
    flat = np.where(log.scored, log.reward, -np.inf).reshape(len(every), -1).argmax(axis=1)
    episode, idx = np.divmod(flat, sweep.n_rollouts)
    outcomes = log.outcomes[every, episode, idx]
    return {
        "best_episode": episode,
        "best_stream": episode * sweep.n_rollouts + idx,
        **_policy(layout, "best", log.theta[every, episode, idx]),
        "best_reward": log.reward[every, episode, idx],
        "best_n_legs": outcomes["n_legs"],
        "best_body_contact": outcomes["body_contact"],
    }


def share(happened: BoolArray, counted: BoolArray, axis: int | tuple[int, ...] = (1, 2)) -> npt.NDArray[np.float64]:
    """Share of the counted in which something happened; NaN where nothing was counted."""
    n = counted.sum(axis=axis)
    return np.where(n > 0, (happened & counted).sum(axis=axis) / np.maximum(n, 1), np.nan)


def mean(
    values: npt.NDArray[np.float64], counted: BoolArray, axis: int | tuple[int, ...] = (1, 2)
) -> npt.NDArray[np.float64]:
    """Mean of the counted values; NaN where there are none."""
    n = counted.sum(axis=axis)
    total = np.where(counted, values, 0.0).sum(axis=axis)
    return np.where(n > 0, total / np.maximum(n, 1), np.nan)


def _rate(happened: BoolArray) -> npt.NDArray[np.float64]:
    return share(happened, np.ones_like(happened), axis=1)
