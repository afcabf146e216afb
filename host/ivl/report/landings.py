"""The landings of a page: flown again by the simulator, packed, and compared with what the run recorded."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from ivl import shapes
from ivl.landing import LandingSpec
from ivl.report import replay
from ivl.rewards import RewardChoice
from ivl.world import Trace, World

Key = tuple[Any, ...]


@dataclass
class Album:
    """Landings in the order in which the page numbers them.

    Attributes:
        reward: What the run paid for landings.
        landings: Packed landings.
        geometry: Shapes of each world that they were flown in, by its name.
        n_different: Landings that did not come out as the run recorded them.
    """

    reward: RewardChoice
    landings: list[dict[str, Any]] = field(default_factory=list)
    geometry: dict[str, dict[str, Any]] = field(default_factory=dict)
    n_different: int = 0
    _worlds: dict[Key, World] = field(default_factory=dict)
    _names: dict[Key, str] = field(default_factory=dict)

    def add(self, spec: LandingSpec, label: str, as_recorded: Callable[[Any], bool]) -> int:
        """Fly a landing and return its number.

        Args:
            spec: What to fly.
            label: What the page calls it.
            as_recorded: Whether an outcome record is the one that the run stored.
        """
        world = self._world(spec)
        _, trace = spec.fly(world)
        self.n_different += not as_recorded(trace.outcome)
        packed = replay.pack(spec, world, trace, self.reward)
        self.landings.append({"label": label, "geometry": self._names[_key(spec)], **packed})
        return len(self.landings) - 1

    def show(self, spec: LandingSpec, trace: Trace, label: str) -> int:
        """Take a landing as it is, recorded or simulated, and return its number; `label` says which it is."""
        packed = replay.pack(spec, self._world(spec), trace, self.reward)
        self.landings.append({"label": label, "geometry": self._names[_key(spec)], **packed})
        return len(self.landings) - 1

    def fact(self) -> list[str]:
        """A line for the page's header: how many, and whether they are what was flown."""
        n = len(self.landings)
        verdict = "each as recorded" if not self.n_different else f"{self.n_different} differ from the record"
        return ["Landings to replay", f"{n}, flown again, {verdict}"]

    def _world(self, spec: LandingSpec) -> World:
        key = _key(spec)
        if key not in self._worlds:
            world = self._worlds[key] = spec.make_world()
            self._names[key] = self._name_of(f"{spec.vehicle}/{spec.gear_set}/{spec.gear}", shapes.geometry(world))
        return self._worlds[key]

    def _name_of(self, name: str, shapes: dict[str, Any]) -> str:
        """The name under which the page finds these shapes; worlds of the same vehicle and gear may differ in them."""
        number = 1
        while self.geometry.setdefault(name if number == 1 else f"{name} {number}", shapes) != shapes:
            number += 1
        return name if number == 1 else f"{name} {number}"


def _key(spec: LandingSpec) -> Key:
    return (spec.vehicle, spec.gear_set, spec.gear, spec.sensing, *sorted(spec.world_settings().items()))


def thinned(wanted: Iterable[int], n_max: int) -> set[int]:
    """At most `n_max` of the numbers, spread evenly over their order."""
    numbers = list(wanted)
    if len(numbers) <= n_max:
        return set(numbers)
    return {numbers[i * len(numbers) // n_max] for i in range(n_max)}
