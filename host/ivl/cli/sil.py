"""`ivl sil`."""

import os
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from ivl import files
from ivl.cli import console, policy_options
from ivl.cli.task_options import EQUIPMENT, Chosen, task_options
from ivl.silproc import model_text, server_path

HELP = """Start the software vehicle: a CRTP server on UDP.

cflib, cfclient and other CRTP tools find it by scanning and connect to udp://127.0.0.1:19850.  Ctrl-C stops it.
docs/SIL.md says what it does, docs/first_flight.py is a first program.

\b
Examples:
  ivl sil
      a Crazyflie 2.1 in real time
  ivl sil --experiment experiments/paper_vertical.yaml --speed max
      what an experiment flies, as fast as possible
  ivl sil --policy g.yaml
      what a policy for every approach was learned on; fly it with: ivl fly --policy g.yaml --uri udp://127.0.0.1:19850
  ivl sil --vehicles 8
      eight vehicles on ports 19850 .. 19857
  ivl sil --deck bcFlow2 --deck bcMultiranger
      with two decks; --deck none leaves out the usual one, bcFlow2
  ivl sil --lockstep
      time stands still until the client writes sil.run_to_ms
  ivl sil --fault loss=0.05 --fault jitter_ms=50 --control 20850
      a bad link, and a port at which it can be changed
  ivl sil --write-model vehicle.txt
      the parameters as the program ivl_sil reads them, then stop
"""


VEHICLE = "crazyflie21"  # turns, as every Crazyflie; the paper's simulated vehicle does not


@task_options(*EQUIPMENT, vehicle=VEHICLE)
def sil(
    chosen: Chosen,
    policy_file: Annotated[
        Path | None, typer.Option("--policy", metavar="FILE", help="Simulate what a policy was learned on.")
    ] = None,
    port: Annotated[int, typer.Option(help="UDP port of the first vehicle; 0 takes a free one.")] = 19850,
    bind: Annotated[str, typer.Option(help="Address to listen on; 0.0.0.0 lets everybody fly.")] = "127.0.0.1",
    vehicles: Annotated[int, typer.Option(help="Number of vehicles, on consecutive ports.")] = 1,
    speed: Annotated[str, typer.Option(metavar="N|max", help="Multiple of real time.")] = "1",
    lockstep: Annotated[bool, typer.Option(help="Time advances only as the client asks.")] = False,
    packets: Annotated[int, typer.Option(help="Packets/s to the client, at most, when time is not paced.")] = 8000,
    seed: Annotated[int, typer.Option(help="Seed of the sensors' noise.", min=0)] = 0,
    deck: Annotated[list[str] | None, typer.Option(metavar="NAME|none", help="A deck on board: bcFlow2, ...")] = None,
    fault: Annotated[list[str] | None, typer.Option(metavar="NAME=X", help="A fault of the link: loss, ...")] = None,
    control: Annotated[int | None, typer.Option(help="UDP port that no fault touches; 0 takes a free one.")] = None,
    write_model: Annotated[Path | None, typer.Option(help="Write the parameters to FILE and stop.")] = None,
) -> None:
    """Start the software vehicle; HELP is the text that people see."""
    learned = policy_options.load(policy_file)
    world = chosen.make_world(*(learned.tasks if learned is not None else ()))
    text = model_text(world)
    if write_model is not None:
        files.write(write_model, text)
        return
    command = [str(server_path()), "--model", "-", "--port", str(port), "--bind", bind]
    command += ["--vehicles", str(vehicles), "--speed", speed, "--packets", str(packets), "--seed", str(seed)]
    command += ["--lockstep"] if lockstep else []
    command += [] if control is None else ["--control", str(control)]
    for item in fault or []:
        command += ["--fault", item]
    for name in deck or []:
        command += ["--deck", name]
    console.err.print(f"{world.vehicle} with gear {world.gear} of {world.gear_set}; Ctrl-C stops")
    if world.params.values["aero.yaw_torque"] == 0.0:
        console.err.print(
            f"{world.vehicle} cannot turn: its aero.yaw_torque is 0, so that yaw commands change nothing",
        )
    _become(command, text)


def _become(command: list[str], text: str) -> None:
    """Replace this process, so that signals and the exit code are the program's own; it reads the model from stdin."""
    with tempfile.TemporaryFile("w+", encoding="ascii") as file:
        file.write(text)
        file.seek(0)
        os.dup2(file.fileno(), 0)
        os.execv(command[0], command)
