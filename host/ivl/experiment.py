"""An experiment: what is flown, what learns, and how success is judged; YAML in, one checked object out.

`load("experiments/paper_vertical.yaml", ["learner.options.shrink_min=0.8", "sense.latency=0.01"])` reads a file (a
path as given, else inside this package), applies settings, and checks everything, the vehicle parameters among them
included.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, model_validator

from ivl import family, forms, references, yamlfile
from ivl.belief.recording import Flight
from ivl.errors import ArgumentError, ConfigError, LearnerError
from ivl.learners import Learner, make_learner
from ivl.rewards import RewardChoice
from ivl.settings import PACKAGE_DIR, Finite, Name, Strict, apply_setting, check_overrides, locate, read_mapping
from ivl.site import file as site_file
from ivl.site import place
from ivl.task import Task
from ivl.world import World

EXPERIMENTS_DIR = PACKAGE_DIR / "experiments"
GRID_DIMENSIONS_MAX = 2
"""The best possible policy of a form with more parameters is looked for without a grid."""

Bounds = Annotated[list[Finite], Field(min_length=2, max_length=2)]


class PolicyParameter(Strict):
    """Where the search for one policy parameter starts, and its bounds."""

    mu0: Finite
    sigma0: Finite = Field(gt=0)
    bounds: Bounds


class PerParameter(Strict):
    """Base of what has one field for each parameter of the policy's form, beside its own fields."""

    model_config = ConfigDict(strict=True, extra="allow", frozen=True)
    __pydantic_extra__: dict[str, Any] = Field(init=False)

    @classmethod
    def further_paths(cls) -> dict[str, bool]:
        """Paths of the fields that any form gives, as `yamlfile.paths` tells them."""
        names = [name for form in forms.forms().values() for name in form.names]
        below = yamlfile.paths(PolicyParameter) if cls is Policy else {}
        return {path: False for name in names for path in (name, *(f"{name}.{field}" for field in below))}

    def of(self, form: forms.Form, where: str) -> list[Any]:
        """The fields of a form's parameters, in its order.

        Raises:
            ConfigError: One is missing, or one is of no parameter.
        """
        given = self.__pydantic_extra__
        missing = [name for name in form.names if name not in given]
        unknown = [name for name in given if name not in form.names]
        if missing or unknown:
            what = f"{unknown[0]}: no such field" if unknown else f"{missing[0]}: must be given"
            raise ConfigError(f"{where}.{what} (the form {form.name} has {', '.join(form.names)})")
        return [given[name] for name in form.names]


class Policy(PerParameter):
    """The learned parameters: a form of the flight core, and for each of its parameters where the search begins."""

    __pydantic_extra__: dict[str, PolicyParameter] = Field(init=False)
    form: str = Field(default=forms.PAPER, description="form of the policy")

    @property
    def shape(self) -> forms.Form:
        """The form, as the flight core describes it."""
        return forms.by_name(self.form)

    @property
    def parameters(self) -> list[PolicyParameter]:
        """Where the search for each parameter begins, in the order of every theta."""
        found: list[PolicyParameter] = self.of(self.shape, "policy")
        return found

    @property
    def mu0(self) -> list[float]:
        """Where the search begins, one value a parameter."""
        return [p.mu0 for p in self.parameters]

    @property
    def bounds(self) -> list[list[float]]:
        """Bounds of the search, one pair a parameter."""
        return [p.bounds for p in self.parameters]


class LearnerChoice(Strict):
    """A learner by name, with options that differ from its defaults."""

    name: str
    options: dict[str, Any] = Field(default_factory=dict)


class GridAxis(Strict):
    """One axis of the grid on which the best possible policy is looked for."""

    lo: Finite
    hi: Finite
    step: Finite = Field(gt=0)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.lo < self.hi:
            raise ValueError(f"lo {self.lo} must be below hi {self.hi}")
        return self


