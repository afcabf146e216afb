"""Learn over links that misbehave, compare every stored bit with learning in process, and write docs/RELIABILITY.md.

Run by `make reliability`. Options shorten it: `--budget 32 --only freeze`; then nothing is written.
"""

import argparse
import platform
import sqlite3
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import marked

from ivl import experiment, native, run
from ivl.errors import IvlError
from ivl.experiment import Experiment
from ivl.layout import layout_of
from ivl.learning.loop import LearningRun
from ivl.learning.recorder import SCORED
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.options import Options
from ivl.links.sites.simulator import Simulator
from ivl.silproc import SilProcess
from ivl.source import WorldSource
from ivl.store import RunStore

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "RELIABILITY.md"
BEGIN, END = "<!-- measured by tools/reliability.py: begin -->", "<!-- measured by tools/reliability.py: end -->"
STRIKE_EVERY = 40
"""A fault that strikes does so in every so many landings, while the vehicle is in its approach or flip."""

STRIKE_S = 0.05
STATUS = 4
"""Column of a stored rollout: trial, episode, idx, stream, status, ..."""

Action = Callable[[SilProcess], None]
Rows = list[tuple[object, ...]]


@dataclass(frozen=True)
class Case:
    """A way to misbehave: faults that last, or one that strikes."""

    name: str
    text: str
    faults: dict[str, float]
    strike: Action | None = None


def freeze(server: SilProcess) -> None:
    """Stop answering for three seconds."""
    server.set("fault.freeze_ms", 3000)


def cut(server: SilProcess) -> None:
    """Lose every packet for three seconds."""
    server.set("fault.cut_ms", 3000)


def restart(server: SilProcess) -> None:
    """Crash, and be started again half a second later at the same address."""
    server.kill()
    time.sleep(0.5)
    server.start()


def restart_at_once(server: SilProcess) -> None:
    """Crash, and be there again at once, knowing nothing."""
    server.kill()
    server.start()


CASES = (
    Case("clean", "no fault", {}),
    Case("loss-5", "5 % of the packets lost, both ways", {"loss": 0.05}),
    Case("loss-20", "20 % of the packets lost, both ways", {"loss": 0.2}),
    Case("jitter", "0 .. 50 ms of delay, both ways, drawn for each packet", {"jitter_ms": 50.0}),
    Case("disorder", "30 % of the packets twice, 30 % overtaken", {"duplicate": 0.3, "reorder": 0.3}),
    Case("freeze", f"frozen for 3 s in every {STRIKE_EVERY}th landing", {}, freeze),
    Case("cut", f"cut for 3 s in every {STRIKE_EVERY}th landing", {}, cut),
    Case("restart", f"killed in every {STRIKE_EVERY}th landing, back 0.5 s later", {}, restart),
    Case("restart-at-once", f"killed in every {STRIKE_EVERY}th landing, back at once", {}, restart_at_once),
)


@dataclass(frozen=True)
class Result:
    """What happened."""

    case: Case
    wall_s: float
    n_flown: int
    n_discarded: int
    n_wrong: int
    n_lost: int
    same: bool
    error: str


def rows_of(folder: Path) -> list[Rows]:
    """All that a run has stored of rollouts, episodes and learners."""
    with sqlite3.connect(folder / "run.sqlite") as db:
        tables = ("rollout ORDER BY trial, episode, idx", "episode", "learner")
        return [db.execute(f"SELECT * FROM {table}").fetchall() for table in tables]


def learn(chosen: Experiment, folder: Path, source: CrazyflieSource | WorldSource) -> None:
    """Learn, without judging what was learned."""
    manifest = run.make_manifest(chosen, chosen.make_world())
    with RunStore.create(
        folder, chosen.to_yaml(), manifest, native.library().outcome_dtype, layout_of(chosen)
    ) as store:
        LearningRun([chosen], source, store).run()


