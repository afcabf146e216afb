"""One landing by its specification: a world and the arguments of one rollout, from a YAML file, a run, or code.

    spec = LandingSpec(gear="wide_long", speed_mps=3.0, angle_deg=60.0, theta=[4.0, 7.0])
    world, trace = spec.fly()

A landing is a task (`ivl.task`) with the policy and the random numbers of one rollout. Equal specifications give the
same bits, today and in a report years later.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pydantic import Field, model_validator

from ivl import forms, model, yamlfile
from ivl.errors import ArgumentError, ConfigError
from ivl.experiment import Experiment
from ivl.seeds import Purpose, derive
from ivl.settings import Finite, check_overrides, read_mapping
from ivl.task import Task, settings_of
from ivl.world import CANNOT_BEGIN, REFUSED, Trace, World

if TYPE_CHECKING:
    from ivl.camera.film import Film

TRACE_PERIOD_S = 0.001
"""Finest useful period: rows come once a tick of the flight core at the most."""


class LandingSpec(Task):
    """What is flown; the simulator checks the ranges."""

    vehicle: str = model.DEFAULT_VEHICLE
    gear: str = model.DEFAULT_GEAR
    form: str = Field(default=forms.PAPER, description="Form of the policy; see `ivl list forms`.")
    theta: list[Finite] = Field(min_length=1, description="Parameters of the policy, in the form's order and units.")
    d_ceil_m: Finite | None = Field(default=None, description="Distance to the ceiling at the start, m.")
    seed: int = Field(default=0, ge=0, lt=2**64)
    stream: int = Field(default=0, ge=0, lt=2**64)

    @model_validator(mode="before")
    @classmethod
    def _with_units(cls, data: Any) -> Any:
        """Parameters of the policy may stand under their names; one of the world may be a number alone."""
        if not isinstance(data, dict):
            return data
        data = _in_order(data)
        overrides = data.get("overrides")
        if not isinstance(overrides, dict):
            return data
        plain = {name: value for name, value in overrides.items() if isinstance(value, (int, float))}
        try:
            return {**data, "overrides": {**overrides, **settings_of(plain, "the specification")}}
        except ConfigError as error:
            raise ValueError(str(error)) from error

    @model_validator(mode="after")
    def _is_of_its_form(self) -> Self:
        forms.by_name(self.form).to_si(self.theta)
        return self

    @property
    def policy(self) -> dict[str, float]:
        """The parameters of the policy by the names that the form gives them."""
        return dict(zip(forms.by_name(self.form).names, self.theta, strict=True))

    def fly(self, world: World | None = None, period_s: float = TRACE_PERIOD_S) -> tuple[World, Trace]:
        """Fly it and record the time series; a world that exists already saves building one.

        Raises:
            ArgumentError: It cannot begin.
        """
        world = world or self.make_world()
        trace = world.trace(
            self.speed_mps,
            self.angle_deg,
            *self.theta,
            form=self.form,
            seed=self.seed,
            start=self.start,
            d_ceil_m=self.d_ceil_m,
            stream=self.stream,
            period_s=period_s,
        )
        if world.end_reason(trace.outcome["end_reason"]) == REFUSED:
            raise ArgumentError(f"this landing cannot begin: {CANNOT_BEGIN}")
        return world, trace

    def film(self, world: World) -> "Film":
        """Fly it again, and keep what its camera saw, pictures included.

        Raises:
            ConfigError: The sensor set has no camera.
        """
        from ivl.camera import film  # which scipy takes a while to load for

        return film.shoot(
            world, self.speed_mps, self.angle_deg, *self.theta, pictures=True,
            form=self.form, seed=self.seed, start=self.start, d_ceil_m=self.d_ceil_m, stream=self.stream,
        )  # fmt: skip


def _in_order(data: dict[str, Any]) -> dict[str, Any]:
    """The data with `theta` in place of parameters under their names, of which all or none must be there."""
    form = forms.by_name(str(data.get("form", forms.PAPER)))
    names = form.names
    given, missing = [name for name in names if name in data], [name for name in names if name not in data]
    if not given:
        return data
    if "theta" in data:
        raise ValueError(f"theta: already given by {given[0]}")
    if missing:
        raise ValueError(f"{missing[0]}: is missing (the form {form.name} has {', '.join(names)})")
    for name in names:
        if isinstance(data[name], bool) or not isinstance(data[name], (int, float)):
            raise ValueError(f"{name}: value {data[name]!r} is not a number{yamlfile.number_hint(data[name])}")
    return {**{name: v for name, v in data.items() if name not in names}, "theta": [data[name] for name in names]}


def load(path: Path) -> LandingSpec:
    """Read a specification from a YAML file.

    Raises:
        ConfigError: One line naming file, field and value.
    """
    spec = yamlfile.validate(LandingSpec, read_mapping(path), path.name)
    check_overrides(spec.overrides, path.name)
    return spec


def of_rollout(experiment: Experiment, trial: int, theta: Sequence[float], stream: int) -> LandingSpec:
    """The specification of one rollout of a trial of a learning run (`Experiment.trial`)."""
    own = experiment.trial(trial)
    return LandingSpec(
        **own.task(),
        form=own.policy.form,
        theta=list(theta),
        seed=derive(own.seed, Purpose.WORLD),
        stream=stream,
    )
