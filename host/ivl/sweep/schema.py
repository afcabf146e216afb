"""The tables of a sweep, column by column: one description for whoever writes them and whoever reads them.

    RUN/manifest.json       what was run: resolved sweep, versions, hashes, units, schema version, layout
    RUN/sweep.yaml          the resolved sweep file
    RUN/trials/*.parquet    one row per trial
    RUN/episodes/*.parquet  one row per trial and episode
    RUN/rollouts/*.parquet  one row per rollout, if they were kept
    RUN/map/*.parquet       one row per point of a policy map (`ivl map`), instead of trials and episodes
    RUN/failures/*.parquet  one row per trial or map cell that could not be finished
    RUN/tasks/*.parquet     one row per finished task: what it cost

A path that a sweep varies and that has no column here has one of its own, `vary.` and the path, at the end of every
table but `tasks`. The name of every other column ends with its unit; `_norm` is a share in 0 .. 1, a count or a number
without unit has no suffix. Each field carries `unit` and `doc` in its metadata, each file the schema version. Columns
of the policy are made from the names of its parameters, those of the return from the terms of the run's reward: both
are the run's layout. A quantity that does not exist (no rollout was triggered, no foot stuck) is NaN, never zero;
nothing is null.
"""

from collections.abc import Iterable
from functools import cache

import pyarrow as pa  # type: ignore[import-untyped]

from ivl import native
from ivl.columns import SHARED, columns_of
from ivl.layout import EMPTY, Layout

SCHEMA_VERSION = 2
VERSION_KEY = b"ivl_schema_version"

TRIALS, EPISODES, ROLLOUTS, MAP, FAILURES, TASKS = "trials", "episodes", "rollouts", "map", "failures", "tasks"
KINDS = (TRIALS, EPISODES, ROLLOUTS, MAP, FAILURES, TASKS)

CELL = ("vehicle", "gear_set", "gear", "learner", "speed_mps", "angle_deg")
"""Columns that name a cell of the sweep; with `trial` they are the key of a trial."""
TRIAL_KEY = (*CELL, "trial")
COLUMN_OF = {"vehicle": "vehicle", "gear_set": "gear_set", "learner.name": "learner"}
"""Paths that a sweep may vary whose column is one of `CELL`; that of any other one begins with `VARIED`."""
VARIED = "vary."

_NAME, _F8, _I4, _I8 = pa.dictionary(pa.int16(), pa.string()), pa.float64(), pa.int32(), pa.int64()


def field(name: str, kind: pa.DataType, unit: str, doc: str) -> pa.Field:
    """One column, with its unit and meaning."""
    return pa.field(name, kind, nullable=False, metadata={"unit": unit, "doc": doc})


def shared(name: str, kind: pa.DataType) -> pa.Field:
    """One column that data frames of a run have, too."""
    return field(name, kind, SHARED[name].unit, SHARED[name].doc)


def column_of(path: str) -> str:
    """Column of a varied path."""
    return COLUMN_OF.get(path, f"{VARIED}{path}")


def varied_field(path: str, number: bool) -> pa.Field:
    """The column of a varied path: numbers, or names and other values as YAML has them."""
    parameter = native.library().params.get(path)
    unit = parameter.unit if parameter else "1"
    return field(column_of(path), _F8 if number else _NAME, unit, f"value of {path}, which the sweep varies")


def varied_columns(names: Iterable[str]) -> list[str]:
    """Those of the columns that a sweep has because it varies something."""
    return [str(name) for name in names if str(name).startswith(VARIED)]


def cell_columns(names: Iterable[str]) -> list[str]:
    """Columns that name a cell in a table with these columns: `CELL`, and whatever else the sweep varies."""
    names = list(names)
    return [*(name for name in CELL if name in names), *varied_columns(names)]


def schema(kind: str, layout: Layout = EMPTY) -> pa.Schema:
    """The columns of one kind of table.

    Args:
        kind: See `KINDS`.
        layout: Policy and reward of the run; kinds of tables that tell of neither do without.
    """
    return _schemas(layout)[kind]


def units(kind: str, layout: Layout = EMPTY) -> dict[str, str]:
    """Unit of each column of one kind of table (arguments as `schema`)."""
    return {f.name: f.metadata[b"unit"].decode() for f in schema(kind, layout)}


def outcome_columns() -> dict[str, tuple[str, int]]:
    """Column name -> (field of the library's outcome table, element of it), for the columns of a rollout's outcome."""
    return columns_of(native.library().outcome_fields)


