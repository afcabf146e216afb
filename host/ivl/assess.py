"""Judging a run: what the best policy could reach, and when, if ever, each trial's recommendation came close to it.

Definitions, the same for every learner:

best rate: The largest four-leg rate that any policy reaches in this world. One or two parameters are searched by a
    dense grid, which is sifted in stages (more rollouts for the better points). More of them are searched by CMA-ES,
    first from where the experiment begins, then from random places, which ends where landings are; and then by clouds
    of policies around these ends, sifted like the grid, since in noise a search alone ends beside the best rate.
    Either way the one that is chosen then flies fresh rollouts, and their rate counts: the rate by which it was chosen
    is inflated by the choice.
    `Best.search` says which it was. Of policies with equal rates the one with the larger margin rate is the better one.
margin rate: The landing rate of a policy of the paper's form, averaged over errors of timing and moment
    (`ivl.belief.decide`), by rollouts in this world. Other forms have none.
check: After each episode the recommended policy flies `n_fresh` fresh rollouts (random numbers of the check alone).
solved: The check after the last episode reaches `share_of_best` of the best rate (`ivl.outcome.solved`).
converged at: The first multiple of N rollouts from which on every check reaches it.
failed: Rollouts up to convergence (all of them if never) that were not four-leg landings: what a drone would suffer.
stuck: Trials whose recommended policy at the end is stuck by the best rate (`ivl.outcome.stuck`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RegularGridInterpolator  # type: ignore[import-untyped]

from ivl import forms
from ivl.belief.decide import around
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
_FINALISTS, _FINAL_ROLLOUTS, _LAST_ROLLOUTS = 10, 1000, 4000
_GRID_STEPS = (140, 20)
"""Steps of each axis of the grid between the bounds of the policy, where an experiment gives no grid."""
_WIDEST, _MARGIN_ROLLOUTS = (8, 3), (50, 100, 300)
"""Policies that may have the largest margin rate, in two sifts, and rollouts of each sift, and of the last look, for
each of the points that a margin rate is averaged over."""
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
        margin_rate: Its margin rate; None: there is none.
        largest_margin_rate: The largest margin rate of any policy, likewise.
        largest_margin_theta: The policy that has it.
    """

    theta: tuple[float, ...]
    rate_four_leg: float
    rate_clean: float
    n_rollouts: int
    search: str = "grid"
    margin_rate: float | None = None
    largest_margin_rate: float | None = None
    largest_margin_theta: tuple[float, ...] | None = None

    @staticmethod
    def of_dict(data: dict[str, Any]) -> "Best":
        """Inverse of `dataclasses.asdict`, also after JSON."""
        names = ("theta", "largest_margin_theta")
        return Best(**data | {name: tuple(data[name]) for name in names if data.get(name) is not None})


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
    axes = _values(_axes(experiment))
    margins = _Margins(axes, theta) if has_margin(experiment) and all(len(axis) > 1 for axis in axes) else None
    chosen, four, _ = _sift(flights, theta, (*_STAGES, (0.0, _FINAL_ROLLOUTS)), on_stage, margins)
    top = chosen[int(np.argmax(four))]  # of equal ones the first is the widest
    best = _judged(flights, top, f"grid of {len(theta)} policies")
    return best if margins is None else _with_margins(flights, best, theta, margins)


def _judged(flights: "_Flights", theta: FloatArray, search: str) -> Best:
    """A policy that was chosen, by fresh rollouts."""
    four, spotless = flights.rates(theta[None], flights.scaled(_LAST_ROLLOUTS))
    return Best(tuple(theta.tolist()), float(four[0]), float(spotless[0]), flights.n_flown, search)


def has_margin(experiment: Experiment) -> bool:
    """Whether the policies of an experiment have a margin rate."""
    return experiment.policy.form == forms.PAPER


