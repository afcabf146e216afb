"""Does the belief over vehicles know what it does not know? Ranks of true vehicles among its particles.

    .venv/bin/python tools/calibration.py                       200 drones, 4 flights each
    .venv/bin/python tools/calibration.py --drones 50 --json
    .venv/bin/python tools/calibration.py --figure docs/figures/belief_ranks.png

Each drone is a member of the family of experiments/transfer.yaml. It flies what `ephe_belief` asks for. Then the rank
of each of its true numbers among the particles is taken (Talts et al. 2018, Validating Bayesian inference algorithms
with simulation-based calibration): of a belief that is right, all ranks are equally likely, and an interval that is
said to hold 90 % of the vehicles holds 90 %. The landing rate that is expected of the recommendation is compared with
that of fresh rollouts, too.
"""

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom, chisquare
from threadpoolctl import threadpool_limits

from ivl import experiment, family
from ivl.belief import recording
from ivl.belief.simulator import Simulator
from ivl.learners.base import LANDED, RECORDING
from ivl.outcome import four_leg
from ivl.plots import style

EXPERIMENT = "experiments/transfer.yaml"
LEVELS = (0.5, 0.9)
N_BINS, FRESH = 10, 400


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="ranks of true vehicles in a belief over vehicles")
    parser.add_argument("--drones", type=int, default=200)
    parser.add_argument("--flights", type=int, default=4)
    parser.add_argument("--seed", type=int, default=6000, help="of the drones")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--figure", type=Path, help="draw the ranks, too")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    _simulator(args.seed)  # the bank is flown once, and kept
    one = partial(_drone, args.seed, args.flights)
    rows = []
    # a worker that shares its core with threads of others takes three times as long
    with ProcessPoolExecutor(args.workers, initializer=threadpool_limits, initargs=(1,)) as pool:
        for row in pool.map(one, range(args.drones)):
            rows.append(row)
            print(f"drone {len(rows)} of {args.drones}", file=sys.stderr, flush=True)
    result = summary(rows)
    if args.figure is not None:
        draw(result, args.figure)
    if args.json:
        print(json.dumps(result))
    else:
        _report(result)
    return 0


def _chosen(seed: int) -> experiment.Experiment:
    return experiment.load(EXPERIMENT, [f"family.seed={seed}"])


def _simulator(seed: int) -> Simulator:
    chosen = _chosen(seed)
    return Simulator.of(family.of(chosen.nominal_world_of(chosen.gear), chosen.family), chosen.flight)


def _drone(seed: int, n_flights: int, number: int) -> dict[str, Any]:
    """Ranks of one drone after its flights, and expected and true landing rate of what is then recommended."""
    chosen, simulator = _chosen(seed), _simulator(seed)
    drawn = simulator.kin.sample(number + 1, seed)
    z, world = drawn.z[-1], drawn.worlds[-1]
    learner = chosen.trial(number).make_learner(seed=number)
    learner.begin(simulator)
    for flight in range(n_flights):
        theta = learner.ask()[:1]
        features, outcome = recording.simulated(world, simulator.flight, theta[0], seed * 1000 + number, flight)
        landed = four_leg(outcome)
        learner.tell(theta, landed.astype(float), {LANDED: landed, RECORDING: features[None]})
    particles = learner.particles
    recommended = np.asarray(learner.result.recommended)
    fresh = world.rollouts(
        chosen.speed_mps, chosen.angle_deg, *recommended.tolist(), form=chosen.policy.form, seed=seed + 1,
        stream=np.arange(FRESH), start=chosen.start, threads=1,
    )  # fmt: skip
    return {
        "ranks": ((particles < z).mean(axis=0)).tolist(),
        "errors": ((particles.mean(axis=0) - z) / particles.std(axis=0)).tolist(),
        "width": particles.std(axis=0).tolist(),
        "expected": float(learner.expected_rates(recommended[None])[0]),
        "rate": float(four_leg(fresh).mean()),
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Figures over drones, by parameter."""
    names = _simulator_names()
    ranks = np.array([row["ranks"] for row in rows])
    errors, widths = (np.array([row[key] for row in rows]) for key in ("errors", "width"))
    expected, rate = (np.array([row[key] for row in rows]) for key in ("expected", "rate"))
    by_name = {}
    for i, name in enumerate(names):
        counts = np.histogram(ranks[:, i], N_BINS, (0.0, 1.0))[0]
        by_name[name] = {
            "counts": counts.tolist(),
            "p_uniform": float(chisquare(counts).pvalue),
            "inside": {str(level): float((np.abs(ranks[:, i] - 0.5) <= level / 2).mean()) for level in LEVELS},
            "error_rms": float(np.sqrt((errors[:, i] ** 2).mean())),
            "width": float(widths[:, i].mean()),
        }
    return {
        "n_drones": len(rows),
        "parameters": by_name,
        "landing": {
            "expected": float(expected.mean()),
            "rate": float(rate.mean()),
            "rms": float(np.sqrt(((expected - rate) ** 2).mean())),
        },
    }


@style.drawing
def draw(result: dict[str, Any], path: Path) -> None:
    """Ranks of each number, with the band that holds nine of ten bars of a belief that is right."""
    n, rows = result["n_drones"], result["parameters"]
    low, high = binom.interval(LEVELS[-1], n, 1.0 / N_BINS)
    n_columns = 5
    figure = style.new_figure(9.0, 1.7 * -(-len(rows) // n_columns))
    axes = figure.subplots(-(-len(rows) // n_columns), n_columns, sharey=True, squeeze=False)
    for axis, (name, row) in zip(axes.flat, rows.items(), strict=False):
        axis.axhspan(low, high, color=style.GREY, alpha=0.25, linewidth=0)
        axis.bar((np.arange(N_BINS) + 0.5) / N_BINS, row["counts"], 0.9 / N_BINS, color=style.BLUE)
        axis.set_title(name, fontsize=style.NORMAL)
        style.finish(axis)
    for axis in axes.flat[len(rows) :]:
        axis.set_axis_off()
    for axis in axes[:, 0]:
        axis.set_ylabel("drones")
    for axis in axes[-1]:
        axis.set_xlabel("rank of the truth")
    style.save(figure, [path], dpi=100)


def _simulator_names() -> tuple[str, ...]:
    chosen = _chosen(0)
    return family.of(chosen.nominal_world_of(chosen.gear), chosen.family).names


def _report(result: dict[str, Any]) -> None:
    print(f"{result['n_drones']} drones; of each number the share that intervals hold, and error / stated spread (rms)")
    for name, row in result["parameters"].items():
        inside = ", ".join(f"{float(level):.0%}: {share:.0%}" for level, share in row["inside"].items())
        print(
            f"{name:28} {inside}   error {row['error_rms']:.2f}   "
            f"spread {row['width']:.2f} of the family   ranks {row['counts']}"
        )
    landing = result["landing"]
    print(f"landing rate of what is recommended: expected {landing['expected']:.3f}, flown {landing['rate']:.3f}")


if __name__ == "__main__":
    sys.exit(main())
