"""Sweep files: a task, and the paths of it that are varied; YAML in, one checked object out.

    sweep = load_sweep("sweeps/paper.yaml", ["gear_set=table1"], ["learner.name=ephe,bo", "sensing=camera50,mocap"])

Any field of an experiment and any parameter of the world can be varied (`vary: {sense.latency: [0.0, 0.02]}`); gears,
speeds and angles have short fields of their own. A *variant* is one value of each varied path but these three;
`Sweep.at` gives the sweep with the values in their fields.

A trial's random numbers follow from its name alone (`Sweep.run_seed`), so that results do not depend on how trials are
grouped, where and in which order they run, or how often a run was cut off. The learner is not part of the name: trials
of two learners are paired, like the seeds of `ivl learn`, and `ivl learn --seed RUN_SEED` repeats a trial.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

import numpy as np
from pydantic import BaseModel, Field, model_validator

from ivl import experiment, forms, model, native, references, yamlfile
from ivl.errors import ArgumentError, ConfigError, LearnerError
from ivl.experiment import (
    Bounds,
    Experiment,
    LearnerChoice,
    Named,
    PerParameter,
    Policy,
    PolicyParameter,
    check_policy,
)
from ivl.learners import LEARNERS
from ivl.rewards import RewardChoice
from ivl.seeds import Purpose, derive, derive_from_key
from ivl.settings import (
    PACKAGE_DIR,
    Finite,
    apply_setting,
    apply_value,
    check_overrides,
    check_path,
    locate,
    parse_setting,
    put,
    read_mapping,
)
from ivl.sweep.schema import column_of
from ivl.sweep.vary import (
    AXES,
    COUNT_MAX,
    Axis,
    Value,
    Varied,
    apply_vary,
    as_cell,
    is_flown,
    listed,
    put_varied,
    refuse_varied,
    text_of,
    values,
    world_name,
)
from ivl.task import Setup, Task
from ivl.world import World

SWEEPS_DIR = PACKAGE_DIR / "sweeps"
_SEED_HAS = ("vehicle", "gear_set")
"""Fields that the name of a cell contains, varied or not."""
_NEVER_VARIED = ("name", "doc", "seed", "check", "flown", "overrides")
"""Fields of an experiment that say nothing of a single cell; overrides are varied by the parameter's own path."""
_COLUMNS = ("policy.form", "reward.name")

Grid = TypeVar("Grid", bound="_Grid")


