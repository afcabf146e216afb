"""Learn on vehicles that no learner has seen, and look at the way there: after 1, 2, 4 ... flights.

    .venv/bin/python tools/transfer.py                         30 drones, 24 flights each, with ephe_belief
    .venv/bin/python tools/transfer.py --learner bo            another learner beside it
    .venv/bin/python tools/transfer.py --scale 3               drones from a family three times as wide
    .venv/bin/python tools/transfer.py --outside               twelve drones, each wrong in a way that no member is
    .venv/bin/python tools/transfer.py --set vehicle=habas2021 --set gear_set=as_simulated --set start=imparted

It is `ivl learn experiments/transfer.yaml --trials N`, whose folder --out keeps, with two things beside its summary:
how good the recommendation of each drone is after so many flights, and how often the first flights land. A drone counts
as solved after n flights if what is then recommended lands at least 0.9 times as often as its best policy, whatever
comes later. Intervals are 95 % (Wilson).
"""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ivl import assess, experiment, run
from ivl.analysis.intervals import wilson
from ivl.learning.loop import Progress
from ivl.outcome import four_leg
from ivl.world import World

AFTER, MARGIN_AFTER = (1, 2, 4, 8, 24), (4, 24)
MARGIN_ROLLOUTS = 100
"""For each of the points that a margin rate is averaged over."""
OUTSIDE: dict[str, dict[str, float]] = {
    "rotors stop late": {"rotor.tau_down": 1.6},
    "rotors start late": {"rotor.tau_up": 1.6},
    "weak rotors": {"rotor.thrust_gain": 0.82},
    "inflow": {"rotor.inflow_loss": 3.0},
    "inertia": {"body.inertia_yy": 1.5},
    "drag": {"aero.drag_xy": 6.0, "aero.drag_z": 6.0},
    "damped feet": {"leg.foot_damping": 2.0e-3},
    "friction": {"plate.friction": 0.2},
    "soft legs": {"leg.stiffness": 0.4},
    "short legs": {"leg.length": 0.8},
    "plane of the cues": {"world.sensed_gap_offset": 0.04},
    "latency": {"sense.latency": 0.025},
}
"""Vehicles that no member of the family explains: factors on the values of the files, but for those of `VALUES`."""
VALUES = ("leg.foot_damping", "world.sensed_gap_offset", "sense.latency")
"""Given as values: the files have 0, or something near it."""
_LEAST = 1e-3
_MARGIN_ENOUGH = 0.95


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="learn on vehicles that no learner has seen")
    parser.add_argument("--experiment", default="experiments/transfer.yaml")
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="A.B=C")
    parser.add_argument("--learner", help="learner by name; default: that of the experiment")
    parser.add_argument("--drones", type=int, default=30)
    parser.add_argument("--flights", type=int, default=24)
    parser.add_argument(
        "--scale", type=float, default=1.0, help="spread of the drones' family, in that of the learner's"
    )
    parser.add_argument("--outside", action="store_true", help="drones outside the family, instead of --drones")
    parser.add_argument("--seed", type=int, default=1000, help="of the drones")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--out", type=Path, help="keep the run folder, or those of --outside within it")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as scratch:
        drones = (_outside if args.outside else _inside)(args, args.out or Path(scratch) / "run")
    chosen = _experiment(args, args.seed, {})
    if args.json:
        print(json.dumps({"learner": chosen.learner.name, "drones": drones}))
    else:
        _report(chosen, drones)
    return 0


def _experiment(args: argparse.Namespace, seed: int, overrides: dict[str, float]) -> experiment.Experiment:
    """What the drones of a seed fly; overrides of theirs are unknown to the learner."""
    drawn = ["family.member=each", f"family.member_scale={args.scale}", f"family.seed={seed}"]
    other = [f"family.member_overrides={json.dumps(overrides)}"] if overrides else []
    settings = [*drawn, *other, "n_rollouts=1", f"budget={args.flights}", *args.settings]
    return experiment.load(args.experiment, settings, learner=args.learner)


def _inside(args: argparse.Namespace, folder: Path) -> list[dict[str, Any]]:
    return _flown(_experiment(args, args.seed, {}), folder, args.drones, args.workers)


def _outside(args: argparse.Namespace, folder: Path) -> list[dict[str, Any]]:
    """One drone for each way to be wrong."""
    chosen = _experiment(args, args.seed, {})
    values_of_files = chosen.nominal_world_of(chosen.gear).params.values
    drones = []
    for number, (name, wrong) in enumerate(OUTSIDE.items()):
        _say(f"drone {number + 1} of {len(OUTSIDE)}: {name}")
        values = {p: x if p in VALUES else x * values_of_files[p] for p, x in wrong.items()}
        chosen = _experiment(args, args.seed + number, values)
        drones += [one | {"name": name} for one in _flown(chosen, folder / str(number), 1, args.workers)]
    return drones


