"""`ivl bench`."""

import importlib.util
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import typer

from ivl import experiment, native
from ivl.cli import console
from ivl.errors import IvlError, LinkError
from ivl.links import pil
from ivl.world import World

HELP = """Measure the simulator on one core, and against MuJoCo.

\b
Examples:
  ivl bench
      rollouts and physics steps per second, ratio to the same landing in MuJoCo; the same for harder sets
      of landings and for each width of registers; with the name of the machine
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
_REGISTER_BITS = (128, 256, 512)
_MUJOCO_BENCH = Path(__file__).parents[3] / "tests" / "mujoco" / "bench.py"


def bench(
    n: Annotated[int, typer.Option("--rollouts", help="Rollouts to time.", min=100)] = 4000,
    mujoco: Annotated[bool, typer.Option(help="Compare with MuJoCo.")] = True,
    on_chip: Annotated[bool, typer.Option("--pil", help="Time the emulated STM32 in the loop as well.")] = False,
    over_udp: Annotated[bool, typer.Option("--udp", help="Time a software vehicle over UDP as well.")] = False,
    with_gym: Annotated[bool, typer.Option("--gym", help="Time the environment of Gymnasium as well.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure speed; HELP is the text that people see."""
    compare = _mujoco_rate() if mujoco else None
    world = experiment.load(_EXPERIMENT).make_world()
    result = measure(world, n)
    result |= _sets(world, n) | _registers(world, n) | {"machine": _machine()}
    result["ratio_to_mujoco"] = result["rollouts_per_s_per_core"] / compare() if compare else None
    if on_chip:
        result |= pil.measure()
    if over_udp:
        result |= _udp_rates()
    if with_gym:
        result |= _gym_rates(world)
    if as_json:
        console.print_json(result)
    else:
        for name, value in result.items():
            text = value if isinstance(value, str) else console.number(value, 3 if name.startswith("occupancy") else 1)
            console.out.print(f"{name:36s} {text}")


def _gym_rates(world: World) -> dict[str, float]:
    """Rates of the vector form, and of landings as an agent explores that are flown as many at once without it."""
    from ivl.gym import speed  # asks for gymnasium

    rate, _, _ = _fly(world, Landings(2048, 2.5, 90.0, (0.5, 8.0), (0.0, 12.0e-3)), 512)
    return {**speed.measure(64), **speed.measure(512), "gym_beside_rollouts_per_s_512": rate}


def measure(world: World, n: int) -> dict[str, Any]:
    """Time n landings of the paper's vertical experiment, near its best policy, on one thread; best of three passes.

    The time is the processor time of that thread, as for MuJoCo, so that a busy machine does not change the figures.
    """
    rate, _, steps = _fly(world, Landings(n, 2.5, 90.0, (4.5, 5.1), (7.0e-3, 9.0e-3)))
    return {"rollouts_per_s_per_core": rate, "steps_per_s_per_core": rate * steps}


@dataclass(frozen=True)
class Landings:
    """A set of landings: how many, their approach, and the range of their policies (paper's form, SI)."""

    n: int
    speed_mps: float
    angle_deg: float
    rrev_per_s: tuple[float, float]
    moment_Nm: tuple[float, float]

    def specs(self) -> npt.NDArray[np.void]:
        """One record a landing."""
        rng = np.random.default_rng(0)
        specs = native.library().default_specs(self.n)
        specs["speed_mps"], specs["angle_deg"], specs["stream"] = self.speed_mps, self.angle_deg, np.arange(self.n)
        specs["theta"][:, 0] = rng.uniform(*self.rrev_per_s, self.n)
        specs["theta"][:, 1] = rng.uniform(*self.moment_Nm, self.n)
        return specs


def _fly(world: World, landings: Landings, at_once: int | None = None) -> tuple[float, float, float]:
    """Fly landings on one thread, some at a time, three times: best rate (1/s), occupancy, steps a landing."""
    specs, model = landings.specs(), world.native_model
    parts = np.split(specs, range(at_once, specs.size, at_once)) if at_once else [specs]
    best_s = np.inf
    flown: list[tuple[npt.NDArray[np.void], float]] = []
    for _ in range(3):
        began = time.thread_time()
        flown = [model.rollouts_and_occupancy(part, 1) for part in parts]
        best_s = min(best_s, time.thread_time() - began)
    steps = sum(int(outcomes["n_steps"].sum()) for outcomes, _ in flown) / specs.size
    return specs.size / best_s, float(np.mean([occupancy for _, occupancy in flown])), steps


def _sets(world: World, n: int) -> dict[str, float]:
    """Rates and occupancies of what a campaign is made of: landings, a cell, its slowest cell, a learner's calls."""
    every = (0.5, 8.0), (0.0, 12.0e-3)  # as learners explore
    few = max(n // 10, 100)
    sets: dict[str, tuple[Landings, int | None]] = {
        "friendly": (Landings(n, 2.5, 90.0, (4.5, 5.1), (7.0e-3, 9.0e-3)), None),
        "cell": (Landings(n, 2.25, 60.0, *every), 256),
        "slowest_cell": (Landings(few, 0.25, 60.0, *every), 256),
        "learner": (Landings(n, 2.5, 90.0, *every), 8),
    }
    result: dict[str, float] = {}
    for name, (landings, at_once) in sets.items():
        rate, occupancy, _ = _fly(world, landings, at_once)
        result |= {f"rollouts_per_s_{name}": rate, f"occupancy_{name}": occupancy}
    return result


def _registers(world: World, n: int) -> dict[str, float]:
    """The rate of the friendly set in registers of each width that the machine has."""
    library = native.library()
    chosen = library.register_bits()
    try:
        widest = library.use_registers()
        result = {}
        for bits in _REGISTER_BITS:
            if bits <= widest:
                library.use_registers(bits)
                result[f"rollouts_per_s_in_{bits}_bits"] = measure(world, n)["rollouts_per_s_per_core"]
    finally:
        library.use_registers(chosen)
    return result | {"register_bits": chosen}


def _machine() -> str:
    """Name of the processor, as the system tells it; speeds say little without it."""
    told = Path("/proc/cpuinfo")
    lines = told.read_text().splitlines() if told.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


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
