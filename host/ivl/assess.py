"""Judging a run: what the best policy could reach, and when, if ever, each trial's recommendation came close to it.

Definitions, the same for every learner:

best rate: The largest four-leg rate that any policy reaches in this world. One or two parameters are searched by a
    dense grid, which is sifted in stages (more rollouts for the better points). More of them are searched by CMA-ES,
    first from where the experiment begins, then from random places, which ends where landings are; and then by clouds
    of policies around these ends, sifted like the grid, since in noise a search alone ends beside the best rate.
    Either way the last stage flies fresh rollouts, so that the figure is not inflated by having been selected.
    `Best.search` says which it was.
check: After each episode the recommended policy flies `n_fresh` fresh rollouts (random numbers of the check alone).
solved: The check after the last episode reaches `share_of_best` of the best rate (`ivl.outcome.solved`).
converged at: The first multiple of N rollouts from which on every check reaches it.
failed: Rollouts up to convergence (all of them if never) that were not four-leg landings: what a drone would suffer.
stuck: Trials whose recommended policy at the end is stuck by the best rate (`ivl.outcome.stuck`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl.experiment import GRID_DIMENSIONS_MAX, Experiment, GridAxis
from ivl.learners import make_learner
from ivl.learning.recorder import SCORED, EpisodeRow, RolloutRows
from ivl.outcome import Outcomes, clean, four_leg, solved, stuck, valid
from ivl.rewards import TOTAL
from ivl.seeds import Purpose, derive
from ivl.source import by_parameter
from ivl.world import World

_STAGES = ((1.0, 8), (0.1, 64), (0.01, 400))
"""(share of the grid points that fly on, rollouts of each), added to what they flew before."""
_FINALISTS, _FINAL_ROLLOUTS = 10, 1000
_GRID_STEPS = (140, 20)
"""Steps of each axis of the grid between the bounds of the policy, where an experiment gives no grid."""
_SEARCHES, _GENERATIONS, _POPULATION = 8, 40, 64
"""Long searches where no grid can be flown: each begins elsewhere, and flies this many generations of rollouts."""
_CLOUDS, _CLOUD, _CLOUD_SPREAD = 3, 320, 0.1
"""Clouds around their results, policies of each, and standard deviation of the first as a share of the bounds."""
_LEAD = 0.25
"""What the largest return without a landing counts in a long search; a landing counts 1."""

FloatArray = npt.NDArray[np.float64]
OnStage = Callable[[int, int], None]


@dataclass(frozen=True)
class Best:
    """The best policy of a world and approach.

    Attributes:
        theta: The policy, in the order and units of the experiment's policy.
        rate_four_leg: Its four-leg rate.
        rate_clean: Its clean rate.
        n_rollouts: Rollouts spent on the search.
        search: How it was looked for, in words.
    """

    theta: tuple[float, ...]
    rate_four_leg: float
    rate_clean: float
    n_rollouts: int
    search: str = "grid"


@dataclass(frozen=True)
class Verdict:
    """How one trial went; see the module's definitions.

    Attributes:
        trial: Number of the trial.
        solved: Whether the final recommendation is good.
        rollouts_to_convergence: Rollouts until convergence, None if not solved.
        rate_four_leg: Four-leg rate of the final recommendation over the fresh rollouts.
        rate_clean: Its clean rate.
        failed_landings: Rollouts up to convergence that were not four-leg landings.
        failed_landings_total: The same over the whole budget.
        body_contacts: Rollouts up to convergence in which body or rotors touched the ceiling.
        stuck: Whether the final recommendation lands at less than half of the best rate.
    """

    trial: int
    solved: bool
    rollouts_to_convergence: int | None
    rate_four_leg: float
    rate_clean: float
    failed_landings: int
    failed_landings_total: int
    body_contacts: int
    stuck: bool


def find_best(
    world: World, experiment: Experiment, threads: int | None = None, on_stage: OnStage | None = None
) -> Best:
    """Search for the policy of the largest four-leg rate, on a grid or by long searches (see above).

    Args:
        world: Where to fly.
        experiment: Approach, policy, grid and effort.
        threads: Worker threads; omitted: all processors.
        on_stage: Called with (stage, number of stages) before each.
    """
    flights = _Flights(world, experiment, threads)
    if experiment.policy.shape.n > GRID_DIMENSIONS_MAX:
        return _search_long(flights, on_stage)
    theta = _grid(_axes(experiment))
    chosen, four, spotless = _sift(flights, theta, (*_STAGES, (0.0, _FINAL_ROLLOUTS)), on_stage)
    top = int(np.argmax(four))  # of the fresh rollouts of the last stage alone
    words = f"grid of {len(theta)} policies"
    return Best(tuple(chosen[top].tolist()), float(four[top]), float(spotless[top]), flights.n_flown, words)


class _Flights:
    """Rollouts of the search, none with the random numbers of another."""

    def __init__(self, world: World, experiment: Experiment, threads: int | None) -> None:
        self.world, self.experiment, self._threads = world, experiment, threads
        self.n_flown = 0

    def scaled(self, n: int) -> int:
        """A number of rollouts, or of generations of them, by the effort of the experiment."""
        return max(1, round(self.experiment.check.effort * n))

    def outcomes(self, theta: FloatArray, n_each: int) -> Outcomes:
        """Fly each policy with `n_each` fresh random numbers, shape (m, n_each)."""
        stream = self.n_flown + np.arange(len(theta) * n_each).reshape(len(theta), n_each)
        self.n_flown += stream.size
        experiment = self.experiment
        return self.world.rollouts(
            experiment.speed_mps,
            experiment.angle_deg,
            *by_parameter(theta[:, None]),
            form=experiment.policy.form,
            seed=derive(experiment.seed, Purpose.GRID),
            stream=stream,
            start=experiment.start,
            threads=self._threads,
        )

    def rates(self, theta: FloatArray, n_each: int) -> tuple[FloatArray, FloatArray]:
        """Four-leg and clean rate of each policy over `n_each` rollouts, shape (m,) each."""
        outcomes = self.outcomes(theta, n_each)
        return four_leg(outcomes).mean(axis=1), clean(outcomes).mean(axis=1)


def _sift(
    flights: _Flights, theta: FloatArray, stages: Sequence[tuple[float, int]], on_stage: OnStage | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fly all policies a few times, the better ones more often, and so on.

    Returns:
        The policies of the last stage, and their four-leg and clean rate in it alone.
    """
    landed, flown, chosen = np.zeros(len(theta)), np.zeros(len(theta)), np.arange(len(theta))
    four = spotless = landed
    for stage, (share, n_full) in enumerate(stages):
        if on_stage:
            on_stage(stage, len(stages))
        n_each = flights.scaled(n_full)
        rate = landed[chosen] / np.maximum(flown[chosen], 1)
        chosen = chosen[np.argsort(-rate, kind="stable")[: max(_FINALISTS, int(share * len(theta)))]]
        four, spotless = flights.rates(theta[chosen], n_each)
        landed[chosen] += four * n_each
        flown[chosen] += n_each
    return theta[chosen], four, spotless


