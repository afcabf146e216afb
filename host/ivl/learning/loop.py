"""The learning loop: ask, fly, score, tell, for one trial or for many together.

A trial is an experiment. It gives the same policies, the same rollouts, the same bits, whether it runs alone, beside
others, or in two halves with a `kill -9` between them, and whatever records it: every episode is read back from the
recorder before the learners are told.
"""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from ivl.belief.simulator import Simulator
from ivl.experiment import Experiment
from ivl.learners import EpheBelief, Learner
from ivl.learners.base import FloatArray
from ivl.learning.earlier import Earlier, meta_of
from ivl.learning.recorder import PLANNED, SCORED, EpisodeRow, Recorder, RolloutRows
from ivl.outcome import RECENT_EPISODES, BoolArray, clean, four_leg
from ivl.seeds import Purpose, derive
from ivl.source import Plan, RolloutSource


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


def trials_of(experiment: Experiment, n_trials: int = 1) -> list[Experiment]:
    """Trials of one experiment (`Experiment.trial`)."""
    return [experiment.trial(number) for number in range(n_trials)]


class LearningRun:
    """Trials that go on together, episode by episode, through one source and one recorder."""

    def __init__(
        self,
        trials: Sequence[Experiment],
        source: RolloutSource | None,
        recorder: Recorder,
        simulator: Simulator | None = None,
        earlier: Earlier | None = None,
        threads: int = 1,
        begin_anew: bool = False,
    ) -> None:
        """Start, or continue where the recorder stands.

        Args:
            trials: What each trial is; they have budget, episodes and reward in common.
            source: Where their rollouts come from; None: nothing is flown.
            recorder: Keeps what they do.
            simulator: Simulated vehicles, for learners that begin with them.
            earlier: Flights that the learners are told before the first episode.
            threads: So many learners think at the same time, each in a process of its own; worth it where each thinks
                long.
            begin_anew: The learners have no state yet, whatever the recorder has (`tell_again`).
        """
        self._threads = threads
        self._first, self._source, self._recorder = trials[0], source, recorder
        self._world_seed = np.array([derive(trial.seed, Purpose.WORLD) for trial in trials], dtype=np.uint64)
        self._learners = [trial.make_learner(derive(trial.seed, Purpose.LEARNER)) for trial in trials]
        if simulator is not None:
            self._learners = self._each(_begun, [(learner, simulator) for learner in self._learners])
        states = {} if begin_anew else recorder.learner_states()
        for number, learner in enumerate(self._learners):
            if number in states:
                learner.load_state_dict(states[number])
            elif earlier is not None:
                earlier.tell(learner, trials[number])
        self._history: list[EpisodeRow] = recorder.episodes()
        self._n_flown = 0

    def run(self, on_episode: Callable[[Progress], None] | None = None) -> None:
        """Fly the rest of the budget; after each stored episode call `on_episode`.

        Raises:
            RolloutError: The source failed; the run can be resumed.
            StoreError: A commit failed; the run can be resumed.
        """
        began, n_episodes = time.monotonic(), self._first.n_episodes
        first = max((row.episode + 1 for row in self._history), default=0)
        stopped = {row.trial for row in self._history if row.stopped}
        active = [trial for trial in range(len(self._learners)) if trial not in stopped]
        for episode in range(first, n_episodes):
            if not active:
                return
            rows = self._fly_episode(episode, active)
            active = [row.trial for row in rows if not row.stopped]
            if on_episode:
                self._history.extend(rows)
                rate = self._n_flown / max(time.monotonic() - began, 1e-9)
                on_episode(Progress(episode + 1, n_episodes, rows, recent_rate(self._history), self._n_flown, rate))

    def tell_again(self, trial: int) -> tuple[list[EpisodeRow], dict[str, Any]]:
        """Tell the learner of a trial every finished episode as it is stored now; returns the episodes and its state.

        It asks as it did before, so that its random numbers go on as they would have; what it asks for now is not
        flown.
        """
        learner, rows = self._learners[trial], []
        finished = [row.episode for row in self._history if row.trial == trial]
        for episode in finished:
            learner.ask()
            rows += self._learn(episode, self._recorder.rollouts(episode=episode), [trial])
        if len(self._recorder.rollouts(episode=len(finished)).of_trial(trial)):  # planned, and not told yet
            learner.ask()
        return rows, learner.state_dict()

    def _fly_episode(self, episode: int, active: list[int]) -> list[EpisodeRow]:
        rollouts = self._recorder.rollouts(episode=episode)
        if not len(rollouts):
            self._plan(episode, active)
            rollouts = self._recorder.rollouts(episode=episode)
        if (rollouts.status == PLANNED).any():
            self._fly(episode, rollouts)
            rollouts = self._recorder.rollouts(episode=episode)
        return self._tell(episode, active, rollouts)

    def _plan(self, episode: int, active: list[int]) -> None:
        n = self._first.n_rollouts
        battery_V = self._source.battery_V() if self._source is not None else math.nan
        for trial in active:
            learner = self._learners[trial]
            if isinstance(learner, EpheBelief):
                learner.take_battery(battery_V)
        theta = [self._learners[trial].ask() for trial in active]
        stream = np.arange(episode * n, (episode + 1) * n, dtype=np.uint64)
        self._recorder.plan(episode, active, stream, theta, self._states(active))

    def _fly(self, episode: int, rollouts: RolloutRows) -> None:
        """Fly what is still planned and record each portion as it comes."""
        still = np.flatnonzero(rollouts.status == PLANNED)
        trial = rollouts.trial[still]
        rechoose = partial(_rechosen, self._learners[int(trial[0])]) if len(self._learners) == 1 else None
        plan = Plan(rollouts.theta[still], self._world_seed[trial], rollouts.stream[still], trial, rechoose)
        assert self._source is not None
        for flown in self._source.fly(plan):
            rows = still[flown.index]
            terms = self._first.reward.score(flown.outcomes)
            if flown.theta is not None:
                self._recorder.fly_instead(episode, rollouts.trial[rows], rollouts.idx[rows], flown.theta)
            self._recorder.score(
                episode,
                rollouts.trial[rows],
                rollouts.idx[rows],
                flown.outcomes,
                terms,
                flown.discarded,
                flown.recordings,
            )
            self._n_flown += len(rows)

    def _tell(self, episode: int, active: list[int], rollouts: RolloutRows) -> list[EpisodeRow]:
        rows = self._learn(episode, rollouts, active)
        self._recorder.finish_episode(rows, self._states(active))
        return rows

    def _learn(self, episode: int, rollouts: RolloutRows, trials: list[int]) -> list[EpisodeRow]:
        """Tell the learners of trials what counts of an episode."""
        own = [rollouts.of_rows((rollouts.trial == trial) & (rollouts.status == SCORED)) for trial in trials]
        told = [
            (self._learners[trial], rows.theta, rows.reward, meta_of(rows.outcomes, rows.recordings))
            for trial, rows in zip(trials, own, strict=True)
        ]
        for trial, learner in zip(trials, self._each(_told, told), strict=True):
            self._learners[trial] = learner
        return [
            _episode_row(
                trial, episode, self._learners[trial], rows.reward, four_leg(rows.outcomes), clean(rows.outcomes)
            )
            for trial, rows in zip(trials, own, strict=True)
        ]

    def _each(self, think: Callable[..., Learner], given: Sequence[tuple[Any, ...]]) -> list[Learner]:
        """Let each learner think, in processes if that is worth it: a learner goes there and comes back."""
        if self._threads == 1 or len(given) == 1:
            return [think(*one) for one in given]
        from joblib import Parallel, delayed  # type: ignore[import-untyped]  # takes a while to load

        return list(Parallel(n_jobs=self._threads)(delayed(think)(*one) for one in given))

    def _states(self, trials: Iterable[int]) -> Iterator[dict[str, Any]]:
        return (self._learners[trial].state_dict() for trial in trials)


