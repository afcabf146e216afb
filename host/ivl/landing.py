"""One landing by its specification: a world and the arguments of one rollout, from a YAML file, a run, or code.

    spec = LandingSpec(gear="wide_long", speed_mps=3.0, angle_deg=60.0, rrev_c_per_s=4.0, moment_y_Nmm=7.0)
    world, trace = spec.fly()

The fields are the options of `ivl rollout`. Equal specifications give the same bits, today and in a report years later.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from ivl import model, yamlfile
from ivl.experiment import Experiment
from ivl.seeds import Purpose, derive
from ivl.world import Trace, World

TRACE_PERIOD_S = 0.001
"""Finest useful period: rows come once a tick of the flight core at the most."""

Finite = Annotated[float, Field(allow_inf_nan=False)]


class LandingSpec(BaseModel):
    """What is flown; the simulator checks the ranges."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    vehicle: str = "habas2021"
    gear: str = "wide_short"
    gear_set: str = model.DEFAULT_GEAR_SET
    sensing: str | None = None
    overrides: dict[str, float] = Field(default_factory=dict)
    speed_mps: Finite
    angle_deg: Finite
    rrev_c_per_s: Finite
    moment_y_Nmm: Finite
    start: Literal["imparted", "flown", "at_trigger"] = "imparted"
    d_ceil_m: Finite | None = None
    seed: int = Field(default=0, ge=0, lt=2**64)
    stream: int = Field(default=0, ge=0, lt=2**64)

    def make_world(self) -> World:
        """The world that the landing is flown in."""
        return World(self.vehicle, self.gear, self.gear_set, self.sensing, **self.overrides)

    def fly(self, world: World | None = None, period_s: float = TRACE_PERIOD_S) -> tuple[World, Trace]:
        """Fly it and record the time series; a world that exists already saves building one."""
        world = world or self.make_world()
        trace = world.trace(
            self.speed_mps,
            self.angle_deg,
            self.rrev_c_per_s,
            self.moment_y_Nmm,
            seed=self.seed,
            start=self.start,
            d_ceil_m=self.d_ceil_m,
            stream=self.stream,
            period_s=period_s,
        )
        return world, trace


def load(path: Path) -> LandingSpec:
    """Read a specification from a YAML file.

    Raises:
        ConfigError: One line naming file, field and value.
    """
    return yamlfile.validate(LandingSpec, yamlfile.read(path), path.name)


def of_rollout(experiment: Experiment, trial: int, theta: tuple[float, float], stream: int) -> LandingSpec:
    """The specification of one rollout of a learning run: trial t flies with the seed of the run plus t."""
    return LandingSpec(
        vehicle=experiment.vehicle,
        gear=experiment.gear,
        gear_set=experiment.gear_set,
        sensing=experiment.sensing,
        overrides=experiment.world_settings(),
        speed_mps=experiment.speed_mps,
        angle_deg=experiment.angle_deg,
        rrev_c_per_s=theta[0],
        moment_y_Nmm=theta[1],
        start=experiment.start,
        seed=derive(experiment.seed + trial, Purpose.WORLD),
        stream=stream,
    )