def _search_long(flights: _Flights, on_stage: OnStage | None) -> Best:
    """Searches of CMA-ES that find where landings are; then clouds of policies around the best, each a smaller one."""
    bounds = np.array(flights.experiment.policy.bounds)
    seed = derive(flights.experiment.seed, Purpose.GRID)
    rng = np.random.Generator(np.random.PCG64(seed))
    n_stages = _SEARCHES + _CLOUDS + 1

    def tell(stage: int) -> None:
        if on_stage:
            on_stage(stage, n_stages)

    # what the experiment begins with may be good already, and of many parameters no search finds much in no time
    begin = np.array(flights.experiment.policy.mu0)
    found = [begin]
    for search in range(_SEARCHES):
        tell(search)
        start = begin if search == 0 else rng.uniform(bounds[:, 0], bounds[:, 1])
        found.append(_climb(flights, bounds, start, search))
    elite = np.array(found)
    for cloud in range(_CLOUDS):
        tell(_SEARCHES + cloud)
        spread = np.ptp(bounds, axis=1) * _CLOUD_SPREAD / 2**cloud
        centre = np.resize(elite, (_CLOUD - len(elite), len(bounds)))
        around = np.clip(centre + spread * rng.standard_normal(centre.shape), bounds[:, 0], bounds[:, 1])
        elite, _, _ = _sift(flights, np.concatenate([elite, around]), _STAGES)
    tell(n_stages - 1)
    # the best of a first look, judged by a second one
    finalists, four, _ = _sift(flights, elite, ((1.0, _FINAL_ROLLOUTS),))
    theta = finalists[int(np.argmax(four))]
    four, spotless = flights.rates(theta[None], flights.scaled(_FINAL_ROLLOUTS))
    each = flights.scaled(_GENERATIONS) * _POPULATION
    words = (
        f"{_SEARCHES} searches of {each} rollouts at most, the best refined in {_CLOUDS} clouds of {_CLOUD} policies"
    )
    return Best(tuple(theta.tolist()), float(four[0]), float(spotless[0]), flights.n_flown, words)


