"""An experiment: what is flown, what learns, and how success is judged; YAML in, one checked object out.

`load("experiments/paper_vertical.yaml", ["learner.options.shrink_min=0.8", "sense.latency=0.01"])` reads a file (a
path as given, else inside this package), applies settings, and checks everything, the vehicle parameters among them
included.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ivl import model, native, sensing, yamlfile
from ivl.errors import ConfigError, LearnerError
from ivl.learners import Learner, make_learner
from ivl.rewards import RewardChoice
from ivl.world import World

PACKAGE_DIR = Path(__file__).parent
EXPERIMENTS_DIR = PACKAGE_DIR / "experiments"
POLICY = ("rrev_c_per_s", "moment_y_Nmm")
"""Names of the two policy parameters, in the order of every theta."""

Finite = Annotated[float, Field(allow_inf_nan=False)]
Bounds = Annotated[list[Finite], Field(min_length=2, max_length=2)]


class Strict(BaseModel):
    """Base of what is read from YAML: no conversion, no unknown key, no change afterwards."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class Setting(Strict):
    """A world parameter that this experiment changes."""

    value: float
    unit: str = Field(min_length=1)
    source: str = Field(min_length=1)


class PolicyParameter(Strict):
    """Where the search for one policy parameter starts, and its bounds."""

    mu0: Finite
    sigma0: Finite = Field(gt=0)
    bounds: Bounds


class Policy(Strict):
    """The learned parameters: trigger threshold RREV_c (1/s) and moment M_yd (N mm)."""

    rrev_c_per_s: PolicyParameter
    moment_y_Nmm: PolicyParameter


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
    rrev_c_per_s: GridAxis = GridAxis(lo=0.5, hi=10.0, step=0.05)
    effort: Finite = Field(default=1.0, gt=0, le=100, description="factor on the rollouts of the search for the best")
    moment_y_Nmm: GridAxis = GridAxis(lo=1.0, hi=11.0, step=0.5)


class Flown(Strict):
    """Policies that landed on a real vehicle: drawn beside what is learned, known to no learner."""

    label: str = Field(min_length=1)
    rrev_c_per_s: Bounds
    moment_y_Nmm: Bounds
    source: str = Field(min_length=1)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for name in POLICY:
            lo, hi = getattr(self, name)
            if not lo <= hi:
                raise ValueError(f"{name}: {lo} must not be above {hi}")
        return self


class Experiment(Strict):
    """A complete, checked experiment; `to_yaml` gives the text from which the same object is read."""

    name: str = Field(min_length=1, pattern=r"^[A-Za-z0-9_.-]+$")
    doc: str = Field(min_length=1)
    vehicle: str
    gear: str
    gear_set: str = model.DEFAULT_GEAR_SET
    speed_mps: Finite = Field(gt=0)
    angle_deg: Finite
    start: Literal["imparted", "flown"] = "imparted"
    sensing: str | None = Field(default=None, description="sensor set that replaces the vehicle's own sensing")
    approach: Literal["accelerate_hold", "constant_acceleration", "constant_rrev"] = "accelerate_hold"
    estimator: (
        Literal["known_height", "known_height_predicted", "formula", "formula_unguarded", "kalman", "range"] | None
    ) = Field(default=None, description="source of the distance; None: as vehicle or sensor set say")
    overrides: dict[str, Setting] = Field(default_factory=dict)
    policy: Policy
    learner: LearnerChoice
    n_rollouts: int = Field(default=8, ge=1, le=10_000)
    budget: int = Field(default=160, ge=1, le=1_000_000)
    reward: RewardChoice = RewardChoice()
    check: Check = Check()
    flown: list[Flown] = Field(default_factory=list, description="real flights to draw beside the learning")
    seed: int = Field(default=0, ge=0, lt=2**63)

    @model_validator(mode="after")
    def _whole_episodes(self) -> Self:
        if self.budget % self.n_rollouts:
            raise ValueError(f"budget {self.budget} is not a multiple of n_rollouts {self.n_rollouts}")
        return self

    @property
    def n_episodes(self) -> int:
        """Episodes of `n_rollouts` that the budget pays for."""
        return self.budget // self.n_rollouts

    def world_settings(self) -> dict[str, float]:
        """World parameters that differ from what vehicle, gear and sensor set say."""
        overrides = {name: setting.value for name, setting in self.overrides.items()}
        return {**sensing.approach_settings(self.approach), **sensing.estimator_settings(self.estimator), **overrides}

    def make_world(self) -> World:
        """The world that this experiment flies in."""
        return World(self.vehicle, self.gear, self.gear_set, self.sensing, **self.world_settings())

    def make_learner(self, seed: int) -> Learner:
        """A new learner at the start of its search."""
        parameters = [getattr(self.policy, name) for name in POLICY]
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
    """Experiments that ship with the package, as paths that `load` takes."""
    return [f"experiments/{path.name}" for path in sorted(EXPERIMENTS_DIR.glob("*.yaml"))]