class _Grid(Setup, Named):
    """What a sweep and a map have in common: a task, and the paths that are varied."""

    gear: str | None = Field(default=None, description="the only landing gear; null: those of the other fields")
    speed_mps: Finite | None = Field(default=None, description="the only speed")
    angle_deg: Finite | None = Field(default=None, description="the only angle")
    gears: list[str] | None = Field(default=None, min_length=1, description="short for vary.gear; null: all of the set")
    speeds_mps: Axis | None = Field(default=None, description="short for vary.speed_mps")
    angles_deg: Axis | None = Field(default=None, description="short for vary.angle_deg")
    vary: dict[str, list[Value]] = Field(default_factory=dict, description="values by path, every one with every other")
    seed: int = Field(default=0, ge=0, lt=2**63)

    @model_validator(mode="before")
    @classmethod
    def _listed(cls, data: Any) -> Any:
        """Write the values of varied paths as lists."""
        if not isinstance(data, dict) or not isinstance(data.get("vary") or {}, dict):
            return data
        given = data.get("vary") or {}
        return {**data, "vary": {str(path): listed(str(path), value) for path, value in given.items()}}

    @model_validator(mode="after")
    def _in_range(self) -> Self:
        for path, short in AXES.items():
            given = [name for name in (path, short) if getattr(self, name) is not None]
            given += [f"vary.{path}"] if path in self.vary else []
            if len(given) > 1:
                raise ValueError(f"{path}: is given twice, by {given[0]} and by {given[1]}")
            if path == "gear":
                if self.gears is not None and len(set(self.gears)) < len(self.gears):
                    raise ValueError("gears: a value is given twice")
                continue
            if not given:
                raise ValueError(f"{short}: is missing (or {path} for one value, or vary.{path})")
            self._check_axis(path, given[0], self.axis(path))
        return self

    @staticmethod
    def _check_axis(path: str, name: str, given: list[Any]) -> None:
        entry = native.library().spec_fields[path]
        if len(set(given)) < len(given):
            raise ValueError(f"{name}: a value is given twice")
        for value in given:
            if not isinstance(value, float):
                raise ValueError(f"{name}: value {value!r} is not a number{yamlfile.number_hint(value)}")
            if not entry.lo <= value <= entry.hi:
                raise ValueError(f"{name}: {value!r} is out of range ({entry.lo:g} .. {entry.hi:g} {entry.unit})")

    def axis(self, path: str) -> list[Any]:
        """Values of one of `AXES`; none of the landing gear means all of the set."""
        if path in self.vary:
            return list(self.vary[path])
        short = getattr(self, AXES[path])
        if short is not None:
            return list(short) if path == "gear" else values(short)
        fixed = getattr(self, path)
        return [] if fixed is None else [fixed]

    def gear_names(self) -> list[str]:
        """Designs that are flown."""
        return self.axis("gear") or model.list_gears(self.gear_set)

    def approaches(self) -> list[tuple[float, float]]:
        """Speed (m/s) and angle (deg) of every cell."""
        return [(speed, angle) for speed in self.axis("speed_mps") for angle in self.axis("angle_deg")]

    def variants(self) -> list[Varied]:
        """Every combination of the varied paths that are none of `AXES`; one without any path if there are none.

        Tasks are numbered in this order, which for that reason does not depend on the order of the paths in a file.
        """
        paths = sorted(path for path in self.vary if path not in AXES)
        return [tuple(zip(paths, chosen, strict=True)) for chosen in product(*(self.vary[path] for path in paths))]

    def variant_of(self, row: Mapping[str, Any]) -> Varied:
        """The variant of a row of the tables, by its columns.

        Raises:
            ConfigError: The sweep has no such variant.
        """
        for varied in self.variants():
            if all(row[column_of(path)] == as_cell(_identity(path, value)) for path, value in varied):
                return varied
        raise ConfigError(f"{self.name}: a row of its tables is of no variant of the sweep")

    def n_gears(self) -> int:
        """Landing gears of all variants together."""
        return sum(len(self.at(varied).gear_names()) for varied in self.variants())

    def at(self, varied: Varied) -> Self:
        """The sweep or map at one value of each of `varied`: its fields have the values, `vary` names them.

        Raises:
            ConfigError: A value is wrong.
        """
        if not varied:
            return self
        data = self.model_dump()
        data["vary"] |= {path: [value] for path, value in varied}
        label = ", ".join(f"vary.{path}={text_of(value)}" for path, value in varied)
        for path, value in varied:
            put(data, path, value, "varied by the sweep", label)
        return yamlfile.validate(type(self), data, label)

    def make_world(self, gear: str) -> World:
        """The world of one landing gear, of a sweep or map with one variant."""
        (varied,) = self.variants()
        return self.at(varied).world_of(gear)

    def worlds(self) -> dict[str, World]:
        """Every world that is flown in, by the name that `world_name` gives it."""
        found: dict[str, World] = {}
        for varied in self.variants():
            grid = self.at(varied)
            for gear in grid.gear_names():
                name = world_name(gear, varied)
                found[name] = found[name] if name in found else grid.world_of(gear)
        return found

    def key(self, gear: str, speed_mps: float, angle_deg: float) -> str:
        """Name of a cell, from which its random numbers follow.

        What is flown is part of it as far as it is varied; how it is learned is not, so that learners are compared on
        the same random numbers.
        """
        vehicle, gear_set = references.identity(self.vehicle), references.identity(self.gear_set)
        name = f"{vehicle}|{gear_set}|{gear}|{float(speed_mps)!r}|{float(angle_deg)!r}"
        for path in sorted(self.vary):
            if path in AXES or path in _SEED_HAS or not is_flown(path):
                continue
            (value,) = self.vary[path]  # of one variant, see `at`
            name += f"|{path}={_identity(path, value)!r}"
        return name

    def to_yaml(self) -> str:
        """The resolved file, every default written out."""
        return yamlfile.dump(self.model_dump(mode="json"))


def _identity(path: str, value: Value) -> Value:
    """A varied value as tables and random numbers name it."""
    named: Value = references.identity(value) if path in references.FIELDS else value
    return named


class StartRange(PerParameter):
    """Where the search of each trial starts: mu0 is drawn from these ranges, by the trial's own random numbers."""

    __pydantic_extra__: dict[str, Bounds] = Field(init=False)


