"""For all tests."""

import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# Flights with known answers are replayed by the tests of flights and by those on the emulated chip.
# What tests of several folders use is in `shared`.
sys.path[:0] = [str(Path(__file__).parent / name) for name in ("flight", "shared")]

# Who starts the tests in the background may have told them to ignore Ctrl-C; programs under test would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples in every run, none judged by how long it takes: a failure is one of the code, not of the machine.
settings.register_profile("ivl", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("ivl")


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A real browser, one for all tests of a session."""
    from browsing import browsing  # playwright is not needed elsewhere

    with browsing() as opened:
        yield opened