def _flown(chosen: experiment.Experiment, folder: Path, n: int, workers: int) -> list[dict[str, Any]]:
    hooks = run.Hooks(on_episode=_episode, on_bank=_bank, on_drone=_drone)
    return _drones(run.run(chosen, folder, n, False, workers, hooks), workers)


def _drones(result: run.RunResult, threads: int) -> list[dict[str, Any]]:
    """What is told of each drone."""
    chosen, bests = result.experiment, [best["rate_four_leg"] for best in result.summary["best"]]
    worlds = chosen.trial_worlds(len(bests))
    shares: dict[int, list[float]] = {}
    margins: dict[int, list[float]] = {}
    for n in AFTER:
        if n % chosen.n_rollouts == 0 and n <= chosen.budget:
            rates = assess.rates_after(worlds, chosen, result.history, n // chosen.n_rollouts - 1, threads)
            shares[n] = (rates / np.maximum(bests, _LEAST)).tolist()
            if n in MARGIN_AFTER and assess.has_margin(chosen):
                margins[n] = _margins(result, worlds, n, threads)
    last = {row.trial: row.insight for row in result.history}
    landed = [four_leg(result.rollouts.of_trial(k).outcomes).tolist() for k in range(len(bests))]
    return [
        {
            "best": best,
            "landed": landed[k],
            "shares": {n: share[k] for n, share in shares.items()},
            "margin_shares": {n: share[k] for n, share in margins.items()},
            "fits": (last[k] or {}).get("model_fits"),
        }
        for k, best in enumerate(bests)
    ]


def _margins(result: run.RunResult, worlds: list[World], n: int, threads: int) -> list[float]:
    """Margin rates of what is recommended after n flights, as shares of the largest of each drone."""
    recommended = {row.trial: row.recommended for row in result.history if row.episode == n - 1}
    shares = []
    for k, (world, best) in enumerate(zip(worlds, result.summary["best"], strict=True)):
        theta = np.array([recommended[k]])
        rate = float(assess.margin_rates(world, result.experiment, theta, MARGIN_ROLLOUTS, threads)[0])
        shares.append(rate / max(best["largest_margin_rate"], _LEAST))
    return shares


def _bank(done: int, n: int) -> None:
    if done == n or done % 200 == 0:
        _say(f"simulated vehicles: {done} of {n}")


def _episode(progress: Progress) -> None:
    _say(f"episode {progress.episode} of {progress.n_episodes}")


def _drone(trial: int, n: int) -> None:
    _say(f"best policy of drone {trial + 1} of {n}")


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _report(chosen: experiment.Experiment, drones: list[dict[str, Any]]) -> None:
    n, best = len(drones), np.array([drone["best"] for drone in drones])
    landed = np.array([drone["landed"] for drone in drones])
    failed = (~landed).sum(axis=1)
    beyond = failed - landed.shape[1] * (1.0 - best)
    print(f"{chosen.learner.name}: {n} drones, best policies land {best.mean():.3f} (lowest {best.min():.2f})")
    for after in drones[0]["shares"]:
        shares = np.array([drone["shares"][after] for drone in drones])
        solved = int((shares >= chosen.check.share_of_best).sum())
        low, high = (float(x) for x in wilson(solved / n, n))
        share = f"solved {solved / n:.2f} ({low:.2f} to {high:.2f}), share of the best {shares.mean():.3f}"
        print(f"after {after:2d} flights: {share}")
    for after in drones[0]["margin_shares"]:
        margins = np.array([drone["margin_shares"][after] for drone in drones])
        enough = float((margins >= _MARGIN_ENOUGH).mean())
        print(
            f"after {after:2d} flights: margin rate {margins.mean():.3f} of the largest, {enough:.2f} of the drones "
            f"at {_MARGIN_ENOUGH:g} of it or above"
        )
    first = ", ".join(f"flight {k + 1} lands {landed[:, k].mean():.2f}" for k in range(min(2, landed.shape[1])))
    print(first)
    more = f"beyond those of the best policy {beyond.mean():.2f}"
    print(f"failures in {landed.shape[1]} flights: {failed.mean():.1f}, {more}")
    told = [drone["fits"] for drone in drones if drone["fits"] is not None]
    if told:
        print(f"no member fits, said of {told.count(False)} drones")
    for drone in drones:
        if "name" in drone:
            flights = "".join(".X"[landed] for landed in drone["landed"])
            last = list(drone["shares"].values())[-1]
            says = "" if drone["fits"] else "; no member fits"
            print(f"{drone['name']:18} {flights} best {drone['best']:.2f}, {last:.2f} of it at the end{says}")


if __name__ == "__main__":
    sys.exit(main())
