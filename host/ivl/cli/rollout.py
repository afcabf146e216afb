"""`ivl rollout`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from pydantic import BaseModel

from ivl import forms, outcome, tracefile, yamlfile
from ivl.api.runs import LearnRun, load
from ivl.camera import video
from ivl.cli import console, policy_options
from ivl.cli.task_options import EQUIPMENT, FLAGS, Chosen, task_options
from ivl.errors import ConfigError
from ivl.landing import LandingSpec
from ivl.rewards import TOTAL, RewardChoice
from ivl.task import Task
from ivl.world import Trace, World

HELP = """Fly one landing and print its outcome.

\b
Examples:
  ivl rollout --gear wide_short --speed 2.5 --angle 90 --rrev 4.8 --moment 8
      the outcome, field by field
  ivl rollout --gear wide_long --gear-set as_simulated --speed 3 --angle 60 --rrev 4 --moment 7 --plot landing.png
      a strobe picture
  ivl rollout --speed 2.5 --angle 90 --rrev 4.8 --moment 8 --trace landing.csv --json
      the whole time series, and the outcome for a script
  ivl rollout --vehicle crazyflie21 --speed 2.5 --angle 90 --rrev 6 --moment 8 --set sense.latency=0.02
      another vehicle, slower sensing
  ivl rollout --experiment experiments/paper_vertical.yaml --rrev 4.8 --moment 8
      the landing that an experiment learns; without it the legs are those of table1, which were built and flown
  ivl rollout --run runs/paper_vertical-ephe-seed0 --plot landing.png
      what a run has learned, on the vehicle, gear and approach that it flew
  ivl rollout --sensing aideck60 --texture panels --plot p.png --frames f.mp4
      pictures of panels in the loop, and a video of what the camera saw; with a sensor set, and nothing said of
      approach and policy, the landing of experiments/onboard_camera.yaml
  ivl rollout --policy g.yaml --speed 1.2 --angle 35 --plot landing.png
      a policy for every approach (ivl policy learn), on what it was learned on, unless other options say otherwise; if
      it calls the approach off, the verdict says no_go, and the picture shows how the vehicle levels out
"""


SHOWN: dict[str, Any] = {"gear_set": "as_simulated", "speed_mps": 2.5, "angle_deg": 90.0, "start": "flown"}
SHOWN_POLICY = (5.05, 10.65)
"""What is flown if neither approach nor policy is said: the landing of experiments/onboard_camera.yaml, and a threshold
(1/s) and a moment (N mm) with which pictures land it (docs/CAMERA.md)."""


@task_options(*EQUIPMENT, "speed_mps", "angle_deg", "start")
def rollout(
    chosen: Chosen,
    rrev: policy_options.Rrev = None,
    moment: policy_options.Moment = None,
    form: policy_options.FormName = None,
    theta: policy_options.Theta = None,
    policy_file: policy_options.FileOption = None,
    run_folder: Annotated[
        Path | None,
        typer.Option("--run", metavar="FOLDER", help="Fly what a run of ivl learn recommends, on what it flew."),
    ] = None,
    distance: Annotated[float | None, typer.Option(help=f"{LandingSpec.model_fields['d_ceil_m'].description}")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.", min=0)] = 0,
    stream: Annotated[int, typer.Option(help="Number of the rollout within the seed.", min=0)] = 0,
    trace: Annotated[Path | None, typer.Option(help="Write the time series to FILE (.csv or .npz).")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the landing into FILE (.png, .svg or .pdf).")] = None,
    frames: Annotated[
        Path | None,
        typer.Option(help="Write what a rendered camera saw, slowed down: .mp4, .gif; .npz for ivl camera bench."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Fly one landing; HELP is the text that people see."""
    _check_files(trace, plot, frames)
    said = {"form": form, "theta": theta, "rrev": rrev, "moment": moment}
    learned = policy_options.load(policy_file, **said)
    if run_folder is not None:
        policy_options.only("--run", run_folder, policy=policy_file, experiment=chosen.path, **said)
    if _shown(chosen, policy_file, run_folder, **said):
        chosen = replace(chosen, given={**SHOWN, **chosen.given})
        rrev, moment = SHOWN_POLICY
    name = form or forms.PAPER
    bases: Sequence[BaseModel] = ()
    if run_folder is not None:
        spec = _of_run(run_folder)
        policy: dict[str, Any] = {"form": spec.form, "theta": spec.theta}
        bases = (Task(**{name: getattr(spec, name) for name in Task.model_fields}),)
    elif learned is not None:
        policy, bases = {"form": learned.form, "theta": learned.values}, learned.tasks
    else:
        policy = {"form": name, "theta": policy_options.theta_of(name, theta, rrev, moment)}
    numbers = {"seed": seed, "stream": stream, "d_ceil_m": distance}
    data = chosen.fields(*bases)
    _check_approach(data)
    spec = yamlfile.validate(LandingSpec, {**data, **policy, **numbers}, "options")
    world, flight = spec.fly()
    seen = spec.film(world) if frames else None
    if trace:
        tracefile.write(trace, flight.rows)
    if plot:
        _draw(world, flight, plot)
    if frames and seen:
        video.save(seen, frames)
    result = _result(world, flight)
    if as_json:
        console.print_json(result)
    else:
        _report(result)