def margin_rates(
    world: World, experiment: Experiment, theta: FloatArray, n_each: int, threads: int | None = None
) -> FloatArray:
    """Margin rates of policies of the paper's form, shape (m,).

    Args:
        world: Where to fly.
        experiment: Approach and bounds; its seed.
        theta: Policies, shape (m, 2).
        n_each: Rollouts for each of the points that a margin rate is averaged over; the same random numbers for each.
        threads: Worker threads; omitted: all processors.
    """
    points, weights = around(theta, np.array(experiment.policy.bounds))
    outcomes = world.rollouts(
        experiment.speed_mps,
        experiment.angle_deg,
        *by_parameter(points[:, :, None]),
        form=experiment.policy.form,
        seed=derive(experiment.seed, Purpose.MARGIN),
        stream=np.arange(n_each),
        start=experiment.start,
        threads=threads,
    )
    return np.asarray(weights @ four_leg(outcomes).mean(axis=2))


class _Margins:
    """Margin rates between the points of a grid, from the rates of its points."""

    def __init__(self, axes: Sequence[FloatArray], theta: FloatArray) -> None:
        self._axes = axes
        self._points, self._weights = around(theta, np.array([[axis[0], axis[-1]] for axis in axes]))
        self.rates = np.zeros(len(theta))

    def see(self, rates: FloatArray) -> None:
        """Take the rates of all points of the grid."""
        between = RegularGridInterpolator(self._axes, rates.reshape([len(axis) for axis in self._axes]))
        self.rates = self._weights @ between(self._points.reshape(-1, 2)).reshape(len(self._weights), -1)


def _with_margins(flights: "_Flights", best: Best, theta: FloatArray, margins: _Margins) -> Best:
    """The best policy with its margin rate, and the largest one of any policy, each from fresh rollouts."""
    bounds = np.array(flights.experiment.policy.bounds)
    n_first, n_second, n_last = (flights.scaled(n) for n in _MARGIN_ROLLOUTS)
    own = flights.margin_rates(np.array([best.theta]), bounds, n_last)[0]
    first = theta[np.argsort(-margins.rates, kind="stable")[: _WIDEST[0]]]
    second = first[np.argsort(-flights.margin_rates(first, bounds, n_first), kind="stable")[: _WIDEST[1]]]
    widest = second[int(np.argmax(flights.margin_rates(second, bounds, n_second)))]
    largest = flights.margin_rates(widest[None], bounds, n_last)[0]
    if own > largest:
        widest, largest = np.array(best.theta), own
    return replace(
        best,
        n_rollouts=flights.n_flown,
        margin_rate=float(own),
        largest_margin_rate=float(largest),
        largest_margin_theta=tuple(widest.tolist()),
    )


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

    def margin_rates(self, theta: FloatArray, bounds: FloatArray, n_each: int) -> FloatArray:
        """Margin rate of each policy, shape (m,), over `n_each` rollouts for each point of the average."""
        points, weights = around(theta, bounds)
        four, _ = self.rates(points.reshape(-1, points.shape[-1]), n_each)
        return np.asarray(weights @ four.reshape(len(weights), -1))


