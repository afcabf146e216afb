"""Measure what docs/ESTIMATION.md states; write it and docs/figures/sensing.png.

    python tools/estimation.py              whatever is not measured yet (20 min on two cores), then the page
    python tools/estimation.py --write      the page alone, from what was measured

Measurements are kept in build/estimation as JSON, so that an interrupted run continues; remove the folder to start
afresh. The table of instructions needs `make firmware`.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from ivl import estimation, experiment, four_leg
from ivl.cli.console import number, percent
from ivl.plots import sensing as plot

ROOT = Path(__file__).parent.parent
CACHE = ROOT / "build" / "estimation"
TEMPLATE = Path(__file__).parent / "estimation_page.md"
PAGE, FIGURE = ROOT / "docs" / "ESTIMATION.md", ROOT / "docs" / "figures" / "sensing.png"
REPLAY = ROOT / "build" / "stm32-Os" / "replay.elf"
TABLE_RUNS, TRIALS, SPEED_RUNS = 1000, 12, 1000
SPEEDS_MPS = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5)

# label: sensor set, estimator
LANDINGS = {
    "(i) ideal": ("ideal", "known_height"),
    "(i) ideal, cues predicted": ("ideal", "known_height_predicted"),
    "(ii) motion capture, 10 ms late": ("mocap", "known_height"),
    "(ii) motion capture, cues predicted": ("mocap", "known_height_predicted"),
    "(iii) onboard: camera and Multi-ranger": ("camera50_ranger10", "kalman"),
    "(iii) onboard: camera alone": ("camera50_delay20", "kalman"),
    "(iii) onboard: fast camera": ("camera100", "kalman"),
}
EQUIPMENT = {
    "motion capture, predicted": ("mocap", "known_height_predicted"),
    "motion capture": ("mocap", "known_height"),
    "camera 100 Hz, 10 ms": ("camera100", "kalman"),
    "camera 50 Hz, 20 ms\n+ Multi-ranger": ("camera50_ranger10", "kalman"),
    "camera 50 Hz, 20 ms": ("camera50_delay20", "kalman"),
    "camera 30 Hz, 40 ms": ("camera30_delay40", "kalman"),
    "VL53L1x 50 Hz": ("ranger50", "kalman"),
    "Multi-ranger 10 Hz": ("ranger10", "kalman"),
}


def cached(name: str, measure: Callable[[], Any]) -> Any:
    """The measurement of that name, made now if it was not made before."""
    path = CACHE / f"{name}.json"
    if not path.exists():
        print(f"measuring {name}", file=sys.stderr, flush=True)
        CACHE.mkdir(parents=True, exist_ok=True)
        result = measure()
        path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return json.loads(path.read_text(encoding="utf-8"))


def table() -> list[dict[str, Any]]:
    """Every approach, sensor set and estimator."""
    return [estimation.study(*cell, n=TABLE_RUNS).as_dict() for cell in estimation.all_cells()]


def learn(sensors: str, estimator: str) -> dict[str, Any]:
    """Learning in the paper's experiment, flown from a hover, under one sensing."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-c", "from ivl.cli import main; main()", "learn", "experiments/onboard_only.yaml",
            "--set", f"sensing={sensors}", "--set", f"estimator={estimator}", "--trials", str(TRIALS), "--json",
            "--out", f"{folder}/run",
        ]  # fmt: skip
        run = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    result: dict[str, Any] = json.loads(run.stdout)
    return result


def best_rate(sensors: str, estimator: str, speed_mps: float) -> float:
    """Four-leg rate of the best policy of a grid, judged by fresh rollouts."""
    world = experiment.load(estimation.EXPERIMENT, sensing=sensors, estimator=estimator).make_world()
    axes = np.meshgrid(np.arange(2.5, 7.01, 0.15), np.array([6.0, 7.5, 9.0, 10.5]), indexing="ij")
    policies = np.stack([axis.ravel() for axis in axes], axis=1)
    for stage, (keep, n) in enumerate(((len(policies), 12), (16, 100), (1, SPEED_RUNS))):
        policies = policies[:keep]
        columns = np.repeat(policies, n, axis=0)
        out = world.rollouts(speed_mps, 90.0, columns[:, 0], columns[:, 1], seed=stage, start="flown")
        rates = four_leg(out).reshape(-1, n).mean(axis=1)
        policies = policies[np.argsort(-rates, kind="stable")]
    return float(rates.max())


def speeds() -> dict[str, list[float]]:
    """Best rate of each equipment over speed."""
    return {label: [best_rate(*chosen, speed) for speed in SPEEDS_MPS] for label, chosen in EQUIPMENT.items()}


def cost() -> dict[str, list[int]]:
    """Instructions of a tick of APPROACH on the STM32 (gcc -Os), by source: mean, and the most of any phase."""
    sys.path.insert(0, str(ROOT / "tools" / "stm32"))
    import budget
    import recording

    result = {}
    names = ("known_height", "formula", "kalman", "range")
    with tempfile.TemporaryDirectory() as folder:
        for source, name in enumerate(names):
            recorded = recording.record(Path(folder), 40_000, 100 + source, source=source)
            counts = budget._counts(REPLAY, recorded)
            n, _, total, most = counts["approach"]
            result[name] = [round(total / n), most, max(row[3] for row in counts.values())]
    return result


