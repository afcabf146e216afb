"""Regenerate the tables and maps of docs/RESULTS.md with the public interface of `ivl`.

    .venv/bin/python tools/results.py table              every learner in the paper's experiment, 100 seeds
    .venv/bin/python tools/results.py other              other approaches, 50 seeds
    .venv/bin/python tools/results.py flight             every learner in the experiment as it was flown, 50 seeds
    .venv/bin/python tools/results.py maps               docs/figures/map_*.png

Each cell of a table is kept in build/results as JSON, so that an interrupted run continues; remove the folder to start
afresh. Trial t is the same seed for every learner (paired): the same random numbers in the world.
"""

import argparse
import json
import math
import shutil
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ivl import assess, experiment, four_leg, native
from ivl.layout import layout_of
from ivl.learning.loop import LearningRun, trials_of
from ivl.plots import style
from ivl.run import make_manifest
from ivl.source import WorldSource
from ivl.store import RunStore

ROOT = Path(__file__).parent.parent
CACHE = ROOT / "build" / "results"
FIGURES = ROOT / "docs" / "figures"
FILES = {
    "ideal": "experiments/paper_vertical.yaml",
    "noise": "experiments/paper_vertical_noise.yaml",
    "flight": "experiments/paper_flight.yaml",
}
EPISODES = ["n_rollouts=8", "budget=160"]
"""Of all learners here alike: some begin with nothing, whatever the files say."""
SIMULATED = ("ideal", "noise")
GEAR_SETS = ("as_simulated", "table1")
LEARNERS = ("ephe", "ephe_new", "ephe_robust", "ephe_memory", "cmaes", "cmaes_lr", "bo")
OTHER_LEARNERS = ("ephe_robust", "bo")
OTHER_APPROACHES = ((2.0, 90.0), (3.0, 90.0), (2.5, 60.0))
MAP_ROLLOUTS = 24


@dataclass(frozen=True)
class Condition:
    """A world and an approach; `label` names its files."""

    gear_set: str
    sensing: str
    speed_mps: float = 2.5
    angle_deg: float = 90.0

    @property
    def label(self) -> str:
        """Name in file names."""
        return f"{self.gear_set}-{self.sensing}-{self.speed_mps:g}mps-{self.angle_deg:g}deg"

    def load(self, learner: str | None = None) -> experiment.Experiment:
        """The experiment, with a learner in place of the file's own."""
        replaced = {"gear_set": self.gear_set, "speed_mps": self.speed_mps, "angle_deg": self.angle_deg}
        return experiment.load(FILES[self.sensing], EPISODES, learner=learner, **replaced)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="regenerate the tables and maps of docs/RESULTS.md")
    parser.add_argument("what", choices=("table", "other", "flight", "maps"))
    parser.add_argument("--trials", type=int, help="seeds a cell; omitted: 100 for the table, 50 for the others")
    parser.add_argument("--first-seed", type=int, default=0, help="seeds from here on; tuning used 1000 to 1999")
    parser.add_argument("--learners", nargs="+", help="omitted: all of the table")
    parser.add_argument("--threads", type=int, default=1, help="of the simulator")
    args = parser.parse_args()
    if args.what == "maps":
        for condition in paper_conditions():
            print(draw_map(condition, args.threads).relative_to(ROOT))
        return 0
    flight = [Condition("table1", "flight")]
    conditions = {"table": paper_conditions(), "other": other_conditions(), "flight": flight}[args.what]
    learners = args.learners or (OTHER_LEARNERS if args.what == "other" else LEARNERS)
    n_trials = args.trials or (100 if args.what == "table" else 50)
    for condition in conditions:
        print_table(condition, learners, n_trials, args.first_seed, args.threads)
    return 0


def paper_conditions() -> Iterator[Condition]:
    """Both gear sets, ideal and noisy."""
    for gear_set in GEAR_SETS:
        for sensing in SIMULATED:
            yield Condition(gear_set, sensing)


def other_conditions() -> Iterator[Condition]:
    """Approaches that no option was chosen on."""
    for speed_mps, angle_deg in OTHER_APPROACHES:
        for sensing in SIMULATED:
            yield Condition("as_simulated", sensing, speed_mps, angle_deg)


