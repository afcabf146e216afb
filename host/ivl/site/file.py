"""What a site file says; every number has its unit in its name, and a range.

    site = load("lab.yaml")
    site.surface.height_m, site.not_measured

Frames: `landing_point_m` is in the axes of the tracking system, z up, floor at 0. All other places are in the flight
frame W: origin on the floor below the landing point, x along the approach, y left, z up. Without a turn and with the
landing point at the origin of the tracking system both are the same.
"""

import itertools
import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from ivl import references, yamlfile
from ivl.errors import ConfigError
from ivl.mocap.config import MocapConfig
from ivl.settings import Finite, Name, Strict

TEMPLATE = Path(__file__).parent / "new.yaml"
"""The commented example, in which everything that must be measured is a placeholder."""
SIMULATED_TRACKING = ("simulator", "mock")
"""Tracking systems that see no real vehicle."""
_SPAN_M = 100.0


def _pair(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


Metres = Annotated[Finite, Field(ge=-_SPAN_M, le=_SPAN_M)]
Place = Annotated[tuple[Metres, Metres], BeforeValidator(_pair)]


def _ordered(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError(f"the first number must be below the second (allowed {-_SPAN_M:g} .. {_SPAN_M:g} m, rising)")
    return span


Span = Annotated[tuple[Metres, Metres], BeforeValidator(_pair), AfterValidator(_ordered)]
Extent = Annotated[Finite, Field(ge=0.05, le=_SPAN_M)]
Volts = Annotated[Finite, Field(ge=2.0, le=30.0)]


class SurfacePlace(Strict):
    """The board under the ceiling, as measured."""

    height_m: Finite = Field(ge=0.5, le=20.0, description="underside of the board above the floor")
    landing_point_m: Place = Field(description="below the place to land at, in the axes of the tracking system")
    heading_deg: Finite = Field(ge=-180.0, le=180.0, description="direction of approach, from its x axis towards y")
    before_m: Extent = Field(description="board from the landing point back towards the start")
    beyond_m: Extent = Field(description="board from the landing point onward")
    left_m: Extent = Field(description="board to the left of the landing point")
    right_m: Extent = Field(description="board to the right of the landing point")


class Fence(Strict):
    """The box in W that a vehicle must not leave before its flip."""

    x_m: Span = Field(description="back and onward from the landing point")
    y_m: Span = Field(description="right (negative) and left")
    z_m: Span = Field(description="below the floor and above the board")


class Battery(Strict):
    """The battery, and the voltages that end flying with it."""

    type: str = Field(min_length=1)
    full_V: Volts = Field(description="just charged")
    rest_V_min: Volts = Field(description="at rest on the floor; below it the operator is asked for another battery")
    hover_V_min: Volts = Field(description="in the hover; below it the vehicle refuses to begin")
    load_V_min: Volts = Field(description="under load; below it the vehicle aborts before its flip")

    @model_validator(mode="after")
    def _falling(self) -> Self:
        names = ("full_V", "rest_V_min", "hover_V_min", "load_V_min")
        for upper, lower in itertools.pairwise(names):
            if not getattr(self, lower) < getattr(self, upper):
                raise ValueError(
                    f"battery.{lower}: value {getattr(self, lower):g} V (allowed below {upper} "
                    f"{getattr(self, upper):g} V)"
                )
        return self


class Cues(Strict):
    """What the cues depend on at this site; null: as the vehicle file says, an assumption."""

    latency_s: Annotated[Finite, Field(ge=0.0, le=0.2)] | None = Field(
        default=None, description="age of a pose when it is used"
    )
    plane_above_m: Annotated[Finite, Field(ge=-0.1, le=0.1)] | None = Field(
        default=None, description="plane that the cues refer to, above the board's underside"
    )


MEASURED = (
    "surface.height_m", "surface.landing_point_m", "surface.heading_deg", "surface.before_m", "surface.beyond_m",
    "surface.left_m", "surface.right_m", "fence.x_m", "fence.y_m", "fence.z_m", "home_m", "emergency_m", "vehicle",
    "battery.rest_V_min",
)  # fmt: skip
"""Fields that somebody has to measure, and that `not_measured` may name."""


class SiteFile(Strict):
    """A room as measured, and what was agreed for flying in it."""

    name: Name
    doc: str = Field(min_length=1)
    surface: SurfacePlace
    fence: Fence
    home_m: Place = Field(description="where the vehicle stands before a flight, in W")
    emergency_m: Place = Field(description="where it lands when a flight is stopped in the hover, in W")
    mocap: MocapConfig | None = Field(description="tracking system; null: the vehicle is told poses by others")
    link: str = Field(min_length=1, description="link of the vehicle; `--uri site` is this one")
    vehicle: str = Field(min_length=1, description="vehicle file, as identified from its own flights")
    battery: Battery
    cues: Cues = Cues()
    judge: Literal["operator", "tracking"] = Field(description="who says how a landing ended")
    stop: Literal["level_out", "motors_off"] = Field(description="what a stop in flight does")
    not_measured: list[str] = Field(default_factory=list, description="fields whose value is still a guess")

    @model_validator(mode="after")
    def _knows_what_is_not_measured(self) -> Self:
        for name in self.not_measured:
            if name not in MEASURED:
                near = yamlfile.did_you_mean(name, MEASURED, at_any_distance=True)
                raise ValueError(f"not_measured: value {name!r} is no field that is measured{near}")
        return self

    @model_validator(mode="after")
    def _turns_only_what_it_tracks(self) -> Self:
        """Poses that others tell the vehicle are not turned: then W is their frame."""
        surface = self.surface
        if self.mocap is None and (any(surface.landing_point_m) or surface.heading_deg):
            raise ValueError(
                "surface.landing_point_m and surface.heading_deg: without mocap nobody here turns the poses "
                "(allowed [0.0, 0.0] and 0.0: the origin and the x axis of whoever tells them)"
            )
        return self

    @property
    def is_simulated(self) -> bool:
        """Whether its tracking system sees no real vehicle."""
        return self.mocap is not None and self.mocap.system in SIMULATED_TRACKING

    @property
    def heading_rad(self) -> float:
        """Direction of the approach, from the x axis of the tracking system towards its y axis."""
        return math.radians(self.surface.heading_deg)

    def to_tracking(self, x_m: float, y_m: float) -> tuple[float, float]:
        """A place in W in the axes of the tracking system, m."""
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        x0, y0 = self.surface.landing_point_m
        return x0 + cos * x_m - sin * y_m, y0 + sin * x_m + cos * y_m


def load(path: str) -> SiteFile:
    """Read and check a site file.

    Raises:
        ConfigError: One line naming file, field and value.
    """
    file = Path(path)
    if not file.is_file():
        raise ConfigError(f"--site {path}: no such file; make one with: ivl site new {path}")
    data = yamlfile.read(file)
    if isinstance(data, dict):
        references.resolve(data, file.parent)
    return yamlfile.validate(SiteFile, data, file.name)
