"""A policy of a file where an experiment or a sweep is read: as the start of a search, or flown as it is."""

from collections.abc import Callable
from typing import Any

from ivl import forms
from ivl.errors import ConfigError
from ivl.policy.file import PolicyFile
from ivl.policy.shape import General, is_general

_SPREAD_PER_S, _SPREAD_NMM = 0.1, 0.3
_SPREAD_NORM, _REACH = 0.05, 5.0
_HELD_NORM = 1e-6


def start_of(policy: PolicyFile) -> dict[str, Any]:
    """The raw data of a search that begins with a policy: threshold and moment are searched near its numbers.

    What decides go or no-go is not for a search over single landings to change: it is held, within a millionth of its
    range. Of a form that is not for every approach all parameters are searched, over their whole ranges.
    """
    form = policy.shape
    general = General(form.name) if is_general(form.name) else None
    data: dict[str, Any] = {"form": form.name}
    for i, (p, value) in enumerate(zip(form.params, policy.values, strict=True)):
        width = p.hi - p.lo
        if general is None:
            sigma, reach = _SPREAD_NORM * width, width
        elif i >= general.searched.stop:
            sigma = reach = _HELD_NORM * width
        else:
            sigma = _SPREAD_PER_S if i < general.n_threshold else _SPREAD_NMM
            reach = _REACH * sigma
        bounds = [max(p.lo, value - reach), min(p.hi, value + reach)]
        data[p.name] = {"mu0": value, "sigma0": min(sigma, bounds[1] - bounds[0]), "bounds": bounds}
    return data


def as_start(policy: PolicyFile) -> Callable[[dict[str, Any]], None]:
    """A change of an experiment's raw data after which its search begins with the policy.

    Spreads and bounds are those of the experiment, if it searches for the same form, else those of `start_of`. What
    else the experiment says of parameters of another form (grid, real flights) is dropped.
    """

    def change(data: dict[str, Any]) -> None:
        own = data.get("policy")
        if isinstance(own, dict) and own.get("form", forms.PAPER) == policy.form:
            for name, value in zip(policy.shape.names, policy.values, strict=True):
                if isinstance(own.get(name), dict):
                    own[name] = {**own[name], "mu0": value}
            return
        data["policy"] = start_of(policy)
        data.pop("flown", None)
        data.pop("mu0_range", None)
        if isinstance(data.get("check"), dict):
            data["check"] = {name: value for name, value in data["check"].items() if name != "grid"}

    return change


def on_its_task(policy: PolicyFile) -> Callable[[dict[str, Any]], None]:
    """As `as_start`, and the experiment flies what the policy was learned on (the first of several)."""

    def change(data: dict[str, Any]) -> None:
        as_start(policy)(data)
        task = policy.tasks[0].model_dump(mode="json")
        if task["start"] not in ("imparted", "flown"):
            raise ConfigError(f"tasks.0.start: value {task['start']!r}: a landing is flown from imparted or flown")
        data.update(task)

    return change


def as_it_is(policy: PolicyFile, learner: str | None) -> Callable[[dict[str, Any]], None]:
    """A change of a sweep's raw data after which every trial flies the policy, or begins with it if a learner is named.

    Raises:
        ConfigError: (by the change) The sweep varies learners, or the policy.
    """

    def change(data: dict[str, Any]) -> None:
        varied = data.get("vary")
        for path in varied if isinstance(varied, dict) else ():
            if str(path).startswith(("policy.", "learner.")):
                raise ConfigError(f"vary.{path}: --policy says what is flown")
        as_start(policy)(data)
        data.pop("mu0_range", None)
        if learner is None:
            data["learner"] = {"name": "fixed"}

    return change