def print_table(condition: Condition, learners: tuple[str, ...], n_trials: int, seed: int, threads: int) -> None:
    """A Markdown table, row by row as the cells are done."""
    best = find_best(condition, threads)
    rrev, moment = best.theta
    print(
        f"\n**{condition.gear_set}, {condition.sensing}, {condition.speed_mps:g} m/s, {condition.angle_deg:g} deg.** ",
        end="",
    )
    print(
        f"Best policy: RREV_c {rrev:.2f} 1/s, M_yd {moment:.2f} N mm, four-leg rate {best.rate_four_leg:.3f}; ", end=""
    )
    print(f"solved from {0.9 * best.rate_four_leg:.3f} on.\n")
    print("| learner | solved (95 %) | rollouts, median | p90 | failed | failed, total | stuck | four-leg | clean |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in learners:
        print(table_row(name, run_cell(condition, name, best, n_trials, seed, threads)), flush=True)


def table_row(name: str, cell: dict[str, Any]) -> str:
    """One row of the table."""
    low, high = wilson(cell["solved"], cell["trials"])
    late = cell["rollouts_to_convergence"]
    return (
        f"| `{name}` | {cell['solved']}/{cell['trials']} ({100 * low:.0f}-{100 * high:.0f} %) "
        f"| {number(late['median'])} | {number(late['p90'])} "
        f"| {number(cell['failed_landings']['median'])} | {number(cell['failed_landings_total']['median'])} "
        f"| {100 * cell['stuck']:.0f} % | {cell['landing_rate_four_leg']:.2f} | {cell['landing_rate_clean']:.2f} |"
    )


def number(value: float | None) -> str:
    """A count, or a dash where fewer trials than that ever got there."""
    return "-" if value is None else f"{value:.0f}"


def wilson(k: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    z, share = 1.96, k / n
    center = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    return max(0.0, center - half), min(1.0, center + half)


def find_best(condition: Condition, threads: int) -> assess.Best:
    """The best possible policy, searched once a condition."""
    chosen = condition.load()
    path = CACHE / f"{condition.label}.json"
    if not path.exists():
        write(path, asdict(assess.find_best(chosen.make_world(), chosen, threads)))
    data = json.loads(path.read_text(encoding="utf-8"))
    return assess.Best.of_dict(data)


def run_cell(
    condition: Condition, learner: str, best: assess.Best, n_trials: int, seed: int, threads: int
) -> dict[str, Any]:
    """Summary of all trials of one learner."""
    path = CACHE / f"{condition.label}-{learner}-seed{seed}-x{n_trials}.json"
    if not path.exists():
        chosen = condition.load(learner).model_copy(update={"seed": seed})
        world = chosen.make_world()
        folder = path.with_suffix("")
        shutil.rmtree(folder, ignore_errors=True)
        manifest = make_manifest(chosen, world, n_trials)
        with RunStore.create(
            folder, chosen.to_yaml(), manifest, native.library().outcome_dtype, layout_of(chosen)
        ) as store:
            LearningRun(trials_of(chosen, n_trials), WorldSource(world, chosen, threads), store).run()
            verdicts = assess.judge(world, chosen, best, store.episodes(), store.rollouts(), threads)
        write(path, assess.summarise(verdicts) | {"verdicts": [asdict(v) for v in verdicts]})
        shutil.rmtree(folder)
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return data


def draw_map(condition: Condition, threads: int) -> Path:
    """Four-leg, other-leg and body-contact rate over the policy plane."""
    chosen = condition.load()
    rrev, moment = np.arange(3.5, 6.6, 0.05), np.arange(1.0, 10.9, 0.3)
    out = chosen.make_world().rollouts(
        chosen.speed_mps,
        chosen.angle_deg,
        np.repeat(np.repeat(rrev[:, None, None], len(moment), axis=1), MAP_ROLLOUTS, axis=2),
        moment[:, None],
        seed=chosen.seed,
        start=chosen.start,
        threads=threads,
    )
    panels = {
        "three or four legs": four_leg(out),
        "one or two legs": (out.n_legs > 0) & ~four_leg(out),
        "body or rotor contact": out.body_contact != 0,
    }
    figure = style.new_figure(7.5, 2.4)
    axes = figure.subplots(1, 3, sharey=True)
    for axis, (title, happened) in zip(axes, panels.items(), strict=True):
        image = axis.pcolormesh(
            rrev, moment, happened.mean(axis=2).T, vmin=0, vmax=1, shading="nearest", rasterized=True
        )
        axis.set_title(title, fontsize=style.NORMAL)
        axis.set_xlabel("RREV_c (1/s)")
        style.finish(axis)
    axes[0].set_ylabel("M_yd (N mm)")
    figure.colorbar(image, ax=axes, label="share of rollouts")
    path = FIGURES / f"map_{condition.gear_set}_{condition.sensing}.png"
    figure.savefig(path, dpi=90)
    return path


def write(path: Path, data: Any) -> None:
    """JSON, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(json.dumps(data, indent=1), encoding="utf-8")
    part.replace(path)


if __name__ == "__main__":
    sys.exit(main())
