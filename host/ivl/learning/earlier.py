"""Earlier flights: what another run flew of the same task, as the first evidence of a new one (`ivl learn --from RUN`).

A learner is told them episode by episode, as it would have been in that run; the return of each is that of the new
run's reward. Flights of another task would teach it something wrong. So a run whose policy has another form, or that
flew another vehicle, gear or approach, is refused. What differs a little is allowed, and said: a speed or an angle near
the new one, numbers of the vehicle that are within what is uncertain of them.

The new run keeps a copy (`ivl.store.EARLIER_FILE`), so that it can be continued when the earlier one is gone.
"""

import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ivl import native, references
from ivl.errors import ConfigError, StoreError
from ivl.experiment import Experiment
from ivl.learners import Learner
from ivl.learners.base import LANDED, RECORDING, Meta
from ivl.learning.recorder import SCORED, RolloutRows
from ivl.outcome import Outcomes, four_leg
from ivl.rewards import TOTAL

_SPEED_SHARE, _ANGLE_DEG = 0.05, 2.0
"""Differences of the approach that matter little."""
_SHARE, _SIGMAS = 0.1, 3.0
"""Differences of a parameter that matter little: a share of its value, or so many standard deviations of its family."""
_TOLD_MAX = 4
_DIGEST = re.compile(r"-[0-9a-f]{12}$")

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Earlier:
    """Flights of earlier runs, in the order in which they were flown; n flights.

    Attributes:
        runs: The runs.
        notes: What differs a little, one line each.
        group: Episode of each, counted through all runs, shape (n,).
        theta: Policies, shape (n, dim).
        outcomes: Outcome records, shape (n,).
        recordings: What each recorded of its flip, shape (n, `ivl.belief.recording.N`), NaN where nothing; None: of no
            flight.
    """

    runs: tuple[str, ...]
    notes: tuple[str, ...]
    group: npt.NDArray[np.int64]
    theta: FloatArray
    outcomes: Outcomes
    recordings: FloatArray | None

    def tell(self, learner: Learner, experiment: Experiment) -> None:
        """Tell a learner that was told nothing yet."""
        reward = experiment.reward.score(self.outcomes)[TOTAL]
        for group in np.unique(self.group):
            own = self.group == group
            recordings = None if self.recordings is None else self.recordings[own]
            learner.tell(self.theta[own], reward[own], meta_of(self.outcomes[own], recordings))

    def to_bytes(self) -> bytes:
        """The copy that a run folder keeps."""
        buffer = io.BytesIO()
        arrays = {"group": self.group, "theta": self.theta, "outcomes": np.asarray(self.outcomes)}
        if self.recordings is not None:
            arrays["recordings"] = self.recordings
        texts = {"runs": np.array(self.runs, dtype=np.str_), "notes": np.array(self.notes, dtype=np.str_)}
        np.savez_compressed(buffer, allow_pickle=False, **texts, **arrays)
        return buffer.getvalue()

    @staticmethod
    def of_bytes(content: bytes) -> "Earlier":
        """Inverse of `to_bytes`."""
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            return Earlier(
                tuple(data["runs"].tolist()), tuple(data["notes"].tolist()), data["group"], data["theta"],
                data["outcomes"].view(np.recarray), data.get("recordings"),
            )  # fmt: skip


@dataclass(frozen=True)
class Source:
    """One earlier run: its folder, what it was, how many trials it had (None: no run of trials), what it flew."""

    folder: Path
    experiment: Experiment
    n_trials: int | None
    uri: str | None
    rollouts: RolloutRows


def meta_of(outcomes: Outcomes, recordings: FloatArray | None) -> Meta:
    """What a learner is told of rollouts beside policy and return."""
    meta = {name: outcomes[name] for name in outcomes.dtype.names or ()} | {LANDED: four_leg(outcomes)}
    return meta if recordings is None else meta | {RECORDING: recordings}


def gather(sources: Sequence[Source], chosen: Experiment, uri: str | None, each: bool) -> Earlier:
    """The flights of earlier runs as evidence for a new one.

    Args:
        sources: The runs, the earliest first.
        chosen: The new experiment.
        uri: Where it flies; None: the simulator.
        each: Whether its trials have vehicles of their own.

    Raises:
        ConfigError: A run is of another task, or of several vehicles.
        StoreError: It has no flight that can be told.
    """
    if each:
        raise ConfigError(
            "--from: family.member: each: the flights of one vehicle say nothing of others; name a member"
        )
    parts, notes, group, n_groups = [], [], [], 0
    for source in sources:
        notes += _checked(source, chosen, uri)
        rows = source.rollouts
        bounds = np.array(chosen.policy.bounds)
        inside = ((rows.theta >= bounds[:, 0]) & (rows.theta <= bounds[:, 1])).all(axis=1)
        scored = rows.status == SCORED
        if (n_outside := int((scored & ~inside).sum())) > 0:
            notes.append(
                f"{source.folder}: {n_outside} flights are left out: policies outside the bounds of the search"
            )
        told = scored & inside
        if not told.any():
            raise StoreError(f"{source.folder}: has no scored flight that this experiment can begin with")
        parts.append((rows, told))
        group.append(n_groups + rows.episode[told])
        n_groups += int(rows.episode.max()) + 1
    return Earlier(
        tuple(str(source.folder) for source in sources),
        tuple(notes),
        np.concatenate(group),
        np.concatenate([rows.theta[told] for rows, told in parts]),
        np.concatenate([np.asarray(rows.outcomes[told]) for rows, told in parts]).view(np.recarray),
        _recordings(parts),
    )


