"""The modules of this folder import each other by plain name."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from crtp_double import Vehicle
from rooms import own_cache as own_cache


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    vehicle = Vehicle()
    yield vehicle
    vehicle.stop()
