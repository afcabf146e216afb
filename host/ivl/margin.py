"""How much room a recommended policy has: its margin rate, whether it lies on a bound, and what stepping back costs.

A policy on a bound of the search, or one that asks for all the moment there is, may land well and still be a bad
choice for a vehicle: nothing is left for a battery that is weaker or a propeller that is worn. So it is said, with the
price of a policy that keeps a tenth of the box away from the bound: the other parameter is chosen anew, by the margin
rate. All rates are of rollouts in the world that judges (`ivl.assess`).
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import assess
from ivl.experiment import Experiment
from ivl.world import World

FloatArray = npt.NDArray[np.float64]

STEP = 0.1
"""How far is stepped back, as a share of the width of the box."""
_ON = 0.01
"""A policy this near to a bound, as a share of the width of the box, lies on it; so for all the moment there is."""
_REACH, _TRIES = 0.15, 31
"""How far the other parameter may move, as a share of its box, and the places that are tried."""
_FIRST, _FINALISTS, _LAST = 20, 5, 200
"""Rollouts for each point of a margin rate at an effort of 1: of all places, and of so many finalists."""
_LEAST = 5
_MOMENT_UNIT = "N mm"
"""Unit of the parameter of the paper's form that is a moment."""


def report(world: World, experiment: Experiment, theta: FloatArray, threads: int | None = None) -> dict[str, Any]:
    """What is to be said of a recommended policy, as plain data.

    Args:
        world: Where it is judged.
        experiment: Approach, form, bounds.
        theta: The policy, shape (dim,).
        threads: Worker threads; omitted: all processors.

    Returns:
        `rate`: its margin rate, None for forms that have none. `on_bound`: one entry for each parameter on a bound:
        `parameter`, `value`, `unit`, `bound` ("lower" or "upper"), `is_all_there_is` (the vehicle can make no larger
        moment), and, where there is a margin rate, `stepped_back`: `theta`, `rate` and `cost`, the margin rate lost.
    """
    rate = None
    has_margin = assess.has_margin(experiment)
    if has_margin:
        rate = float(assess.margin_rates(world, experiment, theta[None], scaled(experiment, _LAST), threads)[0])
    found = []
    for i, p in enumerate(experiment.policy.shape.params):
        (lo, hi), value = experiment.policy.bounds[i], float(theta[i])
        is_all = (
            has_margin
            and p.unit == _MOMENT_UNIT
            and value >= (1.0 - _ON) * float(world.derived()["pitch_moment_max_Nmm"])
        )
        bound = _bound(value, lo, hi) or ("upper" if is_all else None)
        if bound is None:
            continue
        entry = {"parameter": p.name, "value": value, "unit": p.unit, "bound": bound, "is_all_there_is": bool(is_all)}
        if rate is not None:
            entry["stepped_back"] = _stepped_back(world, experiment, theta, i, bound, rate, threads)
        found.append(entry)
    return {"rate": rate, "on_bound": found}


def scaled(experiment: Experiment, n_rollouts: int) -> int:
    """A number of rollouts by the effort of the experiment's judge."""
    return max(_LEAST, round(experiment.check.effort * n_rollouts))


def lines(margin: dict[str, Any], best: assess.Best, experiment: Experiment) -> list[tuple[str, str]]:
    """The same for people: what it is, and its value."""
    told = []
    if margin["rate"] is not None:
        largest = best.largest_margin_rate
        of = "" if largest is None else f" (largest of any policy {100 * largest:.1f} %)"
        told.append(("its margin rate", f"{100 * margin['rate']:.1f} %{of}"))
    return told + [("on a bound", text) for text in sentences(margin, experiment)]


def sentences(margin: dict[str, Any], experiment: Experiment) -> list[str]:
    """One sentence for each parameter that is on a bound."""
    found = []
    for entry in margin["on_bound"]:
        symbol = next(p.symbol for p in experiment.policy.shape.params if p.name == entry["parameter"])
        what = "all the moment there is" if entry["is_all_there_is"] else f"the {entry['bound']} bound of the search"
        text = f"{symbol} {entry['value']:.2f} {entry['unit']} is {what}"
        if (back := entry.get("stepped_back")) is not None:
            at = experiment.policy.shape.describe(back["theta"])
            text += f"; at {at} the margin rate is {100 * back['rate']:.1f} %, {_cost(back['cost'])}"
        found.append(text)
    return found


def _cost(cost: float) -> str:
    points = f"{100 * abs(cost):.1f} points"
    return f"{points} less" if cost > 0 else f"{points} more" if cost < 0 else "as much"


def _bound(value: float, lo: float, hi: float) -> str | None:
    """The bound that a value lies on."""
    near = _ON * (hi - lo)
    return "lower" if value <= lo + near else "upper" if value >= hi - near else None


def _stepped_back(
    world: World, experiment: Experiment, theta: FloatArray, i: int, bound: str, rate: float, threads: int | None
) -> dict[str, Any]:
    """The policy of the largest margin rate one step away from a bound, with what that costs."""
    bounds = np.array(experiment.policy.bounds)
    width = np.ptp(bounds, axis=1)
    other = 1 - i
    places = np.tile(theta, (_TRIES, 1))
    edge = bounds[i, 0] if bound == "lower" else min(bounds[i, 1], theta[i])
    places[:, i] = edge + (STEP if bound == "lower" else -STEP) * width[i]
    places[:, other] = np.clip(theta[other] + np.linspace(-_REACH, _REACH, _TRIES) * width[other], *bounds[other])
    first = assess.margin_rates(world, experiment, places, scaled(experiment, _FIRST), threads)
    finalists = places[np.argsort(-first, kind="stable")[:_FINALISTS]]
    last = assess.margin_rates(world, experiment, finalists, scaled(experiment, _LAST), threads)
    top = int(np.argmax(last))
    return {"theta": finalists[top].tolist(), "rate": float(last[top]), "cost": rate - float(last[top])}
