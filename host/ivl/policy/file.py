"""The policy file: a form with its numbers, what they were learned on, how, and how good they are. YAML.

    policy = file.load(Path("g.yaml"))
    world.rollouts(2.5, 60.0, *policy.values, form=policy.form)

`digest` stands for all else in the file, `form_table` for the meaning of the numbers, and `crc` is what a vehicle calls
the policy. A file in which one of them is wrong is refused. Who writes or changes a policy by hand says so with
`digest: none`, and is believed; `form_table`, `crc`, `made_by`, `training` and `score` may then be left out.
"""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from ivl import files, forms, native, references, yamlfile
from ivl.errors import ArgumentError, ConfigError
from ivl.experiment import LearnerChoice
from ivl.forms import Form
from ivl.policy.flying import Drawn, PolicyTask
from ivl.policy.region import RegionField
from ivl.settings import Finite, Strict, check_overrides

NONE = "none"
"""Digest of a policy that was written or changed by hand."""
_BY_HAND = f"digest: {NONE} accepts a policy that was written or changed by hand"

Share = Annotated[Finite, Field(ge=0, le=1)]


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


class WithGo(Strict):
    """The same approaches, with the policy's own go / no-go."""

    refused: Share = Field(description="share of all approaches that are called off")
    landed: Share = Field(description="share of all approaches that land")
    clean: Share = Field(description="share of all approaches that land without body or rotor contact")


class Score(Strict):
    """Landing rates over the approaches that chose the policy; `ivl policy assess` takes fresh ones."""

    flights: int = Field(ge=1, description="approaches of all tasks and vehicles")
    landed: Share = Field(description="share that lands when every approach is flown, go / no-go off")
    clean: Share = Field(description="share that lands without body or rotor contact then")
    with_go: WithGo | None = Field(default=None, description="with go / no-go; null: it refuses nothing")


class PolicyFile(Strict):
    """A complete, checked policy."""

    ivl_policy: Literal[1] = Field(description="version of this file's form")
    form: str
    theta: dict[str, Number] = Field(description="parameters by the names of the form")
    tasks: list[PolicyTask] = Field(min_length=1, description="what it was learned on")
    training: Training | None = None
    score: Score | None = None
    made_by: str | None = Field(default=None, description="digest of the simulator library that wrote it")
    form_table: str | None = Field(default=None, description="digest of the form's names, units and ranges")
    crc: str | None = Field(default=None, description="checksum by which a vehicle names it, hexadecimal")
    digest: str = Field(description=f"SHA-256 of all else in the file; {NONE}: written or changed by hand")

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
    def checksum(self) -> int:
        """Checksum by which a vehicle names it."""
        return self.shape.crc(self.values)

    def sealed(self) -> "PolicyFile":
        """The same policy with what vouches for it."""
        marks = {"made_by": native.library().digest(), "form_table": self.shape.digest, "crc": f"{self.checksum:08x}"}
        marked = self.model_copy(update=marks)
        return marked.model_copy(update={"digest": _digest(marked.model_dump(mode="json"))})


def _digest(data: dict[str, Any]) -> str:
    """Of what is in a file, whatever this version's defaults are for what is not."""
    rest = {name: value for name, value in data.items() if name != "digest"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, default=str).encode()).hexdigest()


def make(
    form: Form, theta: Sequence[float], tasks: Sequence[PolicyTask], training: Training | None, score: Score | None
) -> PolicyFile:
    """A policy with its digest; theta is in the order and units of the form."""
    numbers = {p.name: Number(value=float(v), unit=p.unit) for p, v in zip(form.params, theta, strict=True)}
    made = PolicyFile(
        ivl_policy=1, form=form.name, theta=numbers, tasks=list(tasks), training=training, score=score, digest=NONE
    )
    return made.sealed()


def save(policy: PolicyFile, path: Path) -> None:
    """Write a policy; a file that is there is replaced as a whole.

    Own files that its tasks name are copied into the folder `files` beside it, so that both can be moved together.

    Raises:
        ConfigError: The file cannot be written, or one of its tasks cannot be read.
    """
    packed = [references.pack(task) for task in policy.tasks]
    named = policy.model_copy(update={"tasks": [task for task, _ in packed]})
    named = named if policy.digest == NONE else named.sealed()
    try:
        for _, copies in packed:
            references.save(copies, path.parent)
        files.write(path, _text(named))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {files.reason(error)}") from error


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
    if isinstance(data, dict) and "digest" not in data:
        raise ConfigError(f"{path.name}: digest: is missing ({_BY_HAND})")
    digest = _digest(data) if isinstance(data, dict) else NONE
    if isinstance(data, dict):
        references.resolve(data, path.parent)
    policy = yamlfile.validate(PolicyFile, data, path.name)
    if policy.digest != NONE:
        _check_marks(policy, digest, path.name)
    for i, task in enumerate(policy.tasks):
        check_overrides(task.overrides, f"{path.name}: tasks.{i}")
    return policy


def _check_marks(policy: PolicyFile, digest: str, label: str) -> None:
    """Refuse a policy that is not what was written, or whose numbers mean something else here."""
    form = policy.shape
    marks = (
        ("digest", policy.digest, digest, "the file was changed after it was written"),
        ("form_table", policy.form_table, form.digest, f"the form {form.name} has other names, units or ranges here"),
        ("crc", policy.crc, f"{policy.checksum:08x}", "a vehicle of this version calls the numbers otherwise"),
    )
    for name, said, found, why in marks:
        if said != found:
            raise ConfigError(f"{label}: {name}: value {said!r}, found {found!r}: {why} ({_BY_HAND})")
