"""`ivl family`: the vehicles that a task may be flown with, as far as its numbers are uncertain."""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
import typer

from ivl import family
from ivl.cli import console
from ivl.cli.task_options import EQUIPMENT, Chosen, task_options
from ivl.errors import ConfigError
from ivl.family import Dimension, Family, FamilyChoice, Sample

HELP = """Families: vehicles that are drawn from the uncertainty of the numbers in the files.

\b
Examples:
  ivl family show experiments/transfer.yaml
      the parameters that are drawn, and how
  ivl family show experiments/transfer.yaml --members 100
      a hundred vehicles of it
  ivl rollout --experiment experiments/transfer.yaml --rrev 4 --moment 8 --set family.member=3
      a landing with one of them, no. 3; every command that takes --set can fly it
  ivl map sweeps/map.yaml --set vehicle=crazyflie21 --set gear_set=table1 --family 20
      where twenty of them land (ivl sweep takes --family, too)
"""

SHOW_HELP = """Show which parameters of a family are drawn, around what and how far, and where that is known from.

The sigma of the files of vehicle, gear and sensors make a family; the section `family:` of an experiment adds to it
and replaces it:

\b
  family:
    parameters:
      body.mass: {share: 0.03, source: "scales"}            standard deviation, as a share of the value
      sense.latency: {sigma: 0.004, source: "log files"}    or in the unit of the parameter
      leg.foot_damping: {log_uniform: [1.0e-5, 5.0e-4], source: "assumption"}
      rotor.tau_up: {share: 0.1, bounds: [0.04, 0.07], source: "motor test"}
    known: [aero.*, body.inertia_xx]                        not drawn, whatever the files say
    correlations:
      - {of: [rotor.tau_up, rotor.tau_down], value: 0.8, source: "the same motors"}
    scale: 1.0                                              factor on all spreads
    seed: 0                                                 of the members
    member: null                                            fly this one, 0 or more; null: the vehicle of the files;
                                                            each: trial k of ivl learn --trials N flies member k
    member_scale: 1.0                                       factor on the spread of the members that fly, not of the
                                                            family that a learner knows
    member_overrides: {aero.drag_xy: 0.1}                   values of the members that fly, whatever was drawn; a
                                                            learner does not know them

A parameter that --set gives a value is known, and is not drawn.

\b
Examples:
  ivl family show experiments/transfer.yaml
      the family of an experiment
  ivl family show --vehicle crazyflie21 --gear wide_long
      the family of the files alone
  ivl family show experiments/transfer.yaml --set family.scale=3 --members 200 --seed 1
      two hundred vehicles at three times the spread, and how many further ones the library refused
  ivl family show experiments/transfer.yaml --set family.parameters.body.mass.share=0.1
      more doubt about the mass
  ivl family show experiments/transfer.yaml --members 200 --json
      all values, for a script
"""

_SHOWN_MAX = 5  # members whose values people see

app = typer.Typer(help=HELP, rich_markup_mode=None, no_args_is_help=True)


@app.command("show", help=SHOW_HELP, short_help="Show what is drawn, and draw it.")
@task_options(*EQUIPMENT)
def show(
    chosen: Chosen,
    path: Annotated[str | None, typer.Argument(metavar="[EXPERIMENT]", help="As --experiment.")] = None,
    members: Annotated[int, typer.Option(help="Draw so many vehicles.", min=0, max=family.MEMBERS_MAX)] = 0,
    seed: Annotated[int | None, typer.Option(help="Seed of the drawn vehicles; default: family.seed.", min=0)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Show a family; SHOW_HELP is the text that people see."""
    if path is not None and chosen.path is not None:
        raise ConfigError(f"--experiment {chosen.path}: the experiment is already {path}")
    if seed is not None and not members:
        raise ConfigError("--seed: is for --members")
    setup, gear = replace(chosen, path=path or chosen.path).setup()
    kin = family.of(setup.nominal_world_of(gear), setup.family)
    seed = setup.family.seed if seed is None else seed
    sample = kin.sample(members, seed) if members else None
    if as_json:
        console.print_json(_data(kin, setup.family, sample, seed))
        return
    _print(kin, setup.family)
    if sample is not None:
        _print_sample(kin, sample)


def _data(kin: Family, choice: FamilyChoice, sample: Sample | None, seed: int) -> dict[str, Any]:
    world = kin.world
    found: dict[str, Any] = {
        "vehicle": world.vehicle,
        "gear_set": world.gear_set,
        "gear": world.gear,
        "sensing": world.sensing,
        "scale": kin.scale,
        "parameters": {d.name: _parameter(d, kin.scale) for d in kin.dimensions},
        "correlations": [c.model_dump() for c in choice.correlations if set(c.of) <= set(kin.names)],
    }
    if sample is not None:
        values = kin.values(sample.z).T.tolist()
        found["members"] = {
            "n": len(sample.worlds),
            "seed": seed,
            "n_refused": sample.n_refused,
            "share_refused": sample.share_refused,
            "values": dict(zip(kin.names, values, strict=True)),
        }
    return found


def _parameter(d: Dimension, scale: float) -> dict[str, Any]:
    lo, hi = (bound if np.isfinite(bound) else None for bound in (d.lo, d.hi))
    sigma = None if d.is_log else scale * d.sigma
    return {"unit": d.unit, "centre": d.centre, "sigma": sigma, "lo": lo, "hi": hi, "source": d.source}


def _print(kin: Family, choice: FamilyChoice) -> None:
    world = kin.world
    sensing = f", sensors {world.sensing}" if world.sensing else ""
    _say(f"vehicle {world.vehicle}, gear {world.gear_set}/{world.gear}{sensing}: {len(kin.names)} parameters are drawn")
    if kin.scale != 1.0:
        _say(f"all spreads are {kin.scale:g} times those of the files and of the section")
    _say(f"{'parameter':26s} {'centre':>10s}  {'spread':>12s} {'unit':10s} {'bounds':24s} source")
    for d in kin.dimensions:
        spread = "log-uniform" if d.is_log else f"+- {kin.scale * d.sigma:.4g}"
        bounds = f"{d.lo:g} .. {d.hi:g}"
        _say(f"{d.name:26s} {d.centre:10.4g}  {spread:>12s} {d.unit:10s} {bounds:24s} {d.source}")
    for c in choice.correlations:
        if set(c.of) <= set(kin.names):
            _say(f"correlation of {' and '.join(c.of)}: {c.value:g} ({c.source})")


def _print_sample(kin: Family, sample: Sample) -> None:
    n = len(sample.worlds)
    values = kin.values(sample.z)
    _say("")
    _say(f"{n} drawn; the library refused {sample.n_refused} others ({console.percent(sample.share_refused)})")
    first = range(min(n, _SHOWN_MAX))
    columns = ["mean", "deviation", "least", "most", *(f"no. {i}" for i in first)]
    _say(f"{'parameter':26s} {' '.join(f'{column:>10s}' for column in columns)} unit")
    for d, drawn in zip(kin.dimensions, values.T, strict=True):
        numbers = [drawn.mean(), drawn.std(), drawn.min(), drawn.max(), *drawn[: len(first)]]
        _say(f"{d.name:26s} {' '.join(f'{number:10.4g}' for number in numbers)} {d.unit}")
    if n > len(first):
        _say(f"(--json has the values of all {n})")


def _say(text: str) -> None:
    console.out.print(text, highlight=False, markup=False, soft_wrap=True)
