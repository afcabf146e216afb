"""Fixtures shared by the tests of the links. The package is imported before numpy, which it sets up."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import ivl  # isort: split

import numpy as np
import pytest

from ivl import experiment, yamlfile
from ivl.experiment import Experiment
from ivl.silproc import SilProcess
from ivl.site import file as site_file
from ivl.site import place
from ivl.source import Plan

sys.path.insert(0, str(Path(__file__).parent))
from rehearsed import Days, fly_both

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
    settings = ["learner.name=ephe_robust", "n_rollouts=4", "budget=12", "check.n_fresh=10", "check.effort=0.01"]
    settings += [
        "check.grid.rrev_c_per_s={lo: 4.5, hi: 5.0, step: 0.1}",
        "check.grid.moment_y_Nmm={lo: 7.0, hi: 9.0, step: 1.0}",
    ]
    return experiment.load("experiments/paper_vertical.yaml", settings)


@pytest.fixture(scope="session")
def furnish(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Experiment], Experiment]:
    """Put an experiment into a room of its own height and vehicle, as wide as no test needs."""

    def put(chosen: Experiment) -> Experiment:
        data = yamlfile.read(site_file.TEMPLATE)
        data |= {"vehicle": chosen.vehicle, "not_measured": [], "mocap": None}
        data["surface"] |= dict.fromkeys(("before_m", "beyond_m", "left_m", "right_m"), 5.0)
        data["surface"]["height_m"] = chosen.make_world().params.values["world.ceiling_height"]
        data["fence"] = {"x_m": [-50.0, 50.0], "y_m": [-50.0, 50.0], "z_m": [-10.0, 20.0]}
        path = tmp_path_factory.mktemp("room") / "lab.yaml"
        path.write_text(yamlfile.dump(data))
        return place.at(chosen.model_copy(update={"site": str(path)}), site_file.load(str(path)), path.name)

    return put


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
