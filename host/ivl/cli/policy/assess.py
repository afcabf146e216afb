"""`ivl policy assess`."""

from pathlib import Path
from typing import Annotated

import typer

from ivl import yamlfile
from ivl.analysis.intervals import Estimate
from ivl.cli import console
from ivl.cli.task_options import EQUIPMENT, Chosen, task_options
from ivl.policy import assess as judging
from ivl.policy import file
from ivl.policy.assess import Assessment, Rates
from ivl.policy.flying import Drawn, PolicyTask

HELP = """Judge a policy on fresh approaches that no learning has seen.

box (1.5 to 3.5 m/s, 30 to 90 degrees) and plane (0.25 to 4 m/s, 20 to 90 degrees): landing rates when every approach is
flown; shaped: the plane, flown by an approach that first leads into the region where landings are possible; go: on the
plane, how well the estimated probability tells landings from failures, and what the policy's own go / no-go does.

It is flown on what it was learned on, changed by the options. A policy that was learned over drawn vehicles is flown
by the vehicles of the files, too, unless --family draws others.

\b
Examples:
  ivl policy assess g.yaml
      as learned
  ivl policy assess g.yaml --sensing camera50_delay20 --estimator kalman --json
      another sensor set, for a script
  ivl policy assess g.yaml --gear narrow_long --set body.inertia_yy=3.0e-5
      other legs, another inertia
  ivl policy assess g.yaml --vehicle crazyflie21 --gear-set table1 --family 20
      vehicles drawn from the sigmas of the files, the same approaches for each; adds the tenth of them that land least
"""


@task_options(*EQUIPMENT, "start", kind=PolicyTask, otherwise="as it was learned")
def assess(
    chosen: Chosen,
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Policy file.")],
    approaches: Annotated[int, typer.Option(help="Fresh approaches of each region.", min=1, max=10_000_000)] = 2000,
    seed: Annotated[int, typer.Option(help="Seed of approaches, noise and drawn vehicles.", min=0)] = 0,
    family: Annotated[
        int | None, typer.Option(metavar="N", help="Draw N vehicles in place of each.", min=1, max=1000)
    ] = None,
    threads: Annotated[int | None, typer.Option(help="Worker threads; default: all processors.", min=1)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Judge a policy; HELP is the text that people see."""
    policy = file.load(path)
    different: list[PolicyTask] = []
    for learned_on in policy.tasks:
        task = yamlfile.validate(PolicyTask, chosen.fields(learned_on), "options")
        if task not in different:
            different.append(task)
    drawn = Drawn(n_vehicles=family, seed=seed) if family is not None else None
    found = judging.assess(policy, different, approaches, seed, threads, drawn)
    if as_json:
        console.print_json(found.as_dict())
    else:
        _print(found)


def _print(found: Assessment) -> None:
    _line("vehicles", str(found.vehicles))
    for name, rates in (("box", found.box), ("plane", found.plane), ("plane, shaped approach", found.shaped)):
        _line(name, _rates(rates) if rates else "this flight core has no such approach")
    go = found.go
    if go is None:
        return
    _line(
        "probability of a landing", f"AUC {console.number(go.auc, 3)}, error {console.number(go.calibration_error, 3)}"
    )
    _line("refused below", f"{go.p_min:g}")
    _line("refused", _share(go.no_go))
    _line("refused although they would land", _share(go.refused_good))
    _line("body strikes avoided", _share(go.strikes_avoided))
    _line("landings among those flown", _share(go.landed_of_flown))
    _line("contacts in level-outs", str(go.level_out_contacts))
    _line("contacts before the refusal", str(go.contacts_before))


def _rates(rates: Rates) -> str:
    text = f"{_share(rates.landed)} land, {_share(rates.clean)} clean"
    worst = rates.worst_tenth
    return text if worst is None else f"{text}; of the worst tenth of the vehicles {console.percent(worst)} land"


def _share(share: Estimate) -> str:
    return f"{console.percent(share.value)} ({console.percent(share.low)} .. {console.percent(share.high)})"


def _line(name: str, text: str) -> None:
    console.out.print(f"{name:36s} {text}", highlight=False, soft_wrap=True)
