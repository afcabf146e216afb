"""How often the intervals of `ivl flight identify` hold: a vehicle with known numbers is flown and identified.

A software vehicle flies landings over UDP, its flight recorder is read and imported, and three numbers that decide a
landing are identified from a vehicle file that has them wrong: rotor.tau_down by +50 %, sense.latency by +10 ms and
world.sensed_gap_offset by +20 mm, with standard deviations as large as these errors. Everything is repeated with other
noise; the share of 95 % intervals that hold the true value is printed, and must be 90 % or more.

    .venv/bin/python tools/identify_study.py --repetitions 50
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from ivl import experiment, model
from ivl.flight import identify, importer
from ivl.flight.log import Given
from ivl.flight.store import Flights
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.landing_flight import Rollout
from ivl.links.options import Options
from ivl.silproc import SilProcess
from ivl.world import World

WRONG = {"rotor.tau_down": 0.095, "sense.latency": 0.01, "world.sensed_gap_offset": 0.02}
"""Added to the true value; also the standard deviation that the wrong file states."""
_HOLD = 0.9


def record(folder: Path, source: CrazyflieSource, n_flights: int, seed: int) -> Flights:
    """Fly and import `n_flights` landings near the window."""
    rng = np.random.default_rng(seed)
    paths = []
    for i in range(n_flights):
        rollout = Rollout((float(rng.uniform(3.7, 4.0)), float(rng.uniform(5.5, 8.0))), seed, i)
        landing = source.fly_one(rollout)
        if landing.recording is None:
            raise RuntimeError("the vehicle has no flight recorder")
        path = folder / f"{seed}-{i}.csv"
        path.write_text(landing.recording.to_csv(), encoding="utf-8")
        legs = int(landing.outcome["n_legs"][0])
        given = Given(threshold_per_s=rollout.theta[0], moment_Nmm=rollout.theta[1], outcomes=[legs])
        paths.append((path, given))
    parts = [importer.run([path], "ivl", given) for path, given in paths]
    return Flights(parts[0].manifest, tuple(part[0] for part in parts))


def wrong_vehicle(folder: Path, vehicle: str) -> Path:
    """The vehicle's file with three numbers wrong."""
    values = model.load_vehicle(vehicle).quantities
    path = folder / "wrong.yaml"
    wrong = {name: values[name].value + error for name, error in WRONG.items()}
    path.write_text(identify.vehicle_text(vehicle, wrong, WRONG), encoding="utf-8")
    return path


def study(repetitions: int, n_flights: int, first_seed: int) -> dict[str, list[dict[str, float]]]:
    """Identify `repetitions` times; estimates by parameter."""
    chosen = experiment.load("experiments/paper_flight.yaml")
    world = chosen.make_world()
    found: dict[str, list[dict[str, float]]] = {name: [] for name in WRONG}
    with tempfile.TemporaryDirectory() as text, SilProcess(world) as server:
        folder = Path(text)
        wrong = str(wrong_vehicle(folder, chosen.vehicle))
        with CrazyflieSource(server.uri, chosen, Options(keep_recordings=True)) as source:
            for seed in range(first_seed, first_seed + repetitions):
                flights = record(folder, source, n_flights, seed)
                start = World(wrong, chosen.gear, chosen.gear_set)
                result = identify.identify(flights, start, list(WRONG), seed=seed)
                for one in result.estimates:
                    low, high = one.interval
                    truth = world.params.values[one.name]
                    found[one.name].append(
                        {"truth": truth, "value": one.value, "low": low, "high": high, "holds": low <= truth <= high}
                    )
                held = ", ".join(
                    f"{name} {rows[-1]['value']:.4f} ({'held' if rows[-1]['holds'] else 'MISSED'})"
                    for name, rows in found.items()
                )
                print(f"{seed - first_seed + 1} of {repetitions}: {held}", file=sys.stderr, flush=True)
    return found


def main() -> int:
    """Print the study; 0 if every interval holds as often as it says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=50)
    parser.add_argument("--flights", type=int, default=8, help="recorded landings of each repetition")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    found = study(args.repetitions, args.flights, args.first_seed)
    summary = {
        name: {
            "truth": rows[0]["truth"],
            "median": float(np.median([row["value"] for row in rows])),
            "spread": float(np.std([row["value"] for row in rows])),
            "half_width": float(np.median([0.5 * (row["high"] - row["low"]) for row in rows])),
            "holds": float(np.mean([row["holds"] for row in rows])),
        }
        for name, rows in found.items()
    }
    if args.json:
        print(json.dumps(summary))
    else:
        for name, one in summary.items():
            print(
                f"{name:26s} true {one['truth']:.4f}, identified {one['median']:.4f} +- {one['spread']:.4f} (spread of "
                f"{args.repetitions}), interval +- {one['half_width']:.4f} holds in {100 * one['holds']:.0f} %"
            )
    return 0 if all(one["holds"] >= _HOLD for one in summary.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
