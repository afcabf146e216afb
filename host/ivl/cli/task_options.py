"""Options that say what is flown, made from the fields of the task: `--gear`, `--sensors`, `--set` and their like.

    @task_options("vehicle", "gear", "gear_set")
    def command(chosen: Chosen, ...): ...

The command gets `chosen` with what was said; its help has the texts and defaults of the fields themselves. A command
with defaults of its own names them: `@task_options("vehicle", vehicle="crazyflie21")`.
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
from ivl.settings import apply_setting, parse_setting
from ivl.task import Setup, Task, default_of
from ivl.world import World

Result = TypeVar("Result")

FLAGS: dict[str, tuple[str, ...]] = {
    "vehicle": ("--vehicle",),
    "gear": ("--gear",),
    "gear_set": ("--gear-set",),
    "sensing": ("--sensors", "--sensing"),
    "estimator": ("--estimator",),
    "approach": ("--approach",),
    "speed_mps": ("--speed",),
    "angle_deg": ("--angle",),
    "start": ("--start",),
}
"""Options of each field; a new field of the task needs a row here."""
EQUIPMENT = ("vehicle", "gear", "gear_set", "sensing", "estimator", "approach")
"""Fields that make a world."""
_KINDS = {"speed_mps": float, "angle_deg": float}
_LABEL = "options"  # the file that errors name where there is none


@dataclass(frozen=True)
class Chosen:
    """What was said on the command line of a task.

    Attributes:
        given: Fields of the task by name; those of which nothing was said are left out.
        settings: Texts of `--set`.
        path: Experiment that all else changes, if one was named.
        defaults: Fields that the command starts from without an experiment, where they are not those of the task.
    """

    given: dict[str, Any] = field(default_factory=dict)
    settings: list[str] = field(default_factory=list)
    path: str | None = None
    defaults: Mapping[str, Any] = field(default_factory=dict)

    def fields(self, base: BaseModel | None = None) -> dict[str, Any]:
        """Fields of the task as raw data: those of the experiment, of `base`, or the defaults, and what was said.

        Args:
            base: What is flown unless an experiment was named; by default the defaults of the task.

        Raises:
            ConfigError: The experiment or a setting is wrong, or an option and a setting say the same.
        """
        for setting in self.settings:
            name, _ = parse_setting(setting)
            if name in self.given:
                raise ConfigError(f"--set {setting}: already given by {FLAGS[name][0]}")
        if self.path is not None:
            return experiment.load(self.path, self.settings).task() | self.given
        named = {name: default_of(name) for name in ("vehicle", "gear")} | dict(self.defaults)
        data = named if base is None else base.model_dump()
        for setting in self.settings:
            apply_setting(data, setting, Task, _LABEL)
        return data | self.given

    def setup(self, base: BaseModel | None = None) -> tuple[Setup, str]:
        """Set-up and landing gear, for commands that need no approach; `base` as for `fields`."""
        data = self.fields(base)
        given = {name: value for name, value in data.items() if name in Setup.model_fields}
        return yamlfile.validate(Setup, given, _LABEL), str(data["gear"])

    def make_world(self, base: BaseModel | None = None) -> World:
        """The world alone, for commands that are told the approach by somebody else; `base` as for `fields`."""
        setup, gear = self.setup(base)
        return setup.world_of(gear)


def task_options(*names: str, **defaults: Any) -> Callable[[Callable[..., Result]], Callable[..., Result]]:
    """Give a command the options of some fields, `--experiment` and `--set`, instead of its parameter `chosen`.

    Args:
        *names: The fields.
        **defaults: Values of fields where nobody says any, in place of the task's own.
    """

    def give(command: Callable[..., Result]) -> Callable[..., Result]:
        own = inspect.signature(command, eval_str=True)
        options = [*(_option(name, defaults.get(name, default_of(name))) for name in names), *_general()]
        kept = [parameter for parameter in own.parameters.values() if parameter.name != "chosen"]

        @wraps(command)
        def run(**arguments: Any) -> Result:
            said = {name: arguments.pop(name) for name in (*names, "experiment", "settings")}
            path, settings = said.pop("experiment"), said.pop("settings")
            given = {name: value for name, value in said.items() if value is not None}
            return command(chosen=Chosen(given, settings or [], path, defaults), **arguments)

        first = [p for p in kept if p.default is inspect.Parameter.empty]
        rest = [p for p in kept if p.default is not inspect.Parameter.empty]
        parameters = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in (*first, *options, *rest)]
        run.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return run

    return give


def _option(name: str, default: Any) -> inspect.Parameter:
    kind = _KINDS.get(name, str)
    text = Task.model_fields[name].description
    shown = f"{text}  [default: {default}]" if isinstance(default, str) else text
    return _parameter(name, Annotated[kind | None, typer.Option(*FLAGS[name], help=shown)])


def _general() -> list[inspect.Parameter]:
    path = "What an experiment flies; the other options change it."
    text = "Change a field of the task or a parameter of the world."
    return [
        _parameter("experiment", Annotated[str | None, typer.Option("--experiment", help=path)]),
        _parameter("settings", Annotated[list[str] | None, typer.Option("--set", metavar="A.B=C", help=text)]),
    ]


def _parameter(name: str, annotation: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
