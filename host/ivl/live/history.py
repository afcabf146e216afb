"""What a run has learned so far, read from its folder: policies, landings, convergence, belief."""

from pathlib import Path
from typing import Any

import numpy as np

from ivl import native
from ivl.belief.changes import most_changed
from ivl.experiment import Experiment
from ivl.learning.recorder import PLANNED, SCORED, EpisodeRow, RolloutRows
from ivl.outcome import clean, four_leg
from ivl.store import RunStore

TRIAL = 0
"""The trial that is shown of a run of several."""


def read(folder: Path) -> tuple[list[EpisodeRow], RolloutRows]:
    """Episodes and rollouts of the trial that is shown, as committed at this moment.

    Raises:
        StoreError: There is no run yet, or it is written too fast to be read.
    """
    with RunStore.open_reading(folder, native.library().outcome_dtype) as store:
        return [row for row in store.episodes() if row.trial == TRIAL], store.rollouts(TRIAL)


def stamp(folder: Path) -> tuple[tuple[int, int], ...]:
    """Changes whenever something was committed; empty before there is a run."""
    files = [path for name in ("run.sqlite", "run.sqlite-wal") if (path := folder / name).exists()]
    return tuple((status.st_mtime_ns, status.st_size) for status in (path.stat() for path in files))


def part(experiment: Experiment, episodes: list[EpisodeRow], rollouts: RolloutRows) -> dict[str, Any]:
    """What the page shows of it."""
    scored = rollouts.status == SCORED
    planned = np.flatnonzero(rollouts.status == PLANNED)
    params = experiment.policy.shape.params
    bounds = experiment.policy.bounds
    return {
        "params": [
            {"symbol": p.symbol, "unit": p.unit, "bounds": list(b)} for p, b in zip(params, bounds, strict=True)
        ],
        "n_all": experiment.budget,
        "n_flown": int(scored.sum()),
        "n_landed": int((four_leg(rollouts.outcomes) & scored).sum()),
        "next": None if not planned.size else _next(rollouts, int(planned[0])),
        "flights": _flights(rollouts, scored),
        "episodes": [_episode(row) for row in episodes],
        "belief": _belief(episodes),
    }


def _next(rollouts: RolloutRows, row: int) -> dict[str, Any]:
    """The rollout that is flown next, or now."""
    return {"number": int(rollouts.stream[row]) + 1, "theta": rollouts.theta[row].tolist()}


def _flights(rollouts: RolloutRows, scored: Any) -> dict[str, Any]:
    """Every flight that counts, column by column."""
    outcomes = rollouts.outcomes[scored]
    return {
        "number": (rollouts.stream[scored] + 1).tolist(),
        "theta": rollouts.theta[scored].T.tolist(),
        "reward": rollouts.reward[scored].tolist(),
        "n_legs": outcomes["n_legs"].tolist(),
        "landed": four_leg(outcomes).tolist(),
        "clean": clean(outcomes).tolist(),
    }


def _episode(row: EpisodeRow) -> dict[str, Any]:
    return {
        "n_scored": row.n_scored,
        "mu": row.mu,
        "sigma": row.sigma,
        "recommended": row.recommended,
        "rate": row.rate_four_leg,
    }


def _belief(episodes: list[EpisodeRow]) -> dict[str, Any] | None:
    """What a learner with a belief expects, and the parameters whose belief has changed most; None without one."""
    insight = episodes[-1].insight if episodes else None
    if insight is None:
        return None
    told = {name: insight.get(name) for name in ("expected_rate", "margin_rate", "model_fits", "surprise")}
    belief = insight.get("belief")
    if belief is None:
        return {**told, "parameters": []}
    chosen = most_changed(np.array([belief["prior"], belief["quantiles"]]))
    parameters = [{name: belief[f"{name}s"][i] for name in ("name", "unit", "quantile")} for i in chosen]
    for found, i in zip(parameters, chosen, strict=True):
        found["prior"] = belief["prior"][i]
    return {**told, "parameters": parameters}