def _policy(layout: Layout, prefix: str, doc: str) -> list[pa.Field]:
    """One column for each parameter of the policy."""
    names = layout.policy_columns(prefix)
    return [field(name, _F8, p.unit, f"{doc}: {p.doc}") for name, p in zip(names, layout.policy, strict=True)]


def _terms(layout: Layout, prefix: str, doc: str) -> list[pa.Field]:
    """One column for each term of the reward."""
    names = layout.term_columns(prefix)
    return [field(names[term.name], _F8, term.unit, f"{doc}: {term.doc}") for term in layout.terms]


def _cell() -> list[pa.Field]:
    return [
        shared("vehicle", _NAME),
        shared("gear_set", _NAME),
        shared("gear", _NAME),
        shared("learner", _NAME),
        shared("speed_mps", _F8),
        shared("angle_deg", _F8),
    ]


def _trial_key() -> list[pa.Field]:
    return [*_cell(), shared("trial", _I4)]


def _trigger(doc: str) -> list[pa.Field]:
    return [
        field("trigger_vx_mps", _F8, "m/s", f"true velocity along x at the trigger, {doc}"),
        field("trigger_vz_mps", _F8, "m/s", f"true velocity towards the ceiling at the trigger, {doc}"),
        field("trigger_d_ceil_m", _F8, "m", f"sensed distance to the ceiling at the trigger, {doc}"),
        field("trigger_rrev_per_s", _F8, "1/s", f"RREV as sensed at the trigger, {doc}"),
        field("trigger_of_y_radps", _F8, "rad/s", f"OF_y as sensed at the trigger, {doc}"),
    ]


def _contact(doc: str) -> list[pa.Field]:
    return [
        field("n_attached", _I4, "1", f"rollouts in which a foot stuck at any time, {doc}"),
        field("fore_legs_first_norm", _F8, "1", "share of those in which a fore leg (1 or 4) stuck first"),
        field("swing_completed_norm", _F8, "1", "share of the latter in which a hind leg (2 or 3) stuck later"),
    ]


def _rates(doc: str) -> list[pa.Field]:
    return [
        field("landing_rate_four_leg_norm", _F8, "1", f"share of rollouts with three or four feet stuck, {doc}"),
        field("landing_rate_clean_norm", _F8, "1", f"the same without contact of body or rotor, {doc}"),
    ]


def _trials(layout: Layout) -> Iterable[pa.Field]:
    recent = "over the last three episodes"
    yield from _trial_key()
    yield shared("run_seed", _I8)
    yield field(
        "seed",
        _I8,
        "1",
        "seed of the world's random numbers, the same for every learner; with `stream` it names a rollout",
    )
    yield shared("learner_seed", _I8)
    yield field("n_rollouts", _I4, "1", "rollouts flown")
    yield shared("n_episodes", _I4)
    yield field("n_discarded", _I4, "1", "rollouts that the simulation could not bring to an end; not learned from")
    yield shared("stopped", pa.bool_())
    yield from _rates(recent)
    yield field("n_recent", _I4, "1", f"rollouts that count {recent}")
    yield field("reward_mean", _F8, "1", f"mean return {recent}")
    yield from _terms(layout, "reward_mean", f"mean term of the return {recent}")
    yield from _policy(layout, "mu0", "centre of the search at the start")
    yield from _policy(layout, "mu", "centre of the search at the end")
    yield from _policy(layout, "sigma", "spread of the search at the end")
    yield from _policy(layout, "recommended", "policy that the learner recommends at the end")
    yield field("n_check", _I4, "1", "fresh rollouts of the recommended policy (0: not checked)")
    yield field("check_rate_four_leg_norm", _F8, "1", "four-leg rate of the recommended policy over the fresh rollouts")
    yield field("check_rate_clean_norm", _F8, "1", "clean rate of the recommended policy over the fresh rollouts")
    yield field("n_failed_landings", _I4, "1", "rollouts of the whole trial that were no four-leg landing")
    yield field("n_body_contacts", _I4, "1", "rollouts of the whole trial in which body or rotor touched the ceiling")
    yield field("n_triggered", _I4, "1", f"rollouts in which the flip was started, {recent}")
    yield from _trigger(f"mean of the triggered rollouts {recent}")
    yield from _contact(recent)
    yield field("best_episode", _I4, "1", "episode of the rollout with the largest return (the first of equals)")
    yield field(
        "best_stream", _I8, "1", "its number within the seed: replay with seed, best_stream and policy, bit for bit"
    )
    yield from _policy(layout, "best", "its policy")
    yield field("best_reward", _F8, "1", "its return")
    yield field("best_n_legs", _I4, "1", "its feet stuck at the end")
    yield field("best_body_contact", _I4, "1", "1 if its body or rotor touched the ceiling")


