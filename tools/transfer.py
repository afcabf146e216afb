"""Learn on vehicles that no learner has seen: how soon, and with how many failed landings.

    .venv/bin/python tools/transfer.py                         30 drones, 24 flights each, with ephe_belief
    .venv/bin/python tools/transfer.py --learner bo            another learner beside it
    .venv/bin/python tools/transfer.py --scale 3               drones from a family three times as wide
    .venv/bin/python tools/transfer.py --set vehicle=habas2021 --set gear_set=as_simulated --set start=imparted

"The drone" is a member of the experiment's family. The learner never sees its numbers: it asks for a policy, the drone
flies it, and it is told what the flight recorded and whether it landed. A drone is solved after n flights if what is
then recommended lands at least 0.9 times as often as the best policy of that drone, which is sought on a grid. Its rate
is one of fresh rollouts, like that of every recommendation. The best of several equal policies is a little lucky.

A failure that the best policy would have had, too, is no fault of the learner: the table has failures in all, and those
beyond the best policy's. Intervals are 95 % (Wilson).
"""

import argparse
import json
import os
import sys
import time
from dataclasses import dataclass
from multiprocessing import Pool
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter  # type: ignore[import-untyped]

from ivl import experiment, family
from ivl.analysis.intervals import wilson
from ivl.belief import recording
from ivl.belief.simulator import Simulator
from ivl.learners import EpheBelief
from ivl.learners.base import LANDED, RECORDING
from ivl.outcome import four_leg
from ivl.seeds import Purpose, derive
from ivl.world import World

AFTER = (1, 2, 4, 8, 24)
_GRID, _SMOOTH, _N_GRID = (0.1, 7), (0.7, 0.5), 10
_FINALISTS, _N_SECOND, _LAST, _N_FRESH = 16, 60, 3, 200
_SOLVED, _LEAST = 0.9, 1e-3


@dataclass(frozen=True)
class Bench:
    """What all drones have in common; the simulator is None for learners that begin with nothing."""

    chosen: experiment.Experiment
    kin: family.Family
    simulator: Simulator | None
    n_flights: int
    seed: int

    def rate(self, world: World, theta: np.ndarray, n: int, purpose: Purpose, first: int = 0) -> np.ndarray:
        """Landing rate of policies, shape (m, 2), over n rollouts each, the first of which has the number `first`."""
        chosen, seed = self.chosen, derive(self.seed, purpose)
        streams = first + np.arange(len(theta) * n).reshape(len(theta), n)
        outcomes = world.rollouts(
            chosen.speed_mps,
            chosen.angle_deg,
            *theta.T[..., None],
            seed=seed,
            stream=streams,
            start=chosen.start,
            threads=1,
        )
        return np.asarray(four_leg(outcomes).mean(axis=1))

    def best(self, world: World) -> float:
        """Landing rate of the best policy that is found, over fresh rollouts."""
        (r_lo, r_hi), (m_lo, m_hi) = self.chosen.policy.bounds
        axes = np.arange(max(r_lo, 2.0), r_hi, _GRID[0]), np.linspace(max(m_lo, 0.35 * m_hi), m_hi, _GRID[1])
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        rates = self.rate(world, grid.reshape(-1, 2), _N_GRID, Purpose.GRID).reshape(grid.shape[:2])
        order = np.argsort(-gaussian_filter(rates, _SMOOTH, mode="nearest").ravel(), kind="stable")
        finalists = grid.reshape(-1, 2)[order[:_FINALISTS]]
        second = self.rate(world, finalists, _N_SECOND, Purpose.GRID, first=1_000_000)
        last = finalists[np.argsort(-second, kind="stable")[:_LAST]]
        return float(self.rate(world, last, _N_FRESH, Purpose.GRID, first=2_000_000).max())

    def fly(self, number: int) -> dict[str, Any]:
        """Learn on one drone."""
        rng = np.random.Generator(np.random.PCG64([self.seed, number]))
        _, drone = self.kin.draw(rng)
        best = self.best(drone)
        learner = self.chosen.make_learner(derive(self.seed + number, Purpose.LEARNER))
        if self.simulator is not None and isinstance(learner, EpheBelief):
            learner.begin(self.simulator)
        landed, shares, took_s = [], {}, 0.0
        for n in range(self.n_flights):
            began = time.process_time()
            theta = learner.ask(1)
            took_s += time.process_time() - began
            flight_seed = derive(self.seed + number, Purpose.WORLD)
            features, outcome = recording.simulated(drone, self.chosen.flight, theta[0], flight_seed, n)
            landed.append(bool(four_leg(outcome)[0]))
            reward = self.chosen.reward.score(outcome)["total"]
            began = time.process_time()
            learner.tell(theta, reward, {LANDED: np.array(landed[-1:]), RECORDING: features[None]})
            took_s += time.process_time() - began
            if n + 1 in AFTER:
                recommended = learner.result.recommended[None]
                shares[n + 1] = float(self.rate(drone, recommended, _N_FRESH, Purpose.CHECK)[0]) / max(best, _LEAST)
        fits = learner.model_fits if isinstance(learner, EpheBelief) else None
        return {"best": best, "landed": landed, "shares": shares, "fits": fits, "cpu_s": took_s / self.n_flights}


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
    parser.add_argument("--seed", type=int, default=1000, help="of the drones")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args(arguments)
    chosen = experiment.load(args.experiment, args.settings, learner=args.learner)
    home = chosen.nominal_world_of(chosen.gear)
    learners = family.of(home, chosen.family)
    drones = family.of(home, chosen.family.model_copy(update={"scale": args.scale * chosen.family.scale}))
    simulator = None
    if chosen.learner.name == "ephe_belief":
        simulator = Simulator.of(learners, chosen.flight, progress=_progress)
    bench = Bench(chosen, drones, simulator, args.flights, args.seed)
    with Pool(args.workers) as pool:
        results = pool.map(bench.fly, range(args.drones), chunksize=1)
    if args.json:
        print(json.dumps({"learner": chosen.learner.name, "drones": results}))
    else:
        _report(chosen.learner.name, results)
    return 0


def _progress(done: int, n: int) -> None:
    if done == n or done % 200 == 0:
        print(f"simulated vehicles: {done} of {n}", file=sys.stderr)


def _report(name: str, results: list[dict[str, Any]]) -> None:
    n, best = len(results), np.array([r["best"] for r in results])
    landed = np.array([r["landed"] for r in results])
    failed = (~landed).sum(axis=1)
    beyond = failed - landed.shape[1] * (1.0 - best)
    print(f"{name}: {n} drones, best policies land {best.mean():.3f} (lowest {best.min():.2f})")
    for after in results[0]["shares"]:
        shares = np.array([r["shares"][after] for r in results])
        solved = int((shares >= _SOLVED).sum())
        low, high = (float(x) for x in wilson(solved / n, n))
        share = f"solved {solved / n:.2f} ({low:.2f} to {high:.2f}), share of the best {shares.mean():.3f}"
        print(f"after {after:2d} flights: {share}")
    first = ", ".join(f"flight {k + 1} lands {landed[:, k].mean():.2f}" for k in range(min(2, landed.shape[1])))
    print(first)
    more = f"beyond those of the best policy {beyond.mean():.2f}"
    print(f"failures in {landed.shape[1]} flights: {failed.mean():.1f}, {more}")
    told = [r["fits"] for r in results if r["fits"] is not None]
    if told:
        print(f"no member fits, said of {told.count(False)} drones")
    print(f"processor time a flight: {np.mean([r['cpu_s'] for r in results]):.2f} s")


if __name__ == "__main__":
    sys.exit(main())
