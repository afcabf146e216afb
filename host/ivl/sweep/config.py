"""Sweep files: what is flown over a grid of approaches and landing gears; YAML in, one checked object out.

    sweep = load_sweep("sweeps/paper.yaml", ["gear_set=table1"], learner="ephe")

A trial's random numbers follow from its name alone (`trial_seed`), so that results do not depend on how trials are
grouped, where and in which order they run, or how often a run was cut off. The learner is not part of the name: trials
of two learners are paired, like the seeds of `ivl learn`, and `ivl learn --seed RUN_SEED` repeats a trial.
"""

from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from ivl import experiment, model, native, yamlfile
from ivl.errors import ConfigError, LearnerError
from ivl.experiment import POLICY, Bounds, Experiment, Finite, LearnerChoice, Policy, Setting, Strict
from ivl.rewards import RewardChoice
from ivl.seeds import Purpose, derive, derive_from_key
from ivl.world import World

SWEEPS_DIR = experiment.PACKAGE_DIR / "sweeps"
_COUNT_MAX = 100_000

Grid = TypeVar("Grid", bound="_Grid")


class Range(Strict):
    """Equally spaced values, both ends included."""

    first: Finite
    last: Finite
    count: int = Field(ge=1, le=_COUNT_MAX)


Axis = Annotated[list[Finite], Field(min_length=1, max_length=_COUNT_MAX)] | Range


def values(axis: list[float] | Range) -> list[float]:
    """The values of an axis, rounded to what a person would have typed."""
    if isinstance(axis, Range):
        return [round(float(x), 9) for x in np.linspace(axis.first, axis.last, axis.count)]
    return [float(x) for x in axis]


class _Grid(Strict):
    """What a sweep and a map have in common: landing gears and approaches."""

    name: str = Field(min_length=1, pattern=r"^[A-Za-z0-9_.-]+$")
    doc: str = Field(min_length=1)
    vehicle: str
    gear_set: str = model.DEFAULT_GEAR_SET
    gears: list[str] | None = Field(default=None, min_length=1, description="designs of the gear set; null: all")
    speeds_mps: Axis
    angles_deg: Axis
    overrides: dict[str, Setting] = Field(default_factory=dict)
    seed: int = Field(default=0, ge=0, lt=2**63)

    @model_validator(mode="after")
    def _in_range(self) -> Self:
        table = native.library().spec_fields
        for axis in self.axes():
            given = values(getattr(self, axis))
            entry = table[{"speeds_mps": "speed_mps", "angles_deg": "angle_deg"}.get(axis, axis)]
            if len(set(given)) < len(given):
                raise ValueError(f"{axis}: a value is given twice")
            for value in given:
                if not entry.lo <= value <= entry.hi:
                    raise ValueError(f"{axis}: {value!r} is out of range ({entry.lo:g} .. {entry.hi:g} {entry.unit})")
        return self

    def axes(self) -> tuple[str, ...]:
        """Names of the fields that are axes of the grid."""
        return ("speeds_mps", "angles_deg")

    def gear_names(self) -> list[str]:
        """Designs that are flown."""
        return list(self.gears) if self.gears is not None else model.list_gears(self.gear_set)

    def make_world(self, gear: str) -> World:
        """The world of one landing gear."""
        overrides = {name: setting.value for name, setting in self.overrides.items()}
        return World(self.vehicle, gear, self.gear_set, None, **overrides)

    def approaches(self) -> list[tuple[float, float]]:
        """Speed (m/s) and angle (deg) of every cell."""
        return [(speed, angle) for speed in values(self.speeds_mps) for angle in values(self.angles_deg)]

    def key(self, gear: str, speed_mps: float, angle_deg: float) -> str:
        """Name of a cell, from which its random numbers follow."""
        return f"{self.vehicle}|{self.gear_set}|{gear}|{speed_mps!r}|{angle_deg!r}"

    def to_yaml(self) -> str:
        """The resolved file, every default written out."""
        return yamlfile.dump(self.model_dump(mode="json"))


class StartRange(Strict):
    """Where the search of each trial starts: mu0 is drawn from these ranges, by the trial's own random numbers."""

    rrev_c_per_s: Bounds
    moment_y_Nmm: Bounds


