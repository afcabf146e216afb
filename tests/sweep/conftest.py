"""Small sweeps that fly in a second or two; the modules of this folder import each other by plain name."""

import sys
from pathlib import Path

import pytest

import ivl
from ivl.sweep.config import Sweep

sys.path.insert(0, str(Path(__file__).parent))

from small_sweep import fly, make


@pytest.fixture
def small(tmp_path: Path) -> Sweep:
    return make(tmp_path)


@pytest.fixture(scope="session")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tables of the small sweep, all trials of a gear in one task."""
    tmp_path = tmp_path_factory.mktemp("reference")
    return fly(make(tmp_path), tmp_path / "run", size=100)


@pytest.fixture
def world(small: Sweep) -> ivl.World:
    return small.make_world("wide_long")
