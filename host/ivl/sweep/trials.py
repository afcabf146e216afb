"""Trials of one landing gear, flown together: an episode of all of them is one native batch on one thread.

A trial depends on its own name alone. It comes out bit for bit the same beside other trials or alone, and the same as
`ivl learn` with its seed: both are the loop of `ivl.learning`, here recorded in arrays.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.experiment import Experiment
from ivl.learning.loop import LearningRun
from ivl.learning.recorder import DISCARDED, PLANNED, SCORED, EpisodeRow, RolloutRows
from ivl.outcome import RECENT_EPISODES, Outcomes, clean, four_leg
from ivl.rewards import TOTAL
from ivl.rewards.base import Terms
from ivl.seeds import Purpose, derive
from ivl.source import Flown, Plan, by_parameter, portions
from ivl.sweep.config import Sweep
from ivl.world import World

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """Name of a trial within a sweep and a landing gear."""

    speed_mps: float
    angle_deg: float
    number: int


@dataclass
class Log:
    """All that some trials did; axes are (trial, episode, rollout), beyond `n_episodes` of a trial nothing is valid.

    Attributes:
        trials: Their names, length t.
        run_seed: Seed of each trial, shape (t,).
        world_seed: Seed of each trial's rollouts, shape (t,).
        learner_seed: Seed of each trial's learner, shape (t,).
        mu0: Start of each search, shape (t, dim).
        n_episodes: Episodes flown, shape (t,).
        stopped: Whether the learner ended the trial, shape (t,).
        theta: Policies, shape (t, e, n, dim).
        reward: Returns, shape (t, e, n), NaN where not scored.
        terms: Terms of the returns by name, shape (t, e, n) each, NaN where not scored.
        scored: Whether a rollout was learned from, shape (t, e, n).
        outcomes: Outcome records, shape (t, e, n).
        mu: Centre of the search after each episode, shape (t, e, dim).
        sigma: Spread of the search after each episode, shape (t, e, dim).
        recommended: Recommended policy after each episode, shape (t, e, dim).
        check: Outcomes of the final recommendations, shape (t, n_check).
    """

    trials: Sequence[Trial]
    run_seed: npt.NDArray[np.uint64]
    world_seed: npt.NDArray[np.uint64]
    learner_seed: npt.NDArray[np.uint64]
    mu0: FloatArray
    n_episodes: npt.NDArray[np.int64]
    stopped: npt.NDArray[np.bool_]
    theta: FloatArray
    reward: FloatArray
    terms: dict[str, FloatArray]
    scored: npt.NDArray[np.bool_]
    outcomes: Outcomes
    mu: FloatArray
    sigma: FloatArray
    recommended: FloatArray
    check: Outcomes

    @property
    def flown(self) -> npt.NDArray[np.bool_]:
        """Episodes that were flown, shape (t, e)."""
        return np.asarray(np.arange(self.theta.shape[1]) < self.n_episodes[:, None])

    @property
    def recent(self) -> npt.NDArray[np.bool_]:
        """The last three episodes of each trial, shape (t, e)."""
        late = np.arange(self.theta.shape[1]) >= self.n_episodes[:, None] - RECENT_EPISODES
        return np.asarray(late & self.flown)

    @property
    def n_rollouts(self) -> int:
        """Rollouts flown in all, checks included."""
        return int(self.n_episodes.sum()) * int(self.theta.shape[2]) + int(self.check.size)


def run(sweep: Sweep, world: World, trials: Sequence[Trial]) -> Log:
    """Fly `trials` in `world` from their first episode to their last."""
    experiments = [sweep.experiment(world.gear, t.speed_mps, t.angle_deg, t.number) for t in trials]
    log, source = _empty_log(sweep, trials, experiments), Approaches(sweep, world, trials)
    LearningRun(experiments, source, Columns(log)).run()
    log.check = _check(sweep, log, source)
    return log


class Approaches:
    """Source of rollouts in which every trial has its own approach: a whole plan as one native batch on one thread."""

    is_flown, vehicle = False, ""

    def __init__(self, sweep: Sweep, world: World, trials: Sequence[Trial]) -> None:
        """Fly the approaches of `trials` in `world`."""
        self.warnings: list[str] = []
        self._world, self._start, self._form = world, sweep.start, sweep.policy.form
        self._speed_mps = np.array([trial.speed_mps for trial in trials])
        self._angle_deg = np.array([trial.angle_deg for trial in trials])

    def fly(self, plan: Plan) -> Iterator[Flown]:
        """Fly the plan, which names the trial of each rollout."""
        assert plan.trial is not None
        yield from portions(self._world, self.batch(plan.trial, plan.theta, plan.seed, plan.stream))

    def batch(
        self, trial: npt.NDArray[Any], theta: FloatArray, seed: npt.NDArray[Any], stream: npt.NDArray[Any]
    ) -> Outcomes:
        """Outcomes of rollouts, shape (n,) like the arguments; `theta` has shape (n, dim)."""
        return self._world.rollouts(
            self._speed_mps[trial],
            self._angle_deg[trial],
            *by_parameter(theta),
            form=self._form,
            seed=seed,
            stream=stream,
            start=self._start,
            threads=1,
        )

    def battery_V(self) -> float:
        """Nothing that lasts: each rollout has a battery of its own."""
        return math.nan

    def close(self) -> None:
        """Nothing to give back."""


class Columns:
    """Recorder of a sweep's trials: fills a `Log`. What was cut off is flown again, so that no state is kept."""

    def __init__(self, log: Log) -> None:
        """Record into `log`."""
        self._log = log
        self._n = log.theta.shape[2]
        self._episode, self._trials = -1, np.zeros(0, dtype=np.int64)  # the planned episode, and who takes part
        self._stream = np.zeros(0, dtype=np.uint64)
        self._status = np.zeros((0, self._n), dtype=np.str_)

    def episodes(self) -> list[EpisodeRow]:
        """None: a trial begins at its beginning."""
        return []

    def learner_states(self) -> dict[int, dict[str, Any]]:
        """None, likewise."""
        return {}

    def rollouts(self, *, episode: int) -> RolloutRows:
        """Rollouts of the planned episode; no rows of any other one. Terms of the returns stay in the log."""
        log, own = self._log, self._trials if episode == self._episode else self._trials[:0]
        return RolloutRows(
            trial=np.repeat(own, self._n),
            episode=np.full(own.size * self._n, episode),
            idx=np.tile(np.arange(self._n), own.size),
            stream=np.tile(self._stream, own.size),
            status=self._status[own].ravel(),
            theta=log.theta[own, episode].reshape(-1, log.theta.shape[-1]),
            reward=log.reward[own, episode].ravel(),
            outcomes=log.outcomes[own, episode].ravel(),
        )

    def plan(
        self,
        episode: int,
        trials: Sequence[int],
        stream: npt.NDArray[np.uint64],
        theta: Sequence[FloatArray],
        states: Iterable[Mapping[str, Any]],  # noqa: ARG002 - of a recorder; made only if read
    ) -> None:
        """Keep the policies of an episode."""
        self._episode, self._trials, self._stream = episode, np.array(trials, dtype=np.int64), stream
        self._status = np.full((len(self._log.trials), self._n), PLANNED, dtype=f"U{len(DISCARDED)}")
        self._log.theta[self._trials, episode] = theta

    def fly_instead(
        self,
        episode: int,
        trial: npt.NDArray[np.int64],
        idx: npt.NDArray[np.int64],
        theta: FloatArray,
    ) -> None:
        """Keep policies as flown; a sweep has no operator, but records what it is told."""
        self._log.theta[trial, episode, idx] = theta

    def score(
        self,
        episode: int,
        trial: npt.NDArray[np.int64],
        idx: npt.NDArray[np.int64],
        outcomes: Outcomes,
        terms: Terms,
        discarded: str = "",
        recordings: FloatArray | None = None,  # noqa: ARG002 - a sweep's learners learn from flights alone
    ) -> None:
        """Keep outcomes; returns only of those that count."""
        log = self._log
        log.outcomes[trial, episode, idx] = outcomes
        self._status[trial, idx] = DISCARDED if discarded else SCORED
        if discarded:
            return
        log.scored[trial, episode, idx] = True
        log.reward[trial, episode, idx] = terms[TOTAL]
        for name, values in log.terms.items():
            values[trial, episode, idx] = terms[name]

    def finish_episode(
        self,
        rows: Sequence[EpisodeRow],
        states: Iterable[Mapping[str, Any]],  # noqa: ARG002 - likewise
    ) -> None:
        """Keep where each search stands."""
        log = self._log
        for row in rows:
            log.mu[row.trial, row.episode], log.sigma[row.trial, row.episode] = row.mu, row.sigma
            log.recommended[row.trial, row.episode] = row.recommended
            log.stopped[row.trial], log.n_episodes[row.trial] = row.stopped, row.episode + 1


