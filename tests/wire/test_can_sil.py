"""Learning's own way to fly, over a CAN bus that loses frames, against the simulator in this process."""

import functools
from collections.abc import Iterator

import numpy as np
import pytest
from test_can_gateway import GIVEN_UP_S, TIMEOUT_S, End, LossyBus, free_port, wait_for

from ivl import experiment
from ivl.can import gateway, link
from ivl.can.gateway import Options
from ivl.can.repeat import Repeater
from ivl.links.crazyflie import CrazyflieSource
from ivl.silproc import SilProcess
from ivl.source import Plan, WorldSource


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "TIMEOUT_S", TIMEOUT_S)
    monkeypatch.setattr(gateway, "Repeater", functools.partial(Repeater, limit_s=GIVEN_UP_S))


@pytest.fixture
def uri() -> Iterator[str]:
    paper = experiment.load("experiments/paper_vertical.yaml")
    with SilProcess(paper.make_world(), speed=None) as process:
        host, port = process.uri.removeprefix("udp://").split(":")
        listen, channel = free_port(), "sil"
        buses = [LossyBus(channel, 0.005, seed) for seed in (1, 2)]
        allow = {"allow_arming": True}
        ends = [
            End(buses[0], Options(0, listen=("127.0.0.1", listen), **allow)),
            End(buses[1], Options(0, to=(host, int(port)), **allow)),
        ]
        wait_for(lambda: ends[0].gateway.report()["up"] and ends[0].gateway._udp is not None, "link up")
        yield f"udp://127.0.0.1:{listen}"
        for end, bus in zip(ends, buses, strict=True):
            end.stop()
            bus.shutdown()
            assert end.error is None
            assert bus.n_lost > 0


def test_landings_over_the_bus_are_those_of_this_process(uri: str) -> None:
    paper = experiment.load("experiments/paper_vertical.yaml")
    theta = np.array([[4.8, 8.0], [4.2, 6.0], [5.5, 7.5]])
    plan = Plan(theta, np.array([11, 12, 13], dtype=np.uint64), np.array([0, 1, 2], dtype=np.uint64))
    (expected,) = WorldSource(paper.make_world(), paper, 1).fly(plan)
    with CrazyflieSource(uri, paper) as source:
        flown = list(source.fly(plan))
    assert [int(f.index[0]) for f in flown] == [0, 1, 2]
    assert np.concatenate([f.outcomes for f in flown]).tobytes() == expected.outcomes.tobytes()
