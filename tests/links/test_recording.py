"""What a flight over a link records of its flip, against the same rollout recorded in this process."""

import numpy as np
import pytest

from ivl import experiment, links
from ivl.belief import recording
from ivl.experiment import Experiment
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.options import Options
from ivl.silproc import SilProcess
from ivl.source import Plan, WorldSource

_ERRORS = {
    "pitch_": (0.6, 5.0), "rate_": (0.05, 0.2), "fall_": (0.003, 0.005), "contact_time": (0.006, 0.006),
    "contact_distance": (0.006, 0.006), "closing": (0.08, 0.08), "overshoot": (1e-6, 1e-6),
}  # fmt: skip
"""Nine of ten differences, and all of them, are at most so large: noise that is assumed of a recorder, its resolution,
and the rows of a trace, 5 ms apart, between which a contact turns the vehicle."""
LANDS = np.array([[4.0, 8.0], [4.3, 9.0], [3.8, 7.0]])


def compared(chosen: Experiment, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Features of the same rollouts over udp:// and in this process."""
    n = len(theta)
    plan = Plan(theta, np.full(n, 2**40 + 3, dtype=np.uint64), np.arange(5, 5 + n, dtype=np.uint64))
    with SilProcess(chosen.make_world()) as server:
        source = links.open_source(server.uri, chosen, record=True)
        try:
            flown = list(source.fly(plan))
        finally:
            source.close()
    here = next(WorldSource(chosen.make_world(), chosen, 1, True).fly(plan))
    assert here.recordings is not None
    return np.concatenate([part.recordings for part in flown if part.recordings is not None]), here.recordings


@pytest.mark.parametrize("name", ["paper_flight", "paper_vertical"])
def test_a_software_vehicle_records_what_is_recorded_in_process(name: str) -> None:
    chosen = experiment.load(f"experiments/{name}.yaml", learner="ephe_robust")
    there, here = compared(chosen, LANDS + (np.array([0.8, 0.0]) if name == "paper_vertical" else 0.0))
    seen = np.isfinite(here)
    battery_V = there[:, recording.NAMES.index("battery")]
    if name == "paper_flight":
        assert np.ptp(battery_V) > 0.01, "each landing has a battery of its own"
        assert battery_V == pytest.approx(here[:, recording.NAMES.index("battery")], abs=0.05)
    else:
        assert np.isnan(battery_V).all(), "a supply that never sags"
    # the time of the contact scatters, so that of each signal the last sample before it may be left out in one of them
    assert (np.isfinite(there) != seen).sum(axis=1).max() <= len(recording.SIGNALS)
    assert seen.sum() > 60
    for stem, (usual, largest) in _ERRORS.items():
        columns = [i for i, feature in enumerate(recording.NAMES) if feature.startswith(stem)]
        both = np.isfinite(there[:, columns]) & np.isfinite(here[:, columns])
        errors = np.abs(there[:, columns] - here[:, columns])[both]
        assert errors.size >= len(here)
        assert np.quantile(errors, 0.9) <= usual, (stem, errors)
        assert errors.max() <= largest, (stem, errors)


def test_a_flight_without_a_trigger_records_nothing_over_a_link() -> None:
    slow = ["speed_mps=0.5", "angle_deg=20.0"]
    chosen = experiment.load("experiments/paper_vertical.yaml", slow, learner="ephe_robust")
    there, here = compared(chosen, np.array([[7.0, 5.0]]))
    assert np.isnan(there).all()
    assert np.isnan(here).all()


def test_recordings_are_downloaded_only_if_they_are_learned_from(server: SilProcess, vertical: Experiment) -> None:
    plan = Plan(np.array([[4.8, 8.0]]), np.ones(1, dtype=np.uint64), np.zeros(1, dtype=np.uint64))
    with CrazyflieSource(server.uri, vertical, Options()) as source:
        (flown,) = source.fly(plan)
    assert flown.recordings is None
