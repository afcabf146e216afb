"""Where rollouts come from: the loop asks a `RolloutSource` and does not know whether it simulates or flies."""

import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ivl.belief.recording import simulated
from ivl.errors import RolloutError
from ivl.experiment import Experiment
from ivl.outcome import Outcomes, valid
from ivl.world import CANNOT_BEGIN, REFUSED, World


@dataclass(frozen=True)
class Plan:
    """Rollouts to fly, one per row.

    Attributes:
        theta: Policies, shape (n, dim), in the order and units of the experiment's policy.
        seed: Seed of the random numbers of each rollout's trial, shape (n,).
        stream: Number of each rollout within its trial, shape (n,).
        trial: Number of each rollout's trial within the run, shape (n,); None: all are of one trial.
        rechoose: Given a policy of the plan, shape (dim,), and the voltage expected in the hover: the policy to fly if
            the battery was changed since the plan was made; None: the plan's, whatever the battery.
    """

    theta: npt.NDArray[np.float64]
    seed: npt.NDArray[np.uint64]
    stream: npt.NDArray[np.uint64]
    trial: npt.NDArray[np.int64] | None = None
    rechoose: Callable[[npt.NDArray[np.float64], float], npt.NDArray[np.float64]] | None = None


@dataclass(frozen=True)
class Flown:
    """Some rollouts of a plan that are over.

    Attributes:
        index: Rows of the plan, shape (m,).
        outcomes: Outcome records, shape (m,).
        discarded: Why these rollouts must not be scored; empty if they are to be scored.
        recordings: What each recorded of its flip, shape (m, `ivl.belief.recording.N`); None if nobody asked.
    """

    index: npt.NDArray[np.intp]
    outcomes: Outcomes
    discarded: str = ""
    recordings: npt.NDArray[np.float64] | None = None
    theta: npt.NDArray[np.float64] | None = None
    """Policies that the operator had flown instead of the plan's, shape (m, dim); None: the plan's were."""


class RolloutSource(Protocol):
    """Flies plans. Results may come in any order and in any portions; each portion is stored as soon as it comes.

    Attributes:
        warnings: What a reader of the results has to know, one line each.
        is_flown: Whether its outcomes are those of a vehicle in a room, which nobody can repeat bit for bit.
        vehicle: Which vehicle flies, as it identifies itself; empty: none does, or it does not tell.
    """

    warnings: list[str]
    is_flown: bool
    vehicle: str

    def fly(self, plan: Plan) -> Iterator[Flown]:
        """Fly every row of the plan once.

        Raises:
            RolloutError: The source cannot go on; what was yielded before stays valid.
        """
        ...

    def battery_V(self) -> float:
        """Voltage expected in the hover of the next rollout, whatever its policy; NaN: nobody knows.

        Raises:
            RolloutError: The source cannot go on.
        """
        ...

    def close(self) -> None:
        """Give back what the source holds when no more is to be flown; calling it again does nothing."""
        ...


class WorldSource:
    """The simulator in this process: a whole plan in one native batch."""

    is_flown, vehicle = False, ""

    def __init__(self, world: World, experiment: Experiment, threads: int | None = None, record: bool = False) -> None:
        """Fly the experiment's approach in `world`; `record`: give what each flip recorded, too."""
        self.world, self._experiment, self._threads, self._record = world, experiment, threads, record
        self.warnings: list[str] = []

    def fly(self, plan: Plan) -> Iterator[Flown]:
        """Fly the plan; one portion with everything, and one with what the simulation could not bring to an end."""
        experiment = self._experiment
        outcomes = self.world.rollouts(
            experiment.speed_mps,
            experiment.angle_deg,
            *by_parameter(plan.theta),
            form=experiment.policy.form,
            seed=plan.seed,
            stream=plan.stream,
            start=experiment.start,
            threads=self._threads,
        )
        recordings = self._recordings(plan) if self._record else None
        for flown in portions(self.world, outcomes):
            yield replace(flown, recordings=None if recordings is None else recordings[flown.index])

    def _recordings(self, plan: Plan) -> npt.NDArray[np.float64]:
        """Every rollout once more, as its recorder sees it: it is a pure function of its arguments."""
        flight = self._experiment.flight
        flown = zip(plan.theta, plan.seed.tolist(), plan.stream.tolist(), strict=True)
        return np.array([simulated(self.world, flight, theta, seed, stream)[0] for theta, seed, stream in flown])

    def battery_V(self) -> float:
        """Nothing that lasts: each rollout has a battery of its own."""
        return math.nan

    def close(self) -> None:
        """Nothing to give back."""


class TrialSource:
    """The simulator in this process, in which every trial has a vehicle of its own."""

    is_flown, vehicle = False, ""

    def __init__(
        self, worlds: Sequence[World], experiment: Experiment, threads: int | None = None, record: bool = False
    ) -> None:
        """Fly the experiment's approach, trial k in `worlds[k]`; `record`: give what each flip recorded, too."""
        self._sources = [WorldSource(world, experiment, 1, record) for world in worlds]
        self._threads = threads or len(os.sched_getaffinity(0))
        self.warnings: list[str] = []

    def fly(self, plan: Plan) -> Iterator[Flown]:
        """Fly the plan; one portion for each trial with everything, and one with what came to no end."""
        assert plan.trial is not None
        rows = [np.flatnonzero(plan.trial == trial) for trial in np.unique(plan.trial)]
        with ThreadPoolExecutor(self._threads) as pool:
            for own, flown in zip(rows, pool.map(partial(self._fly, plan), rows), strict=True):
                yield from (replace(portion, index=own[portion.index]) for portion in flown)

    def _fly(self, plan: Plan, own: npt.NDArray[np.intp]) -> list[Flown]:
        """Some rows of a plan, all of one trial."""
        assert plan.trial is not None
        source = self._sources[int(plan.trial[own[0]])]
        return list(source.fly(Plan(plan.theta[own], plan.seed[own], plan.stream[own])))

    def battery_V(self) -> float:
        """Nothing that lasts: each rollout has a battery of its own."""
        return math.nan

    def close(self) -> None:
        """Nothing to give back."""


def by_parameter(theta: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], ...]:
    """Policies, shape (..., dim), as the arguments of `World.rollouts`: an array of shape (...) per parameter."""
    return tuple(np.moveaxis(theta, -1, 0))


def portions(world: World, outcomes: Outcomes) -> Iterator[Flown]:
    """A whole plan's outcomes: what is to be scored, and what the simulation could not bring to an end.

    Raises:
        RolloutError: Not one of them could begin.
    """
    outcomes = outcomes.view(np.recarray)  # a selection of these need not carry the arguments
    good = valid(outcomes)
    if len(outcomes) and all(world.end_reason(code) == REFUSED for code in set(outcomes["end_reason"].tolist())):
        raise RolloutError(f"no landing can begin: {CANNOT_BEGIN}")
    yield Flown(np.flatnonzero(good), outcomes[good])
    if not good.all():
        reasons = sorted({world.end_reason(code) for code in outcomes["end_reason"][~good]})
        yield Flown(np.flatnonzero(~good), outcomes[~good], f"simulation: {', '.join(reasons)}")
