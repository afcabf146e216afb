"""How good a policy is: fresh approaches, counted.

box, plane   landing rates of the flips, every approach flown (`go_p_min` 0)
shaped       those of the plane, with the approach that first leads into the region where landings are possible
go           on the plane: how well the estimate tells landings from failures, and what the policy's own `go_p_min`
             does with the same flights
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ivl.analysis.intervals import Estimate, share_of, wilson, worst_tenth
from ivl.outcome import Outcomes, clean, four_leg
from ivl.policy import go
from ivl.policy.file import PolicyFile
from ivl.policy.flying import Drawn, Place, PolicyTask, fly
from ivl.policy.region import BOX, PLANE, Approaches, Region, Series
from ivl.policy.shape import FloatArray, General, is_general
from ivl.seeds import Purpose
from ivl.sensing import APPROACHES
from ivl.task import settings_of

SHAPED = "region"
"""Name of the approach that leads into the region, where the flight core has it."""
SHAPED_ROOM_M = 1.2
"""A shaped approach begins at least so far below the ceiling: its ramp, and the distance of the trigger."""
_SERIES = {"box": BOX, "plane": PLANE, "shaped": PLANE}


@dataclass(frozen=True)
class Rates:
    """Shares of all flights.

    Attributes:
        landed: At least three legs hold.
        clean: And neither body nor rotors touched the ceiling.
        worst_tenth: Share of landings of the tenth of the vehicles that land least, one at least; None if none were
            drawn.
        n_flights: Flights in all.
    """

    landed: Estimate
    clean: Estimate
    worst_tenth: float | None
    n_flights: int

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        data: dict[str, Any] = {
            "landed": self.landed.value,
            "clean": self.clean.value,
            "landed_interval": [self.landed.low, self.landed.high],
            "clean_interval": [self.clean.low, self.clean.high],
            "flights": self.n_flights,
        }
        return data if self.worst_tenth is None else {**data, "landed_worst_tenth": self.worst_tenth}


@dataclass(frozen=True)
class Go:
    """What go / no-go is worth, over the plane.

    Attributes:
        auc: Share of pairs of a landing and a failure that the estimate puts in order.
        calibration_error: Mean distance of the share of landings from the estimate.
        strikes_avoided: Share of the body strikes that are refused.
        refused_good: Share of all approaches that are refused although they would have landed.
        no_go: Share of all approaches that are refused.
        level_out_contacts: Refused flights that touched the ceiling all the same.
        landed_of_flown: Share of landings among the approaches that are flown.
        p_min: The policy's own `go_p_min`.
    """

    auc: float
    calibration_error: float
    strikes_avoided: Estimate
    refused_good: Estimate
    no_go: Estimate
    level_out_contacts: int
    landed_of_flown: Estimate
    p_min: float

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON; what cannot be told is null."""
        data: dict[str, Any] = {"auc": self.auc, "calibration_error": self.calibration_error}
        for name in ("strikes_avoided", "refused_good", "no_go", "landed_of_flown"):
            share = getattr(self, name)
            data[name], data[f"{name}_interval"] = share.value, [share.low, share.high]
        data |= {"level_out_contacts": self.level_out_contacts, "p_min": self.p_min}
        return {name: None if isinstance(value, float) and np.isnan(value) else value for name, value in data.items()}


@dataclass(frozen=True)
class Assessment:
    """What `ivl policy assess` says.

    Attributes:
        box: Approaches that the authors learned for.
        plane: All approaches.
        shaped: The plane by the approach of `SHAPED`; None if the flight core has none.
        go: None if the form decides nothing.
    """

    box: Rates
    plane: Rates
    shaped: Rates | None
    go: Go | None

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        parts = {"box": self.box, "plane": self.plane, "shaped": self.shaped, "go": self.go}
        return {name: part.as_dict() if part is not None else None for name, part in parts.items()}


