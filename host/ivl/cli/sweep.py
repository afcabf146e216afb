"""`ivl sweep` and `ivl map`."""

import math
import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn

from ivl import plugins, references, run
from ivl.cli import console, policy_options
from ivl.family import MEMBER
from ivl.policy import use

HELP = """Learn over a grid of approaches and landing gears: run a sweep FILE.

FILE is YAML; a name such as sweeps/paper.yaml is also found inside the package. The run folder has tables in
Parquet, one row per trial (see ivl.sweep.schema); results do not depend on workers, their number, or interruptions.

\b
Examples:
  ivl sweep sweeps/smoke.yaml
      a few cells, in seconds
  ivl sweep sweeps/paper.yaml --learner ephe
      the paper's campaign with another learner, on all processors of this machine
  ivl sweep sweeps/paper.yaml --set gear_set=table1 --set trials=1
      other landing gears, one trial per cell
  ivl sweep sweeps/smoke.yaml --set sensing=camera50 --set estimator=kalman --vary learner.name=ephe,bo
      learners side by side, on the same random numbers, with an upward camera; any field of an experiment and any
      parameter of the world can be varied
  ivl sweep sweeps/smoke.yaml --vary sense.latency=0.0,0.01,0.02 --vary gear=wide_short
      one landing gear, three latencies
  ivl sweep sweeps/smoke.yaml --policy g.yaml --set start=flown --set estimator=known_height_predicted
      a policy for every approach, as it is, over the grid: landing rates without learning
  ivl sweep sweeps/smoke.yaml --set vehicle=crazyflie21 --set gear_set=table1 --family 10
      on ten vehicles of a family (ivl family --help)
  ivl sweep sweeps/paper.yaml --out runs/mine --resume
      go on after Ctrl-C, kill -9 or power loss; trials that failed are flown again
  ivl sweep sweeps/paper.yaml --scheduler tcp://10.0.0.1:8786
      on a Dask cluster that is running
  ivl sweep sweeps/paper.yaml --scheduler slurm --workers 100
      on a batch system (describe its jobs in Dask's configuration, see docs/SCALING.md)
"""

MAP_HELP = """Fly the policy map: flips commanded at once over a grid of speed, angle, distance and moment.

FILE is YAML; a name such as sweeps/map.yaml is also found inside the package. Nothing is learned: the map shows from
where a landing is possible at all. Options are those of `ivl sweep`.

\b
Examples:
  ivl map sweeps/map.yaml
      the map of the paper's landing gears
  ivl map sweeps/map.yaml --set gears=[wide_long] --json
      one of them, for a script
  ivl map sweeps/map.yaml --set vehicle=crazyflie21 --set gear_set=table1 --family 20
      over 20 vehicles of a family (ivl family --help): for each gear the flip that suits all of them best, its landing
      rate as a mean, over the worst tenth of the vehicles, and the share of vehicles that it lands
"""

File = Annotated[str, typer.Argument(metavar="FILE", help="YAML file.")]
Out = Annotated[Path | None, typer.Option(help="Run folder; default: a new one under runs/.")]
Resume = Annotated[bool, typer.Option("--resume", help="Continue a run that was cut off, or had failures.")]
Scheduler = Annotated[
    str | None, typer.Option(help="Address of a Dask scheduler, or slurm; default: processes on this machine.")
]
Workers = Annotated[int | None, typer.Option(help="Worker processes; default: one per processor.", min=1, max=100_000)]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="A.B=C", help="Change a field of the file or a parameter of the world."),
]
Family = Annotated[
    int | None,
    typer.Option(
        metavar="N", help="Fly N members of the family in place of the vehicle: --vary family.member.", min=1, max=1000
    ),
]
Vary = Annotated[
    list[str] | None,
    typer.Option("--vary", metavar="A.B=X,Y", help="Fly every value of a field, in place of the file's values."),
]
TaskSize = Annotated[int | None, typer.Option(help="Trials per task; default: as fits the workers.", min=1, max=10_000)]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Say what would be flown, and stop.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object; progress goes to stderr.")]


def sweep(
    path: File,
    out: Out = None,
    resume: Resume = False,
    scheduler: Scheduler = None,
    workers: Workers = None,
    learner: Annotated[str | None, typer.Option(help="Learner by name; see `ivl list learners`.")] = None,
    settings: Settings = None,
    vary: Vary = None,
    family: Family = None,
    policy_file: Annotated[
        Path | None,
        typer.Option("--policy", metavar="FILE", help="Fly this policy as it is; with --learner: begin with it."),
    ] = None,
    task_size: TaskSize = None,
    dry_run: DryRun = False,
    as_json: AsJson = False,
) -> int:
    """Run a sweep; HELP is the text that people see."""
    from ivl.sweep import config  # with Arrow and Dask it takes a second to load

    learned = policy_options.load(policy_file)
    change = use.as_it_is(learned, learner, vary or []) if learned is not None else None
    grid = config.load_sweep(path, settings or [], [*(vary or []), *_members(family)], change, learner=learner)
    if learned is not None:
        use.check_as_it_is(grid, learned, learner)
    base = f"{grid.name}-{references.title(grid.gear_set)}-{'-'.join(map(plugins.title, grid.learner_names()))}"
    return _run(grid, base, "ivl sweep", path, out, resume, scheduler, workers, task_size, dry_run, as_json)


