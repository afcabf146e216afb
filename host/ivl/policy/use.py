"""A policy of a file where an experiment or a sweep is read: as the start of a search, or flown as it is."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from ivl import forms
from ivl.errors import ConfigError
from ivl.policy.file import PolicyFile
from ivl.policy.shape import General, is_general

if TYPE_CHECKING:
    from ivl.sweep.config import Sweep

_SPREAD_PER_S, _SPREAD_NMM = 0.1, 0.3
_SPREAD_NORM, _REACH = 0.05, 5.0
_HELD_NORM = 1e-6
_NO_SEARCH = "fixed"
"""Learner that proposes its start again and again."""


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


def on_its_task(policy: PolicyFile, task: int = 0) -> Callable[[dict[str, Any]], None]:
    """As `as_start`, and the experiment flies what the policy was learned on, the first task or another."""

    def change(data: dict[str, Any]) -> None:
        as_start(policy)(data)
        data.update(policy.tasks[task].model_dump(mode="json"))

    return change


def the_one(tasks: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The only one of the tasks of a policy, as raw data, after all that was said has changed each of them.

    Raises:
        ConfigError: They are not all the same.
    """
    first = tasks[0]
    for name in first:
        found = list(dict.fromkeys(str(task[name]) for task in tasks))
        if len(found) > 1:
            raise ConfigError(
                f"--policy: it was learned on {len(tasks)} tasks that differ in {name} ({', '.join(found)}): "
                f"say which, for example --set {name}={found[0]}"
            )
    return first


def as_it_is(policy: PolicyFile, learner: str | None, vary: Sequence[str] = ()) -> Callable[[dict[str, Any]], None]:
    """A change of a sweep's raw data after which every trial flies the policy, or begins with it if a learner is named.

    Args:
        policy: The policy.
        learner: Who begins a search with it; None: nobody.
        vary: "a.b=x,y" each: what is to be varied beside what the sweep says.

    Raises:
        ConfigError: (by the change) The sweep varies learners, or the policy.
    """
    taken = ("policy.", "mu0_range") if learner is not None else ("policy.", "mu0_range", "learner.")

    def change(data: dict[str, Any]) -> None:
        varied = data.get("vary")
        paths = [text.partition("=")[0].strip() for text in vary]
        for path in (*(varied if isinstance(varied, dict) else ()), *paths):
            if str(path).startswith(taken):
                raise ConfigError(f"vary: {path}: --policy says what is flown (--learner NAME begins a search with it)")
        as_start(policy)(data)
        data.pop("mu0_range", None)
        if learner is None:
            data["learner"] = {"name": _NO_SEARCH}

    return change


def check_as_it_is(sweep: "Sweep", policy: PolicyFile, learner: str | None) -> None:
    """Refuse a sweep in which a setting has changed what `as_it_is` said.

    Raises:
        ConfigError: It has another learner, or other numbers.
    """
    if learner is None and sweep.learner.name != _NO_SEARCH:
        name = sweep.learner.name
        raise ConfigError(
            f"learner.name: value {name!r}: --policy flies without a search (--learner {name} begins one)"
        )
    if sweep.mu0_range is not None or (sweep.policy.form, sweep.policy.mu0) != (policy.form, policy.values):
        raise ConfigError("policy: --policy says the numbers, and a setting says others")
