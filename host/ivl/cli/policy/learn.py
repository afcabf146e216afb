"""`ivl policy learn`."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ivl.cli import console
from ivl.errors import ConfigError
from ivl.policy import file, general
from ivl.policy.learn import Progress as Standing
from ivl.policy.learn import learn as learn_policy

HELP = """Learn one policy for every approach, and write it into a file.

TASK is a YAML file that says what is flown, where approaches are drawn, and how it learns; a name such as
experiments/general.yaml is also found inside the package. Further files add their tasks: the objective is the mean.
Ctrl-C keeps the best so far.

\b
Examples:
  ivl policy learn experiments/general.yaml --out g.yaml
      Wide-Short with ideal sensing
  ivl policy learn experiments/general.yaml --form bilinear --learner ephe_robust --out g.yaml
      another form, another learner (see: ivl list forms, ivl list learners)
  ivl policy learn experiments/general.yaml --set sensing=camera50_delay20 --set estimator=kalman --out c.yaml
      with an upward camera
  ivl policy learn experiments/general.yaml --policy g.yaml --set gear=narrow_long --out n.yaml
      search on from the numbers of another policy
  ivl policy learn experiments/general.yaml --set vehicle=crazyflie21 --set drawn.n_vehicles=6 --out f.yaml
      over six vehicles, drawn from the sigmas of the files of vehicle and gear (with --set gear_set=table1)
"""


def learn(
    tasks: Annotated[list[str], typer.Argument(metavar="TASK...", help="YAML files.")],
    out: Annotated[Path, typer.Option(help="File for the policy.")],
    form: Annotated[str | None, typer.Option(help="Form of the policy; see `ivl list forms`.")] = None,
    learner: Annotated[str | None, typer.Option(help="Learner by name; see `ivl list learners`.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of approaches, noise and learner.", min=0)] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="A.B=C", help="Change a field, in every task, or a parameter of every world."),
    ] = None,
    policy: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Search from this policy, in place of the map's.")
    ] = None,
    threads: Annotated[int | None, typer.Option(help="Worker threads; default: all processors.", min=1)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object; progress goes to stderr.")] = False,
) -> int:
    """Learn a policy; HELP is the text that people see."""
    if not out.parent.is_dir():
        raise ConfigError(f"--out {out}: there is no folder {out.parent}")
    if out.is_dir():
        raise ConfigError(f"--out {out}: is a folder; a file is needed")
    chosen = general.load(tasks, settings or [], form=form, learner=learner, seed=seed)
    start = file.load(policy) if policy is not None else None
    with _progress() as tell:
        learned = learn_policy(chosen, tell, threads, start)
    file.save(learned, out)
    training, score = learned.training, learned.score
    if training is None:
        raise ConfigError(f"{out}: a learned policy says how it was learned")
    if training.interrupted:
        console.say(f"interrupted; the best so far is in {out}")
    if as_json:
        console.print_json({"policy": str(out), **learned.model_dump(mode="json")})
    else:
        rates, own = "not known", "it refuses nothing"
        if score is not None:
            rates = f"{console.percent(score.landed)} land, {console.percent(score.clean)} clean, every one flown"
        if score is not None and score.with_go is not None:
            own = f"{console.percent(score.with_go.refused)} are refused, {console.percent(score.with_go.landed)} land"
        for name, text in (
            ("form", f"{learned.form}, {learned.shape.n} numbers"),
            ("flights", str(training.rollouts)),
            ("objective at the start", console.number(training.start_objective, 4)),
            ("objective of the policy", console.number(training.objective, 4)),
            ("over the approaches that chose it", rates),
            ("go / no-go", f"no flip below a probability of {learned.theta['go_p_min'].value:g}"),
            ("the same with go / no-go", own),
            ("policy", str(out)),
        ):
            console.out.print(f"{name:36s} {text}", highlight=False, soft_wrap=True)
    return 130 if training.interrupted else 0


@contextmanager
def _progress() -> Iterator[Callable[[Standing], None]]:
    """A bar on stderr, and the function that moves it."""
    columns = (
        TextColumn("{task.description:12s}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[told]}"),
    )
    began = time.monotonic()
    with Progress(*columns, console=console.err) as bar:
        row = bar.add_task("map", total=1.0, told="")

        def move(at: Standing) -> None:
            rate = at.n_flights / max(time.monotonic() - began, 1e-9)
            told = f"{at.n_flights} flights, {rate:.0f}/s"
            told += f", objective {at.objective:.3f}" if np.isfinite(at.objective) else ""
            bar.update(row, description=at.stage, completed=at.done, told=told)

        yield move