def map_(
    path: File,
    out: Out = None,
    resume: Resume = False,
    scheduler: Scheduler = None,
    workers: Workers = None,
    settings: Settings = None,
    vary: Vary = None,
    family: Family = None,
    task_size: TaskSize = None,
    dry_run: DryRun = False,
    as_json: AsJson = False,
) -> int:
    """Fly a policy map; MAP_HELP is the text that people see."""
    from ivl.sweep import config

    grid = config.load_map(path, settings or [], [*(vary or []), *_members(family)])
    base = f"{grid.name}-{references.title(grid.gear_set)}"
    return _run(grid, base, "ivl map", path, out, resume, scheduler, workers, task_size, dry_run, as_json)


def _members(n: int | None) -> list[str]:
    """The text of `--vary` for n members of the family."""
    return [] if n is None else [f"{MEMBER}={','.join(map(str, range(n)))}"]


def _run(
    grid: Any, base: str, command: str, path: str, out: Path | None, resume: bool, scheduler: str | None,
    workers: int | None, task_size: int | None, dry_run: bool, as_json: bool,
) -> int:  # fmt: skip
    """What both commands do; exit code 1 if trials failed."""
    from ivl.sweep import cluster, engine, plan, summary

    if dry_run:
        size = task_size or plan.good_size(grid, workers or cluster.default_workers())
        _print(summary.of_plan(grid, size), as_json)
        return 0
    run_folder = out or run.numbered_folder(base, resume)
    try:
        with _progress(run_folder) as on_standing:
            result = engine.run(
                grid, run_folder, resume=resume, scheduler=scheduler, workers=workers, task_size=task_size,
                on_standing=on_standing,
            )  # fmt: skip
    except KeyboardInterrupt:
        words = shlex.join([*command.split(), path, "--resume", "--out", str(run_folder)])
        console.say(f"interrupted; continue with: {words} and the same options")
        raise
    report = summary.of_run(result)
    _print(report, as_json)
    return 1 if report["failed"] else 0


@contextmanager
def _progress(run_folder: Path) -> Iterator[Callable[[Any], None]]:
    """The folder and a bar on stderr once there is something to tell, and the function that moves the bar."""
    columns = (
        BarColumn(),
        TaskProgressColumn(),
        MofNCompleteColumn(),
        TextColumn("trials,"),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[left]}"),
    )
    bar = Progress(*columns, console=console.err)
    row = bar.add_task("", total=None, rate="starting workers", left="")

    def move(standing: Any) -> None:
        if not bar.live.is_started:
            console.err.print(f"run folder: {run_folder}")
            bar.start()
        bar.update(row, total=standing.n_trials, completed=standing.n_done, rate=_rate(standing), left=_left(standing))

    try:
        yield move
    finally:
        if bar.live.is_started:
            bar.stop()


def _rate(standing: Any) -> str:
    failed = f", {standing.n_failed} failed" if standing.n_failed else ""
    if not standing.n_workers:
        return "starting workers" if standing.n_done < standing.n_trials else ""
    speed = standing.n_rollouts / standing.elapsed_s if standing.elapsed_s > 0 else 0.0
    return f"{speed:.0f} rollouts/s on {standing.n_workers} workers{failed}"


def _left(standing: Any) -> str:
    if standing.n_done == standing.n_trials:
        return f"took {_clock(standing.elapsed_s)}"
    return "" if math.isnan(standing.left_s) else f"{_clock(standing.left_s)} to go"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"


def _print(report: dict[str, Any], as_json: bool) -> None:
    if as_json:
        console.print_json(report)
        return
    groups = report.get("groups", [])
    _print_lines({name: value for name, value in report.items() if name != "groups"})
    for group in groups:
        console.out.print()
        _print_lines({name: "null" if value is None else value for name, value in group.items()})


def _print_lines(values: dict[str, Any]) -> None:
    for name, value in values.items():
        console.out.print(f"{name.replace('_', ' '):34s} {_text(value)}")


def _text(value: Any) -> str:
    """A value of the report for people."""
    if value is None:
        return "-"
    if isinstance(value, list):
        return ", ".join(map(str, value))
    if isinstance(value, dict):
        return ", ".join(f"{name} {_text(each)}" for name, each in value.items())
    return str(value)
