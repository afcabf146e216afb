"""How fast a vehicle is flown over UDP in lock-step, beside the simulator in this process."""

import tempfile
import time
from pathlib import Path

import numpy as np

from ivl import experiment, native, run
from ivl.experiment import Experiment
from ivl.layout import layout_of
from ivl.learning.loop import LearningRun
from ivl.links.crazyflie import CrazyflieSource
from ivl.silproc import SilProcess
from ivl.source import Plan, RolloutSource, WorldSource
from ivl.store import RunStore

_EXPERIMENT = "experiments/paper_vertical.yaml"
_N_LANDINGS = 100


def measure() -> dict[str, float]:
    """Landings a second and vehicle time per wall time over UDP; time to learn the paper's experiment there and here.

    Everything counts: round trips, log packets at 50 Hz, heartbeats, storing, the learner; not the judging afterwards.
    """
    chosen = experiment.load(_EXPERIMENT)
    world = chosen.make_world()
    with SilProcess(world) as server, CrazyflieSource(server.uri, chosen) as source:
        began_ms, began_s = server.get("sil.time_ms"), time.monotonic()
        for _ in source.fly(_landings(chosen)):
            pass
        elapsed_s = time.monotonic() - began_s
        vehicle_s = 1e-3 * (server.get("sil.time_ms") - began_ms)
        udp_s = _learn(chosen, source)
    return {
        "udp_rollouts_per_s": _N_LANDINGS / elapsed_s,
        "udp_times_real_time": vehicle_s / elapsed_s,
        "udp_learn_paper_s": udp_s,
        "in_process_learn_paper_s": _learn(chosen, WorldSource(world, chosen, 1)),
    }


def _landings(chosen: Experiment) -> Plan:
    """Landings near the best policy of the experiment."""
    rng = np.random.default_rng(0)
    theta = np.column_stack((rng.uniform(4.5, 5.1, _N_LANDINGS), rng.uniform(7.0, 9.0, _N_LANDINGS)))
    seed = np.full(_N_LANDINGS, chosen.seed, dtype=np.uint64)
    return Plan(theta, seed, np.arange(_N_LANDINGS, dtype=np.uint64))


def _learn(chosen: Experiment, source: RolloutSource) -> float:
    """Learn once; returns the time that it took, s."""
    with tempfile.TemporaryDirectory() as folder:
        manifest = run.make_manifest(chosen, chosen.make_world())
        dtype = native.library().outcome_dtype
        with RunStore.create(Path(folder) / "run", chosen.to_yaml(), manifest, dtype, layout_of(chosen)) as store:
            began_s = time.monotonic()
            LearningRun([chosen], source, store).run()
            return time.monotonic() - began_s
