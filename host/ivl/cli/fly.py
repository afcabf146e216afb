"""`ivl fly`."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ivl import experiment, files, outcome
from ivl.cli import console, policy_options, site_options
from ivl.cli.task_options import FLAGS
from ivl.errors import ConfigError, LinkError
from ivl.experiment import Experiment
from ivl.links import pil
from ivl.links.options import Options
from ivl.policy import use
from ivl.policy.file import PolicyFile
from ivl.rewards import TOTAL, RewardChoice
from ivl.settings import parse_setting
from ivl.site import require
from ivl.source import Plan
from ivl.task import Task

_USUAL = "experiments/paper_vertical.yaml"

HELP = """Fly one landing with a vehicle, and print what it latched at the trigger and how it ended.

The approach is that of EXPERIMENT, by default the paper's vertical one. With --policy and no EXPERIMENT the vehicle is
what the policy was learned on, and --speed and --angle say the approach. A drone takes off, flies to the start point
and asks the operator for the outcome; a software vehicle is reset into the air and knows the outcome itself.

\b
Examples:
  ivl fly --uri udp://127.0.0.1:19850 --rrev 4.8 --moment 8
      one landing of the software vehicle (docs/SIL.md starts one)
  ivl fly --uri udp://127.0.0.1:19850 --rrev 4.8 --moment 8 --site lab.yaml --rehearse
      the same as if it were a drone in the room of lab.yaml: every question, take-off and all
  ivl fly --uri site --site lab.yaml --rrev 4.8 --moment 8 --csv landing.csv
      the drone there; the flight recorder goes into landing.csv
  ivl fly --uri udp://127.0.0.1:19850 --policy g.yaml --speed 1.2 --angle 35
      a policy for every approach (ivl policy learn); its vehicle starts with: ivl sil --policy g.yaml
  ivl fly --uri pil:// --policy g.yaml --speed 1.2 --angle 35
      the same, every tick decided by an emulated STM32
"""


def fly(
    uri: Annotated[
        str, typer.Option(help="Link of the vehicle: radio://, usb://, udp://, tcp:// or serial://; pil://; or site.")
    ],
    rrev: policy_options.Rrev = None,
    moment: policy_options.Moment = None,
    theta: policy_options.Theta = None,
    policy_file: policy_options.FileOption = None,
    path: Annotated[str | None, typer.Argument(metavar="[EXPERIMENT]", help="YAML file of the experiment.")] = None,
    speed: Annotated[float | None, typer.Option(help=str(Task.model_fields["speed_mps"].description))] = None,
    angle: Annotated[float | None, typer.Option(help=str(Task.model_fields["angle_deg"].description))] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="A.B=C", help="Change a field of the experiment.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers of a software vehicle.", min=0)] = 0,
    stream: Annotated[int, typer.Option(help="Number of the rollout within the seed.", min=0)] = 0,
    csv: Annotated[Path | None, typer.Option(help="Write the flight recorder into FILE.")] = None,
    mocap: Annotated[
        str | None, typer.Option(metavar="CONFIG", help="Track the vehicle; file or name, see `ivl mocap --list`.")
    ] = None,
    site: site_options.Site = None,
    rehearse: Annotated[bool, typer.Option("--rehearse", help="Fly a software vehicle as a drone.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Fly one landing; HELP is the text that people see."""
    learned = policy_options.load(policy_file, theta=theta, rrev=rrev, moment=moment)
    chosen = _experiment(learned, path, settings or [], speed_mps=speed, angle_deg=angle, site=site)
    uri = require.link_of(chosen, uri) or uri
    values = learned.values if learned else policy_options.theta_of(chosen.policy.form, theta, rrev, moment)
    if uri.startswith("pil://"):
        _refuse(uri, {"--csv": csv, "--mocap": mocap, "--rehearse": rehearse or None})
        _refuse(uri, {"--site": site})
        _print(*_fly_chip(uri, chosen, values, seed, stream), as_json)
        return
    try:
        from ivl.links import crazyflie
        from ivl.links.landing_flight import Rollout
    except ImportError as error:
        raise LinkError(f"{uri}: a link needs cflib: pip install 'ivl[link]' ({error})") from error
    require.for_flight(chosen, uri, rehearse)
    tracker = site_options.tracker(chosen, uri, mocap, rehearse)
    # one landing is also of interest in another world; the vehicle's site warns of it
    options = Options(
        mocap=tracker, rehearse=rehearse, other_world=True, keep_recordings=csv is not None, say=console.say
    )
    with crazyflie.CrazyflieSource(uri, chosen, options) as source:
        landing = source.fly_one(Rollout(tuple(values), seed, stream))
        end_reason = source.world.end_reason(int(landing.outcome["end_reason"][0]))
    if csv is not None and landing.recording is not None:
        files.write(csv, landing.recording.to_csv())
    result = {"snapshot": _snapshot(landing), "outcome": _outcome(landing.outcome, end_reason)}
    _print(result, source.warnings, as_json)


