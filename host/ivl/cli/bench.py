"""`ivl bench`."""

import importlib.util
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import numpy as np
import typer

from ivl import experiment
from ivl.cli import console
from ivl.errors import IvlError, LinkError
from ivl.links import pil
from ivl.world import World

HELP = """Measure the simulator on one core, and against MuJoCo.

\b
Examples:
  ivl bench
      rollouts and physics steps per second, ratio to the same landing in MuJoCo
  ivl bench --json
      for a script
  ivl bench --no-mujoco
      without the comparison
  ivl bench --pil
      also with the flight core on an emulated STM32, against real time
  ivl bench --udp
      also a software vehicle over UDP: landings a second, how long the paper's experiment takes to learn,
      and how fast it runs freely while cflib logs
"""
_EXPERIMENT = "experiments/paper_vertical.yaml"
_MUJOCO_BENCH = Path(__file__).parents[3] / "tests" / "mujoco" / "bench.py"


def bench(
    n: Annotated[int, typer.Option("--rollouts", help="Rollouts to time.", min=100)] = 4000,
    mujoco: Annotated[bool, typer.Option(help="Compare with MuJoCo.")] = True,
    on_chip: Annotated[bool, typer.Option("--pil", help="Time the emulated STM32 in the loop as well.")] = False,
    over_udp: Annotated[bool, typer.Option("--udp", help="Time a software vehicle over UDP as well.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure speed; HELP is the text that people see."""
    compare = _mujoco_rate() if mujoco else None
    result = measure(experiment.load(_EXPERIMENT).make_world(), n)
    result["ratio_to_mujoco"] = result["rollouts_per_s_per_core"] / compare() if compare else None
    if on_chip:
        result |= pil.measure()
    if over_udp:
        result |= _udp_rates()
    if as_json:
        console.print_json(result)
    else:
        for name, value in result.items():
            console.out.print(f"{name:28s} {console.number(value, 1)}")


def measure(world: World, n: int) -> dict[str, Any]:
    """Time n landings of the paper's vertical experiment, near its best policy, on one thread; best of three passes.

    The time is the processor time of that thread, as for MuJoCo, so that a busy machine does not change the figures.
    """
    rng = np.random.default_rng(0)
    theta = rng.uniform(4.5, 5.1, n), rng.uniform(7.0, 9.0, n)  # of the paper's form
    best_s, steps = np.inf, 0
    for _ in range(3):
        began = time.thread_time()
        outcomes = world.rollouts(2.5, 90.0, *theta, threads=1)
        best_s = min(best_s, time.thread_time() - began)
        steps = int(outcomes.n_steps.sum())
    return {"rollouts_per_s_per_core": n / best_s, "steps_per_s_per_core": steps / best_s}


def _udp_rates() -> dict[str, float]:
    """Figures of the link.

    Raises:
        LinkError: cflib is not installed.
    """
    try:
        from ivl.links.bench import measure as measure_link
        from ivl.links.stream import measure as measure_stream
    except ImportError as error:
        raise LinkError(f"--udp needs cflib: pip install 'ivl[link]' ({error})") from error
    return measure_link() | measure_stream()


def _mujoco_rate() -> Callable[[], float]:
    """The function that times MuJoCo; it lives with the tests, since nothing else needs that engine.

    Raises:
        IvlError: This is not a source tree, or MuJoCo is not installed.
    """
    if not _MUJOCO_BENCH.is_file():
        raise IvlError(
            f"{_MUJOCO_BENCH} is missing: the comparison needs the source tree; leave it out with --no-mujoco"
        )
    if importlib.util.find_spec("mujoco") is None:
        raise IvlError("mujoco is not installed: run `make setup-dev`, or leave the comparison out with --no-mujoco")
    rate: Callable[[], float] = _load(_MUJOCO_BENCH).rollouts_per_s_per_core
    return rate


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("ivl_mujoco_bench", path)
    if spec is None or spec.loader is None:
        raise IvlError(f"{path}: cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module
