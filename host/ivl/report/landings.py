"""The landings of a page: flown again by the simulator, packed, and compared with what the run recorded."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from ivl.landing import LandingSpec
from ivl.report import replay
from ivl.rewards import RewardChoice
from ivl.world import World

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
        name = f"{spec.vehicle}/{spec.gear_set}/{spec.gear}"
        self.landings.append({"label": label, "geometry": name, **replay.pack(spec, world, trace, self.reward)})
        return len(self.landings) - 1

    def fact(self) -> list[str]:
        """A line for the page's header: how many, and whether they are what was flown."""
        n = len(self.landings)
        verdict = "each as recorded" if not self.n_different else f"{self.n_different} differ from the record"
        return ["Landings to replay", f"{n}, flown again, {verdict}"]

    def _world(self, spec: LandingSpec) -> World:
        key = (spec.vehicle, spec.gear_set, spec.gear, *sorted(spec.overrides.items()))
        if key not in self._worlds:
            world = self._worlds[key] = spec.make_world()
            self.geometry[f"{spec.vehicle}/{spec.gear_set}/{spec.gear}"] = replay.geometry(world)
        return self._worlds[key]


def thinned(wanted: Iterable[int], n_max: int) -> set[int]:
    """At most `n_max` of the numbers, spread evenly over their order."""
    numbers = list(wanted)
    if len(numbers) <= n_max:
        return set(numbers)
    return {numbers[i * len(numbers) // n_max] for i in range(n_max)}
