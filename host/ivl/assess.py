"""Judging a run: what the best policy could reach, and when, if ever, each trial's recommendation came close to it.

Definitions, the same for every learner:

best rate: The largest four-leg rate that any policy reaches in this world. One or two parameters are searched by a
    dense grid, which is refined in stages (more rollouts for the better points); more of them by long searches of
    CMA-ES from places of their own, of which the best is taken. Either way the last stage flies fresh rollouts, so
    that the figure is not inflated by having been selected. `Best.search` says which it was.
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
from ivl.outcome import Outcomes, clean, four_leg, solved, stuck
from ivl.rewards import TOTAL
from ivl.seeds import Purpose, derive
from ivl.source import by_parameter
from ivl.world import World

_STAGES = ((1.0, 8), (0.1, 64), (0.01, 400))
"""(share of the grid points that fly on, rollouts of each), added to what they flew before."""
_FINALISTS, _FINAL_ROLLOUTS = 10, 1000
_GRID_STEPS = (140, 20)
"""Steps of each axis of the grid between the bounds of the policy, where an experiment gives no grid."""
_SEARCHES, _GENERATIONS, _POPULATION = 8, 100, 64
"""Long searches where no grid can be flown: each begins elsewhere, and flies this many generations of rollouts."""

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
    if experiment.policy.shape.n > GRID_DIMENSIONS_MAX:
        return _search_long(world, experiment, threads, on_stage)
    check = experiment.check
    theta = _grid(_axes(experiment))
    landed, flown = np.zeros(len(theta)), np.zeros(len(theta))
    chosen, stream = np.arange(len(theta)), 0
    for stage, (share, n_full) in enumerate((*_STAGES, (0.0, _FINAL_ROLLOUTS))):
        if on_stage:
            on_stage(stage, len(_STAGES) + 1)
        n_each = max(1, round(check.effort * n_full))
        rate = landed[chosen] / np.maximum(flown[chosen], 1)
        chosen = chosen[np.argsort(-rate, kind="stable")[: max(_FINALISTS, int(share * len(theta)))]]
        four, spotless = _rates(world, experiment, theta[chosen], n_each, stream, threads)
        landed[chosen] += four * n_each
        flown[chosen] += n_each
        stream += len(chosen) * n_each
    top = int(np.argmax(four))  # of the fresh rollouts of the last stage alone
    words = f"grid of {len(theta)} policies"
    return Best(tuple(theta[chosen[top]].tolist()), float(four[top]), float(spotless[top]), stream, words)


def _search_long(world: World, experiment: Experiment, threads: int | None, on_stage: OnStage | None) -> Best:
    """Searches of CMA-ES, the first from the middle of the bounds, the others from random places within them."""
    bounds = np.array(experiment.policy.bounds)
    rng = np.random.Generator(np.random.PCG64(derive(experiment.seed, Purpose.GRID)))
    n_generations, stream, found = max(1, round(experiment.check.effort * _GENERATIONS)), 0, []
    for search in range(_SEARCHES):
        if on_stage:
            on_stage(search, _SEARCHES + 1)
        start = bounds.mean(axis=1) if search == 0 else rng.uniform(bounds[:, 0], bounds[:, 1])
        learner = make_learner(
            "cmaes", start, np.ptp(bounds, axis=1) / 5.0, bounds=bounds, n_rollouts=_POPULATION, seed=search
        )
        for _ in range(n_generations):
            if learner.stop():
                break
            theta = learner.ask()
            outcomes = _fly(world, experiment, theta, stream + np.arange(len(theta))[:, None], threads)[:, 0]
            meta = {name: outcomes[name] for name in outcomes.dtype.names or ()}
            learner.tell(theta, experiment.reward.score(outcomes)[TOTAL], meta)
            stream += len(theta)
        found.append(np.clip(learner.result.recommended, bounds[:, 0], bounds[:, 1]))
    if on_stage:
        on_stage(_SEARCHES, _SEARCHES + 1)
    n_final = max(1, round(experiment.check.effort * _FINAL_ROLLOUTS))
    # the best of a first look, judged by a second one
    four, _ = _rates(world, experiment, np.array(found), n_final, stream, threads)
    theta = found[int(np.argmax(four))][None]
    stream += len(found) * n_final
    four, spotless = _rates(world, experiment, theta, n_final, stream, threads)
    words = f"best of {_SEARCHES} searches of {n_generations * _POPULATION} rollouts"
    return Best(tuple(theta[0].tolist()), float(four[0]), float(spotless[0]), stream + n_final, words)


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


def _fly(
    world: World, experiment: Experiment, theta: FloatArray, stream: npt.NDArray[np.integer[Any]], threads: int | None
) -> Outcomes:
    """Fly each policy with its streams of the search's random numbers, shape (m, n)."""
    return world.rollouts(
        experiment.speed_mps,
        experiment.angle_deg,
        *by_parameter(theta[:, None]),
        form=experiment.policy.form,
        seed=derive(experiment.seed, Purpose.GRID),
        stream=stream,
        start=experiment.start,
        threads=threads,
    )


def _grid(axes: Sequence[GridAxis]) -> FloatArray:
    """Every combination of the axes' values, shape (m, dim)."""
    values = [axis.lo + axis.step * np.arange(int((axis.hi - axis.lo) / axis.step + 1e-9) + 1) for axis in axes]
    return np.stack(np.meshgrid(*values, indexing="ij"), axis=-1).reshape(-1, len(values))


def _rates(
    world: World, experiment: Experiment, theta: FloatArray, n_each: int, first_stream: int, threads: int | None
) -> tuple[FloatArray, FloatArray]:
    """Four-leg and clean rate of each policy, shape (m,) each, over `n_each` rollouts of the grid's random numbers."""
    stream = first_stream + np.arange(len(theta) * n_each).reshape(len(theta), n_each)
    outcomes = _fly(world, experiment, theta, stream, threads)
    return four_leg(outcomes).mean(axis=1), clean(outcomes).mean(axis=1)


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