def _rechosen(learner: Learner, theta: FloatArray, battery_V: float) -> FloatArray:
    """What a learner flies in place of a policy that it chose for another battery."""
    return learner.rechosen(theta, battery_V) if isinstance(learner, EpheBelief) else theta


def _begun(learner: Learner, simulator: Simulator) -> Learner:
    """A learner that has begun with simulated vehicles, if it can."""
    with threadpool_limits(1):
        if isinstance(learner, EpheBelief):
            learner.begin(simulator)
    return learner


def _told(learner: Learner, theta: FloatArray, rewards: FloatArray, meta: Mapping[str, Any]) -> Learner:
    """A learner that was told rollouts; by one thread, so that it thinks the same bits alone and beside others."""
    with threadpool_limits(1):
        learner.tell(theta, rewards, meta)
    return learner


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
    trial: int, episode: int, learner: Learner, reward: FloatArray, four: BoolArray, spotless: BoolArray
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
        rate_four_leg=_mean(four),
        rate_clean=_mean(spotless),
        stopped=learner.stop(),
        insight=learner.insight,
    )


def _mean(values: FloatArray | BoolArray) -> float:
    """As `numpy.mean`, which is slow for a handful of numbers; NaN of none."""
    return float(np.add.reduce(values, dtype=np.float64) / values.size) if values.size else float("nan")
