"""The bank: simulated members of a family, with policies flown by each, made once for a task and cached.

Every flight of the bank has its own policy. A first part of the members flies policies from the whole box; the others
fly near policies that landed, too, since a landing window is a small share of the box. Some flights of each member are
recorded (`ivl.belief.recording`). A bank depends on its task, its family and its seed alone.
"""

import hashlib
import json
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.belief import recording
from ivl.errors import StoreError
from ivl.family import Family
from ivl.outcome import four_leg, valid

FloatArray = npt.NDArray[np.float64]

VERSION = 1
_BROAD = 0.25
"""Share of the members that fly policies from the whole box."""
_NEAR, _JITTER = 0.7, 0.06
"""Of the others: share of policies near a landing, and their distance from it, in widths of the box."""


@dataclass(frozen=True)
class Flight:
    """What all flights of a bank have in common.

    Attributes:
        speed_mps: Approach speed.
        angle_deg: Approach angle.
        form: Form of the policy.
        start: How a rollout begins.
        bounds: Box of the policies, shape (dim, 2).
    """

    speed_mps: float
    angle_deg: float
    form: str
    start: str
    bounds: FloatArray


@dataclass(frozen=True)
class Bank:
    """Members and what they flew; n members with m flights each, of which the first k are recorded.

    Attributes:
        z: Members, shape (n, n_dimensions).
        theta: Policies, shape (n, m, dim).
        landed: Whether a flight landed on three legs or more, shape (n, m).
        features: Recordings, shape (n, k, recording.N).
    """

    z: FloatArray
    theta: FloatArray
    landed: npt.NDArray[np.bool_]
    features: FloatArray


def make(
    kin: Family,
    flight: Flight,
    n_members: int,
    n_flights: int,
    n_recorded: int,
    seed: int,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Bank:
    """Fly a bank.

    Args:
        kin: The family.
        flight: What is flown.
        n_members: Members.
        n_flights: Flights of each member.
        n_recorded: How many of them are recorded.
        seed: Of members, policies and flights.
        threads: Worker threads; omitted: all processors.
        progress: Called with (members done, members).
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    drawn = [kin.draw(rng) for _ in range(n_members)]
    n_broad = max(1, round(_BROAD * n_members))
    lo, hi = flight.bounds.T
    theta = rng.uniform(lo, hi, (n_members, n_flights, len(lo)))
    jitter = rng.standard_normal(theta.shape) * _JITTER * (hi - lo)
    near = rng.random((n_members, n_flights)) < _NEAR
    pick = rng.random((n_members, n_flights))
    workers = threads or len(os.sched_getaffinity(0))
    results = []
    with ThreadPoolExecutor(workers) as pool:
        pool_of_landings: FloatArray = np.empty((0, len(lo)))
        for first, last in ((0, n_broad), (n_broad, n_members)):
            if len(pool_of_landings):
                chosen = pool_of_landings[(pick * len(pool_of_landings)).astype(int)]
                moved = np.clip(chosen + jitter, lo, hi)
                theta[first:last] = np.where(near[..., None], moved, theta)[first:last]
            jobs = [pool.submit(_fly, drawn[i][1], flight, theta[i], n_recorded, _member_seed(seed, i)) for i in range(first, last)]
            for job in jobs:
                results.append(job.result())
                if progress:
                    progress(len(results), n_members)
            pool_of_landings = np.concatenate([t[r[0]] for t, r in zip(theta, results, strict=False)])
    return Bank(
        np.array([z for z, _ in drawn]), theta, np.array([r[0] for r in results]), np.array([r[1] for r in results])
    )


def _member_seed(seed: int, i: int) -> int:
    return int(np.random.SeedSequence([seed, i]).generate_state(1, np.uint64)[0] >> np.uint64(1))


def _fly(world, flight: Flight, theta: FloatArray, n_recorded: int, seed: int):  # type: ignore[no-untyped-def]
    """Landings and recordings of one member."""
    flown = {"form": flight.form, "start": flight.start}
    outcomes = world.rollouts(
        flight.speed_mps, flight.angle_deg, *theta[n_recorded:].T, seed=seed,
        stream=np.arange(n_recorded, len(theta)), threads=1, **flown,
    )  # fmt: skip
    features = np.full((n_recorded, recording.N), np.nan)
    landed = np.zeros(len(theta), dtype=bool)
    landed[n_recorded:] = four_leg(outcomes) & valid(outcomes)
    for k in range(n_recorded):
        features[k], outcome = recording.simulated(world, (flight.speed_mps, flight.angle_deg), theta[k], k, seed, **flown)
        landed[k] = bool(four_leg(outcome))
    return landed, features
