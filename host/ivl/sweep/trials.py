"""Trials of one landing gear, flown in lock-step: each episode of all of them is one native batch on one thread.

A trial depends on its own name alone. It comes out bit for bit the same beside other trials or alone, and the same as
`ivl learn` with its seed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.experiment import Experiment
from ivl.learn import RECENT_EPISODES
from ivl.learners import Learner
from ivl.learners.base import LANDED
from ivl.outcome import Outcomes, clean, four_leg, valid
from ivl.rewards import TOTAL
from ivl.seeds import Purpose, derive
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
        mu0: Start of each search, shape (t, 2).
        n_episodes: Episodes flown, shape (t,).
        stopped: Whether the learner ended the trial, shape (t,).
        theta: Policies, shape (t, e, n, 2).
        reward: Returns, shape (t, e, n), NaN where not scored.
        terms: Terms of the returns by name, shape (t, e, n) each, NaN where not scored.
        scored: Whether a rollout was learned from, shape (t, e, n).
        outcomes: Outcome records, shape (t, e, n).
        mu: Centre of the search after each episode, shape (t, e, 2).
        sigma: Spread of the search after each episode, shape (t, e, 2).
        recommended: Recommended policy after each episode, shape (t, e, 2).
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
    log = _empty_log(sweep, trials, experiments)
    learners = [e.make_learner(int(s)) for e, s in zip(experiments, log.learner_seed, strict=True)]
    active = np.arange(len(trials))
    for episode in range(sweep.n_episodes):
        if not active.size:
            break
        _fly(sweep, world, log, learners, active, episode)
        _tell(log, learners, active, episode)
        active = active[~log.stopped[active]]
    log.check = _check(sweep, world, log)
    return log


def _empty_log(sweep: Sweep, trials: Sequence[Trial], experiments: Sequence[Experiment]) -> Log:
    t, e, n = len(trials), sweep.n_episodes, sweep.n_rollouts
    run_seed = [x.seed for x in experiments]
    start = [[x.policy.rrev_c_per_s.mu0, x.policy.moment_y_Nmm.mu0] for x in experiments]
    outcomes = np.zeros((t, e, n), dtype=native.library().outcome_dtype)
    return Log(
        trials=trials,
        run_seed=np.array(run_seed, dtype=np.uint64),
        world_seed=np.array([derive(seed, Purpose.WORLD) for seed in run_seed], dtype=np.uint64),
        learner_seed=np.array([derive(seed, Purpose.LEARNER) for seed in run_seed], dtype=np.uint64),
        mu0=np.array(start),
        n_episodes=np.zeros(t, dtype=np.int64),
        stopped=np.zeros(t, dtype=np.bool_),
        theta=np.full((t, e, n, 2), np.nan),
        reward=np.full((t, e, n), np.nan),
        terms={term.name: np.full((t, e, n), np.nan) for term in sweep.reward.reward.terms},
        scored=np.zeros((t, e, n), dtype=np.bool_),
        outcomes=outcomes,
        mu=np.full((t, e, 2), np.nan),
        sigma=np.full((t, e, 2), np.nan),
        recommended=np.full((t, e, 2), np.nan),
        check=outcomes[:, 0, :0],
    )


def _fly(
    sweep: Sweep, world: World, log: Log, learners: Sequence[Learner], active: npt.NDArray[np.intp], episode: int
) -> None:
    """One episode of the active trials, as one batch."""
    theta = np.stack([learners[i].ask() for i in active])
    first = episode * sweep.n_rollouts
    outcomes = _batch(sweep, world, log, active, theta, log.world_seed, first + np.arange(sweep.n_rollouts))
    terms = sweep.reward.score(outcomes)
    scored = valid(outcomes)
    log.theta[active, episode], log.outcomes[active, episode], log.scored[active, episode] = theta, outcomes, scored
    log.reward[active, episode] = np.where(scored, terms[TOTAL], np.nan)
    for name, own in log.terms.items():
        own[active, episode] = np.where(scored, terms[name], np.nan)


def _tell(log: Log, learners: Sequence[Learner], active: npt.NDArray[np.intp], episode: int) -> None:
    for i in active:
        scored, outcomes = log.scored[i, episode], log.outcomes[i, episode]
        meta = {name: outcomes[name][scored] for name in outcomes.dtype.names or ()}
        meta[LANDED] = four_leg(outcomes)[scored]
        learners[i].tell(log.theta[i, episode][scored], log.reward[i, episode][scored], meta)
        result = learners[i].result
        log.mu[i, episode], log.sigma[i, episode] = result.mu, result.sigma
        log.recommended[i, episode] = result.recommended
        log.stopped[i] = learners[i].stop()
    log.n_episodes[active] = episode + 1


def _check(sweep: Sweep, world: World, log: Log) -> Outcomes:
    """Fresh rollouts of the policies recommended at the end, with random numbers of their own."""
    every = np.arange(len(log.trials))
    theta = log.recommended[every, log.n_episodes - 1]
    seed = np.array([derive(int(s), Purpose.CHECK) for s in log.run_seed], dtype=np.uint64)
    policies = np.repeat(theta[:, None, :], sweep.check_rollouts, axis=1)
    return _batch(sweep, world, log, every, policies, seed, np.arange(sweep.check_rollouts))


def _batch(
    sweep: Sweep, world: World, log: Log, active: npt.NDArray[np.intp], theta: FloatArray,
    seed: npt.NDArray[np.uint64], stream: npt.NDArray[np.int64],
) -> Outcomes:  # fmt: skip
    """Fly `theta`, shape (len(active), n, 2), each trial at its own approach."""
    if not theta.size:
        return np.zeros(theta.shape[:2], dtype=native.library().outcome_dtype)
    approach = np.array([[log.trials[i].speed_mps, log.trials[i].angle_deg] for i in active])
    return world.rollouts(
        approach[:, :1],
        approach[:, 1:],
        theta[..., 0],
        theta[..., 1],
        seed=seed[active, None],
        stream=stream,
        start=sweep.start,
        threads=1,
    )


def landed(log: Log) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Four-leg and clean landings among the scored rollouts, shape (t, e, n) each."""
    return np.asarray(four_leg(log.outcomes) & log.scored), np.asarray(clean(log.outcomes) & log.scored)
