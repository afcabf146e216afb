"""A correction of what came of a flown landing, afterwards: the outcome, its return, and all that was learned from it.

    amend(folder, number=17, change=Change(n_legs=2), who="anna", why="the video shows two legs")

What was there before is kept, with who and when. The learner begins anew and is told every finished episode again, so
that the run goes on as if the outcome had been told rightly at once; the policies that were flown since stay what they
were. A landing that the simulator has judged is no matter of opinion, and is not corrected.
"""

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ivl import native, run
from ivl.errors import ConfigError
from ivl.learning.loop import LearningRun, trials_of
from ivl.learning.recorder import DISCARDED, SCORED, Amendment, RolloutRows
from ivl.outcome import Outcomes, end_code
from ivl.store import RunStore, read_manifest

_LEGS_MAX = 4


@dataclass(frozen=True)
class Change:
    """What is to be said otherwise; None: as it is.

    Attributes:
        n_legs: Legs that held on.
        body_contact: Body or rotors touched.
        counts: Whether the landing counts; one that does not is not learned from.
    """

    n_legs: int | None = None
    body_contact: bool | None = None
    counts: bool | None = None


def amend(folder: Path, number: int, change: Change, who: str, why: str, threads: int | None = None) -> Amendment:
    """Correct rollout `number`, counted from 1, of a flown run.

    Raises:
        ConfigError: Nothing is changed, there is no such flown landing, or nobody says why.
        StoreError: The folder holds no run, or another process has it open.
    """
    if not (who.strip() and why.strip()):
        raise ConfigError("an amendment needs a name and a reason: --who NAME --why TEXT")
    experiment, n_trials = run.read_config(folder)
    if not read_manifest(folder).get("flown"):
        raise ConfigError(f"{folder}: the simulator has judged its landings; only those of a vehicle are amended")
    with RunStore.open_existing(folder, native.library().outcome_dtype) as store:
        row = _flown(store.rollouts(), number, folder)
        outcomes = _changed(row.outcomes, change)
        counts = row.status[0] == SCORED if change.counts is None else change.counts
        terms = dict(experiment.reward.score(outcomes))
        after = replace(
            row, outcomes=outcomes, status=np.array([SCORED if counts else DISCARDED]), reward=terms.pop("total"),
            terms=terms,
        )  # fmt: skip
        said = [_said(each) for each in (row, after)]
        if said[0] == said[1]:
            raise ConfigError(f"{folder}: rollout {number} says so already: {said[0]}")
        utc = datetime.now(UTC).isoformat(timespec="seconds")
        made = Amendment(int(row.trial[0]), int(row.episode[0]), int(row.idx[0]), utc, who, why, *said)
        simulator, _ = run.simulator_of(experiment, threads, in_room=True)
        trials = trials_of(experiment, n_trials or 1)
        learning = LearningRun(trials, None, store, simulator, run.kept_earlier(folder), begin_anew=True)
        store.amend(after, "" if counts else f"amended: {why}", made, lambda: learning.tell_again(made.trial))
    (folder / "result.json").unlink(missing_ok=True)  # its verdict is that of what was there before
    return made


def listed(folder: Path) -> list[dict[str, Any]]:
    """All corrections of a run as plain data, the earliest first; rollouts are counted from 1.

    Raises:
        StoreError: The folder holds no run that can be read.
    """
    experiment, _ = run.read_config(folder)
    with RunStore.open_reading(folder, native.library().outcome_dtype) as store:
        found = store.amendments()
    return [
        {
            "rollout": made.episode * experiment.n_rollouts + made.idx + 1, "trial": made.trial, "utc": made.utc,
            "who": made.who, "why": made.why, "before": made.before, "after": made.after,
        }
        for made in found
    ]  # fmt: skip


def _flown(rows: RolloutRows, number: int, folder: Path) -> RolloutRows:
    """The row of a landing that was flown."""
    found = np.flatnonzero(rows.stream == number - 1)
    if number < 1 or not found.size:
        raise ConfigError(f"{folder}: there is no rollout {number} (allowed 1 .. {len(rows)})")
    row = rows.of_rows(found[:1])
    if row.outcomes["n_ticks"][0] == 0:
        raise ConfigError(f"{folder}: rollout {number} was not flown: {row.status[0]}")
    return row


def _changed(outcomes: Outcomes, change: Change) -> Outcomes:
    """The outcome with what is said now; legs that hold on have touched, whatever the recorder noticed."""
    changed = outcomes.copy()
    if change.n_legs is not None:
        if not 0 <= change.n_legs <= _LEGS_MAX:
            raise ConfigError(f"--legs {change.n_legs}: value is out of range (allowed 0 .. {_LEGS_MAX})")
        changed["n_legs"] = change.n_legs
        if change.n_legs and changed["end_reason"][0] == end_code("missed"):
            changed["end_reason"] = end_code("contact_time")
    if change.body_contact is not None:
        changed["body_contact"] = int(change.body_contact)
    return changed


def _said(row: RolloutRows) -> dict[str, Any]:
    """What people can see of a row."""
    outcome = row.outcomes[0]
    return {
        "n_legs": int(outcome["n_legs"]),
        "body_contact": bool(outcome["body_contact"]),
        "counts": bool(row.status[0] == SCORED),
    }
