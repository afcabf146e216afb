"""`ivl fly`."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ivl import experiment, outcome
from ivl.cli import console, policy_options
from ivl.errors import LinkError
from ivl.links.options import Options
from ivl.mocap import config as mocap_config
from ivl.rewards import TOTAL, RewardChoice

HELP = """Fly one landing with a vehicle, and print what it latched at the trigger and how it ended.

The approach is that of EXPERIMENT (default: the paper's vertical one). A drone takes off, flies to the start point and
asks the operator for the outcome; a software vehicle is reset into the air and knows the outcome itself.

\b
Examples:
  ivl fly --uri udp://127.0.0.1:19850 --rrev 4.8 --moment 8
      one landing of the software vehicle (docs/SIL.md starts one)
  ivl fly --uri udp://127.0.0.1:19850 --rrev 4.8 --moment 8 --rehearse
      the same as if it were a drone: every question, take-off and all
  ivl fly --uri radio://0/80/2M/E7E7E7E7E7 --rrev 4.8 --moment 8 --csv landing.csv
      the drone; the flight recorder goes into landing.csv
"""


def fly(
    uri: Annotated[str, typer.Option(help="Link of the vehicle: radio://, usb://, udp://, tcp:// or serial://.")],
    rrev: policy_options.Rrev = None,
    moment: policy_options.Moment = None,
    theta: policy_options.Theta = None,
    path: Annotated[
        str, typer.Argument(metavar="[EXPERIMENT]", help="YAML file of the experiment.")
    ] = "experiments/paper_vertical.yaml",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="A.B=C", help="Change a field of the experiment.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers of a software vehicle.", min=0)] = 0,
    stream: Annotated[int, typer.Option(help="Number of the rollout within the seed.", min=0)] = 0,
    csv: Annotated[Path | None, typer.Option(help="Write the flight recorder into FILE.")] = None,
    mocap: Annotated[
        str | None, typer.Option(metavar="CONFIG", help="Track the vehicle; file or name, see `ivl mocap --list`.")
    ] = None,
    rehearse: Annotated[bool, typer.Option("--rehearse", help="Fly a software vehicle as a drone.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Fly one landing; HELP is the text that people see."""
    chosen = experiment.load(path, settings or [])
    policy = policy_options.theta_of(chosen.policy.form, theta, rrev, moment)
    try:
        from ivl.links import crazyflie
        from ivl.links.landing_flight import Rollout
    except ImportError as error:
        raise LinkError(f"{uri}: a link needs cflib: pip install 'ivl[link]' ({error})") from error
    tracker = mocap_config.load(mocap) if mocap else None
    # one landing is also of interest in another world; it is told
    options = Options(
        mocap=tracker, rehearse=rehearse, other_world=True, keep_recordings=csv is not None, say=console.say
    )
    with crazyflie.CrazyflieSource(uri, chosen, options) as source:
        landing = source.fly_one(Rollout(tuple(policy), seed, stream))
        end_reason = source.world.end_reason(int(landing.outcome["end_reason"][0]))
    if csv is not None and landing.recording is not None:
        csv.write_text(landing.recording.to_csv(), encoding="utf-8")
    result = {"snapshot": _snapshot(landing), "outcome": _outcome(landing.outcome, end_reason)}
    if as_json:
        console.print_json({**result, "warnings": source.warnings})
        return
    for title, values in result.items():
        console.out.print(title, style="bold")
        for name, value in values.items():
            text = f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)
            console.out.print(f"  {name:24s} {text}", highlight=False, soft_wrap=True)


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
    result["reward_paper"] = float(RewardChoice(name="paper").score(record)[TOTAL][0])
    return result
