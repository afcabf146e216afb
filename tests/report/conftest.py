"""Runs to report on, made by the program itself, and a real browser without network."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import policies
import pytest
from looking import Look

import ivl  # isort: split

from playwright.sync_api import Browser

from ivl import cli, experiment, report, run
from ivl.landing import LandingSpec
from ivl.policy import file
from ivl.sweep import config, folder, plan, store, work

SMALL = {
    "name": "small",
    "doc": "A short run for tests.",
    "vehicle": "habas2021",
    "gear": "wide_short",
    "gear_set": "as_simulated",
    "speed_mps": 2.5,
    "angle_deg": 90.0,
    "policy": {
        "rrev_c_per_s": {"mu0": 4.8, "sigma0": 0.8, "bounds": [0.0, 7.0]},
        "moment_y_Nmm": {"mu0": 8.0, "sigma0": 1.0, "bounds": [0.0, 10.0]},
    },
    "learner": {"name": "ephe_robust"},
    "n_rollouts": 4,
    "budget": 24,
    "check": {
        "n_fresh": 10,
        "effort": 0.01,
        "grid": {
            "rrev_c_per_s": {"lo": 4.5, "hi": 5.0, "step": 0.1},
            "moment_y_Nmm": {"lo": 7.0, "hi": 9.0, "step": 1.0},
        },
    },
}


@pytest.fixture(scope="session")
def world() -> ivl.World:
    return ivl.World("habas2021", "wide_short", "as_simulated")


@pytest.fixture(scope="session")
def spec() -> LandingSpec:
    """A landing on four feet whose feet stick at different times."""
    return LandingSpec(gear_set="as_simulated", speed_mps=2.5, angle_deg=60.0, rrev_c_per_s=4.8, moment_y_Nmm=8.0)


@pytest.fixture(scope="session")
def learn_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("learn") / "run"
    run.run(experiment.from_data(SMALL, "small.yaml"), path)
    return path


@pytest.fixture(scope="session")
def sweep_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep of two gears, flown task by task in this process."""
    settings = ["speeds_mps=[1.0, 2.5]", "angles_deg=[30.0, 60.0, 90.0]", "budget=48", "keep_rollouts=false"]
    sweep = config.load_sweep("sweeps/smoke.yaml", settings, learner="ephe_robust")
    path = tmp_path_factory.mktemp("sweep") / "run"
    worlds = {gear: sweep.make_world(gear) for gear in sweep.gear_names()}
    kept = folder.open_run(path, sweep, worlds, 32, resume=False)
    for task in plan.plan(sweep, kept.task_size):
        done = work.run_task(sweep, worlds[task.gear], task)
        store.write_part(path, task.number, {**done.parts, "tasks": work.record(task, done)})
    kept.close()
    return path


@pytest.fixture(scope="session")
def learn_page(learn_run: Path) -> Path:
    return report.write(learn_run).path


@pytest.fixture(scope="session")
def sweep_page(sweep_run: Path) -> Path:
    return report.write(sweep_run).path


@pytest.fixture(scope="session")
def policy_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a policy, of as few flights as show a landing and a no-go."""
    folder = tmp_path_factory.mktemp("policy")
    file.save(policies.by_hand(), folder / "g.yaml")
    page = folder / "page.html"
    assert cli.run(["policy", "report", str(folder / "g.yaml"), "--out", str(page), "--approaches", "30"]) == 0
    return page


class Visit(Look):
    """A look at the page of a file."""

    def __init__(self, browser: Browser, path: Path) -> None:
        super().__init__(browser, path.resolve().as_uri(), also=("data:", "blob:"), width=1366)

    def drawn(self, pane: int) -> dict[str, Any]:
        """Where body and feet of a view are on its canvas."""
        return dict(self.page.evaluate(f"report.replay.panes[{pane}].drawn"))

    def number_of(self, pane: int) -> int:
        """Number of the landing that a view shows."""
        return int(self.page.evaluate(f"report.replay.panes[{pane}].index"))

    def set_time(self, milliseconds: float) -> None:
        """Move the slider as a hand does: set it, and let it tell."""
        self.page.locator("#time").evaluate(
            "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }", milliseconds
        )


@pytest.fixture(scope="session")
def learn(browser: Browser, learn_page: Path) -> Iterator[Visit]:
    visit = Visit(browser, learn_page)
    yield visit
    visit.page.close()


@pytest.fixture(scope="session")
def policy(browser: Browser, policy_page: Path) -> Iterator[Visit]:
    visit = Visit(browser, policy_page)
    yield visit
    visit.page.close()


@pytest.fixture(scope="session")
def sweep(browser: Browser, sweep_page: Path) -> Iterator[Visit]:
    visit = Visit(browser, sweep_page)
    yield visit
    visit.page.close()
