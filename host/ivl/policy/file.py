"""The policy file: a form with its numbers, what they were learned on, how, and how good they are. YAML.

    policy = file.load(Path("g.yaml"))
    world.rollouts(2.5, 60.0, *policy.values, form=policy.form)

`digest` stands for all else in the file. Who writes a policy by hand leaves it out, with `training` and `score`.
"""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from ivl import forms, yamlfile
from ivl.errors import ArgumentError, ConfigError
from ivl.experiment import LearnerChoice
from ivl.forms import Form
from ivl.policy.flying import Drawn, PolicyTask
from ivl.policy.region import RegionField
from ivl.settings import Finite, Strict, check_overrides


class Number(Strict):
    """One parameter of the policy."""

    value: Finite
    unit: str = Field(min_length=1)


class Training(Strict):
    """How the numbers came about.

    The objective is the mean over approaches, tasks and vehicles of 1 for a clean landing and 1/2 for another one.
    """

    learner: LearnerChoice
    seed: int = Field(ge=0, lt=2**63)
    family: Drawn | None = Field(default=None, description="vehicles that were drawn in place of each task's")
    regions: list[RegionField] = Field(min_length=1, description="approaches that were drawn")
    rollouts: int = Field(ge=0, description="flights in all")
    approaches: int = Field(ge=0, description="different approaches that the search flew")
    start_objective: Finite | None = Field(description="of what the map gave, on the approaches of the choice")
    objective: Finite | None = Field(description="of what was chosen, on the same approaches; null: interrupted")
    interrupted: bool = Field(default=False, description="the best so far when somebody stopped it")


class Score(Strict):
    """Landing rates of the chosen policy over the approaches that chose it; `ivl policy assess` takes fresh ones."""

    landed: Finite = Field(ge=0, le=1)
    clean: Finite = Field(ge=0, le=1)
    flights: int = Field(ge=1)


class PolicyFile(Strict):
    """A complete, checked policy."""

    ivl_policy: Literal[1] = Field(description="version of this file's form")
    form: str
    theta: dict[str, Number] = Field(description="parameters by the names of the form")
    tasks: list[PolicyTask] = Field(min_length=1, description="what it was learned on")
    training: Training | None = None
    score: Score | None = None
    digest: str | None = Field(default=None, description="SHA-256 of all else; null: written by hand")

    @model_validator(mode="after")
    def _is_of_its_form(self) -> Self:
        try:
            form = self.shape
            for p in form.params:
                if p.name not in self.theta:
                    raise ValueError(f"theta.{p.name}: is missing (the form {form.name} has {', '.join(form.names)})")
                given = self.theta[p.name]
                if given.unit != p.unit:
                    raise ValueError(f"theta.{p.name}: unit {given.unit!r} (the form {form.name} has {p.unit!r})")
            for name in self.theta:
                if name not in form.names:
                    raise ValueError(f"theta.{name}: unknown key{yamlfile.did_you_mean(name, form.names)}")
            form.to_si(self.values)
        except ArgumentError as error:
            raise ValueError(f"theta: {error}") from error
        if self.digest is not None and self.digest != self._digest():
            raise ValueError(
                f"digest: value {self.digest!r}: the file was changed after it was written "
                "(leave digest out of a policy that is written by hand)"
            )
        return self

    @property
    def shape(self) -> Form:
        """Its form, as the flight core describes it."""
        return forms.by_name(self.form)

    @property
    def values(self) -> list[float]:
        """Its parameters in the order and units of the form."""
        return [self.theta[name].value for name in self.shape.names]

    @property
    def crc(self) -> int:
        """Checksum by which a vehicle names it."""
        return self.shape.crc(self.values)

    def _digest(self) -> str:
        # without defaults: a field that a later version adds changes no digest
        data = self.model_dump(mode="json", exclude={"digest"}, exclude_defaults=True)
        return hashlib.sha256(json.dumps(data, sort_keys=True, allow_nan=False).encode()).hexdigest()

    def sealed(self) -> "PolicyFile":
        """The same policy with its digest."""
        return self.model_copy(update={"digest": self._digest()})


def make(
    form: Form, theta: Sequence[float], tasks: Sequence[PolicyTask], training: Training | None, score: Score | None
) -> PolicyFile:
    """A policy with its digest; theta is in the order and units of the form."""
    numbers = {p.name: Number(value=float(v), unit=p.unit) for p, v in zip(form.params, theta, strict=True)}
    made = PolicyFile(ivl_policy=1, form=form.name, theta=numbers, tasks=list(tasks), training=training, score=score)
    return made.sealed()


def save(policy: PolicyFile, path: Path) -> None:
    """Write a policy; a file that is there is replaced as a whole.

    Raises:
        ConfigError: The file cannot be written.
    """
    draft = path.with_name(f".{path.name}.part")
    try:
        draft.write_text(_text(policy), encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error}") from error


def _text(policy: PolicyFile) -> str:
    data = policy.model_dump(mode="json")
    head = f"# A policy of the form {policy.form}: {policy.shape.doc}.\n# Fly it with --policy; see ivl policy show.\n"
    return head + yamlfile.dump(data)


def load(path: Path) -> PolicyFile:
    """Read and check a policy.

    Raises:
        ConfigError: One line naming file, field and what is allowed.
    """
    data: Any = yamlfile.read(path)
    policy = yamlfile.validate(PolicyFile, data, path.name)
    for i, task in enumerate(policy.tasks):
        check_overrides(task.overrides, f"{path.name}: tasks.{i}")
    return policy
