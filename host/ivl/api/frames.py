"""Data frames of a run of `ivl learn`, with the columns that the tables of a sweep have."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ivl import files, native
from ivl.columns import SHARED, columns_of, values_of
from ivl.errors import StoreError
from ivl.experiment import Experiment
from ivl.layout import Layout
from ivl.learning.loop import recent_rate
from ivl.learning.recorder import DISCARDED, SCORED, EpisodeRow, RolloutRows
from ivl.optional import needed
from ivl.outcome import four_leg
from ivl.quantity import Quantity
from ivl.seeds import Purpose, derive
from ivl.table import describe

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped]

_EXTRA = "frames"
_SEED = Quantity("seed", "1", "seed of the world's random numbers; with `stream` it names a rollout")
_STATUS = Quantity("status", "1", "planned, scored, or discarded: an outcome that must not be learned from")
_REWARD = Quantity("reward", "1", "return; NaN if not flown")
_MEAN = Quantity("reward_mean", "1", "mean return of the episode")
_FOUR = Quantity("landing_rate_four_leg_norm", "1", "share of rollouts with three or four feet stuck")
_CLEAN = Quantity("landing_rate_clean_norm", "1", "the same without contact of body or rotor")
_JUDGED = {
    "solved": Quantity("solved", "1", "whether the final recommendation is good (ivl.assess)"),
    "rollouts_to_convergence": Quantity("rollouts_to_convergence", "1", "rollouts until convergence; missing: never"),
    "rate_four_leg": Quantity("check_rate_four_leg_norm", "1", "four-leg rate of the recommendation in fresh rollouts"),
    "rate_clean": Quantity("check_rate_clean_norm", "1", "clean rate of the recommendation in fresh rollouts"),
    "failed_landings": Quantity("n_failed_until_convergence", "1", "failed landings until convergence"),
    "body_contacts": Quantity("n_body_contacts_until_convergence", "1", "body contacts until convergence"),
    "stuck": Quantity("stuck", "1", "whether the recommendation lands at less than half of the best rate"),
}
"""Fields of a verdict, and the columns that show them."""
_TYPES = {"solved": "boolean", "stuck": "boolean", "rollouts_to_convergence": "Int64"}

Columns = dict[str, tuple[Any, Quantity]]


def rollouts(experiment: Experiment, layout: Layout, rows: RolloutRows) -> "pd.DataFrame":
    """One row for each rollout."""
    columns = _key(experiment, rows.trial)
    columns |= {name: (getattr(rows, name), SHARED[name]) for name in ("episode", "idx")}
    seeds = np.array([_world_seed(experiment, trial) for trial in rows.trial.tolist()], dtype=np.uint64)
    columns["seed"] = (seeds, _SEED)
    columns["stream"] = (rows.stream, SHARED["stream"])
    columns |= _policy(layout, "", "policy as flown", rows.theta)
    columns["status"] = (rows.status.astype(object), _STATUS)
    columns["reward"] = (rows.reward, _REWARD)
    for term, name in layout.term_columns().items():
        (quantity,) = (each for each in layout.terms if each.name == term)
        columns[name] = (rows.terms[term], replace(quantity, name=name))
    fields = native.library().outcome_fields
    for name, element in columns_of(fields).items():
        field = fields[element[0]]
        columns[name] = (values_of(rows.outcomes, element), Quantity(name, field.unit, field.doc))
    return _frame(columns)


def episodes(experiment: Experiment, layout: Layout, history: Sequence[EpisodeRow]) -> "pd.DataFrame":
    """One row for each finished episode of each trial."""
    columns = _key(experiment, np.array([row.trial for row in history], dtype=np.int64))
    columns["episode"] = ([row.episode for row in history], SHARED["episode"])
    columns["n_scored"] = ([row.n_scored for row in history], SHARED["n_scored"])
    columns |= _search(layout, history, "after the episode")
    columns["reward_mean"] = ([row.reward_mean for row in history], _MEAN)
    columns["landing_rate_four_leg_norm"] = ([row.rate_four_leg for row in history], _FOUR)
    columns["landing_rate_clean_norm"] = ([row.rate_clean for row in history], _CLEAN)
    return _frame(columns)


def trials(
    experiment: Experiment,
    layout: Layout,
    history: Sequence[EpisodeRow],
    rows: RolloutRows,
    result: Mapping[str, Any] | None,
) -> "pd.DataFrame":
    """One row for each trial that has a finished episode."""
    last = list({row.trial: row for row in sorted(history, key=lambda row: (row.trial, row.episode))}.values())
    numbers = [row.trial for row in last]
    columns = _key(experiment, np.array(numbers, dtype=np.int64))
    columns["run_seed"] = ([experiment.trial(trial).seed for trial in numbers], SHARED["run_seed"])
    columns["seed"] = ([_world_seed(experiment, trial) for trial in numbers], _SEED)
    columns["n_episodes"] = ([row.episode + 1 for row in last], SHARED["n_episodes"])
    scored, failed = rows.status == SCORED, (rows.status == SCORED) & ~four_leg(rows.outcomes)
    for name, mask, doc in (
        ("n_rollouts", rows.status != "", "rollouts planned or flown"),
        ("n_scored", scored, SHARED["n_scored"].doc),
        ("n_discarded", rows.status == DISCARDED, "rollouts that must not be learned from"),
        ("n_failed_landings", failed, "scored rollouts that were no four-leg landing"),
    ):
        columns[name] = ([int((mask & (rows.trial == trial)).sum()) for trial in numbers], Quantity(name, "1", doc))
    columns["stopped"] = ([row.stopped for row in last], SHARED["stopped"])
    for quantity, clean_only in ((_FOUR, False), (_CLEAN, True)):
        doc = f"{quantity.doc}, over the last three episodes"
        rates = [recent_rate(list(history), trial, clean_only) for trial in numbers]
        columns[quantity.name] = (rates, replace(quantity, doc=doc))
    columns |= _search(layout, last, "at the end")
    verdicts = {verdict["trial"]: verdict for verdict in (result or {}).get("verdicts", [])}
    frame = _frame(columns | _verdicts(numbers, verdicts))
    for name, kind in _TYPES.items():
        frame[name] = frame[name].astype(kind)
    return frame


def read_result(folder: Path) -> dict[str, Any] | None:
    """The summary of a run; None: there is none yet.

    Raises:
        StoreError: It cannot be read.
    """
    path = folder / "result.json"
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {files.reason(error)}") from error
    except ValueError as error:
        raise StoreError(f"{path}: is damaged: {error}") from error
    return found


def _verdicts(numbers: Sequence[int], verdicts: Mapping[int, Mapping[str, Any]]) -> Columns:
    return {
        quantity.name: ([verdicts.get(trial, {}).get(field) for trial in numbers], quantity)
        for field, quantity in _JUDGED.items()
    }


def _key(experiment: Experiment, trial: npt.NDArray[np.int64]) -> Columns:
    """Columns that name a trial."""
    fixed = {
        "vehicle": experiment.vehicle,
        "gear_set": experiment.gear_set,
        "gear": experiment.gear,
        "learner": experiment.learner.name,
        "speed_mps": experiment.speed_mps,
        "angle_deg": experiment.angle_deg,
    }
    columns: Columns = {name: ([value] * len(trial), SHARED[name]) for name, value in fixed.items()}
    return {**columns, "trial": (trial, SHARED["trial"])}


def _policy(layout: Layout, prefix: str, doc: str, theta: npt.NDArray[np.float64]) -> Columns:
    """A column for each parameter of the policy."""
    names = layout.policy_columns(prefix)
    return {
        name: (theta[:, i], Quantity(name, parameter.unit, f"{doc}: {parameter.doc}"))
        for i, (name, parameter) in enumerate(zip(names, layout.policy, strict=True))
    }


def _search(layout: Layout, rows: Sequence[EpisodeRow], when: str) -> Columns:
    """Columns of where a search stands."""
    columns: Columns = {}
    for prefix, doc in (("mu", "centre of the search"), ("sigma", "spread of the search"), ("recommended", "policy")):
        values = np.array([getattr(row, prefix) for row in rows], dtype=np.float64).reshape(len(rows), -1)
        values = values if len(rows) else np.zeros((0, len(layout.policy)))
        columns |= _policy(layout, prefix, f"{doc} {when}", values)
    return columns


def _world_seed(experiment: Experiment, trial: int) -> int:
    return derive(experiment.trial(trial).seed, Purpose.WORLD)


def _frame(columns: Columns) -> "pd.DataFrame":
    pd = needed("pandas", _EXTRA)
    frame = pd.DataFrame({name: values for name, (values, _) in columns.items()})
    return describe(frame, {name: quantity for name, (_, quantity) in columns.items()})
