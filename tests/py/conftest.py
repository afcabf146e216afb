"""Fixtures shared by the tests of the Python package.

The package is imported before numpy, since it sets the number of BLAS threads.
"""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import ivl  # isort: split

import numpy as np

from ivl import experiment, run
from ivl.experiment import Experiment


@pytest.fixture(scope="session")
def world() -> ivl.World:
    return ivl.World("habas2021", "wide_short", "as_simulated")


def small_experiment() -> dict[str, Any]:
    """Raw data of an experiment that learns and is judged within a second."""
    return {
        "name": "small",
        "doc": "A short run for tests.",
        "vehicle": "habas2021",
        "gear": "wide_short",
        "gear_set": "as_simulated",
        "speed_mps": 2.5,
        "angle_deg": 90.0,
        "policy": {
            "rrev_c_per_s": {"mu0": 4.8, "sigma0": 0.3, "bounds": [0.0, 7.0]},
            "moment_y_Nmm": {"mu0": 8.0, "sigma0": 1.0, "bounds": [0.0, 10.0]},
        },
        "learner": {"name": "ephe_robust"},
        "n_rollouts": 4,
        "budget": 16,
        "check": {
            "n_fresh": 10,
            "effort": 0.01,
            "grid": {
                "rrev_c_per_s": {"lo": 4.5, "hi": 5.0, "step": 0.1},
                "moment_y_Nmm": {"lo": 7.0, "hi": 9.0, "step": 1.0},
            },
        },
    }


@pytest.fixture
def small_data() -> dict[str, Any]:
    return small_experiment()


@pytest.fixture(scope="session")
def small() -> Experiment:
    return experiment.from_data(small_experiment(), "small.yaml")


@pytest.fixture(scope="session")
def small_run(small: Experiment, tmp_path_factory: pytest.TempPathFactory) -> run.RunResult:
    """A finished run of it, made once for all tests, which only read it."""
    return run.run(small, tmp_path_factory.mktemp("small") / "run")


@pytest.fixture
def finished(small_run: run.RunResult, tmp_path: Path) -> Path:
    """The folder of a finished run, for the test alone."""
    return Path(shutil.copytree(small_run.folder, tmp_path / "finished"))


@pytest.fixture
def small_file(small: Experiment, tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(small.to_yaml())
    return path


@pytest.fixture
def fly() -> "Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]":
    """Surrogate flights with noise that is the same in every test run."""
    rng = np.random.default_rng(7)
    return lambda theta: surrogate_flights(theta, rng)


def surrogate_flights(theta: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """An analytic stand-in for landings, for testing optimisers alone: returns (n, 2) policies -> (returns, four-leg).

    A wide ridge of success in (RREV, M): the flip of 155 degrees must fit into the time to contact.
    """
    rrev = np.maximum(theta[:, 0] + 0.08 * rng.standard_normal(len(theta)), 1e-3)
    moment = np.maximum(theta[:, 1] * (1 + 0.03 * rng.standard_normal(len(theta))), 1e-3)
    tau_s = 1 / rrev
    t_rot_s = np.sqrt(5.1 / (moment * 1e-3 / 3e-5)) + 0.05
    angle_deg = np.clip(155 * (np.maximum(tau_s - 0.05, 0) / (t_rot_s - 0.05)) ** 2, 0, 270)
    contact = (tau_s < 0.33) & (rrev > 0.5)
    four = contact & (angle_deg > 118) & (angle_deg < 178) & (rng.random(len(theta)) > 0.05)
    two = contact & (angle_deg > 70) & (angle_deg < 205) & ~four
    legs = np.where(four, 150.0, np.where(two, 50.0, 0.0)) * np.where(angle_deg < 60, 0.5, 1.0)
    d_min_m = np.where(contact, 0.06, 0.06 + 1.5 * np.clip(tau_s - 0.33, 0, 0.6))
    folded_deg = np.where(angle_deg > 180, 360 - angle_deg, angle_deg)
    return np.minimum(1 / d_min_m, 20) + 10 * np.minimum(folded_deg / 90, 1) + legs, four