def _experiment(
    learned: PolicyFile | None, path: str | None, settings: list[str], site: str | None, **approach: float | None
) -> Experiment:
    """What is flown: the experiment that is named, or what the policy was learned on, or the paper's approach."""
    if learned is None:
        return experiment.load(path or _USUAL, settings, None, site=site, **approach)
    if path is not None:
        return experiment.load(path, settings, use.as_start(learned), site=site, **approach)
    said = {parse_setting(setting)[0] for setting in settings}
    for name, value in approach.items():
        if value is None and name not in said:
            raise ConfigError(f"{FLAGS[name][0]} is missing: a policy file says no approach")
    n_tasks = range(len(learned.tasks))
    found = [experiment.load(_USUAL, settings, use.on_its_task(learned, i), site=site, **approach) for i in n_tasks]
    use.the_one([each.task() for each in found])
    return found[0]


def _refuse(uri: str, options: dict[str, Any]) -> None:
    for name, value in options.items():
        if value is not None:
            raise ConfigError(f"{name}: {uri} has no vehicle that could do this")


def _fly_chip(
    uri: str, chosen: Experiment, theta: list[float], seed: int, stream: int
) -> tuple[dict[str, Any], list[str]]:
    """One landing that an emulated chip decides; its snapshot is that of the outcome."""
    source = pil.PilSource(uri, chosen, threads=1)
    plan = Plan(np.array([theta]), np.array([seed], dtype=np.uint64), np.array([stream], dtype=np.uint64))
    (record,) = (flown.outcomes for flown in source.fly(plan) if len(flown.index))
    end_reason = source.world.end_reason(int(record["end_reason"][0]))
    latched = {
        name: float(record[field][0]) if record["triggered"][0] else None
        for name, field in (("d_ceil_m", "d_trigger_m"), ("rrev_per_s", "rrev_trigger"), ("of_y_radps", "of_y_trigger"))
    }
    snapshot = {"triggered": bool(record["triggered"][0]), **latched}
    return {"snapshot": snapshot, "outcome": _outcome(record, end_reason)}, source.warnings


def _print(result: dict[str, Any], warnings: list[str], as_json: bool) -> None:
    if as_json:
        console.print_json({**result, "warnings": warnings})
        return
    for title, values in result.items():
        console.out.print(title, style="bold")
        for name, value in values.items():
            text = f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)
            console.out.print(f"  {name:24s} {text}")


def _snapshot(landing: Any) -> dict[str, Any]:
    """What the vehicle latched; None where this landing's trigger did not fire."""
    snapshot = landing.snapshot
    fired = snapshot.policy_seq == landing.policy_seq
    names = ("d_ceil_m", "rrev_per_s", "of_y_radps", "vx_mps", "vz_mps")
    values = {name: getattr(snapshot, name) if fired else None for name in names}
    battery_V = landing.battery_V if np.isfinite(landing.battery_V) else None
    return {"policy_seq": landing.policy_seq, "triggered": fired, **values, "battery_V": battery_V}


def _outcome(record: Any, end_reason: str) -> dict[str, Any]:
    result = outcome.as_dict(record[0], end_reason)
    result["four_leg"] = bool(outcome.four_leg(record)[0])
    result["clean"] = bool(outcome.clean(record)[0])
    result["verdict"] = outcome.verdict(record[0])
    result["reward_paper"] = float(RewardChoice(name="paper").score(record)[TOTAL][0])
    return result
