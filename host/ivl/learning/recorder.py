"""What the learning loop asks of a recorder, and the rows in which both speak.

A recorder keeps what some trials did. The loop reads everything back from it before a learner is told, so that a run
that a recorder can continue takes the very same path as an uninterrupted one. Two recorders exist:
`ivl.store.RunStore`, a database that survives `kill -9`, and `ivl.sweep.trials.Columns`, arrays in memory for many
trials at once.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ivl.outcome import Outcomes
from ivl.rewards.base import Terms

PLANNED, SCORED, DISCARDED = "planned", "scored", "discarded"
"""What may be known of a rollout: its policy; its outcome; an outcome that must not be learned from."""


@dataclass(frozen=True)
class RolloutRows:
    """Rollouts of one or more trials as read back, in the order (trial, episode, idx).

    Attributes:
        trial: Trial of each rollout, shape (n,).
        episode: Episode within the trial, shape (n,).
        idx: Place within the episode, shape (n,).
        stream: Random stream, shape (n,).
        status: "planned", "scored" or "discarded", shape (n,).
        theta: Policies, shape (n, dim).
        reward: Return, shape (n,), NaN if not flown.
        outcomes: Outcome records, shape (n,); NaN and zero if not flown.
        terms: Terms of the return by name, shape (n,) each, NaN if not flown.
        recordings: What each recorded of its flip, shape (n, `ivl.belief.recording.N`), NaN where nothing; None: the
            recorder keeps none.
    """

    trial: npt.NDArray[np.int64]
    episode: npt.NDArray[np.int64]
    idx: npt.NDArray[np.int64]
    stream: npt.NDArray[np.uint64]
    status: npt.NDArray[np.str_]
    theta: npt.NDArray[np.float64]
    reward: npt.NDArray[np.float64]
    outcomes: Outcomes
    terms: dict[str, npt.NDArray[np.float64]] = field(default_factory=dict)
    recordings: npt.NDArray[np.float64] | None = None

    def __len__(self) -> int:
        """Number of rollouts."""
        return len(self.trial)

    def of_trial(self, number: int) -> "RolloutRows":
        """Those of one trial."""
        return self.of_rows(self.trial == number)

    def of_rows(self, own: npt.NDArray[Any]) -> "RolloutRows":
        """Some of them: a mask of shape (n,), or their places."""
        arrays = {
            field.name: getattr(self, field.name)[own]
            for field in fields(self)
            if isinstance(getattr(self, field.name), np.ndarray)
        }
        return replace(self, **arrays, terms={name: values[own] for name, values in self.terms.items()})


@dataclass(frozen=True)
class EpisodeRow:
    """What is kept of one finished episode of one trial; arrays have one element per policy parameter.

    `insight` is what the learner expected then (`ivl.learners.base.Learner.insight`).
    """

    trial: int
    episode: int
    n_scored: int
    mu: tuple[float, ...]
    sigma: tuple[float, ...]
    recommended: tuple[float, ...]
    reward_mean: float
    rate_four_leg: float
    rate_clean: float
    stopped: bool
    insight: dict[str, Any] | None = None


@dataclass(frozen=True)
class Amendment:
    """A change that a person made to what a rollout says, kept with what it said before.

    Attributes:
        trial: Trial of the rollout.
        episode: Episode within the trial.
        idx: Place within the episode.
        utc: When.
        who: By whom.
        why: Why.
        before: What was changed, as it was: field and value.
        after: The same, as it is.
    """

    trial: int
    episode: int
    idx: int
    utc: str
    who: str
    why: str
    before: dict[str, Any]
    after: dict[str, Any]


class Recorder(Protocol):
    """Keeps the trials of a run. An episode passes through `plan`, `score` (in portions) and `finish_episode`."""

    def episodes(self) -> list[EpisodeRow]:
        """Finished episodes of earlier sessions, ordered by (trial, episode); none if runs cannot be continued."""
        ...

    def learner_states(self) -> Mapping[int, Mapping[str, Any]]:
        """The last state of each trial's learner, of earlier sessions too."""
        ...

    def rollouts(self, *, episode: int) -> RolloutRows:
        """Rollouts of an episode of all trials; no rows before it is planned."""
        ...

    def plan(
        self,
        episode: int,
        trials: Sequence[int],
        stream: npt.NDArray[np.uint64],
        theta: Sequence[npt.NDArray[np.float64]],
        states: Iterable[Mapping[str, Any]],
    ) -> None:
        """Keep the policies of one episode, before any is flown.

        Args:
            episode: Number of the episode.
            trials: Trials that take part.
            stream: Random stream of each rollout, shape (n_rollouts,), the same in every trial.
            theta: For each of these trials the policies, shape (n_rollouts, dim).
            states: For each of these trials the learner's state after `ask`; made only if it is read.
        """
        ...

    def fly_instead(
        self, episode: int, trial: npt.NDArray[np.int64], idx: npt.NDArray[np.int64], theta: npt.NDArray[np.float64]
    ) -> None:
        """Keep that an operator had other policies flown than those that were planned.

        Args:
            episode: Number of the episode.
            trial: Trial of each rollout, shape (n,).
            idx: Place of each within the episode, shape (n,).
            theta: Policies as flown, shape (n, dim).
        """
        ...

    def score(
        self,
        episode: int,
        trial: npt.NDArray[np.int64],
        idx: npt.NDArray[np.int64],
        outcomes: Outcomes,
        terms: Terms,
        discarded: str = "",
        recordings: npt.NDArray[np.float64] | None = None,
    ) -> None:
        """Keep the outcomes of some planned rollouts of an episode.

        Args:
            episode: Number of the episode.
            trial: Trial of each rollout, shape (n,).
            idx: Place of each within the episode, shape (n,).
            outcomes: Outcome records, shape (n,).
            terms: The return, `total`, and the reward's terms by name, shape (n,) each.
            discarded: Reason why they must not be learned from; empty if they are to be.
            recordings: What each recorded of its flip, shape (n, `ivl.belief.recording.N`); None if nothing.
        """
        ...

    def finish_episode(self, rows: Sequence[EpisodeRow], states: Iterable[Mapping[str, Any]]) -> None:
        """Keep the end of an episode of some trials.

        Args:
            rows: The episode's figures, one row per trial.
            states: For each of these trials the learner's state after `tell`; made only if it is read.
        """
        ...
