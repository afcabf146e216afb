"""A camera at the other end of the link: what it tells over the app channel becomes the vehicle's own distance.

Vehicle and host in lock-step, so that a flight is a function of the packets alone.
"""

import math
from collections.abc import Callable, Iterator

import pytest

from ivl import World, forms
from ivl.links import sil
from ivl.links.clock import LockStep
from ivl.links.packets import Phase, Request
from ivl.links.tables import LogBlock, Session
from ivl.links.vehicle import Command, Vehicle
from ivl.silproc import SilProcess

SPEED_MPS, START_BELOW_M = 2.5, 1.7
SAMPLE_S, HEARTBEAT_N = 0.02, 4


class Bench:
    """A vehicle whose distance comes from the filter alone, and a camera that knows the truth of each 20 ms."""

    def __init__(self, vehicle: Vehicle, world: World) -> None:
        self.vehicle = vehicle
        self.h_ceil_m = float(world.native_model.config()[0]["ivl.h_ceil"][0])
        self.truth = LogBlock(("simTruth.z", "simTruth.vz"), 10)
        self.seen = LogBlock(("ivl.phase", "ivl.d_ceil", "ivl.d_sigma", "ivl.n_trigger", "ivl.n_measured"), 10)
        self.counts = LogBlock(("ivl.n_reading", "ivl.n_reading_bad"), 10)
        for block in (self.truth, self.seen, self.counts):
            vehicle.session.start_log(block)
        vehicle.clock.pause(0.05)

    @property
    def d_m(self) -> float:
        return self.h_ceil_m - self.truth.values["simTruth.z"]

    @property
    def rrev_per_s(self) -> float:
        return self.truth.values["simTruth.vz"] / self.d_m

    @property
    def d_error_m(self) -> float:
        """Of the vehicle's distance; NaN while it has none."""
        return self.seen.values["ivl.d_ceil"] - self.d_m if self.seen.values["ivl.d_sigma"] > 0.0 else math.nan

    def hover(self, rrev_c_per_s: float) -> None:
        self.vehicle.put_policy(forms.by_name("constant"), [rrev_c_per_s, 8.0])
        start = (0.0, 0.0, self.h_ceil_m - START_BELOW_M)
        self.vehicle.ask_for(Command(Request.HOVER, start), (Phase.READY,), 2.0)
        self.vehicle.pause(3.0)

    def approach(self, look: Callable[[], None], until: Callable[[], bool]) -> None:
        """Fly towards the ceiling; `look` is called at each sampling instant of the camera."""
        self.vehicle.command = Command(Request.APPROACH, (0.0, 0.0, 0.0), SPEED_MPS, math.pi / 2)
        for i in range(100):
            if i % HEARTBEAT_N == 0:
                self.vehicle.send_command()
            if i > 0 and until():
                return
            look()
            self.vehicle.clock.pause(SAMPLE_S)
        raise AssertionError(f"the approach did not end: {self.vehicle.describe()}")


@pytest.fixture(name="bench")
def _bench() -> Iterator[Bench]:
    world = World("habas2021", **{"firmware.d_source": 2.0})
    with SilProcess(world, lockstep=True) as server, Session(server.uri) as session:
        vehicle = Vehicle(session, LockStep(session))
        vehicle.configure(world)
        sil.reset(vehicle)
        yield Bench(vehicle, world)


def test_readings_become_the_distance_and_trigger_the_flip(bench: Bench) -> None:
    errors_m: list[float] = []

    def look() -> None:
        errors_m.append(bench.d_error_m)
        bench.vehicle.tell_reading(bench.rrev_per_s)

    bench.hover(rrev_c_per_s=4.8)
    assert math.isnan(bench.d_error_m)
    bench.approach(look, until=lambda: bench.seen.values["ivl.phase"] == Phase.FLIP)
    bench.vehicle.clock.pause(0.05)  # what was latched at the trigger is in a block of its own
    assert bench.vehicle.snapshot().rrev_per_s >= 4.8
    assert bench.seen.values["ivl.n_trigger"] == 1
    assert bench.counts.values["ivl.n_reading"] == len(errors_m)
    assert bench.counts.values["ivl.n_reading_bad"] == 0
    # first invalid, then as good as a perfect camera makes it
    assert math.isnan(errors_m[1])
    assert [abs(error) < 0.02 for error in errors_m[-6:-1]] == [True] * 5, errors_m


def test_stream_that_stops_makes_the_distance_invalid_and_the_vehicle_level_out(bench: Bench) -> None:
    errors_m: list[float] = []

    def look() -> None:
        errors_m.append(bench.d_error_m)
        if bench.rrev_per_s < 1.2:  # what is remembered for 0.25 s then ends at about 3 1/s
            bench.vehicle.tell_reading(bench.rrev_per_s)

    bench.hover(rrev_c_per_s=4.8)
    bench.approach(look, until=lambda: bench.seen.values["ivl.phase"] == Phase.LEVEL_OUT)
    assert any(abs(error) < 0.05 for error in errors_m), "the distance was valid while the camera told readings"
    assert math.isnan(bench.d_error_m)
    assert bench.seen.values["ivl.n_trigger"] == 0


def test_bad_readings_are_counted_and_leave_the_distance_as_it_would_be_without_them(bench: Bench) -> None:
    bench.hover(rrev_c_per_s=4.8)
    bad = [(math.nan, 0.0), (math.inf, 0.0), (25.0, 0.0), (1.0, -0.001), (1.0, 0.5), (1.0, math.nan)]

    def look() -> None:
        for rrev_per_s, age_s in bad:
            bench.vehicle.tell_reading(rrev_per_s, age_s=age_s)

    bench.approach(look, until=lambda: bench.d_m < 0.1)
    assert bench.counts.values["ivl.n_reading"] == 0
    assert bench.counts.values["ivl.n_reading_bad"] > 100
    assert bench.counts.values["ivl.n_reading_bad"] % len(bad) == 0
    assert bench.seen.values["ivl.n_measured"] == 0
    assert math.isnan(bench.d_error_m)
    assert bench.seen.values["ivl.n_trigger"] == 0
