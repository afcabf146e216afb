"""A flight that was imported tells a belief what the simulator tells it of the same landing."""

import numpy as np
import pytest
from recorded import QUIET, landing

from ivl.belief import recording
from ivl.belief.recording import NAMES
from ivl.flight import motion
from ivl.world import World

SLACK = {"pitch": 3.0, "rate": 0.9, "fall": 0.012, "contact": 0.02}
"""Deg, rad/s, m, and s or m: a pose is held for 10 ms, and a contact is seen in the rate of the gyro."""


@pytest.mark.parametrize(("rrev", "moment"), [(3.85, 6.5), (3.5, 7.5)])
def test_a_log_tells_what_the_simulator_tells(rrev: float, moment: float) -> None:
    world = World("crazyflie21", "wide_short", "table1", None, **QUIET)
    trace = world.trace(2.5, 90.0, rrev, moment, start="flown", period_s=0.005)
    simulated = recording.of_trace(world, trace, rrev, np.random.default_rng(0))
    logged = recording.of_flip(motion.flip(landing(world, rrev, moment)), 3.8, 0.03)
    compared = 0
    for name, a, b in zip(NAMES, simulated, logged, strict=True):
        stem = name.partition("_")[0]
        if stem in SLACK and np.isfinite([a, b]).all() and name not in ("contact_pitch", "contact_rate"):
            assert b == pytest.approx(a, abs=SLACK[stem]), name
            compared += 1
    assert compared > 20
    assert (logged[NAMES.index("battery")], logged[NAMES.index("overshoot")]) == (3.8, 0.03)
    assert logged[NAMES.index("closing")] == pytest.approx(simulated[NAMES.index("closing")], abs=0.1)
