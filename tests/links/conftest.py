"""Fixtures shared by the tests of the links."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import rooms  # isort: split

import numpy as np
import pytest
from rooms import own_cache as own_cache

from ivl.experiment import Experiment
from ivl.silproc import SilProcess
from ivl.source import Plan

sys.path.insert(0, str(Path(__file__).parent))
from rehearsed import Days, fly_both


@pytest.fixture(scope="session")
def vertical() -> Experiment:
    return rooms.vertical(n_rollouts=4, budget=12)


@pytest.fixture(scope="session")
def furnish(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Experiment], Experiment]:
    """Put an experiment into a room of its own height and vehicle, as wide as no test needs."""
    return lambda chosen: rooms.furnished(chosen, tmp_path_factory.mktemp("room"), **rooms.WIDE)


@pytest.fixture(scope="session")
def in_room(vertical: Experiment, furnish: Callable[[Experiment], Experiment]) -> Experiment:
    """The same in a room."""
    return furnish(vertical)


@pytest.fixture(scope="session")
def days(tmp_path_factory: pytest.TempPathFactory) -> Days:
    """A rehearsed day of sixty flights with every kind of fault, continued on a second day."""
    return fly_both(tmp_path_factory.mktemp("cage"))


@pytest.fixture
def server(vertical: Experiment) -> Iterator[SilProcess]:
    """A software vehicle in the experiment's world."""
    with SilProcess(vertical.make_world()) as process:
        yield process


@pytest.fixture
def plan() -> Plan:
    """Landings all over the policy's range, with large seeds."""
    rng = np.random.default_rng(1)
    theta = np.column_stack((rng.uniform(0.0, 7.0, 8), rng.uniform(0.0, 10.65, 8)))
    return Plan(theta, np.full(8, 2**63 + 12345, dtype=np.uint64), np.arange(2**40, 2**40 + 8, dtype=np.uint64))
