"""Batches of flights: each policy on each approach in the world of each task."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from ivl import family
from ivl.outcome import Outcomes, clean, four_leg
from ivl.policy.region import Approaches
from ivl.seeds import Purpose, derive
from ivl.settings import Strict
from ivl.task import Setup
from ivl.world import World

FloatArray = npt.NDArray[np.float64]


class PolicyTask(Setup):
    """What a policy is learned on: a task without speed and angle, whose flights come to a trigger of their own."""

    gear: str = Field(description="Landing gear; see `ivl list gears`.")
    start: Literal["imparted", "flown"] = Field(
        default="imparted", description="At the approach velocity (imparted), or from hover (flown)."
    )


class Drawn(Strict):
    """How many vehicles are drawn in place of the one of each task, from the family of the task (`ivl.family`)."""

    n_vehicles: int = Field(ge=1, le=1000, description="vehicles of each task")
    seed: int = Field(default=0, ge=0, lt=2**63)


@dataclass(frozen=True)
class Place:
    """A task with its world, which is built once; the world is that of the task, or of a member of its family."""

    task: PolicyTask
    world: World

    @staticmethod
    def of(task: PolicyTask) -> "Place":
        """Build the world."""
        return Place(task, task.world_of(task.gear))

    def members(self, drawn: Drawn, purpose: Purpose) -> list["Place"]:
        """The same task with vehicles that are drawn from its family; those of different purposes differ.

        Raises:
            ConfigError: Nothing of the task is uncertain.
        """
        worlds = family.members(self.world, drawn.n_vehicles, derive(drawn.seed, purpose), self.task.family)
        return [Place(self.task, world) for world in worlds]


def fly(
    places: Sequence[Place],
    form: str,
    theta: npt.ArrayLike,
    approaches: Approaches | Sequence[Approaches],
    threads: int | None = None,
) -> list[Outcomes]:
    """Fly policies, shape (..., dim), over all approaches in each place.

    All policies meet the same approaches with the same random numbers.

    Args:
        places: Where.
        form: Form of the policies.
        theta: Their numbers.
        approaches: The same in all places, or those of each place.
        threads: Worker threads; omitted: all processors.

    Returns:
        Outcomes of each place, shape (..., n).
    """
    return _fly(places, form, np.asarray(theta, dtype=np.float64)[..., None, :], approaches, threads)


def fly_own(
    places: Sequence[Place], form: str, theta: npt.ArrayLike, approaches: Approaches, threads: int | None = None
) -> list[Outcomes]:
    """Fly each approach with a policy of its own, theta of shape (n, dim); outcomes of each place, shape (n,)."""
    return _fly(places, form, np.asarray(theta, dtype=np.float64), approaches, threads)


def _fly(
    places: Sequence[Place],
    form: str,
    theta: FloatArray,
    approaches: Approaches | Sequence[Approaches],
    threads: int | None,
) -> list[Outcomes]:
    """Fly policies whose shape (..., 1 or n, dim) meets that of the approaches, (n,)."""
    columns = np.moveaxis(theta, -1, 0)
    batches = [approaches] * len(places) if isinstance(approaches, Approaches) else approaches
    return [
        place.world.rollouts(
            batch.speed_mps,
            batch.angle_deg,
            *columns,
            form=form,
            seed=batch.seed,
            stream=batch.stream,
            start=place.task.start,
            threads=threads,
        )
        for place, batch in zip(places, batches, strict=True)
    ]


def score(outcomes: Outcomes) -> FloatArray:
    """What is made large: 1 for a clean landing, 1/2 for one with body or rotor contact, 0 for none."""
    return np.asarray(0.5 * four_leg(outcomes) + 0.5 * clean(outcomes), dtype=np.float64)


def objective(flown: Sequence[Outcomes]) -> FloatArray:
    """Mean score of each policy over approaches and places, shape (...) of the policies."""
    return np.asarray(np.mean([score(outcomes).mean(axis=-1) for outcomes in flown], axis=0))
