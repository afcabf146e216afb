"""Several vehicles of one room as rigid bodies of one motion capture: each its own, and two of them exchanged."""

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from ivl.errors import LinkError
from ivl.links.deadlines import Deadlines
from ivl.links.packets import Phase
from ivl.links.tables import Session
from ivl.mocap import watch
from ivl.mocap.config import MocapConfig
from ivl.mocap.guard import LossGuard
from ivl.mocap.simulated import SimulatedRoom
from ivl.mocap.stream import Mocap
from ivl.mocap.watch import Status
from ivl.silproc import SilProcess
from ivl.world import World

# for a machine that is busy, as in test_mocap_sil
LIMITS: dict[str, Any] = {"system": "simulator", "lost_s": 1.0, "frozen_s": 1.0, "settle_s": 1.05}
DEADLINE_S = 60.0
N = 3


def wait(what: str, condition: Callable[[], Any]) -> None:
    end_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end_s, what
        time.sleep(0.01)


class Sink:
    """Takes the poses that would go to a vehicle."""

    def __init__(self) -> None:
        self.places: list[tuple[float, float, float]] = []

    def send_extpose(self, x: float, y: float, z: float, *_: float) -> None:
        self.places.append((x, y, z))


class Lab:
    """Three vehicles that hover, and who follows each of them."""

    def __init__(self, stack: contextlib.ExitStack) -> None:
        self.process = stack.enter_context(SilProcess(World("crazyflie21"), vehicles=N))
        for n in range(N):
            self.process.set("sil.reset", 1, n)
        sessions = [stack.enter_context(Session(uri, Deadlines(answer_s=DEADLINE_S))) for uri in self.process.uris]
        self.room = stack.enter_context(SimulatedRoom(sessions[0], "cf0"))
        for n in range(1, N):
            self.room.track(sessions[n], f"cf{n}")
        with pytest.raises(LinkError, match="cf1 is another vehicle"):
            self.room.track(sessions[2], "cf1")
        configs = [MocapConfig(body=f"cf{n}", **LIMITS) for n in range(N)]
        self.sinks = [Sink() for _ in range(N)]
        self.mocaps = [
            stack.enter_context(Mocap(config, sink, self.room.request(config)))
            for config, sink in zip(configs, self.sinks, strict=True)
        ]
        for n, mocap in enumerate(self.mocaps):
            mocap.wait_until_good(DEADLINE_S)
            wait(f"vehicle {n} where it hovers", lambda n=n: self.is_tracked(n))

    def is_tracked(self, n: int) -> bool:
        state = self.mocaps[n].state()
        true_W_m = [self.process.get(f"simTruth.{axis}", n) for axis in "xyz"]
        return state.status is Status.GOOD and state.pose.p_W_m == pytest.approx(true_W_m, abs=0.02)


@pytest.fixture(scope="module")
def lab() -> Iterator[Lab]:
    with contextlib.ExitStack() as stack, pytest.MonkeyPatch.context() as patch:
        patch.setattr(watch, "SLACK_M", 0.3)  # less than the vehicles are apart
        yield Lab(stack)


def test_each_frame_has_every_body(lab: Lab) -> None:
    for n, mocap in enumerate(lab.mocaps):
        assert mocap.state().bodies == ("cf0", "cf1", "cf2")
        assert lab.is_tracked(n)
    places = {tuple(round(v, 1) for v in sink.places[-1]) for sink in lab.sinks}
    assert len(places) == N


def test_bodies_that_are_exchanged_are_never_followed_in_flight(lab: Lab) -> None:
    spoiled: list[list[str]] = [[], [], []]
    for n, mocap in enumerate(lab.mocaps):
        mocap.guard = LossGuard(lambda: Phase.READY, lambda _: None, spoil=spoiled[n].append)
    begun = [len(sink.places) for sink in lab.sinks]
    lab.room.occluded = True
    time.sleep(0.05)
    lab.room.swapped = ("cf0", "cf2")
    lab.room.occluded = False
    for n in (0, 2):
        wait(f"the jump of cf{n}", lambda n=n: lab.mocaps[n].state().status is Status.JUMPED)
    frames = lab.mocaps[0].state().counts.n_frames
    wait("more than settles", lambda: lab.mocaps[0].state().counts.n_frames > frames + 200)
    for n in (0, 2):
        assert lab.mocaps[n].state().status is Status.JUMPED
        assert spoiled[n]
        own = lab.sinks[n].places[begun[n] - 1]
        assert all(place == pytest.approx(own, abs=0.1) for place in lab.sinks[n].places[begun[n] :])
    assert lab.is_tracked(1)
    assert spoiled[1] == []
    lab.room.swapped = None
    for mocap in lab.mocaps:
        mocap.guard = None
    for n in range(N):
        wait(f"cf{n} again", lambda n=n: lab.is_tracked(n))
