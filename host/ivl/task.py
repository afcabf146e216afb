"""What is flown: a vehicle with its gear and sensors, and the approach that it makes. Nothing else spells it.

    task = Task(vehicle="habas2021", gear="wide_long", sensing="camera50", estimator="kalman",
                speed_mps=3.0, angle_deg=60.0, start="flown")
    world = task.make_world()

An experiment is a task with a learner, a landing is a task with a policy, a sweep is a task with paths that it varies
(`ivl.experiment`, `ivl.landing`, `ivl.sweep.config`). A new field of the task goes into this file; `--set` and
`--vary` know it then, its option is a row of `ivl.cli.task_options`.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from ivl import model, native
from ivl.camera.textures import TEXTURES
from ivl.errors import ConfigError
from ivl.family import FamilyChoice, chosen_member
from ivl.sensing import APPROACHES, ESTIMATORS, approach_settings, estimator_settings
from ivl.settings import Finite, Setting, Strict
from ivl.world import World


def _approach(name: str) -> str:
    if name not in APPROACHES:
        raise ValueError(f"unknown approach (allowed {', '.join(APPROACHES)})")
    return name


def _estimator(name: str) -> str:
    if name not in ESTIMATORS:
        raise ValueError(f"unknown estimator (allowed {', '.join(ESTIMATORS)})")
    return name


class SurfaceChoice(Strict):
    """The plane that is landed on. Its normal (sin, 0, -cos) of the angle points into it, in the world."""

    angle_deg: Finite = Field(
        default=180.0, ge=0.0, le=180.0, description="Angle, degrees: 180 is a ceiling, 90 a wall ahead, 0 a floor."
    )
    along_mps: Finite = Field(
        default=0.0, ge=-5.0, le=5.0, description="Velocity of the surface forward along itself, m/s."
    )
    away_mps: Finite = Field(
        default=0.0, ge=-5.0, le=5.0, description="Velocity of the surface along its normal, m/s; below 0 it comes."
    )

    @model_validator(mode="before")
    @classmethod
    def _an_angle_alone(cls, data: Any) -> Any:
        """An angle may stand for the whole: of a surface at rest."""
        is_number = isinstance(data, (int, float)) and not isinstance(data, bool)
        return {"angle_deg": float(data)} if is_number else data

    def world_settings(self) -> dict[str, float]:
        """World parameters that differ from those of a ceiling at rest."""
        default = SurfaceChoice()
        names = {"angle_deg": "surface.angle", "along_mps": "surface.speed_along", "away_mps": "surface.speed_away"}
        return {name: getattr(self, own) for own, name in names.items() if getattr(self, own) != getattr(default, own)}


class Setup(Strict):
    """The part of a task that is no place in a grid: all but landing gear and approach velocity."""

    vehicle: str = Field(description="Vehicle; see `ivl list vehicles`.")
    gear_set: str = Field(default=model.DEFAULT_GEAR_SET, description="Set of landing gears.")
    sensing: str | None = Field(
        default=None, description="Sensor set in place of the vehicle's own sensing; see `ivl list sensors`."
    )
    texture: str | None = Field(
        default=None,
        description="Surface that a rendered camera sees, in place of the sensor set's: "
        f"{', '.join(TEXTURES)}, or a picture (.png).",
    )
    estimator: Annotated[str, AfterValidator(_estimator)] | None = Field(
        default=None,
        description=f"Source of the ceiling's distance, one of {', '.join(ESTIMATORS)}; "
        "by default as vehicle or sensor set say.",
    )
    approach: Annotated[str, AfterValidator(_approach)] = Field(
        default=APPROACHES[0], description=f"Shape of the approach, one of {', '.join(APPROACHES)}."
    )
    start: Literal["imparted", "flown", "at_trigger"] = Field(
        default="imparted", description="At the approach velocity, from hover, or at the trigger."
    )
    surface: SurfaceChoice = Field(
        default=SurfaceChoice(), description="Surface to land on by its angle: 180 ceiling, 90 wall, 0 floor."
    )
    overrides: dict[str, Setting] = Field(default_factory=dict, description="Parameters of the world that differ.")
    family: FamilyChoice = Field(
        default=FamilyChoice(), description="What is uncertain of all that, beside the sigma of the files."
    )

    @model_validator(mode="after")
    def _one_word_for_each(self) -> Self:
        """Refuse an override of what approach, estimator or surface say otherwise: one of them would do nothing."""
        said = {} if self.approach == APPROACHES[0] else approach_settings(self.approach)
        by_field = {
            "approach": said,
            "estimator": estimator_settings(self.estimator),
            "surface": self.surface.world_settings(),
        }
        for field, name, value in [(field, *item) for field, said in by_field.items() for item in said.items()]:
            override = self.overrides.get(name)
            if override is not None and override.value != value:
                said_by = f"{field} {getattr(self, field)!r}"
                raise ValueError(f"overrides.{name}: {override.value:g} contradicts {said_by}, which says {value:g}")
        return self

    @model_validator(mode="after")
    def _family_is_possible(self) -> Self:
        try:
            self.family.check()
        except ConfigError as error:
            raise ValueError(str(error)) from error
        return self

    def world_settings(self) -> dict[str, float]:
        """World parameters that differ from what vehicle, gear and sensor set say."""
        overrides = {name: setting.value for name, setting in self.overrides.items()}
        said = {**approach_settings(self.approach), **estimator_settings(self.estimator)}
        return {**said, **self.surface.world_settings(), **overrides}

    def world_of(self, gear: str) -> World:
        """The world of this set-up with one landing gear; that of a member if the family names one."""
        return chosen_member(self.nominal_world_of(gear), self.family)

    def nominal_world_of(self, gear: str) -> World:
        """The world of the files and overrides, whichever member flies."""
        return World(self.vehicle, gear, self.gear_set, self.sensing, self.texture, **self.world_settings())

    def setup(self) -> dict[str, Any]:
        """The fields of the set-up by name, to make another object of them."""
        return {name: getattr(self, name) for name in Setup.model_fields}


class Task(Setup):
    """A complete description of what is flown."""

    gear: str = Field(description="Landing gear; see `ivl list gears`.")
    speed_mps: Finite = Field(description="Approach speed, m/s.")
    angle_deg: Finite = Field(description="Approach angle to the surface, degrees: of a ceiling above the horizontal.")

    @model_validator(mode="after")
    def _in_range(self) -> Self:
        for name in ("speed_mps", "angle_deg"):
            check_range(name, getattr(self, name), f"{name}: value")
        return self

    def make_world(self) -> World:
        """The world that the task is flown in."""
        return self.world_of(self.gear)

    def task(self) -> dict[str, Any]:
        """The fields of the task by name, to make another object of them."""
        return {name: getattr(self, name) for name in Task.model_fields}


def check_range(name: str, value: float, what: str) -> None:
    """Refuse a value that the simulator's table of specifications does not allow.

    Args:
        name: Field of the table.
        value: The value.
        what: What the error says before the value.

    Raises:
        ValueError: It is out of range.
    """
    entry = native.library().spec_fields[name]
    if not entry.lo <= value <= entry.hi:
        raise ValueError(f"{what} {value!r} is out of range (allowed {entry.lo:g} .. {entry.hi:g} {entry.unit})")


def default_of(field: str) -> Any:
    """Value of a field of the task where a command names none; None if it must be named."""
    named = {"vehicle": model.DEFAULT_VEHICLE, "gear": model.DEFAULT_GEAR}
    entry = Task.model_fields[field]
    return named.get(field, None if entry.is_required() else entry.get_default())


def settings_of(values: Mapping[str, float], source: str) -> dict[str, Setting]:
    """Plain values of world parameters as overrides with their units.

    Raises:
        ConfigError: A name is unknown, or a value out of range.
    """
    checked = {name: model.check_override(name, value) for name, value in values.items()}
    return {name: Setting(value=value, unit=model.unit(name), source=source) for name, value in checked.items()}
