"""Fixtures shared by the tests of the links. The package is imported before numpy, which it sets up."""

import sys
from collections.abc import Iterator
from pathlib import Path

import ivl  # isort: split

import numpy as np
import pytest

from ivl import experiment
from ivl.experiment import Experiment
from ivl.silproc import SilProcess
from ivl.source import Plan

sys.path.insert(0, str(Path(__file__).parent))
assert ivl.__version__


@pytest.fixture(autouse=True, scope="session")
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tables of contents are kept for these tests alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def vertical() -> Experiment:
    """The paper's vertical landing, learned and judged within a second."""
    settings = ["learner.name=ephe_robust", "n_rollouts=4", "budget=12", "check.n_fresh=10", "check.effort=0.05"]
    settings += [
        "check.grid.rrev_c_per_s={lo: 4.5, hi: 5.0, step: 0.1}",
        "check.grid.moment_y_Nmm={lo: 7.0, hi: 9.0, step: 1.0}",
    ]
    return experiment.load("experiments/paper_vertical.yaml", settings)


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