def _shown(chosen: Chosen, policy_file: Path | None, run_folder: Path | None, **said: object) -> bool:
    """Whether nothing was said of approach and policy, so that the landing that shows pictures is meant."""
    camera = chosen.given.get("sensing")
    quiet = [policy_file, run_folder, chosen.path, *said.values(), *map(chosen.given.get, ("speed_mps", "angle_deg"))]
    return camera is not None and all(value is None for value in quiet)


def _check_files(trace: Path | None, plot: Path | None, frames: Path | None) -> None:
    """Refuse files whose kind is unknown, before anything is flown."""
    if trace:
        tracefile.check_suffix(trace)
    if plot and plot.suffix not in (".png", ".svg", ".pdf"):
        raise ConfigError(f"--plot {plot}: unknown kind of file (allowed .png, .svg, .pdf)")
    if frames:
        video.check_suffix(frames)


def _check_approach(data: dict[str, Any]) -> None:
    for name in ("speed_mps", "angle_deg"):
        if name not in data:
            raise ConfigError(f"{FLAGS[name][0]} is missing (or --experiment, which has it)")


def _of_run(folder: Path) -> LandingSpec:
    """The landing that a run recommends.

    Raises:
        ConfigError: It is no run of `ivl learn`, or nothing of it is finished.
        StoreError: There is no run.
    """
    found = load(folder)
    if not isinstance(found, LearnRun):
        raise ConfigError(f"--run {folder}: is no run of ivl learn; --policy and --rrev fly a landing of a sweep")
    return found.landing()


def _draw(world: World, flight: Trace, path: Path) -> None:
    from ivl.plots import strobe  # matplotlib takes a second to load

    strobe.draw(world, flight, [path])


def _result(world: World, flight: Trace) -> dict[str, Any]:
    """The outcome's fields by name, and what they amount to."""
    record = flight.outcome
    result = outcome.as_dict(record, world.end_reason(record.end_reason))
    result["verdict"] = outcome.verdict(record)
    batch = np.array([record], dtype=record.dtype)
    result["four_leg"] = bool(outcome.four_leg(batch)[0])
    result["clean"] = bool(outcome.clean(batch)[0])
    result["reward_paper"] = float(RewardChoice(name="paper").score(batch)[TOTAL][0])
    return result


def _report(result: dict[str, Any]) -> None:
    console.out.print(f"{'verdict':24s} {result['verdict']}", style="bold")
    for name, value in result.items():
        if name == "verdict":
            continue
        text = f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)
        console.out.print(f"{name:24s} {text}")
