"""The experiment of a policy for every approach: what is flown, where, how it is learned. YAML in, one checked object.

`load(["experiments/general.yaml"], ["form=bilinear", "sensing=mocap"])`; further files add their tasks.
"""

from collections.abc import Sequence
from typing import Any

from pydantic import Field, model_validator

from ivl import experiment, native, yamlfile
from ivl.errors import ConfigError, IvlError
from ivl.experiment import Bounds, LearnerChoice, Named
from ivl.learners import make_learner
from ivl.policy.flying import Drawn, PolicyTask
from ivl.policy.region import RegionField
from ivl.policy.shape import General
from ivl.settings import Finite, Strict, apply_setting, check_overrides, locate, parse_setting, read_mapping


class MapSettings(Strict):
    """The map from which the search starts: thresholds and moments, each flown in cells of speed and angle."""

    n_speeds: int = Field(default=8, ge=2, le=100, description="cells along the speed")
    n_angles: int = Field(default=8, ge=2, le=100, description="cells along the angle")
    tau_s: Bounds = Field(default=[0.06, 0.46], description="least and largest 1 / threshold")
    n_thresholds: int = Field(default=50, ge=4, le=1000, description="thresholds, equal steps of 1 / threshold")
    moments_norm: list[Finite] = Field(
        default=[0.7, 0.85, 1.0], min_length=1, description="moments, in parts of what the front motors can do"
    )
    timing_s: Finite = Field(
        default=0.01, gt=0, le=0.1, description="the map is smoothed over this error of the trigger's instant"
    )

    @model_validator(mode="after")
    def _ordered(self) -> "MapSettings":
        if not 0 < self.tau_s[0] < self.tau_s[1]:
            raise ValueError(f"tau_s: value {self.tau_s} must be two rising numbers above 0")
        if not all(0 < moment <= 1.5 for moment in self.moments_norm):
            raise ValueError(f"moments_norm: value {self.moments_norm} (allowed above 0 .. 1.5)")
        return self


class SearchSettings(Strict):
    """The search from there: all candidates of an iteration fly the same new approaches."""

    n_candidates: int = Field(default=16, ge=2, le=1000, description="policies of an iteration")
    n_approaches: int = Field(
        default=250,
        ge=1,
        le=100_000,
        description="approaches of an iteration, in each region, for each vehicle",
    )
    n_iterations: int = Field(default=60, ge=0, le=100_000)
    spread_per_s: Finite = Field(default=0.4, gt=0, le=10, description="first spread of the candidates' thresholds")
    spread_moment_norm: Finite = Field(
        default=0.05, gt=0, le=1, description="first spread of the moment, in parts of what the front motors can do"
    )
    n_select: int = Field(
        default=2000, ge=1, le=1_000_000, description="approaches in each region that choose among start and end"
    )


class GoSettings(Strict):
    """Go / no-go: logistic regression of the landing over the point of decision."""

    region: RegionField = Field(description="approaches that it is learned on")
    n_approaches: int = Field(default=6000, ge=100, le=1_000_000)
    n_held_out: int = Field(default=3000, ge=100, le=1_000_000, description="other approaches that choose go_p_min")
    ridge: Finite = Field(default=1.0, gt=0, le=1000, description="weight of small coefficients, in flights")
    strikes_avoided_min: Finite = Field(default=0.75, ge=0, le=1, description="share of body strikes to be avoided")
    refused_good_max: Finite = Field(
        default=0.04, ge=0, le=1, description="share of approaches that may be refused although they would land"
    )


class GeneralExperiment(Named):
    """A complete, checked experiment."""

    form: str = Field(default="polynomial3", description="form of the policy; see `ivl list forms`")
    tasks: list[PolicyTask] = Field(min_length=1, description="what is flown; the objective is the mean")
    drawn: Drawn | None = Field(
        default=None, description="vehicles drawn in place of each task's; the objective is the mean over them, too"
    )
    regions: list[RegionField] = Field(min_length=1, description="box, plane, or limits of speed and angle")
    map: MapSettings = MapSettings()
    learner: LearnerChoice
    search: SearchSettings = SearchSettings()
    go: GoSettings
    seed: int = Field(default=0, ge=0, lt=2**63)


def load(paths: Sequence[str], settings: Sequence[str] = (), **replacements: Any) -> GeneralExperiment:
    """Read, change and check an experiment.

    Args:
        paths: Files; one that does not exist is looked for inside the package. Of those after the first the tasks
            alone count.
        settings: "a.b=value" each: a field of the first file, or of every task, or a parameter of every world.
        **replacements: Fields to replace; None leaves what the file says. `learner` takes a name.

    Raises:
        ConfigError: One line naming file, field and value.
    """
    files = [locate(path, experiment.list_general()) for path in paths]
    data = read_mapping(files[0])
    label = files[0].name
    if "tasks" not in data:
        raise ConfigError(f"{label}: tasks: is missing (an experiment for one approach is for ivl learn)")
    for file in files[1:]:
        more = read_mapping(file)
        if not isinstance(data.get("tasks"), list) or not isinstance(more.get("tasks"), list):
            raise ConfigError(f"{file.name}: tasks: a list of tasks is needed, in {label} as well")
        data["tasks"] = [*data["tasks"], *more["tasks"]]
    experiment.replace(data, replacements)
    for setting in settings:
        _apply(data, setting, label)
    return from_data(data, label)


def _apply(data: dict[str, Any], setting: str, label: str) -> None:
    """A field of the task, or a parameter of the world, is set in every task."""
    name, _ = parse_setting(setting)
    of_task = name.partition(".")[0] in PolicyTask.model_fields or name in native.library().params
    tasks = data.get("tasks")
    if not of_task or not isinstance(tasks, list) or not all(isinstance(task, dict) for task in tasks):
        apply_setting(data, setting, GeneralExperiment, label)
        return
    for task in tasks:
        apply_setting(task, setting, PolicyTask, label)


def from_data(data: Any, label: str) -> GeneralExperiment:
    """Check plain data; `label` names it in errors."""
    checked = yamlfile.validate(GeneralExperiment, data, label)
    for i, task in enumerate(checked.tasks):
        check_overrides(task.overrides, f"{label}: tasks.{i}")
    try:
        General(checked.form)
        make_learner(checked.learner.name, [0.0], [0.1], bounds=[[-1.0, 1.0]], **checked.learner.options)
    except IvlError as error:
        raise ConfigError(f"{label}: {error}") from error
    return checked
