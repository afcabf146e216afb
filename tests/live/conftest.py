"""A run to look at, its view, and a browser. The package is imported before numpy, which it sets up."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import ivl  # isort: split

import pytest

from ivl import experiment, yamlfile
from ivl.experiment import Experiment
from ivl.live.view import View
from ivl.site import file as site_file
from ivl.site import place

assert ivl.__version__
OPEN = Callable[..., AbstractContextManager[View]]


@pytest.fixture(autouse=True, scope="session")
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tables of contents are kept for these tests alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def vertical() -> Experiment:
    """The paper's vertical landing, learned and judged within a second."""
    settings = ["learner.name=ephe_robust", "n_rollouts=2", "budget=4", "check.n_fresh=10", "check.effort=0.01"]
    settings += [
        "check.grid.rrev_c_per_s={lo: 4.5, hi: 5.0, step: 0.1}",
        "check.grid.moment_y_Nmm={lo: 7.0, hi: 9.0, step: 1.0}",
    ]
    return experiment.load("experiments/paper_vertical.yaml", settings)


@pytest.fixture(scope="session")
def in_room(vertical: Experiment, tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    """The same in a room whose fence fits on a page."""
    data = yamlfile.read(site_file.TEMPLATE)
    data |= {"vehicle": vertical.vehicle, "not_measured": [], "mocap": None}
    data["surface"]["height_m"] = vertical.make_world().params.values["world.ceiling_height"]
    data["fence"]["z_m"] = [-0.2, 4.0]
    path = tmp_path_factory.mktemp("room") / "lab.yaml"
    path.write_text(yamlfile.dump(data))
    return place.at(vertical.model_copy(update={"site": str(path)}), site_file.load(str(path)), path.name)


@pytest.fixture
def view_of(tmp_path: Path) -> OPEN:
    """Opens a view of an experiment, at free ports, of the run folder `run`."""

    def open_view(chosen: Experiment, in_process: bool, said: list[str] | None = None) -> View:
        heard = [] if said is None else said
        return View(chosen, tmp_path / "run", ("127.0.0.1", 0), in_process, heard.append)

    return open_view
