"""Where approaches are drawn from, and the random numbers of their flights.

Approaches are uniform in speed and angle. A series belongs to one purpose (`ivl.seeds`), so that those of learning,
of choosing and of judging never meet.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, model_validator

from ivl.experiment import Bounds
from ivl.seeds import Purpose, derive
from ivl.settings import Strict
from ivl.task import check_range

FloatArray = npt.NDArray[np.float64]


class Region(Strict):
    """Approaches between two speeds (m/s) and two angles (degrees above the horizontal)."""

    speeds_mps: Bounds
    angles_deg: Bounds

    @model_validator(mode="after")
    def _ordered(self) -> "Region":
        for name, field in (("speeds_mps", "speed_mps"), ("angles_deg", "angle_deg")):
            lo, hi = getattr(self, name)
            if not lo < hi:
                raise ValueError(f"{name}: {lo} must be below {hi}")
            check_range(field, lo, f"{name}: value")
            check_range(field, hi, f"{name}: value")
        return self


BOX = Region(speeds_mps=[1.5, 3.5], angles_deg=[30.0, 90.0])
PLANE = Region(speeds_mps=[0.25, 4.0], angles_deg=[20.0, 90.0])
NAMED = {"box": BOX, "plane": PLANE}
"""Where policies are compared: the approaches that the authors learned for, and all that the vehicle can fly."""


def _by_name(value: Any) -> Any:
    if isinstance(value, str):
        if value not in NAMED:
            raise ValueError(f"unknown region (allowed {', '.join(NAMED)}, or speeds_mps and angles_deg)")
        return NAMED[value]
    return value


RegionField = Annotated[Region, BeforeValidator(_by_name)]
"""A region by its name, or by its limits."""


@dataclass(frozen=True)
class Approaches:
    """Approaches with the random numbers of their flights; arrays of shape (n,), but one seed for all."""

    speed_mps: FloatArray
    angle_deg: FloatArray
    stream: npt.NDArray[np.uint64]
    seed: int

    def __len__(self) -> int:
        """How many."""
        return len(self.speed_mps)


class Series:
    """Random approaches out of some regions, in equal shares, one batch after the other; none comes twice."""

    def __init__(self, regions: list[Region], seed: int, purpose: Purpose) -> None:
        """Begin the series of a purpose."""
        self._regions, self._seed = regions, derive(seed, purpose)
        self._rng = np.random.Generator(np.random.PCG64(self._seed))
        self._n_drawn = 0

    def next(self, n: int) -> Approaches:
        """The next batch: n approaches of each region."""
        drawn = []
        for region in self._regions:
            (v_lo, v_hi), (a_lo, a_hi) = region.speeds_mps, region.angles_deg
            drawn.append((self._rng.uniform(v_lo, v_hi, n), self._rng.uniform(a_lo, a_hi, n)))
        speed, angle = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
        stream = np.arange(self._n_drawn, self._n_drawn + len(speed), dtype=np.uint64)
        self._n_drawn += len(speed)
        return Approaches(speed, angle, stream, self._seed)

    def for_each(self, n_places: int, n: int) -> list[Approaches]:
        """A batch of its own for each of some places, so that many vehicles together meet many approaches."""
        return [self.next(n) for _ in range(n_places)]
