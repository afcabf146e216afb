"""How soon a stop acts, from the key to the vehicle, over links that lose packets: the table of docs/SITE.md.

    .venv/bin/python tools/stop.py --trials 200

A software vehicle in real time hovers under the flight core. A key at a terminal of its own is pressed, and the
vehicle's phase is read over a port that no fault touches, until it is `aborted`. The time counts from the key.
"""

import argparse
import os
import pty
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from ivl import experiment
from ivl.links import sil
from ivl.links.packets import Phase, Request
from ivl.links.stop import Stop
from ivl.links.tables import Session
from ivl.links.vehicle import Command, Vehicle
from ivl.silproc import SilProcess

LOSSES = (0.0, 0.05)
_EXPERIMENT = "experiments/paper_flight.yaml"
_READY_S, _SEEN_S_MAX = 5.0, 2.0


def trial(server: SilProcess, session: Session, vehicle: Vehicle, master: int) -> float:
    """Hover, press the key, and look until the vehicle has aborted; the time in between, s."""
    sil.reset(vehicle)
    vehicle.stopped = ""
    vehicle.ask_for(Command(Request.HOVER, vehicle.position_W_m), (Phase.READY,), _READY_S)
    stop = Stop(None, False, lambda _: None)
    stop.begin(vehicle)
    vehicle.pause(0.2)
    session.check()
    pressed_s = time.monotonic()
    os.write(master, b" ")
    try:
        while server.get("ivl.phase") != Phase.ABORTED:
            if time.monotonic() - pressed_s > _SEEN_S_MAX:
                raise SystemExit(f"the vehicle did not stop within {_SEEN_S_MAX:g} s")
        return time.monotonic() - pressed_s
    finally:
        stop.end()


def measure(loss: float, n_trials: int) -> np.ndarray:
    """Times of `n_trials` stops, s, shape (n_trials,)."""
    master, slave = pty.openpty()
    sys.stdin = os.fdopen(slave, "r")
    world = experiment.load(_EXPERIMENT).make_world()
    with SilProcess(world, faults={"loss": loss}) as server, Session(server.uri) as session:
        vehicle = Vehicle(session)
        vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _READY_S)
        vehicle.configure(world)
        return np.array([trial(server, session, vehicle, master) for _ in range(n_trials)])


def main() -> None:
    """Print a row for each loss."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=200)
    n_trials = parser.parse_args().trials
    print("| packets lost | stops | median | worst |\n|---|---|---|---|")
    for loss in LOSSES:
        times_ms = 1e3 * measure(loss, n_trials)
        print(f"| {100 * loss:g} % | {n_trials} | {np.median(times_ms):.1f} ms | {times_ms.max():.1f} ms |", flush=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("XDG_CACHE_HOME", str(Path(folder)))
        main()
