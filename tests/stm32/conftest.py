"""Tests of the flight core on an emulated STM32F405; `make firmware` makes the programs that they run."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tools" / "stm32"))

BUILDS = ("stm32-Os", "stm32-O2", "stm32-clang")


@pytest.fixture(params=BUILDS)
def build(request: pytest.FixtureRequest) -> Path:
    return ROOT / "build" / request.param


@pytest.fixture
def run_script() -> Path:
    return ROOT / "tools" / "run_stm32.sh"
