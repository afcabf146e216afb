"""`ivl list`."""

import math
from collections.abc import Callable
from enum import StrEnum
from typing import Annotated, Any

import typer

from ivl import experiment, forms, model, native, sensing
from ivl.cli import console
from ivl.learners import LEARNERS
from ivl.policy import general
from ivl.rewards import REWARDS, Reward
from ivl.settings import PACKAGE_DIR, read_mapping
from ivl.task import Task

HELP = """List vehicles, gears, learners and all other choices.

\b
Examples:
  ivl list
      everything but the parameters of a world
  ivl list params
      parameters of a world: name, default, range, unit, meaning; --set takes each of them
  ivl list gears --json
      the landing gears, for a script
  ivl list forms
      the forms of a policy that this library has, and their parameters in the order of --theta
"""


class Kind(StrEnum):
    """What can be listed."""

    VEHICLES = "vehicles"
    GEARS = "gears"
    SENSORS = "sensors"
    EXPERIMENTS = "experiments"
    TASKS = "tasks"
    SWEEPS = "sweeps"
    LEARNERS = "learners"
    REWARDS = "rewards"
    FORMS = "forms"
    APPROACHES = "approaches"
    ESTIMATORS = "estimators"
    PARAMS = "params"


def list_(
    kind: Annotated[Kind | None, typer.Argument(help="What to list; all if omitted.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """List what there is to choose from; HELP is the text that people see."""
    kinds = [kind] if kind else [each for each in Kind if as_json or each is not Kind.PARAMS]
    found = {k.value: _entries(k) for k in kinds}
    if as_json:
        console.print_json(found)
        return
    for name, entries in found.items():
        console.out.print(name, style="bold")
        for entry in entries:
            label = f"{entry['gear_set']}/{entry['name']}" if "gear_set" in entry else entry["name"]
            console.out.print(f"  {label:40s} {_words(entry)}")
            for key, p in entry["parameters"].items() if kind is Kind.FORMS else ():
                told = f"{p['lo']:g} .. {p['hi']:g} {p['unit']}"
                console.out.print(f"    {key:38s} {told:22s} {p['doc']}")


def _words(entry: dict[str, Any]) -> str:
    """What stands behind a name."""
    if "default" not in entry:
        return str(entry["doc"])
    default = "must be given" if entry["default"] is None else f"{entry['default']:g}"
    lo, hi = ("any" if entry[key] is None else f"{entry[key]:g}" for key in ("lo", "hi"))
    return f"{default} {entry['unit']} ({lo} .. {hi}): {entry['doc']}"


def _finite(value: float | None) -> float | None:
    """A number for JSON; null for what has no limit, or none at all."""
    return value if value is not None and math.isfinite(value) else None


def _entries(kind: Kind) -> list[dict[str, Any]]:
    return _MAKERS[kind]()


def _vehicles() -> list[dict[str, Any]]:
    vehicles = [model.load_vehicle(name) for name in model.list_vehicles()]
    return [{"name": v.name, "doc": v.doc} for v in vehicles]


def _sensors() -> list[dict[str, Any]]:
    sets = [model.load_sensors(name) for name in model.list_sensor_sets()]
    return [{"name": s.name, "doc": s.doc} for s in sets]


def _gears() -> list[dict[str, Any]]:
    return [_gear(gear_set, name) for gear_set in model.list_gear_sets() for name in model.list_gears(gear_set)]


def _experiments() -> list[dict[str, Any]]:
    found = {path: experiment.load(path).doc for path in experiment.list_experiments()}
    found |= {path: f"{general.load([path]).doc} (ivl policy learn)" for path in experiment.list_general()}
    return [{"name": path, "doc": doc} for path, doc in found.items()]


def _tasks() -> list[dict[str, Any]]:
    """What each shipped experiment flies."""
    return [_task(experiment.load(path)) for path in experiment.list_experiments()]


def _task(chosen: experiment.Experiment) -> dict[str, Any]:
    task = chosen.model_dump(mode="json", include=set(Task.model_fields))
    sensing = f", {chosen.sensing}" if chosen.sensing else ""
    doc = (
        f"{chosen.vehicle}, {chosen.gear_set}/{chosen.gear}{sensing}, {chosen.speed_mps:g} m/s, "
        f"{chosen.angle_deg:g} deg, {chosen.start}"
    )
    return {"name": chosen.name, "doc": doc, "task": task}


def _sweeps() -> list[dict[str, Any]]:
    found = {f"sweeps/{path.name}": read_mapping(path) for path in sorted((PACKAGE_DIR / "sweeps").glob("*.yaml"))}
    return [
        {"name": name, "doc": f"{data['doc']}{' (ivl map)' if 'd_ceil_m' in data else ''}"}
        for name, data in found.items()
    ]


def _approaches() -> list[dict[str, Any]]:
    return [{"name": name, "doc": sensing.APPROACH_DOCS[name]} for name in sensing.APPROACHES]


def _estimators() -> list[dict[str, Any]]:
    return [
        {"name": name, "doc": sensing.ESTIMATOR_DOCS[name], "parameters": values}
        for name, values in sensing.ESTIMATORS.items()
    ]


def _params() -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "doc": p.doc,
            "unit": p.unit,
            **{key: _finite(getattr(p, key)) for key in ("lo", "hi", "default")},
        }
        for name, p in native.library().params.items()
    ]


def _learners() -> list[dict[str, Any]]:
    return [{"name": name, "doc": entry.doc, "options": _options(name)} for name, entry in LEARNERS.found().items()]


def _form(form: forms.Form) -> dict[str, Any]:
    parameters = {p.name: {"unit": p.unit, "lo": p.lo, "hi": p.hi, "doc": p.doc} for p in form.params}
    return {"name": form.name, "doc": form.doc, "parameters": parameters}


def _reward(reward: Reward) -> dict[str, Any]:
    options = {key: field.default for key, field in reward.options_type.model_fields.items()}
    terms = {term.name: {"unit": term.unit, "doc": term.doc} for term in reward.terms}
    return {"name": reward.name, "doc": reward.doc, "options": options, "terms": terms}


def _gear(gear_set: str, name: str) -> dict[str, Any]:
    gear = model.load_gear(name, gear_set)
    quantities = {
        key: {"value": q.value, "unit": q.unit} for key, q in gear.quantities.items() if abs(q.value) != float("inf")
    }
    return {"gear_set": gear_set, "name": name, "doc": gear.doc, "parameters": quantities}


def _options(name: str) -> dict[str, Any]:
    """Options of a learner with the defaults that this entry of the registry has."""
    entry = LEARNERS[name]
    defaults = {key: field.default for key, field in entry.cls.Options.model_fields.items()}
    return {**defaults, **entry.preset}


_MAKERS: dict[Kind, Callable[[], list[dict[str, Any]]]] = {
    Kind.VEHICLES: _vehicles,
    Kind.GEARS: _gears,
    Kind.SENSORS: _sensors,
    Kind.EXPERIMENTS: _experiments,
    Kind.TASKS: _tasks,
    Kind.SWEEPS: _sweeps,
    Kind.LEARNERS: _learners,
    Kind.REWARDS: lambda: [_reward(reward) for reward in REWARDS.found().values()],
    Kind.FORMS: lambda: [_form(form) for form in forms.forms().values()],
    Kind.APPROACHES: _approaches,
    Kind.ESTIMATORS: _estimators,
    Kind.PARAMS: _params,
}