def markdown(head: str, rows: list[list[str]]) -> str:
    """A table; `head` has its columns separated by bars."""
    columns = head.split("|")
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(cell.strip() for cell in line)} |".replace(" --- ", "---") for line in lines)


def rows_of_table(cells: list[dict[str, Any]]) -> list[list[str]]:
    """One row a cell."""
    shares = ("triggered", "valid", "error_median", "error_p90")
    return [
        [
            c["approach"], c["sensors"], c["estimator"], *(percent(c[name]) for name in shares),
            number(c["nees"]), percent(c["coverage"]), number(c["speed_mps"]),
        ]
        for c in cells
    ]  # fmt: skip


def rows_of_landings(runs: dict[str, Any]) -> list[list[str]]:
    """Rates after learning."""
    return [
        [
            label, LANDINGS[label][1], percent(run["best"]["rate_four_leg"]), percent(run["landing_rate_four_leg"]),
            number(run["rollouts_to_convergence"]["median"], 0),
        ]
        for label, run in runs.items()
    ]  # fmt: skip


def find(cells: list[dict[str, Any]], *names: str) -> dict[str, Any]:
    """One cell of the table."""
    return next(c for c in cells if (c["approach"], c["sensors"], c["estimator"]) == names)


def errors(cell: dict[str, Any]) -> str:
    """Median and 90th percentile."""
    return f"{percent(cell['error_median'])}, {percent(cell['error_p90'])}"


def rows_of_targets(cells: list[dict[str, Any]], runs: dict[str, Any]) -> list[list[str]]:
    """The targets, and what was measured."""
    best = find(cells, "accelerate_hold", "camera50_delay20", "kalman")
    unknown = find(cells, "accelerate_hold", "camera50_delay20_unknown", "kalman")
    raw = find(cells, "accelerate_hold", "camera50_delay20", "formula_unguarded")
    ideal, _, _, _, onboard, *_ = (run["landing_rate_four_leg"] for run in runs.values())
    known = [c for c in cells if c["estimator"] == "kalman" and c["coverage"] and not c["sensors"].endswith("_unknown")]
    low, high = estimation.COVERAGE
    honest = [c for c in known if low <= c["coverage"] <= high]
    honesty = f"{number(best['nees'])}, {percent(best['coverage'])}"
    return [
        [
            "filter, camera 50 Hz, 5 % noise, 20 ms delay known: error, median and 90th percentile",
            "5 %, 12 %",
            errors(best),
        ],
        ["the same: NEES, and share within 2 sigma", "1, 90 to 99 %", honesty],
        ["the same with the delay unknown: error", "-", errors(unknown)],
        [f"formula without its guards: error of the {percent(raw['triggered'])} that trigger", "-", errors(raw)],
        ["filter, delays known: rows with 90 to 99 % within 2 sigma", "all", f"{len(honest)} of {len(known)}"],
        [
            "landing rate lost from (i) to (iii), recommended policies",
            "5 points",
            f"{100 * (ideal - onboard):.1f} points",
        ],
    ]


def write(cells: list[dict[str, Any]], runs: dict[str, Any], rates: dict[str, list[float]], counts: Any) -> None:
    """The page and its figure."""
    plot.draw(SPEEDS_MPS, rates, "Wide-Short, vertical, from a hover", [FIGURE])
    columns = "approach | sensors | estimator | triggers | valid | median | 90 % | NEES | within 2 sigma | speed"
    landings = "sensing | estimator | best possible | recommended | rollouts to convergence, median"
    costs = [[name, *map(str, row)] for name, row in counts.items()]
    text = Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        targets=markdown("what | target | measured", rows_of_targets(cells, runs)),
        trials=str(TRIALS),
        landings=markdown(landings, rows_of_landings(runs)),
        runs=f"{TABLE_RUNS:,}",
        table=markdown(columns, rows_of_table(cells)),
        cost=markdown("source | APPROACH, mean | APPROACH, most | any phase, most", costs),
    )
    PAGE.write_text(text, encoding="utf-8")
    print(f"wrote {PAGE.relative_to(ROOT)}, {FIGURE.relative_to(ROOT)}")


def main() -> int:
    """Measure what is missing, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="measure nothing; fail if something is missing")
    args = parser.parse_args()
    measured = sorted(path.stem for path in CACHE.glob("*.json"))
    wanted = ["table", "speeds", "cost", *(f"learn-{i}" for i in range(len(LANDINGS)))]
    if args.write and (missing := [name for name in wanted if name not in measured]):
        print(f"error: not measured yet: {', '.join(missing)}", file=sys.stderr)
        return 1
    counts = cached("cost", cost)
    cells = cached("table", table)
    runs = {
        label: cached(f"learn-{i}", lambda chosen=chosen: learn(*chosen))
        for i, (label, chosen) in enumerate(LANDINGS.items())
    }
    rates = cached("speeds", speeds)
    write(cells, runs, rates, counts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