def _climb(flights: _Flights, bounds: FloatArray, start: FloatArray, seed: int) -> FloatArray:
    """Where one search ends, shape (dim,).

    A landing counts 1, whatever its return: the rate is what is judged. The return leads to the first landings.
    """
    reward = flights.experiment.reward
    learner = make_learner(
        "cmaes", start, np.ptp(bounds, axis=1) / 5.0, bounds=bounds, n_rollouts=_POPULATION, seed=seed
    )
    for _ in range(flights.scaled(_GENERATIONS)):
        if learner.stop():
            break
        theta = learner.ask()
        outcomes = flights.outcomes(theta, 1)[:, 0]
        # what the vehicle refuses has no return, and is as bad as any failure
        ok = valid(outcomes)
        total = np.where(ok, reward.score(outcomes)[TOTAL], 0.0)
        lead = _LEAD * total / max(float(total.max()), np.finfo(np.float64).tiny)
        learner.tell(theta, np.where(ok & four_leg(outcomes), 1.0, lead))
    return np.clip(learner.result.recommended, bounds[:, 0], bounds[:, 1])


def judge(
    world: World,
    experiment: Experiment,
    best: Best,
    history: Sequence[EpisodeRow],
    rollouts: RolloutRows,
    threads: int | None = None,
) -> list[Verdict]:
    """Judge every trial of a finished run.

    The checks are flown from the last one backwards, each trial until its first failure: earlier ones cannot change
    its verdict.
    """
    recommended = _recommendations(history, experiment.n_episodes)
    n_trials, last = len(recommended), experiment.n_episodes - 1
    converged = np.full(n_trials, -1)
    final_four, final_clean = np.zeros(n_trials), np.zeros(n_trials)
    alive = np.arange(n_trials)
    for episode in range(last, -1, -1):
        if not alive.size:
            break
        four, spotless = _check(world, experiment, recommended[alive, episode], alive, episode, threads)
        if episode == last:
            final_four, final_clean = four, spotless
        alive = alive[solved(four, best.rate_four_leg, experiment.check.share_of_best)]
        converged[alive] = episode
    return [
        _verdict(trial, experiment, int(converged[trial]), final_four[trial], final_clean[trial], best, rollouts)
        for trial in range(n_trials)
    ]


