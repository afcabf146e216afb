"""The learning loop: ask, fly, score, tell, for one trial or for many in lock-step.

Trial t of a run with seed s is the run with seed s + t: the same policies, the same rollouts, the same bits, whether
it runs alone, beside others, or in two halves with a `kill -9` between them. Every episode is read back from the
store before the learners are told, so that a resumed run takes the very same path as an uninterrupted one.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl.experiment import Experiment
from ivl.learners import Learner
from ivl.learners.base import LANDED
from ivl.outcome import Outcomes, clean, four_leg
from ivl.seeds import Purpose, derive
from ivl.source import Plan, RolloutSource
from ivl.store import PLANNED, SCORED, EpisodeRow, RolloutRows, RunStore

RECENT_EPISODES = 3
"""The landing rate of a trial is that of its last three episodes (as in the paper)."""


@dataclass(frozen=True)
class Progress:
    """Where a run stands after an episode.

    Attributes:
        episode: Episodes done.
        n_episodes: Episodes that the budget pays for.
        rows: This episode's row of each trial that took part.
        rate_recent: Four-leg rate over the last three episodes, all trials.
        n_flown: Rollouts flown by this process.
        rollouts_per_s: Of this process so far, learning and storing included.
    """

    episode: int
    n_episodes: int
    rows: list[EpisodeRow]
    rate_recent: float
    n_flown: int
    rollouts_per_s: float


class LearningRun:
    """Trials of one experiment, advanced in lock-step through one source and one store."""

    def __init__(self, experiment: Experiment, source: RolloutSource, store: RunStore, n_trials: int = 1) -> None:
        """Start, or continue where the store stands."""
        self.experiment, self.n_trials = experiment, n_trials
        self._source, self._store = source, store
        seeds = [experiment.seed + trial for trial in range(n_trials)]
        self._world_seed = np.array([derive(seed, Purpose.WORLD) for seed in seeds], dtype=np.uint64)
        self._learners = [experiment.make_learner(derive(seed, Purpose.LEARNER)) for seed in seeds]
        for trial, state in store.learner_states().items():
            self._learners[trial].load_state_dict(state)
        self._history: list[EpisodeRow] = store.episodes()
        self._n_flown = 0

    def run(self, on_episode: Callable[[Progress], None] | None = None) -> None:
        """Fly the rest of the budget; after each stored episode call `on_episode`.

        Raises:
            RolloutError: The source failed; the run can be resumed.
            StoreError: A commit failed; the run can be resumed.
        """
        began = time.monotonic()
        first = max((row.episode + 1 for row in self._history), default=0)
        for episode in range(first, self.experiment.n_episodes):
            stopped = {row.trial for row in self._history if row.stopped}
            active = [trial for trial in range(self.n_trials) if trial not in stopped]
            if not active:
                return
            rows = self._fly_episode(episode, active)
            self._history.extend(rows)
            if on_episode:
                rate = self._n_flown / max(time.monotonic() - began, 1e-9)
                total = self.experiment.n_episodes
                on_episode(Progress(episode + 1, total, rows, recent_rate(self._history), self._n_flown, rate))

    def _fly_episode(self, episode: int, active: list[int]) -> list[EpisodeRow]:
        rollouts = self._store.rollouts(episode=episode)
        if not len(rollouts):
            self._plan(episode, active)
            rollouts = self._store.rollouts(episode=episode)
        if (rollouts.status == PLANNED).any():
            self._fly(rollouts)
            rollouts = self._store.rollouts(episode=episode)
        return self._tell(episode, active, rollouts)

    def _plan(self, episode: int, active: list[int]) -> None:
        n = self.experiment.n_rollouts
        theta = [self._learners[trial].ask() for trial in active]
        stream = np.arange(episode * n, (episode + 1) * n, dtype=np.uint64)
        states = [self._learners[trial].state_dict() for trial in active]
        self._store.plan(episode, active, stream, theta, states)

    def _fly(self, rollouts: RolloutRows) -> None:
        """Fly what is still planned and commit each portion as it comes."""
        open_rows = np.flatnonzero(rollouts.status == PLANNED)
        trial = rollouts.trial[open_rows]
        plan = Plan(rollouts.theta[open_rows], self._world_seed[trial], rollouts.stream[open_rows])
        for flown in self._source.fly(plan):
            rows = open_rows[flown.index]
            keys = [(int(rollouts.trial[i]), int(rollouts.episode[i]), int(rollouts.idx[i])) for i in rows]
            terms = self.experiment.reward.score(flown.outcomes)
            self._store.score(keys, flown.outcomes, terms, flown.discarded)
            self._n_flown += len(keys)

    def _tell(self, episode: int, active: list[int], rollouts: RolloutRows) -> list[EpisodeRow]:
        rows, states = [], []
        for trial in active:
            chosen = (rollouts.trial == trial) & (rollouts.status == SCORED)
            outcomes, learner = rollouts.outcomes[chosen], self._learners[trial]
            meta = {name: outcomes[name] for name in outcomes.dtype.names or ()} | {LANDED: four_leg(outcomes)}
            learner.tell(rollouts.theta[chosen], rollouts.reward[chosen], meta)
            rows.append(_episode_row(trial, episode, learner, rollouts.reward[chosen], outcomes))
            states.append(learner.state_dict())
        self._store.finish_episode(rows, states)
        return rows


def recent_rate(history: list[EpisodeRow], trial: int | None = None, clean_only: bool = False) -> float:
    """Landing rate over the last three episodes of each trial (or of one), four-leg or clean; NaN without rollouts."""
    last = {row.trial: row.episode for row in history}
    recent = [
        row
        for row in history
        if row.episode > last[row.trial] - RECENT_EPISODES and trial in (None, row.trial) and row.n_scored
    ]
    n_scored = sum(row.n_scored for row in recent)
    landed = sum((row.rate_clean if clean_only else row.rate_four_leg) * row.n_scored for row in recent)
    return landed / n_scored if n_scored else float("nan")


def _episode_row(
    trial: int, episode: int, learner: Learner, reward: npt.NDArray[np.float64], outcomes: Outcomes
) -> EpisodeRow:
    result = learner.result
    return EpisodeRow(
        trial=trial,
        episode=episode,
        n_scored=reward.size,
        mu=tuple(result.mu.tolist()),
        sigma=tuple(result.sigma.tolist()),
        recommended=tuple(result.recommended.tolist()),
        reward_mean=_mean(reward),
        rate_four_leg=_mean(four_leg(outcomes)),
        rate_clean=_mean(clean(outcomes)),
        stopped=learner.stop(),
    )


def _mean(values: npt.NDArray[np.float64] | npt.NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if values.size else float("nan")