def _sift(
    flights: _Flights,
    theta: FloatArray,
    stages: Sequence[tuple[float, int]],
    on_stage: OnStage | None = None,
    margins: _Margins | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fly all policies a few times, the better ones more often, and so on; of equal ones the wider ones.

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
        width = np.zeros(len(chosen)) if margins is None else margins.rates[chosen]
        chosen = chosen[np.lexsort((-width, -rate))[: max(_FINALISTS, int(share * len(theta)))]]
        four, spotless = flights.rates(theta[chosen], n_each)
        landed[chosen] += four * n_each
        flown[chosen] += n_each
        if margins is not None and stage == 0:
            margins.see(landed / flown)
    if margins is None:
        return theta[chosen], four, spotless
    order = np.lexsort((-margins.rates[chosen], -four))
    return theta[chosen][order], four[order], spotless[order]


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
    each = flights.scaled(_GENERATIONS) * _POPULATION
    words = (
        f"{_SEARCHES} searches of {each} rollouts at most, the best refined in {_CLOUDS} clouds of {_CLOUD} policies"
    )
    return _judged(flights, theta, words)


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


def judge_each(
    worlds: Sequence[World],
    experiment: Experiment,
    bests: Sequence[Best],
    history: Sequence[EpisodeRow],
    rollouts: RolloutRows,
    threads: int | None = None,
) -> list[Verdict]:
    """As `judge`, where trial k flew in `worlds[k]` and its best policy is `bests[k]`."""
    verdicts = []
    for number, (world, best) in enumerate(zip(worlds, bests, strict=True)):
        rows = [replace(row, trial=0) for row in history if row.trial == number]
        own = rollouts.of_trial(number)
        (verdict,) = judge(world, experiment.trial(number), best, rows, replace(own, trial=0 * own.trial), threads)
        verdicts.append(replace(verdict, trial=number))
    return verdicts


def rates_after(
    worlds: Sequence[World],
    experiment: Experiment,
    history: Sequence[EpisodeRow],
    episode: int,
    threads: int | None = None,
) -> FloatArray:
    """Four-leg rate of what trial k recommended after an episode, over fresh rollouts in `worlds[k]`: shape (n,)."""
    recommended, first = _recommendations(history, experiment.n_episodes), np.zeros(1, dtype=np.intp)
    rates = [
        _check(world, experiment.trial(k), recommended[k, [episode]], first, episode, threads)[0]
        for k, world in enumerate(worlds)
    ]
    return np.concatenate(rates)


def summarise_each(
    verdicts: Sequence[Verdict], bests: Sequence[Best], rollouts: RolloutRows, fits: Sequence[bool | None]
) -> dict[str, Any]:
    """Figures over trials that had vehicles of their own, beside and in place of those of `summarise`.

    Each failed landing costs a part of a real vehicle, so all of them count, and beside them those that the best policy
    of the vehicle would have been spared: failed - rollouts (1 - its rate).

    Args:
        verdicts: One for each trial.
        bests: The best policy of each trial's vehicle.
        rollouts: All rollouts.
        fits: Whether the learner's model fits each trial's vehicle (`Learner.insight`); None: it has none.
    """
    common = summarise(verdicts)
    failed = np.array([v.failed_landings_total for v in verdicts], dtype=np.float64)
    scored = rollouts.status == SCORED
    n_flown = np.array([((rollouts.trial == v.trial) & scored).sum() for v in verdicts])
    beyond = failed - n_flown * (1.0 - np.array([best.rate_four_leg for best in bests]))
    known = [fit for fit in fits if fit is not None]
    return {
        **common,
        "flights_to_solved": common["rollouts_to_convergence"],
        "failed_landings": _spread(failed),
        "failed_landings_beyond_best": _spread(beyond),
        "failed_landings_until_solved": common["failed_landings"],
        "model_fits": sum(known) / len(known) if known else None,
        "model_fits_trials": {"yes": sum(known), "no": len(known) - sum(known)} if known else None,
        "best_rate_four_leg": {"mean": float(np.mean([b.rate_four_leg for b in bests])),
                               "lowest": min(b.rate_four_leg for b in bests)},
    }  # fmt: skip


def _spread(values: FloatArray) -> dict[str, float | None]:
    return {
        "mean": float(values.mean()),
        "median": _quantile(values.tolist(), 0.5),
        "p90": _quantile(values.tolist(), 0.9),
    }


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


def _values(axes: Sequence[GridAxis]) -> list[FloatArray]:
    """The values along each axis."""
    numbers = [np.arange(int((axis.hi - axis.lo) / axis.step + 1e-9) + 1, dtype=np.float64) for axis in axes]
    return [np.asarray(axis.lo + axis.step * n, dtype=np.float64) for axis, n in zip(axes, numbers, strict=True)]


def _grid(axes: Sequence[GridAxis]) -> FloatArray:
    """Every combination of the axes' values, shape (m, dim)."""
    return np.stack(np.meshgrid(*_values(axes), indexing="ij"), axis=-1).reshape(-1, len(axes))


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
