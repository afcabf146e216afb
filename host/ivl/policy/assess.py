"""How good a policy is: fresh approaches, counted.

box, plane   landing rates of the flips, every approach flown (`go_p_min` 0)
shaped       those of the plane, with the approach that first leads into the region where landings are possible
go           on the plane: how well the estimate tells landings from failures, and what the policy's own `go_p_min`
             does with the same flights

Flights of one approach, on several tasks or with several vehicles, are alike, and so are those of one drawn vehicle.
The intervals know that.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ivl.analysis.intervals import Estimate, share_of_clusters, worst_tenth
from ivl.outcome import Outcomes, clean, four_leg
from ivl.policy import go
from ivl.policy.file import PolicyFile
from ivl.policy.flying import Drawn, Place, PolicyTask, fly
from ivl.policy.go import BoolArray
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
        level_out_contacts: Refused flights that touched the ceiling in the level-out.
        contacts_before: Flights that touched it before they were refused.
        landed_of_flown: Share of landings among the approaches that are flown.
        p_min: The policy's own `go_p_min`.
    """

    auc: float
    calibration_error: float
    strikes_avoided: Estimate
    refused_good: Estimate
    no_go: Estimate
    level_out_contacts: int
    contacts_before: int
    landed_of_flown: Estimate
    p_min: float

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON; what cannot be told is null."""
        data: dict[str, Any] = {"auc": self.auc, "calibration_error": self.calibration_error}
        for name in ("strikes_avoided", "refused_good", "no_go", "landed_of_flown"):
            share = getattr(self, name)
            data[name], data[f"{name}_interval"] = share.value, [share.low, share.high]
        data |= {"level_out_contacts": self.level_out_contacts, "contacts_before_no_go": self.contacts_before}
        data["p_min"] = self.p_min
        return {name: None if isinstance(value, float) and np.isnan(value) else value for name, value in data.items()}


@dataclass(frozen=True)
class Vehicles:
    """Which vehicles flew.

    Attributes:
        drawn: What was drawn in place of each task's; None: the vehicles of the files.
        learned_over: What the policy was learned over, likewise.
    """

    drawn: Drawn | None
    learned_over: Drawn | None

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON; null stands for the vehicles of the files."""
        families = {"drawn": self.drawn, "learned_over": self.learned_over}
        return {name: family.model_dump(mode="json") if family else None for name, family in families.items()}

    def __str__(self) -> str:
        """As people read it."""
        flown, learned = (
            f"{family.n_vehicles} drawn ones (seed {family.seed})" if family else "those of the files"
            for family in (self.drawn, self.learned_over)
        )
        return f"{flown}; the policy was learned over {learned}"


