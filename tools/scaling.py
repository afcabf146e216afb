"""What a sweep costs beside its flights, and what follows for larger machines.

.venv/bin/python tools/scaling.py           measure and print
.venv/bin/python tools/scaling.py --write   also rewrite the tables of docs/SCALING.md
"""

import argparse
import json
import re
from pathlib import Path

from ivl.sweep import bench, config, plan
from ivl.sweep.bench import Measured

PAGE = Path(__file__).parent.parent / "docs" / "SCALING.md"
LEARNERS = ("ephe", "bo")
CORES = (2, 16, 100, 1000, 10_000)
LINK_BYTES_PER_S = 1e9 / 8  # a gigabit


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="measure sweeps, and compute how they scale")
    parser.add_argument("--cells", type=int, default=240, help="cells flown for each measurement")
    parser.add_argument("--write", action="store_true", help="rewrite the tables of docs/SCALING.md")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    args = parser.parse_args()
    measured = [bench.measure(name, args.cells) for name in LEARNERS]
    blocks = {"measured": measured_table(measured), "computed": computed_table(measured[-1])}
    if args.json:
        print(json.dumps({m.learner: m.as_dict() for m in measured}))
    else:
        print("\n\n".join(blocks.values()))
    if args.write:
        PAGE.write_text(with_blocks(PAGE.read_text(encoding="utf-8"), blocks), encoding="utf-8")


def measured_table(measured: list[Measured]) -> str:
    """One column for each learner."""
    rows = {
        "load average before": [f"{m.load_before:.1f}" for m in measured],
        "rollouts/s, one worker": [f"{m.rollouts_per_s_1:,.0f}" for m in measured],
        "rollouts/s, two workers": [f"{m.rollouts_per_s_2:,.0f}" for m in measured],
        "efficiency of two": [f"{100 * m.efficiency:.0f} %" for m in measured],
        "processor time of a trial": [f"{1e3 * m.trial_processor_s:.0f} ms" for m in measured],
        "overhead of a task": [f"{1e3 * m.task_overhead_s:.1f} ms" for m in measured],
        "task of 32 trials, as sent": [f"{m.task_bytes / 1e3:.1f} kB" for m in measured],
        "result of a trial": [f"{m.trial_bytes / 1e3:.2f} kB" for m in measured],
        "the same with every rollout": [f"{m.trial_bytes_with_rollouts / 1e3:.1f} kB" for m in measured],
    }
    head = ["", *(f"`{m.learner}`" for m in measured)]
    return table(head, [[name, *cells] for name, cells in rows.items()])


def computed_table(m: Measured) -> str:
    """The paper's campaign and one of a thousand times its trials, on more and more cores."""
    paper = config.load_sweep("sweeps/paper.yaml")
    rows = [row(m, paper, cores) for cores in CORES]
    rows += [row(m, paper.model_copy(update={"trials": 1000 * paper.trials}), cores) for cores in CORES[2:]]
    head = ["trials", "cores", "trials a task", "tasks", "a task lasts", "tasks/s back", "client busy", "MB/s", "takes"]
    return table(head, rows)


def row(m: Measured, sweep: config.Sweep, cores: int) -> list[str]:
    """The model: cores work side by side, the client takes tasks back one by one, the last one is waited for."""
    n_trials = len(sweep.approaches()) * len(sweep.gear_names()) * sweep.trials
    size = plan.good_size(sweep, cores)
    n_tasks = -(-n_trials // size)
    flying_s = n_trials * m.trial_processor_s / min(cores, n_tasks)
    client_s = n_tasks * m.task_overhead_s
    takes_s = max(flying_s, client_s) + size * m.trial_processor_s
    return [
        f"{n_trials:,}", f"{cores:,}", f"{size}", f"{n_tasks:,}", f"{size * m.trial_processor_s:.1f} s",
        f"{n_tasks / takes_s:,.1f}", f"{100 * client_s / takes_s:.0f} %",
        f"{n_trials * m.trial_bytes / takes_s / 1e6:.2f}", duration(takes_s),
    ]  # fmt: skip


def duration(seconds: float) -> str:
    """Seconds for people."""
    return (
        f"{seconds:.0f} s"
        if seconds < 100
        else f"{seconds / 60:.1f} min"
        if seconds < 6000
        else f"{seconds / 3600:.1f} h"
    )


def table(head: list[str], rows: list[list[str]]) -> str:
    """Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def with_blocks(page: str, blocks: dict[str, str]) -> str:
    """The page with the text between `<!-- name -->` and `<!-- /name -->` replaced."""
    for name, text in blocks.items():
        page, n = re.subn(
            f"<!-- {name} -->.*?<!-- /{name} -->", f"<!-- {name} -->\n{text}\n<!-- /{name} -->", page, flags=re.DOTALL
        )
        if n != 1:
            raise SystemExit(f"{PAGE}: the marks of {name!r} are missing")
    return page


if __name__ == "__main__":
    main()