def summarise(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Figures over all trials; never converged counts as infinitely late (printed as None)."""
    rollouts = [v.rollouts_to_convergence if v.rollouts_to_convergence is not None else np.inf for v in verdicts]
    failed = [v.failed_landings for v in verdicts]
    n_stuck = sum(v.stuck for v in verdicts)
    return {
        "trials": len(verdicts),
        "solved": sum(v.solved for v in verdicts),
        "rollouts_to_convergence": {"median": _quantile(rollouts, 0.5), "p90": _quantile(rollouts, 0.9)},
        "failed_landings": {"median": _quantile(failed, 0.5), "p90": _quantile(failed, 0.9)},
        "stuck": n_stuck / len(verdicts),
        "stuck_trials": n_stuck,
        "body_contacts": {"median": _quantile([v.body_contacts for v in verdicts], 0.5)},
        "failed_landings_total": {"median": _quantile([v.failed_landings_total for v in verdicts], 0.5)},
        "landing_rate_four_leg": float(np.mean([v.rate_four_leg for v in verdicts])),
        "landing_rate_clean": float(np.mean([v.rate_clean for v in verdicts])),
    }


def _axes(experiment: Experiment) -> list[GridAxis]:
    """Axes of the grid, as the experiment says them or between the bounds of its policy."""
    policy, found = experiment.policy, []
    for name, (lo, hi), steps in zip(policy.shape.names, policy.bounds, _GRID_STEPS, strict=False):
        found.append(experiment.check.grid.get(name) or GridAxis(lo=lo, hi=hi, step=(hi - lo) / steps))
    return found


def _grid(axes: Sequence[GridAxis]) -> FloatArray:
    """Every combination of the axes' values, shape (m, dim)."""
    values = [axis.lo + axis.step * np.arange(int((axis.hi - axis.lo) / axis.step + 1e-9) + 1) for axis in axes]
    return np.stack(np.meshgrid(*values, indexing="ij"), axis=-1).reshape(-1, len(values))


def _check(
    world: World,
    experiment: Experiment,
    theta: FloatArray,
    trials: npt.NDArray[np.intp],
    episode: int,
    threads: int | None,
) -> tuple[FloatArray, FloatArray]:
    """Four-leg and clean rate of each trial's recommendation after one episode, over its fresh rollouts."""
    n_fresh = experiment.check.n_fresh
    seed = np.array([derive(experiment.seed + int(trial), Purpose.CHECK) for trial in trials], dtype=np.uint64)
    outcomes = world.rollouts(
        experiment.speed_mps,
        experiment.angle_deg,
        *by_parameter(theta[:, None]),
        form=experiment.policy.form,
        seed=seed[:, None],
        stream=episode * n_fresh + np.arange(n_fresh),
        start=experiment.start,
        threads=threads,
    )
    return four_leg(outcomes).mean(axis=1), clean(outcomes).mean(axis=1)


def _recommendations(history: Sequence[EpisodeRow], n_episodes: int) -> FloatArray:
    """Recommended policy after each episode, shape (n_trials, n_episodes, dim); one that stopped keeps its last."""
    n_trials = 1 + max(row.trial for row in history)
    theta = np.full((n_trials, n_episodes, len(history[0].recommended)), np.nan)
    for row in history:
        theta[row.trial, row.episode :] = row.recommended
    return theta


def _verdict(
    trial: int, experiment: Experiment, episode: int, four: float, spotless: float, best: Best, rollouts: RolloutRows
) -> Verdict:
    converged = episode >= 0
    n_until = (episode + 1) * experiment.n_rollouts if converged else experiment.budget
    own = (rollouts.trial == trial) & (rollouts.status == SCORED)
    until = own & (rollouts.episode * experiment.n_rollouts + rollouts.idx < n_until)
    failed = ~four_leg(rollouts.outcomes)
    return Verdict(
        trial=trial,
        solved=converged,
        rollouts_to_convergence=n_until if converged else None,
        rate_four_leg=float(four),
        rate_clean=float(spotless),
        failed_landings=int((failed & until).sum()),
        failed_landings_total=int((failed & own).sum()),
        body_contacts=int(((rollouts.outcomes["body_contact"] != 0) & until).sum()),
        stuck=bool(stuck(four, best.rate_four_leg)),
    )


def _quantile(values: Sequence[float], q: float) -> float | None:
    value = float(np.quantile(np.asarray(values, dtype=np.float64), q, method="inverted_cdf"))
    return value if np.isfinite(value) else None
