"""Options that say what is flown, made from the fields of the task: `--gear`, `--sensors`, `--set` and their like.

    @task_options("vehicle", "gear", "gear_set")
    def command(chosen: Chosen, ...): ...

The command gets `chosen` with what was said; its help has the texts and defaults of the fields themselves. A command
with defaults of its own names them: `@task_options("vehicle", vehicle="crazyflie21")`. One that flies a task of another
kind, such as one without an approach, names the kind, and where its values come from unless somebody says others:
`@task_options("start", kind=PolicyTask, otherwise="as it was learned")`.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import wraps
from typing import Annotated, Any, TypeVar

import typer
from pydantic import BaseModel

from ivl import experiment, yamlfile
from ivl.errors import ConfigError
from ivl.policy.use import the_one
from ivl.settings import apply_setting, parse_setting
from ivl.task import Setup, Task, default_of
from ivl.world import World

Result = TypeVar("Result")

FLAGS: dict[str, tuple[str, ...]] = {
    "vehicle": ("--vehicle",),
    "gear": ("--gear",),
    "gear_set": ("--gear-set",),
    "sensing": ("--sensors", "--sensing"),
    "texture": ("--texture",),
    "estimator": ("--estimator",),
    "approach": ("--approach",),
    "speed_mps": ("--speed",),
    "angle_deg": ("--angle",),
    "surface": ("--surface",),
    "start": ("--start",),
}
"""Options of each field; a new field of the task needs a row here."""
EQUIPMENT = ("vehicle", "gear", "gear_set", "sensing", "texture", "estimator", "approach", "surface")
"""Fields that make a world."""
_KINDS = {"speed_mps": float, "angle_deg": float, "surface": float}
_LABEL = "options"  # the file that errors name where there is none


@dataclass(frozen=True)
class Chosen:
    """What was said on the command line of a task.

    Attributes:
        given: Fields of the task by name; those of which nothing was said are left out.
        settings: Texts of `--set`.
        path: Experiment that all else changes, if one was named.
        defaults: Fields that the command starts from without an experiment, where they are not those of the task.
        kind: What is flown: the fields that can be set.
    """

    given: dict[str, Any] = field(default_factory=dict)
    settings: list[str] = field(default_factory=list)
    path: str | None = None
    defaults: Mapping[str, Any] = field(default_factory=dict)
    kind: type[Setup] = Task

    def fields(self, *bases: BaseModel) -> dict[str, Any]:
        """Fields of the task as raw data: those of the experiment, of a base, or the defaults, and what was said.

        Args:
            *bases: What is flown unless an experiment was named, such as the tasks of a policy; none: the defaults of
                the task. What was said must tell which of several is meant.

        Raises:
            ConfigError: The experiment or a setting is wrong, an option and a setting say the same, or several bases
                are left.
        """
        for setting in self.settings:
            name, _ = parse_setting(setting)
            if name in self.given:
                raise ConfigError(f"--set {setting}: already given by {FLAGS[name][0]}")
            if name in Task.model_fields.keys() - self.kind.model_fields.keys():
                raise ConfigError(f"--set {setting}: {name} cannot be set: the approaches are drawn")
        if self.path is not None:
            data = experiment.load(self.path, self.settings).task() | self.given
            return {name: value for name, value in data.items() if name in self.kind.model_fields}
        named = {name: default_of(name) for name in ("vehicle", "gear")} | dict(self.defaults)
        return the_one([self._changed(base.model_dump()) for base in bases] or [self._changed(named)])

    def _changed(self, data: dict[str, Any]) -> dict[str, Any]:
        for setting in self.settings:
            apply_setting(data, setting, self.kind, _LABEL)
        return data | self.given

    def setup(self, *bases: BaseModel) -> tuple[Setup, str]:
        """Set-up and landing gear, for commands that need no approach; `bases` as for `fields`."""
        data = self.fields(*bases)
        given = {name: value for name, value in data.items() if name in Setup.model_fields}
        return yamlfile.validate(Setup, given, _LABEL), str(data["gear"])

    def make_world(self, *bases: BaseModel) -> World:
        """The world alone, for commands to which somebody else says the approach; `bases` as for `fields`."""
        setup, gear = self.setup(*bases)
        return setup.world_of(gear)


def task_options(
    *names: str, kind: type[Setup] = Task, otherwise: str | None = None, **defaults: Any
) -> Callable[[Callable[..., Result]], Callable[..., Result]]:
    """Give a command the options of some fields, `--experiment` and `--set`, instead of its parameter `chosen`.

    Args:
        *names: The fields.
        kind: What is flown, which has these fields.
        otherwise: What the help says of fields of which nobody says anything; None: their defaults.
        **defaults: Values of fields where nobody says any, in place of the task's own.
    """

    def give(command: Callable[..., Result]) -> Callable[..., Result]:
        own = inspect.signature(command, eval_str=True)
        shown = {name: otherwise or defaults.get(name, default_of(name)) for name in names}
        options = [*(_option(kind, name, default) for name, default in shown.items()), *_general()]
        kept = [parameter for parameter in own.parameters.values() if parameter.name != "chosen"]

        @wraps(command)
        def run(**arguments: Any) -> Result:
            said = {name: arguments.pop(name) for name in (*names, "experiment", "settings")}
            path, settings = said.pop("experiment"), said.pop("settings")
            given = {name: value for name, value in said.items() if value is not None}
            return command(chosen=Chosen(given, settings or [], path, defaults, kind), **arguments)

        first = [p for p in kept if p.default is inspect.Parameter.empty]
        rest = [p for p in kept if p.default is not inspect.Parameter.empty]
        parameters = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in (*first, *options, *rest)]
        run.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return run

    return give


def _option(kind: type[Setup], name: str, default: Any) -> inspect.Parameter:
    value = _KINDS.get(name, str)
    text = kind.model_fields[name].description
    shown = f"{text}  [default: {default}]" if isinstance(default, str) else text
    return _parameter(name, Annotated[value | None, typer.Option(*FLAGS[name], help=shown)])


def _general() -> list[inspect.Parameter]:
    path = "What an experiment flies; the other options change it."
    text = "Change a field of the task or a parameter of the world."
    return [
        _parameter("experiment", Annotated[str | None, typer.Option("--experiment", help=path)]),
        _parameter("settings", Annotated[list[str] | None, typer.Option("--set", metavar="A.B=C", help=text)]),
    ]


def _parameter(name: str, annotation: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
