"""`ivl policy adapt`."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ivl import family
from ivl.cli import console
from ivl.errors import ConfigError
from ivl.outcome import clean, four_leg
from ivl.policy import adapt as adapting
from ivl.policy import file
from ivl.policy.flying import Place, PolicyTask
from ivl.policy.region import NAMED
from ivl.seeds import Purpose, derive
from ivl.settings import apply_setting
from ivl.world import World

HELP = """Adapt a policy for every approach to vehicles that differ from what it was learned on.

A belief over vehicles starts from the family of the policy's task: the sigmas of the files of vehicle, gear and
sensors (see `ivl family show`). Each vehicle is drawn from that family, and flies some landings at random approaches.
The belief learns from each recording and outcome which vehicle this is, and EPHE over imagined flights changes
threshold and moment. Fresh approaches judge each vehicle's policy before and after. Go / no-go is off in all of it.

\b
Examples:
  ivl policy adapt g.yaml --vehicles 10
      ten vehicles, eight flights each
  ivl policy adapt g.yaml --vehicles 1 --first 3 --out adapted.yaml
      the vehicle with the number 3; its adapted policy is written
  ivl policy adapt g.yaml --set family.scale=2 --flights 16 --json
      vehicles that differ twice as much
"""


_TOLD_EVERY = 400


def adapt(
    policy: Annotated[Path, typer.Argument(metavar="FILE", help="Policy to begin with.")],
    vehicles: Annotated[int, typer.Option(help="Vehicles to adapt to.", min=1, max=1000)] = 10,
    flights: Annotated[int, typer.Option(help="Flights of each.", min=1, max=1000)] = 8,
    first: Annotated[int, typer.Option(help="Number of the first vehicle.", min=0, max=9999)] = 0,
    region: Annotated[str, typer.Option(help=f"Approaches that count: {', '.join(NAMED)}.")] = "box",
    fresh: Annotated[int, typer.Option(help="Approaches that judge a policy.", min=1, max=1_000_000)] = 2000,
    seed: Annotated[int, typer.Option(help="Seed of vehicles, approaches and noise.", min=0)] = 0,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="A.B=C", help="Change a field of the policy's task, or a parameter of its world."
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File for the adapted policy of the only vehicle.")] = None,
    threads: Annotated[int | None, typer.Option(help="Worker threads; default: all processors.", min=1)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object; progress goes to stderr.")] = False,
) -> int:
    """Adapt a policy; HELP is the text that people see."""
    if out is not None and vehicles != 1:
        raise ConfigError(f"--out {out}: one vehicle is needed (--vehicles 1)")
    if region not in NAMED:
        raise ConfigError(f"--region: value {region!r} (allowed {', '.join(NAMED)})")
    begun = file.load(policy)
    place = Place.of(_task(begun, settings or []))
    kin = family.of(place.world, place.task.family)
    drones = kin.sample(first + vehicles, derive(seed, Purpose.FAMILY_ASSESS)).worlds[first:]
    rows: list[dict[str, Any]] = []
    theta = np.array(begun.values)
    for number, world in enumerate(drones, start=first):
        adaptation = adapting.Adaptation(place, begun, NAMED[region], seed + number, threads, _bank)
        row = _one(world, adaptation, number, flights, fresh, seed, threads)
        rows.append(row)
        theta = adaptation.theta
        console.say(
            f"vehicle {number}: landed {row['before']['landed']:.3f} before, {row['after']['landed']:.3f} after"
        )
    if out is not None:
        file.save(file.make(begun.shape, theta.tolist(), [place.task], begun.training, None), out)
    summary = _summary(rows)
    if as_json:
        console.print_json({"policy": str(policy), "flights": flights, **summary, "vehicles": rows})
    else:
        for when in ("before", "after"):
            told = f"{summary[when]['landed']:.3f} land, {summary[when]['clean']:.3f} clean"
            console.out.print(f"{when + ' ' + str(flights) + ' flights':22s} {told}", highlight=False)
        error = summary["gain_error"]
        told = f"{summary['gain']:+.3f}" + ("" if error is None else f" +- {error:.3f}")
        console.out.print(f"{'gain in landings':22s} {told}", highlight=False)
    return 0


def _task(begun: file.PolicyFile, settings: list[str]) -> PolicyTask:
    data = begun.tasks[0].model_dump(mode="json")
    for setting in settings:
        apply_setting(data, setting, PolicyTask, "task")
    return PolicyTask.model_validate(data)


def _bank(done: int, n: int) -> None:
    if done == n or done % _TOLD_EVERY == 0:
        console.say(f"simulated vehicles: {done} of {n}")


def _one(
    world: World, adaptation: adapting.Adaptation, number: int, flights: int, fresh: int, seed: int, threads: int | None
) -> dict[str, Any]:
    """Adapt to one vehicle, and judge."""
    rng = np.random.default_rng([seed, number])
    approaches = adaptation.flight.approaches
    assert approaches is not None
    before = _judged(world, adaptation, fresh, seed, threads)
    expected = [adaptation.expected_rate()]
    landed = []
    for stream in range(flights):
        speed_mps, angle_deg = (float(rng.uniform(lo, hi)) for lo, hi in approaches)
        features, outcome = adapting.fly(
            world, adaptation, speed_mps, angle_deg, derive(seed + number, Purpose.WORLD), stream
        )
        landed.append(adapting.landed(outcome))
        adaptation.tell(speed_mps, angle_deg, features, landed[-1])
        expected.append(adaptation.expected_rate())
    return {
        "number": number,
        "before": before,
        "after": _judged(world, adaptation, fresh, seed, threads),
        "landed": landed,
        "expected": expected,
    }


def _judged(world: World, adaptation: adapting.Adaptation, n: int, seed: int, threads: int | None) -> dict[str, float]:
    """Landing rates of the present policy over fresh approaches."""
    general, approaches = adaptation.general, adaptation.flight.approaches
    assert approaches is not None
    rng = np.random.default_rng([seed, int(Purpose.ASSESS)])
    speed_mps, angle_deg = (rng.uniform(lo, hi, n) for lo, hi in approaches)
    outcomes = world.rollouts(
        speed_mps, angle_deg, *general.always_go(adaptation.theta)[:, None], form=general.form.name,
        seed=derive(seed, Purpose.ASSESS), stream=np.arange(n), start=adaptation.flight.start, threads=threads,
    )  # fmt: skip
    return {"landed": float(four_leg(outcomes).mean()), "clean": float(clean(outcomes).mean())}


def _summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    gains = np.array([row["after"]["landed"] - row["before"]["landed"] for row in rows])
    mean = {
        when: {kind: float(np.mean([row[when][kind] for row in rows])) for kind in ("landed", "clean")}
        for when in ("before", "after")
    }
    error = float(gains.std(ddof=1) / np.sqrt(len(gains))) if len(gains) > 1 else None
    return {**mean, "gain": float(gains.mean()), "gain_error": error}