def _empty_log(sweep: Sweep, trials: Sequence[Trial], experiments: Sequence[Experiment]) -> Log:
    t, e, n = len(trials), sweep.n_episodes, sweep.n_rollouts
    run_seed = [x.seed for x in experiments]
    mu0 = np.array([x.policy.mu0 for x in experiments])
    dim = mu0.shape[1]
    outcomes = np.zeros((t, e, n), dtype=native.library().outcome_dtype)
    return Log(
        trials=trials,
        run_seed=np.array(run_seed, dtype=np.uint64),
        world_seed=np.array([derive(seed, Purpose.WORLD) for seed in run_seed], dtype=np.uint64),
        learner_seed=np.array([derive(seed, Purpose.LEARNER) for seed in run_seed], dtype=np.uint64),
        mu0=mu0,
        n_episodes=np.zeros(t, dtype=np.int64),
        stopped=np.zeros(t, dtype=np.bool_),
        theta=np.full((t, e, n, dim), np.nan),
        reward=np.full((t, e, n), np.nan),
        terms={term.name: np.full((t, e, n), np.nan) for term in sweep.reward.reward.terms},
        scored=np.zeros((t, e, n), dtype=np.bool_),
        outcomes=outcomes,
        mu=np.full((t, e, dim), np.nan),
        sigma=np.full((t, e, dim), np.nan),
        recommended=np.full((t, e, dim), np.nan),
        check=outcomes[:, 0, :0],
    )


def _check(sweep: Sweep, log: Log, source: Approaches) -> Outcomes:
    """Fresh rollouts of the policies recommended at the end, with random numbers of their own, shape (t, n_check)."""
    every, n = np.arange(len(log.trials)), sweep.check_rollouts
    if not n:
        return log.check
    seed = np.array([derive(int(s), Purpose.CHECK) for s in log.run_seed], dtype=np.uint64)
    theta = log.recommended[every, log.n_episodes - 1]
    outcomes = source.batch(
        np.repeat(every, n), np.repeat(theta, n, axis=0), np.repeat(seed, n), np.tile(np.arange(n), every.size)
    )
    return outcomes.reshape(every.size, n)


def landed(log: Log) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Four-leg and clean landings among the scored rollouts, shape (t, e, n) each."""
    return np.asarray(four_leg(log.outcomes) & log.scored), np.asarray(clean(log.outcomes) & log.scored)