class Sweep(_Grid):
    """A complete, checked sweep: one learner over all cells."""

    trials: int = Field(ge=1, le=_COUNT_MAX, description="per cell")
    start: Literal["imparted", "flown"] = "imparted"
    policy: Policy
    mu0_range: StartRange | None = Field(default=None, description="null: every trial starts from policy.*.mu0")
    learner: LearnerChoice
    n_rollouts: int = Field(default=8, ge=1, le=10_000, description="per episode")
    budget: int = Field(default=160, ge=1, le=1_000_000, description="rollouts of a trial, at most")
    check_rollouts: int = Field(
        default=0, ge=0, le=100_000, description="fresh rollouts of each trial's recommendation, on top of the budget"
    )
    reward: RewardChoice = RewardChoice()
    keep_rollouts: bool = Field(default=False, description="store every rollout")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.budget % self.n_rollouts:
            raise ValueError(f"budget {self.budget} is not a multiple of n_rollouts {self.n_rollouts}")
        for name in POLICY if self.mu0_range else ():
            lo, hi = getattr(self.mu0_range, name)
            parameter = getattr(self.policy, name)
            if not parameter.bounds[0] <= lo <= hi <= parameter.bounds[1]:
                raise ValueError(f"mu0_range.{name}: {[lo, hi]} must lie in order inside the bounds {parameter.bounds}")
        return self

    @property
    def n_episodes(self) -> int:
        """Episodes that the budget of a trial pays for."""
        return self.budget // self.n_rollouts

    def run_seed(self, gear: str, speed_mps: float, angle_deg: float, trial: int) -> int:
        """The seed of one trial: that of the run of `ivl learn` which repeats it."""
        return derive_from_key(self.seed, f"{self.key(gear, speed_mps, angle_deg)}|{trial}")

    def experiment(self, gear: str, speed_mps: float, angle_deg: float, trial: int) -> Experiment:
        """The experiment that one trial is."""
        seed = self.run_seed(gear, speed_mps, angle_deg, trial)
        return Experiment(
            name=self.name,
            doc=self.doc,
            vehicle=self.vehicle,
            gear=gear,
            gear_set=self.gear_set,
            speed_mps=speed_mps,
            angle_deg=angle_deg,
            start=self.start,
            overrides=self.overrides,
            policy=self._policy(seed),
            learner=self.learner,
            n_rollouts=self.n_rollouts,
            budget=self.budget,
            reward=self.reward,
            seed=seed,
        )

    def _policy(self, seed: int) -> Policy:
        """The search's start, drawn if the sweep says so."""
        if self.mu0_range is None:
            return self.policy
        rng = np.random.Generator(np.random.PCG64(derive(seed, Purpose.START)))
        drawn = {}
        for name in POLICY:
            mu0 = float(rng.uniform(*getattr(self.mu0_range, name)))
            drawn[name] = getattr(self.policy, name).model_copy(update={"mu0": mu0})
        return Policy(**drawn)


class PolicyMap(_Grid):
    """A complete, checked policy map: flips commanded at once, at every point of a grid, without learning."""

    d_ceil_m: Axis
    moment_y_Nmm: Axis
    n_rollouts: int = Field(default=8, ge=1, le=100_000, description="per point")

    def axes(self) -> tuple[str, ...]:
        """Names of the fields that are axes of the grid."""
        return ("speeds_mps", "angles_deg", "d_ceil_m", "moment_y_Nmm")

    def cell_seed(self, gear: str, speed_mps: float, angle_deg: float) -> int:
        """Seed of the random numbers of one cell's rollouts."""
        return derive(derive_from_key(self.seed, f"{self.key(gear, speed_mps, angle_deg)}|map"), Purpose.WORLD)


def list_sweeps() -> list[str]:
    """Sweep and map files that ship with the package, as paths that the loaders take."""
    return [f"sweeps/{path.name}" for path in sorted(SWEEPS_DIR.glob("*.yaml"))]


def load_sweep(path: str, settings: list[str] | None = None, **replacements: Any) -> Sweep:
    """Read, change and check a sweep file (arguments and errors as `ivl.experiment.load`)."""
    sweep = _load(Sweep, path, settings or [], replacements)
    try:
        gear, (speed_mps, angle_deg) = sweep.gear_names()[0], sweep.approaches()[0]
        sweep.experiment(gear, speed_mps, angle_deg, trial=0).make_learner(seed=0)
    except LearnerError as error:
        raise ConfigError(f"{Path(path).name}: {error}") from error
    return sweep


def load_map(path: str, settings: list[str] | None = None, **replacements: Any) -> PolicyMap:
    """Read, change and check a map file (arguments and errors as `ivl.experiment.load`)."""
    return _load(PolicyMap, path, settings or [], replacements)


def _load(kind: type[Grid], path: str, settings: list[str], replacements: dict[str, Any]) -> Grid:
    file = experiment.locate(path, list_sweeps())
    data = yamlfile.read(file)
    if not isinstance(data, dict):
        raise ConfigError(f"{file.name}: expected a mapping of fields, got {type(data).__name__}")
    for name, value in replacements.items():
        if value is not None:
            data[name] = {"name": value} if name == "learner" else value
    for setting in settings:
        experiment.apply_setting(data, setting)
    grid = yamlfile.validate(kind, data, file.name)
    experiment.check_overrides(grid.overrides, file.name)
    return grid