def _episodes(layout: Layout) -> Iterable[pa.Field]:
    yield from _trial_key()
    yield shared("episode", _I4)
    yield shared("n_scored", _I4)
    yield from _policy(layout, "mu", "centre of the search after the episode")
    yield from _policy(layout, "sigma", "spread of the search after the episode")
    yield from _policy(layout, "recommended", "policy recommended after the episode")
    yield field("reward_mean", _F8, "1", "mean return of the episode")
    yield from _terms(layout, "reward_mean", "mean term of the return")
    yield from _rates("of the episode")


def _rollouts(layout: Layout) -> Iterable[pa.Field]:
    yield from _trial_key()
    yield shared("episode", _I4)
    yield shared("idx", _I4)
    yield field("seed", _I8, "1", "seed of the world's random numbers")
    yield shared("stream", _I8)
    yield from _policy(layout, "", "policy as flown")
    yield field("scored", pa.bool_(), "1", "false: the simulation could not bring it to an end, not learned from")
    yield field("reward", _F8, "1", "return; NaN if not scored")
    yield from _terms(layout, "reward", "term of the return; NaN if not scored")
    for column, (name, _) in outcome_columns().items():
        entry = native.library().outcome_fields[name]
        yield field(column, pa.from_numpy_dtype(entry.type), entry.unit, entry.doc)


def _map(_: Layout) -> Iterable[pa.Field]:
    yield from (f for f in _cell() if f.name != "learner")
    yield field("d_ceil_m", _F8, "m", "distance of the body origin from the plane of the cues, where the flip starts")
    yield field("moment_Nmm", _F8, "N mm", "moment M_yd")
    yield field("vx_mps", _F8, "m/s", "velocity along x at the start of the flip, V cos phi")
    yield field("vz_mps", _F8, "m/s", "velocity towards the ceiling at the start of the flip, V sin phi")
    yield field("rrev_per_s", _F8, "1/s", "true RREV there, vz / d; what is sensed is older by up to a pose period")
    yield field("of_y_radps", _F8, "rad/s", "true OF_y there, -vx / d")
    yield field("seed", _I8, "1", "seed of the world's random numbers; the same at all points of a cell")
    yield field("first_stream", _I8, "1", "rollout k of the point has the number first_stream + k within the seed")
    yield field("n", _I4, "1", "rollouts flown and brought to an end")
    yield field("n_four_leg", _I4, "1", "rollouts with three or four feet stuck")
    yield field("n_clean", _I4, "1", "the same without contact of body or rotor")
    yield field("n_body_contact", _I4, "1", "rollouts in which body or rotor touched the ceiling")
    yield field("n_legs_mean", _F8, "1", "mean number of feet stuck at the end")
    yield field(
        "theta_impact_mean_deg", _F8, "deg", "mean nose-up rotation at the first contact, of those with contact"
    )
    yield from _contact("of this point")


def _failures(_: Layout) -> Iterable[pa.Field]:
    yield from _trial_key()
    yield field("task", _I4, "1", "number of the task")
    yield field("error", pa.string(), "1", "kind and message of the error")
    yield field("traceback", pa.string(), "1", "where it was raised")


def _tasks(_: Layout) -> Iterable[pa.Field]:
    yield field("task", _I4, "1", "number of the task")
    yield field("n_trials", _I4, "1", "trials (or map points) finished")
    yield field("n_failed", _I4, "1", "trials that failed")
    yield field("n_rollouts", _I8, "1", "rollouts flown")
    yield field("processor_s", _F8, "s", "processor time of the worker")
    yield field("wall_s", _F8, "s", "wall time on the worker")
    yield field("result_bytes", _I8, "bytes", "size of what the worker sent back")
    yield field("worker", pa.string(), "1", "address of the worker")


@cache
def _schemas(layout: Layout) -> dict[str, pa.Schema]:
    metadata = {VERSION_KEY: str(SCHEMA_VERSION).encode()}
    makers = {
        TRIALS: _trials, EPISODES: _episodes, ROLLOUTS: _rollouts, MAP: _map, FAILURES: _failures, TASKS: _tasks,
    }  # fmt: skip
    return {kind: pa.schema(list(make(layout)), metadata=metadata) for kind, make in makers.items()}