@contextmanager
def striking(server: SilProcess, action: Action | None) -> Iterator[None]:
    """Let a fault strike in the air, in every so many landings; errors of the fault itself are raised at the end."""
    original, n_landings = Simulator.outcome, 0
    threads: list[threading.Thread] = []
    errors: list[IvlError] = []

    def strike(what: Action) -> None:
        try:
            what(server)
        except IvlError as error:
            errors.append(error)

    def outcome(site: Simulator, policy_seq: int) -> object:
        nonlocal n_landings
        n_landings += 1
        if action is not None and n_landings % STRIKE_EVERY == STRIKE_EVERY // 2:
            threads.append(threading.Thread(target=strike, args=(action,)))
            threads[-1].start()
            time.sleep(STRIKE_S)
        return original(site, policy_seq)

    Simulator.outcome = outcome
    try:
        yield
    finally:
        Simulator.outcome = original
        for thread in threads:
            thread.join()
    if errors:
        raise errors[0]


def run_case(case: Case, chosen: Experiment, reference: list[Rows], folder: Path) -> Result:
    """Learn under one case and compare."""
    said: list[str] = []
    error, n_discarded = "", 0
    with SilProcess(chosen.make_world()) as server:
        began_s = time.monotonic()
        try:
            with striking(server, case.strike), CrazyflieSource(server.uri, chosen, Options(say=said.append)) as source:
                for name, value in case.faults.items():
                    server.set(f"fault.{name}", value)
                learn(chosen, folder, source)
                n_discarded = source.n_discarded
                for name in case.faults:
                    server.set(f"fault.{name}", 0.0)
        except IvlError as failure:
            error = str(failure)
        wall_s = time.monotonic() - began_s
    for line in said:
        print(f"    {line}", flush=True)
    rows = rows_of(folder)
    known = dict(zip([row[:3] for row in reference[0]], reference[0], strict=True))
    scored = [row for row in rows[0] if row[STATUS] == SCORED]
    n_wrong = sum(row != known.get(row[:3]) for row in scored)
    n_lost = chosen.budget - len(scored)
    return Result(case, wall_s, len(scored), n_discarded, n_wrong, n_lost, rows == reference, error)


def table(results: list[Result], chosen: Experiment) -> str:
    """The results for the page."""
    lines = [
        f"{chosen.budget} rollouts of {chosen.name}, learner {chosen.learner.name}; {platform.machine()}, "
        f"{time.strftime('%Y-%m-%d')}.",
        "",
        "| link | wall time, s | flown again | scored wrongly | lost | stored bits as in process | ended by |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in results:
        same, ended = "yes" if r.same else "**no**", r.error or "its budget"
        lines.append(
            f"| {r.case.text} | {r.wall_s:.1f} | {r.n_discarded} | {r.n_wrong} | {r.n_lost} | {same} | {ended} |"
        )
    return "\n".join(lines) + "\n"


def main() -> int:
    """Run the cases; exit code 1 if one of them did not end right."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--experiment", default="experiments/paper_vertical.yaml")
    parser.add_argument("--budget", type=int, help="rollouts, instead of the experiment's")
    parser.add_argument("--only", action="append", choices=[case.name for case in CASES], help="this case alone")
    arguments = parser.parse_args()
    chosen = experiment.load(arguments.experiment, budget=arguments.budget)
    cases = [case for case in CASES if not arguments.only or case.name in arguments.only]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        learn(chosen, folder / "in-process", WorldSource(chosen.make_world(), chosen, 1))
        reference = rows_of(folder / "in-process")
        results = []
        for case in cases:
            print(f"{case.name}: {case.text}", flush=True)
            results.append(run_case(case, chosen, reference, folder / case.name))
    text = table(results, chosen)
    print(text)
    if arguments.only is None and arguments.budget is None:
        marked.write(PAGE, text, BEGIN, END)
    return 0 if all(r.same and not r.error and not r.n_wrong and not r.n_lost for r in results) else 1


if __name__ == "__main__":
    raise SystemExit(main())