def assess(
    policy: PolicyFile,
    tasks: Sequence[PolicyTask] | None = None,
    n_approaches: int = 2000,
    seed: int = 0,
    threads: int | None = None,
    family: Drawn | None = None,
) -> Assessment:
    """Judge a policy.

    Args:
        policy: The policy.
        tasks: What is flown; omitted: what it was learned on. With several each flies the same approaches.
        n_approaches: Fresh approaches of each region.
        seed: Their seed; they differ from those of any learning.
        threads: Worker threads; omitted: all processors.
        family: Vehicles that are drawn in place of each task's; they differ from those of any learning. Intervals are
            then those of a mean over vehicles.

    Raises:
        ConfigError: Vehicles are to be drawn, and the files of a task give no parameter a sigma.
    """
    places = _places(tasks or policy.tasks, family)
    theta = np.array(policy.values)
    free = General(policy.form).always_go(theta) if is_general(policy.form) else theta

    def rates(name: str, flown_by: Sequence[Place]) -> Rates:
        approaches = fresh(_SERIES[name], n_approaches, seed)
        flown = fly(flown_by, policy.form, free, approaches, threads)
        return _rates(flown) if family is None else _rates_of_vehicles(flown)

    led = None
    if SHAPED in APPROACHES:
        led = rates("shaped", _places([shaped(task) for task in tasks or policy.tasks], family))
    judged = _go(General(policy.form), places, theta, n_approaches, seed, threads) if is_general(policy.form) else None
    return Assessment(rates("box", places), rates("plane", places), led, judged)


def fresh(region: Region, n: int, seed: int) -> Approaches:
    """Approaches that no learning has seen."""
    return Series([region], seed, Purpose.ASSESS).next(n)


def _places(tasks: Sequence[PolicyTask], family: Drawn | None) -> list[Place]:
    places = [Place.of(task) for task in tasks]
    if family is None:
        return places
    return [member for place in places for member in place.members(family, Purpose.FAMILY_ASSESS)]


def shaped(task: PolicyTask) -> PolicyTask:
    """The same task with the approach that leads into the region, and room for it."""
    own = task.overrides.get("start.room")
    if own is not None and own.value >= SHAPED_ROOM_M:
        return task.model_copy(update={"approach": SHAPED})
    room = settings_of({"start.room": SHAPED_ROOM_M}, "room for a shaped approach")
    return task.model_copy(update={"approach": SHAPED, "overrides": {**task.overrides, **room}})


def _rates(flown: Sequence[Outcomes]) -> Rates:
    landed, spotless = (np.concatenate([rate(outcomes) for outcomes in flown]) for rate in (four_leg, clean))
    return Rates(share_of(landed), share_of(spotless), None, landed.size)


def _rates_of_vehicles(flown: Sequence[Outcomes]) -> Rates:
    """Flights of one vehicle are alike, so the vehicles count for the intervals, not the flights."""
    shares = np.array([[rate(outcomes).mean() for outcomes in flown] for rate in (four_leg, clean)])
    landed, spotless = (_mean_over_vehicles(of) for of in shares)
    return Rates(landed, spotless, worst_tenth(shares[0]), sum(outcomes.size for outcomes in flown))


def _mean_over_vehicles(shares: FloatArray) -> Estimate:
    mean = float(shares.mean())
    low, high = wilson(mean, shares.size)
    return Estimate(mean, float(low), float(high), shares.size)


def _go(general: General, places: Sequence[Place], theta: FloatArray, n: int, seed: int, threads: int | None) -> Go:
    approaches = fresh(PLANE, n, seed)
    policies = np.stack([general.always_go(theta), theta])
    flown = fly(places, general.form.name, policies, approaches, threads)
    free, own = (np.concatenate([outcomes[i] for outcomes in flown]) for i in (0, 1))
    landed, refused = four_leg(free), own["no_go"] == 1
    decided = go.has_decided(free)
    p = free["p_land"][decided]
    return Go(
        auc=go.auc(p, landed[decided]),
        calibration_error=go.calibration_error(p, landed[decided]),
        strikes_avoided=share_of(refused[go.strikes(free)]),
        refused_good=share_of(refused & landed),
        no_go=share_of(refused),
        level_out_contacts=int((refused & np.isfinite(own["t_impact_s"])).sum()),
        landed_of_flown=share_of(four_leg(own)[~refused]),
        p_min=float(theta[general.go_p_min]),
    )