class Check(Strict):
    """How "solved" is judged: see `ivl.assess`."""

    n_fresh: int = Field(default=200, ge=1, le=100_000, description="rollouts that judge one recommended policy")
    share_of_best: Finite = Field(default=0.9, gt=0, le=1, description="share of the best possible rate that solves")
    effort: Finite = Field(default=1.0, gt=0, le=100, description="factor on the rollouts of the search for the best")
    grid: dict[str, GridAxis] = Field(
        default_factory=dict, description="grid of the search, by parameter; none: spans the bounds of the policy"
    )


class Flown(PerParameter):
    """Policies that landed on a real vehicle: drawn beside what is learned, known to no learner."""

    __pydantic_extra__: dict[str, Bounds] = Field(init=False)
    label: str = Field(min_length=1)
    source: str = Field(min_length=1)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for name, (lo, hi) in self.__pydantic_extra__.items():
            if not lo <= hi:
                raise ValueError(f"{name}: {lo} must not be above {hi}")
        return self


def _site(path: str) -> str:
    if not references.is_path(path):
        raise ValueError("expected the path of a site file, such as lab.yaml; make one with: ivl site new lab.yaml")
    return path


class Named(Strict):
    """What a file calls itself."""

    name: Name = Field(description="Run folders are named after it.")
    doc: str = Field(min_length=1, description="What it is, in a line.")


class Experiment(Task, Named):
    """A complete, checked experiment; `to_yaml` gives the text from which the same object is read."""

    start: Literal["imparted", "flown"] = Field(
        default="imparted", description="At the approach velocity, or from hover."
    )
    policy: Policy = Field(description="What is learned: a form, and where the search for each of its numbers begins.")
    learner: LearnerChoice = Field(description="Who learns; see `ivl list learners`, or module:name of your own.")
    n_rollouts: int = Field(
        default=8, ge=1, le=10_000, description="Rollouts of an episode, before the learner is told."
    )
    budget: int = Field(default=160, ge=1, le=1_000_000, description="Rollouts in all; a multiple of n_rollouts.")
    reward: RewardChoice = Field(
        default=RewardChoice(), description="What is paid for; see `ivl list rewards`, or module:name of your own."
    )
    check: Check = Field(default=Check(), description="How it is judged whether the task is solved.")
    flown: list[Flown] = Field(default_factory=list, description="real flights to draw beside the learning")
    site: Annotated[str, AfterValidator(_site)] | None = Field(
        default=None, description="site file of the room in which a drone flies it"
    )
    seed: int = Field(default=0, ge=0, lt=2**63, description="Seed of learner and world.")

    @model_validator(mode="after")
    def _whole_episodes(self) -> Self:
        if self.budget % self.n_rollouts:
            raise ValueError(f"budget {self.budget} is not a multiple of n_rollouts {self.n_rollouts}")
        return self

    @property
    def n_episodes(self) -> int:
        """Episodes of `n_rollouts` that the budget pays for."""
        return self.budget // self.n_rollouts

    @property
    def flight(self) -> Flight:
        """What every rollout of the experiment has in common."""
        return Flight(self.speed_mps, self.angle_deg, self.policy.form, self.start, np.array(self.policy.bounds))

    def trial(self, number: int) -> "Experiment":
        """Trial `number` of the experiment: its seed + number, and the member of the family that flies there."""
        return self.model_copy(update={"seed": self.seed + number, "family": self.family.of_trial(number)})

    def trial_worlds(self, n_trials: int) -> list[World]:
        """The worlds that the trials fly in: one for each trial if they have vehicles of their own, else one for all.

        Raises:
            ConfigError: As `ivl.family.of` and `Family.sample`.
        """
        if not self.family.is_each:
            return [self.make_world()]
        self.family.of_trial(n_trials - 1)
        return family.flown(self.nominal_world_of(self.gear), self.family, n_trials)

    def make_learner(self, seed: int) -> Learner:
        """A new learner at the start of its search."""
        parameters = self.policy.parameters
        return make_learner(
            self.learner.name,
            [p.mu0 for p in parameters],
            [p.sigma0 for p in parameters],
            bounds=[p.bounds for p in parameters],
            n_rollouts=self.n_rollouts,
            seed=seed,
            **self.learner.options,
        )

    def to_yaml(self) -> str:
        """The resolved experiment, every default written out."""
        return yamlfile.dump(self.model_dump(mode="json"))