def load(path: str, settings: Sequence[str] = (), **replacements: Any) -> Experiment:
    """Read, change and check an experiment.

    Args:
        path: A file; if it does not exist, the same path inside the package.
        settings: "a.b=value" each: a field of the experiment, or a world parameter such as "sense.latency=0.01".
        **replacements: Fields to replace; None leaves what the file says. `learner` takes a name and drops the options.

    Raises:
        ConfigError: One line naming file, field and value.
    """
    file = locate(path, list_experiments())
    data = yamlfile.read(file)
    if not isinstance(data, dict):
        raise ConfigError(f"{file.name}: expected a mapping of fields, got {type(data).__name__}")
    for name, value in replacements.items():
        if value is not None:
            data[name] = {"name": value} if name == "learner" else value
    for setting in settings:
        apply_setting(data, setting)
    return from_data(data, file.name)


def from_data(data: Any, label: str) -> Experiment:
    """Check plain data; `label` names it in errors."""
    experiment = yamlfile.validate(Experiment, data, label)
    check_overrides(experiment.overrides, label)
    try:
        experiment.make_learner(seed=0)
    except LearnerError as error:
        raise ConfigError(f"{label}: {error}") from error
    return experiment


def parse_setting(setting: str) -> tuple[str, Any]:
    """Split "name=value"; the value is read as YAML."""
    name, equals, text = setting.partition("=")
    if not equals or not name.strip():
        raise ConfigError(f"--set {setting!r}: expected name=value, for example sense.latency=0.01")
    return name.strip(), yamlfile.parse(text, f"--set {setting}")


def locate(path: str, shipped: Sequence[str]) -> Path:
    """A file as given, else inside this package; `shipped` are the names that an error offers."""
    for candidate in (Path(path), PACKAGE_DIR / path):
        if candidate.is_file():
            return candidate
    raise ConfigError(f"{path}: no such file, neither here nor in the package (shipped: {', '.join(shipped)})")


def apply_setting(data: dict[str, Any], setting: str) -> None:
    """Write one setting into the raw data of an experiment or a sweep."""
    name, value = parse_setting(setting)
    table = native.library().params
    if name in table:
        checked = model.check_override(name, value)
        data["overrides"] = {**(data.get("overrides") or {})}
        data["overrides"][name] = {"value": checked, "unit": table[name].unit, "source": "set on the command line"}
        return
    *parents, last = name.split(".")
    if parents and parents[0] not in data and any(known.startswith(f"{parents[0]}.") for known in table):
        model.check_override(name, value)  # a slip in the name of a parameter, which this refuses with advice
    target = data
    for key in parents:
        target = target.setdefault(key, {})
        if not isinstance(target, dict):
            raise ConfigError(f"--set {setting}: {key} is a value, it has no field {last!r}")
    if parents and last == "name" and target.get(last) != value:
        target.pop("options", None)  # they belong to the reward or learner of the old name
    target[last] = value


def check_overrides(overrides: Mapping[str, Setting], label: str) -> None:
    """Check names, values and units of overrides; `label` names their file in errors."""
    for name, setting in overrides.items():
        try:
            model.check_override(name, setting.value)
        except ConfigError as error:
            raise ConfigError(f"{label}: {error}") from error
        unit = native.library().params[name].unit
        if setting.unit != unit:
            raise ConfigError(
                f"{label}: override: {name}: value {setting.value!r} has unit {setting.unit!r}, not {unit!r}"
            )
