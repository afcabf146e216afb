"""`ivl list`."""

from enum import StrEnum
from typing import Annotated, Any

import typer

from ivl import experiment, forms, model
from ivl.cli import console
from ivl.learners import LEARNERS
from ivl.policy import general
from ivl.rewards import REWARDS, Reward

HELP = """List vehicles, gears, learners and all other choices.

\b
Examples:
  ivl list
      everything
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
    LEARNERS = "learners"
    REWARDS = "rewards"
    FORMS = "forms"


def list_(
    kind: Annotated[Kind | None, typer.Argument(help="What to list; all if omitted.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """List what there is to choose from; HELP is the text that people see."""
    kinds = [kind] if kind else list(Kind)
    found = {k.value: _entries(k) for k in kinds}
    if as_json:
        console.print_json(found)
        return
    for name, entries in found.items():
        console.out.print(name, style="bold")
        for entry in entries:
            label = f"{entry['gear_set']}/{entry['name']}" if "gear_set" in entry else entry["name"]
            console.out.print(f"  {label:40s} {entry['doc']}")
            for key, p in entry["parameters"].items() if kind is Kind.FORMS else ():
                told = f"{p['lo']:g} .. {p['hi']:g} {p['unit']}"
                console.out.print(f"    {key:38s} {told:22s} {p['doc']}")


def _entries(kind: Kind) -> list[dict[str, Any]]:
    if kind is Kind.VEHICLES:
        vehicles = [model.load_vehicle(name) for name in model.list_vehicles()]
        return [{"name": v.name, "doc": v.doc} for v in vehicles]
    if kind is Kind.SENSORS:
        sets = [model.load_sensors(name) for name in model.list_sensor_sets()]
        return [{"name": s.name, "doc": s.doc} for s in sets]
    if kind is Kind.GEARS:
        return [_gear(gear_set, name) for gear_set in model.list_gear_sets() for name in model.list_gears(gear_set)]
    if kind is Kind.EXPERIMENTS:
        found = {path: experiment.load(path).doc for path in experiment.list_experiments()}
        found |= {path: f"{general.load([path]).doc} (ivl policy learn)" for path in experiment.list_general()}
        return [{"name": path, "doc": doc} for path, doc in found.items()]
    if kind is Kind.LEARNERS:
        return [{"name": name, "doc": entry.doc, "options": _options(name)} for name, entry in LEARNERS.found().items()]
    if kind is Kind.FORMS:
        return [_form(form) for form in forms.forms().values()]
    return [_reward(reward) for reward in REWARDS.found().values()]


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