def list_experiments() -> list[str]:
    """Experiments that ship with the package, as paths that `load` takes; those of `ivl.policy` are not among them."""
    return [f"experiments/{path.name}" for path in sorted(EXPERIMENTS_DIR.glob("*.yaml")) if not _is_general(path)]


def list_general() -> list[str]:
    """Experiments for every approach that ship with the package, as paths that `ivl.policy.general.load` takes."""
    return [f"experiments/{path.name}" for path in sorted(EXPERIMENTS_DIR.glob("*.yaml")) if _is_general(path)]


def _is_general(path: Path) -> bool:
    return path.name.startswith("general")


def load(
    path: str, settings: Sequence[str] = (), change: Callable[[dict[str, Any]], None] | None = None, **replacements: Any
) -> Experiment:
    """Read, change and check an experiment.

    Args:
        path: A file; if it does not exist, the same path inside the package, or the bare name of one there.
        settings: "a.b=value" each: a field of the experiment, or a world parameter such as "sense.latency=0.01".
        change: Changes the raw data before settings and replacements do.
        **replacements: Fields to replace; None leaves what the file says. `learner` takes a name and drops the options.

    Raises:
        ConfigError: One line naming file, field and value.
    """
    data, label = read(path)
    if change is not None:
        change(data)
    replace(data, replacements)
    for setting in settings:
        apply_setting(data, setting, Experiment, label)
    return from_data(data, label)


def read(path: str) -> tuple[dict[str, Any], str]:
    """The raw data of an experiment's file, and what errors call the file (path and errors as `load`)."""
    file = locate(path, list_experiments())
    data = read_mapping(file)
    if "tasks" in data:
        raise ConfigError(f"{file.name}: tasks: an experiment for every approach; learn it with ivl policy learn")
    return data, file.name


def replace(data: dict[str, Any], replacements: Mapping[str, Any]) -> None:
    """Replace fields of raw data; None leaves what is there, `learner` is a name and drops the options."""
    for name, value in replacements.items():
        if value is not None:
            value = references.absolute(value, Path.cwd()) if name in references.FIELDS else value  # noqa: PLW2901
            data[name] = {"name": value} if name == "learner" else value


def from_data(data: Any, label: str) -> Experiment:
    """Check plain data; `label` names it in errors."""
    experiment = yamlfile.validate(Experiment, data, label)
    check_overrides(experiment.overrides, label)
    if experiment.site is not None:
        experiment = place.at(experiment, site_file.load(experiment.site), Path(experiment.site).name)
    check_policy(experiment, label)
    try:
        experiment.make_learner(seed=0)
    except LearnerError as error:
        raise ConfigError(f"{label}: {error}") from error
    return experiment


def check_policy(experiment: Experiment, label: str) -> None:
    """Check everything that names parameters of the policy against its form; `label` names the file in errors."""
    try:
        form = experiment.policy.shape
        for p, search in zip(form.params, experiment.policy.parameters, strict=True):
            lo, hi = search.bounds
            if not p.lo <= lo < hi <= p.hi:
                raise ConfigError(
                    f"policy.{p.name}.bounds: [{lo:g}, {hi:g}] "
                    f"(the form {form.name} allows within {p.lo:g} .. {p.hi:g} {p.unit})"
                )
            if not lo <= search.mu0 <= hi:
                raise ConfigError(
                    f"policy.{p.name}.mu0: value {search.mu0!r} is out of range (allowed {lo:g} .. {hi:g} {p.unit})"
                )
        for flown in experiment.flown:
            flown.of(form, f"flown.{flown.label}")
        for name in experiment.check.grid:
            if name not in form.names or form.n > GRID_DIMENSIONS_MAX:
                allowed = ", ".join(form.names) if form.n <= GRID_DIMENSIONS_MAX else "none: the form has too many"
                raise ConfigError(f"check.grid.{name}: no axis of this name (allowed {allowed})")
    except (ArgumentError, ConfigError) as error:
        raise ConfigError(f"{label}: {error}") from error