class Sweep(_Grid):
    """A complete, checked sweep: one learner, or each of several, over all cells."""

    start: Literal["imparted", "flown"] = "imparted"
    trials: int = Field(ge=1, le=COUNT_MAX, description="per cell")
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
        starts = [path for path in self.vary if re.fullmatch(r"policy\.\w+\.mu0", path)]
        if self.mu0_range is not None and starts:
            raise ValueError(f"vary: {starts[0]}: mu0_range draws the start of every trial")
        for name, parameter, (lo, hi) in self._starts():
            if not parameter.bounds[0] <= lo <= hi <= parameter.bounds[1]:
                raise ValueError(f"mu0_range.{name}: {[lo, hi]} must lie in order inside the bounds {parameter.bounds}")
        return self

    def _starts(self) -> list[tuple[str, PolicyParameter, list[float]]]:
        """Name, parameter and range of its start; none if the start is not drawn."""
        if self.mu0_range is None:
            return []
        try:
            form = self.policy.shape
            return list(zip(form.names, self.policy.parameters, self.mu0_range.of(form, "mu0_range"), strict=True))
        except (ArgumentError, ConfigError) as error:
            raise ValueError(str(error)) from error

    @property
    def n_episodes(self) -> int:
        """Episodes that the budget of a trial pays for."""
        return self.budget // self.n_rollouts

    def learner_names(self) -> list[str]:
        """Learners that are compared, or the one."""
        return [str(name) for name in self.vary.get("learner.name", [self.learner.name])]

    def run_seed(self, gear: str, speed_mps: float, angle_deg: float, trial: int) -> int:
        """The seed of one trial: that of the run of `ivl learn` which repeats it."""
        return derive_from_key(self.seed, f"{self.key(gear, speed_mps, angle_deg)}|{trial}")

    def experiment(self, gear: str, speed_mps: float, angle_deg: float, trial: int) -> Experiment:
        """The experiment that one trial is."""
        seed = self.run_seed(gear, speed_mps, angle_deg, trial)
        return Experiment(
            **self.setup(),
            name=self.name,
            doc=self.doc,
            gear=gear,
            speed_mps=speed_mps,
            angle_deg=angle_deg,
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
        drawn: dict[str, Any] = {}
        for name, parameter, (lo, hi) in self._starts():
            drawn[name] = parameter.model_copy(update={"mu0": float(rng.uniform(lo, hi))})
        return Policy(form=self.policy.form, **drawn)


class PolicyMap(_Grid):
    """A complete, checked policy map: flips commanded at once, at every point of a grid, without learning."""

    start: Literal["at_trigger"] = "at_trigger"
    d_ceil_m: Axis
    moment_Nmm: Axis
    n_rollouts: int = Field(default=8, ge=1, le=100_000, description="per point")

    @model_validator(mode="after")
    def _points_in_range(self) -> Self:
        self._check_axis("d_ceil_m", "d_ceil_m", values(self.d_ceil_m))
        moment, given = forms.by_name(forms.PAPER).params[-1], values(self.moment_Nmm)
        if not moment.lo <= min(given) <= max(given) <= moment.hi:
            raise ValueError(f"moment_Nmm: is out of range ({moment.lo:g} .. {moment.hi:g} {moment.unit})")
        return self

    def cell_seed(self, gear: str, speed_mps: float, angle_deg: float) -> int:
        """Seed of the random numbers of one cell's rollouts."""
        return derive(derive_from_key(self.seed, f"{self.key(gear, speed_mps, angle_deg)}|map"), Purpose.WORLD)


def list_sweeps() -> list[str]:
    """Sweep and map files that ship with the package, as paths that the loaders take."""
    return [f"sweeps/{path.name}" for path in sorted(SWEEPS_DIR.glob("*.yaml"))]


def load_sweep(
    path: str,
    settings: Sequence[str] = (),
    vary: Sequence[str] = (),
    change: Callable[[dict[str, Any]], None] | None = None,
    **replacements: Any,
) -> Sweep:
    """Read, change and check a sweep file.

    Args:
        path: As for `ivl.experiment.load`.
        settings: Likewise.
        vary: "a.b=x,y" each: values of a path, in place of what the file says of it.
        change: As for `ivl.experiment.load`.
        **replacements: As for `ivl.experiment.load`.

    Raises:
        ConfigError: One line naming file, field and value.
    """
    return _learnable(_load(Sweep, Experiment, path, settings, vary, replacements, change), Path(path).name)


def _learnable(sweep: Sweep, label: str) -> Sweep:
    """The sweep, whose variants can all be learned.

    Raises:
        ConfigError: One cannot.
    """
    for varied in sweep.variants():
        grid = sweep.at(varied)
        try:
            gear, (speed_mps, angle_deg) = grid.gear_names()[0], grid.approaches()[0]
            trial = grid.experiment(gear, speed_mps, angle_deg, trial=0)
            check_policy(trial, label)
            trial.make_learner(seed=0)
            if LEARNERS[trial.learner.name].cls.uses_simulator and trial.policy.form == forms.PAPER:
                raise LearnerError(
                    f"learner.name: {trial.learner.name} begins with simulated vehicles, a sweep has none"
                )
        except LearnerError as error:
            where = "".join(f"vary.{path}={text_of(value)}: " for path, value in varied)
            raise ConfigError(f"{label}: {where}{error}") from error
    return sweep


def load_map(path: str, settings: Sequence[str] = (), vary: Sequence[str] = (), **replacements: Any) -> PolicyMap:
    """Read, change and check a map file (arguments and errors as `load_sweep`)."""
    return _load(PolicyMap, Task, path, settings, vary, replacements)


def _load(
    kind: type[Grid], varied: type[BaseModel], path: str, settings: Sequence[str], vary: Sequence[str],
    replacements: dict[str, Any], change: Callable[[dict[str, Any]], None] | None = None,
) -> Grid:  # fmt: skip
    """Read a file; `varied` has the fields that may be varied."""
    data, label = read(path)
    if change is not None:
        change(data)
    experiment.replace(data, replacements)
    apply_vary(data, vary, label)
    for setting in settings:
        refuse_varied(data, parse_setting(setting)[0], f"{label}: --set {setting}")
        apply_setting(data, setting, kind, label)
    if replacements.get("learner") is not None:
        refuse_varied(data, "learner.name", f"{label}: --learner {replacements['learner']}")
    return _checked(kind, varied, data, label)


def read(path: str) -> tuple[dict[str, Any], str]:
    """The raw data of a sweep or map file, and what errors call it (path as for `ivl.experiment.load`)."""
    file = locate(path, list_sweeps())
    return read_mapping(file), file.name


def from_data(
    data: dict[str, Any], label: str, options: Mapping[str, Any], vary: Mapping[str, Any]
) -> Sweep | PolicyMap:
    """Change and check raw data: of a map, if it has the distances of one, else of a sweep.

    Args:
        data: As a file has it; changed in place.
        label: What errors call it.
        options: Values by dotted path.
        vary: Values by varied path, in place of what the data says of that path.

    Raises:
        ConfigError: One line naming label, field and value.
    """
    is_map = "d_ceil_m" in data
    kind: type[Sweep | PolicyMap] = PolicyMap if is_map else Sweep
    put_varied(data, vary, label)
    for name, value in options.items():
        refuse_varied(data, name, f"{label}: {name}")
        apply_value(data, name, value, kind, label, "given to ivl.sweep", name)
    if is_map:
        return _checked(PolicyMap, Task, data, label)
    return _learnable(_checked(Sweep, Experiment, data, label), label)


def _checked(kind: type[Grid], varied: type[BaseModel], data: dict[str, Any], label: str) -> Grid:
    """Raw data as a checked sweep or map."""
    grid = yamlfile.validate(kind, data, label)
    check_overrides(grid.overrides, label)
    for name in grid.vary:
        if name in _COLUMNS:
            raise ConfigError(f"{label}: vary: {name}: decides which columns a run has: sweep each value by itself")
        check_path(name, varied, f"{label}: vary", _NEVER_VARIED)
    try:
        _check_variants(grid)
    except ConfigError as error:
        raise ConfigError(f"{label}: {error}") from error
    return grid


def _check_variants(grid: _Grid) -> None:
    """Try every variant, and the files that varied values name."""
    read: dict[str, Callable[[str], object]] = {
        "vehicle": model.load_vehicle, "sensing": model.load_sensors, "gear_set": model.list_gears,
    }  # fmt: skip
    for path in read.keys() & grid.vary.keys():
        for name in grid.vary[path]:
            if isinstance(name, str):
                read[path](name)
    for varied in grid.variants():
        at = grid.at(varied)
        for gear in at.vary.get("gear", ()):
            model.load_gear(str(gear), at.gear_set)