@dataclass(frozen=True)
class Assessment:
    """What `ivl policy assess` says.

    Attributes:
        box: Approaches that the authors learned for.
        plane: All approaches.
        shaped: The plane by the approach of `SHAPED`; None if the flight core has none.
        go: None if the form decides nothing.
        vehicles: What flew.
    """

    box: Rates
    plane: Rates
    shaped: Rates | None
    go: Go | None
    vehicles: Vehicles

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        parts = {
            "box": self.box, "plane": self.plane, "shaped": self.shaped, "go": self.go, "vehicles": self.vehicles,
        }  # fmt: skip
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
        family: Vehicles that are drawn in place of each task's; they differ from those of any learning. Omitted: the
            vehicles of the files, also for a policy that was learned over a family.

    Raises:
        ConfigError: Vehicles are to be drawn, and the files of a task give no parameter a sigma.
    """
    flown_on = tasks or policy.tasks
    bench = _Bench(policy, len(flown_on), n_approaches, seed, threads, family)
    places = _places(flown_on, family)
    led = None
    if SHAPED in APPROACHES:
        led = bench.rates("shaped", _places([shaped(task) for task in flown_on], family))
    go_no_go = bench.go(places) if is_general(policy.form) else None
    vehicles = Vehicles(family, policy.training.family if policy.training else None)
    return Assessment(bench.rates("box", places), bench.rates("plane", places), led, go_no_go, vehicles)


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


class _Bench:
    """Flies the fresh approaches in places, which are those of each task, vehicle by vehicle."""

    def __init__(
        self, policy: PolicyFile, n_tasks: int, n: int, seed: int, threads: int | None, family: Drawn | None
    ) -> None:
        self._policy, self._n_tasks, self._n, self._seed, self._threads = policy, n_tasks, n, seed, threads
        self._is_family = family is not None
        self._theta = np.array(policy.values)

    def _fly(self, places: Sequence[Place], theta: FloatArray, region: Region) -> Outcomes:
        """Outcomes of shape (..., tasks, vehicles, approaches) of policies (..., dim)."""
        flown = fly(places, self._policy.form, theta, fresh(region, self._n, self._seed), self._threads)
        stacked = np.stack(flown, axis=-2)
        return stacked.reshape(*stacked.shape[:-2], self._n_tasks, -1, self._n)

    def _share(self, happened: BoolArray, counted: BoolArray | None = None) -> Estimate:
        """A share of flights (tasks, vehicles, approaches); tasks are given, vehicles and approaches are drawn."""
        _, vehicle, approach = np.indices(happened.shape)
        drawn = (approach, vehicle) if self._is_family else (approach,)
        return share_of_clusters(happened, np.ones(happened.shape) if counted is None else counted, *drawn)

    def rates(self, name: str, places: Sequence[Place]) -> Rates:
        """Landing rates, every approach flown."""
        general = is_general(self._policy.form)
        theta = General(self._policy.form).always_go(self._theta) if general else self._theta
        flown = self._fly(places, theta, _SERIES[name])
        landed = four_leg(flown)
        worst = None
        if self._is_family:
            worst = worst_tenth(landed.mean(axis=-1).ravel())
        return Rates(self._share(landed), self._share(clean(flown)), worst, flown.size)

    def go(self, places: Sequence[Place]) -> Go:
        """What go / no-go is worth, over the plane."""
        general, theta = General(self._policy.form), self._theta
        free, own = self._fly(places, np.stack([general.always_go(theta), theta]), PLANE)
        landed, refused = four_leg(free), own["no_go"] == 1
        decided = go.has_decided(free)
        p = free["p_land"][decided]
        before, during = self._contacts(places, own)
        return Go(
            auc=go.auc(p, landed[decided]),
            calibration_error=go.calibration_error(p, landed[decided]),
            strikes_avoided=self._share(refused, go.strikes(free)),
            refused_good=self._share(refused & landed),
            no_go=self._share(refused),
            level_out_contacts=during,
            contacts_before=before,
            landed_of_flown=self._share(four_leg(own), ~refused),
            p_min=float(theta[general.go_p_min]),
        )

    def _contacts(self, places: Sequence[Place], own: Outcomes) -> tuple[int, int]:
        """Refused flights of the plane that touched the ceiling: before they were called off, and in the level-out.

        The outcome does not say when a flight was called off, so those few are flown again.
        """
        approaches = fresh(PLANE, self._n, self._seed)
        of_places = own.reshape(len(places), self._n)
        touched = (of_places["no_go"] == 1) & np.isfinite(of_places["t_impact_s"])
        during = [
            self._is_in_level_out(places[i], approaches, int(j), of_places[i, j]) for i, j in np.argwhere(touched)
        ]
        return len(during) - sum(during), sum(during)

    def _is_in_level_out(self, place: Place, approaches: Approaches, i: int, outcome: Any) -> bool:
        trace = place.world.trace(
            float(approaches.speed_mps[i]), float(approaches.angle_deg[i]), *self._policy.values,
            form=self._policy.form, seed=approaches.seed, stream=int(approaches.stream[i]), start=place.task.start,
        )  # fmt: skip
        return bool(outcome["t_impact_s"] >= place.world.called_off_s(trace))
