"""The paper's vertical landing, learned and judged within a second, and a room around an experiment."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import ivl  # isort: split

import pytest

from ivl import experiment, yamlfile
from ivl.experiment import Experiment
from ivl.site import file as site_file
from ivl.site import place

assert ivl.__version__, "the package is imported before numpy, which it sets up"
WIDE = {
    "surface": dict.fromkeys(("before_m", "beyond_m", "left_m", "right_m"), 5.0),
    "fence": {"x_m": [-50.0, 50.0], "y_m": [-50.0, 50.0], "z_m": [-10.0, 20.0]},
}
"""A board and a fence as wide as no test needs."""


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What is kept in the user's cache folder, such as tables of contents, is kept for these tests alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


def vertical(n_rollouts: int, budget: int) -> Experiment:
    """The experiment, with episodes of so many rollouts."""
    settings = ["learner.name=ephe_robust", f"n_rollouts={n_rollouts}", f"budget={budget}"]
    settings += ["check.n_fresh=10", "check.effort=0.01"]
    settings += [
        "check.grid.rrev_c_per_s={lo: 4.5, hi: 5.0, step: 0.1}",
        "check.grid.moment_y_Nmm={lo: 7.0, hi: 9.0, step: 1.0}",
    ]
    return experiment.load("experiments/paper_vertical.yaml", settings)


def furnished(chosen: Experiment, folder: Path, **changes: dict[str, Any]) -> Experiment:
    """An experiment in a room of its own height and vehicle; `changes` of groups of the site file, such as `WIDE`."""
    data = yamlfile.read(site_file.TEMPLATE)
    data |= {"vehicle": chosen.vehicle, "not_measured": [], "mocap": None}
    for group, fields in changes.items():
        data[group] |= fields
    data["surface"]["height_m"] = chosen.make_world().params.values["world.ceiling_height"]
    path = folder / "lab.yaml"
    path.write_text(yamlfile.dump(data))
    return place.at(chosen.model_copy(update={"site": str(path)}), site_file.load(str(path)), path.name)