def _recordings(parts: Sequence[tuple[RolloutRows, npt.NDArray[np.bool_]]]) -> FloatArray | None:
    widths = {rows.recordings.shape[1] for rows, _ in parts if rows.recordings is not None}
    if not widths:
        return None
    width = max(widths)
    return np.concatenate(
        [
            np.full((told.sum(), width), np.nan) if rows.recordings is None else rows.recordings[told]
            for rows, told in parts
        ]
    )


def _checked(source: Source, chosen: Experiment, uri: str | None) -> list[str]:
    """What differs a little between an earlier run and the new one."""
    old, where = source.experiment, f"--from {source.folder}"
    if source.n_trials is not None and source.n_trials > 1:
        raise ConfigError(
            f"{where}: holds {source.n_trials} trials: earlier flights are those of a run without --trials"
        )
    _refuse_others(old, chosen, where)
    notes = []
    for name, allowed, unit in (
        ("speed_mps", _SPEED_SHARE * chosen.speed_mps, "m/s"),
        ("angle_deg", _ANGLE_DEG, "deg"),
    ):
        then, now = getattr(old, name), getattr(chosen, name)
        if abs(then - now) > allowed + 1e-9:
            raise ConfigError(f"{where}: {name}: flown at {then:g}, here {now:g} (allowed within {allowed:.3g} {unit})")
        if then != now:
            notes.append(f"{source.folder}: {name}: flown at {then:g}, here {now:g}")
    notes += [f"{source.folder}: {text}" for text in _parameters(old, chosen, where)]
    if source.uri != uri:
        notes.append(f"{source.folder}: flown {_place(source.uri)}, here {_place(uri)}")
    return notes


def _place(uri: str | None) -> str:
    return "in the simulator" if uri is None else f"over {uri}"


def _refuse_others(old: Experiment, chosen: Experiment, where: str) -> None:
    """Refuse a run with another form, vehicle, gear or kind of approach."""
    then, now = _kind(old), _kind(chosen)
    for name, value in now.items():
        if then[name] != value:
            raise ConfigError(f"{where}: {name}: flown with {then[name]}, here {value}")


def _kind(experiment: Experiment) -> dict[str, object]:
    """What must be equal; files by their own names."""
    member = experiment.family.of_trial(0).member
    return {
        "policy.form": experiment.policy.form,
        "vehicle": _DIGEST.sub("", references.title(experiment.vehicle)),
        "gear_set": _DIGEST.sub("", references.title(experiment.gear_set)),
        "gear": experiment.gear,
        "approach": experiment.approach,
        "start": experiment.start,
        "family.member": member,
        "family.seed": None if member is None else experiment.family.seed,
    }


def _parameters(old: Experiment, chosen: Experiment, where: str) -> list[str]:
    """Parameters of the simulated world that differ a little.

    Raises:
        ConfigError: One differs by more.
    """
    then, now = old.make_world().params, chosen.make_world().params
    fields, told = native.library().params, []
    spread = {**dict.fromkeys(now.values, 0.0), **now.sigma}
    for name, spread_of in chosen.family.parameters.items():
        share = spread_of.share or 0.0
        spread[name] = spread_of.sigma if spread_of.sigma is not None else share * abs(now.values[name])
        if spread_of.log_uniform is not None:
            spread[name] = math.inf
    for name, value in now.values.items():
        before = then.values[name]
        if before == value or (math.isnan(before) and math.isnan(value)):
            continue
        text = f"{name}: {before:g} there, {value:g} {fields[name].unit} here"
        if not abs(before - value) <= max(_SHARE * max(abs(before), abs(value)), _SIGMAS * spread[name]):
            raise ConfigError(f"{where}: {text}")
        told.append(text)
    more = f" (and {len(told) - _TOLD_MAX} more)" if len(told) > _TOLD_MAX else ""
    return ["; ".join(told[:_TOLD_MAX]) + more] if told else []
