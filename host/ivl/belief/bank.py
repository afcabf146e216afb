"""The bank: simulated members of a family, with policies flown by each.

Every flight of the bank has its own policy. A first part of the members flies policies from the whole box; the others
fly near policies that landed, too, since a landing window is a small share of the box. Once emulators exist, each
member can fly policies that they expect to land (`policies`). Every flight is recorded (`ivl.belief.recording`). A bank
depends on its task, its family, its policies and its seed alone.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from ivl.belief import recording
from ivl.belief.recording import Flight
from ivl.family import Family
from ivl.outcome import four_leg, valid
from ivl.world import World

FloatArray = npt.NDArray[np.float64]

Progress = Callable[[int, int], None]
Policies = Callable[[FloatArray, np.random.Generator], FloatArray]
"""Policies, shape (n, m, dim), for members z, shape (n, n_dimensions)."""

SPREAD = 1.3
_BROAD = 0.25
"""Share of the members that fly policies from the whole box."""
_NEAR, _JITTER = 0.7, 0.06
"""Of the others: share of policies near a landing, and their distance from it, in widths of the box."""


@dataclass(frozen=True)
class Bank:
    """Members and what they flew; n members with m flights each.

    Attributes:
        z: Members, shape (n, n_dimensions), in standard deviations of the family.
        theta: Policies, shape (n, m, dim).
        landed: Whether a flight landed on three legs or more, shape (n, m).
        features: Recordings, shape (n, m, recording.N).
    """

    z: FloatArray
    theta: FloatArray
    landed: npt.NDArray[np.bool_]
    features: FloatArray

    def __add__(self, other: "Bank") -> "Bank":
        """Both banks as one; they have as many flights a member."""
        return Bank(*(np.concatenate([getattr(self, f.name), getattr(other, f.name)]) for f in fields(self)))


def make(
    kin: Family,
    flight: Flight,
    n_members: int,
    n_flights: int,
    seed: int,
    threads: int | None = None,
    progress: Progress | None = None,
    policies: Policies | None = None,
) -> Bank:
    """Fly a bank.

    Args:
        kin: The family; members are drawn `SPREAD` times as wide as it is, since the vehicle that flies may be rare.
        flight: What is flown.
        n_members: Members.
        n_flights: Flights of each member.
        seed: Of members, policies and flights.
        threads: Worker threads; omitted: all processors.
        progress: Called with (members done, members).
        policies: What each member flies; omitted: policies of the box, and near landings of earlier members.
    """
    wide = replace(kin, scale=SPREAD * kin.scale)
    rng = np.random.Generator(np.random.PCG64(seed))
    drawn = [wide.draw(rng) for _ in range(n_members)]
    z = SPREAD * np.array([z for z, _ in drawn])
    theta, near, pick = _policies(rng, flight.box, n_members, n_flights)
    parts = [(0, max(1, round(_BROAD * n_members))), (max(1, round(_BROAD * n_members)), n_members)]
    if policies is not None:
        theta, parts = policies(z, rng), [(0, n_members)]
    results: list[tuple[npt.NDArray[np.bool_], FloatArray]] = []
    with ThreadPoolExecutor(threads or len(os.sched_getaffinity(0))) as pool:
        for first, last in parts:
            landings = np.concatenate([t[r[0]] for t, r in zip(theta, results, strict=False)]) if results else None
            if landings is not None and len(landings):
                chosen = landings[(pick[first:last] * len(landings)).astype(np.intp)]
                moved = np.clip(chosen + near[first:last], *flight.box.T)
                theta[first:last] = np.where(np.isfinite(moved), moved, theta[first:last])
            seeds = [derive_member(seed, i) for i in range(first, last)]
            worlds = [drawn[i][1] for i in range(first, last)]
            for result in pool.map(partial(_fly, flight), worlds, theta[first:last], seeds):
                results.append(result)
                if progress:
                    progress(len(results), n_members)
    return Bank(z, theta, np.array([r[0] for r in results]), np.array([r[1] for r in results]))


def _policies(
    rng: np.random.Generator, bounds: FloatArray, n_members: int, n_flights: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Policies from the whole box; how far others lie from a landing, NaN for those that stay; which landing."""
    lo, hi = bounds.T
    shape = (n_members, n_flights)
    theta = rng.uniform(lo, hi, (*shape, len(lo)))
    jitter = rng.standard_normal(theta.shape) * _JITTER * (hi - lo)
    near = np.where(rng.random(shape)[..., None] < _NEAR, jitter, np.nan)
    return theta, near, rng.random(shape)


def derive_member(seed: int, i: int) -> int:
    """Seed of the flights of member i."""
    return int(np.random.SeedSequence([seed, i]).generate_state(1, np.uint64)[0])


def _fly(flight: Flight, world: World, theta: FloatArray, seed: int) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """Landings and recordings of one member."""
    landed, features = np.zeros(len(theta), dtype=bool), np.empty((len(theta), recording.N))
    for k, policy in enumerate(theta):
        features[k], outcome = recording.simulated(world, flight, policy, seed, k)
        landed[k] = bool((valid(outcome) & four_leg(outcome)).all())
    return landed, features
