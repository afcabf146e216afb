"""A run to look at, its view, and a browser."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
import rooms
from rooms import own_cache as own_cache

from ivl.experiment import Experiment
from ivl.live.view import View

OPEN = Callable[..., AbstractContextManager[View]]


@pytest.fixture(scope="session")
def vertical() -> Experiment:
    return rooms.vertical(n_rollouts=2, budget=4)


@pytest.fixture(scope="session")
def in_room(vertical: Experiment, tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    """The same in a room whose fence fits on a page."""
    return rooms.furnished(vertical, tmp_path_factory.mktemp("room"), fence={"z_m": [-0.2, 4.0]})


@pytest.fixture
def view_of(tmp_path: Path) -> OPEN:
    """Opens a view of an experiment, at free ports, of the run folder `run`."""

    def open_view(chosen: Experiment, in_process: bool, said: list[str] | None = None) -> View:
        heard = [] if said is None else said
        return View(chosen, tmp_path / "run", ("127.0.0.1", 0), in_process, heard.append)

    return open_view
