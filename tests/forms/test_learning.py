"""A form that no product file knows is learned: in process, over a link, on the emulated chip, and judged."""

import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from form_six import policy_most

from ivl import assess, experiment, forms
from ivl import run as ivl_run
from ivl.experiment import Experiment
from ivl.learners import LEARNERS
from ivl.links import pil
from ivl.outcome import four_leg
from ivl.silproc import SilProcess


def rows_of(folder: Path) -> list[list[tuple[Any, ...]]]:
    """Everything that a run has stored about rollouts, episodes and learners."""
    with sqlite3.connect(folder / "run.sqlite") as db:
        tables = ("rollout ORDER BY trial, episode, idx", "episode ORDER BY trial, episode", "learner ORDER BY trial")
        return [db.execute(f"SELECT * FROM {table}").fetchall() for table in tables]


def with_learner(chosen: Experiment, name: str) -> Experiment:
    return experiment.from_data(chosen.model_dump(mode="json") | {"learner": {"name": name}}, "six.yaml")


@pytest.fixture(autouse=True)
def judged_in_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two searches instead of eight; how good they are is tested below."""
    monkeypatch.setattr(assess, "_SEARCHES", 2)


def until_episode(n: int) -> Callable[[Any], None]:
    def interrupt(progress: Any) -> None:
        if progress.episode == n:
            raise KeyboardInterrupt

    return interrupt


@pytest.mark.parametrize("learner", [name for name in LEARNERS if name != "fixed"])
def test_every_learner_learns_it_with_the_same_bits_twice_and_after_an_interruption(
    six: Experiment, learner: str, tmp_path: Path
) -> None:
    chosen = with_learner(six, learner)
    runs = [ivl_run.run(chosen, tmp_path / name) for name in ("one", "two")]
    with pytest.raises(KeyboardInterrupt):
        ivl_run.run(chosen, tmp_path / "cut", hooks=ivl_run.Hooks(on_episode=until_episode(2)))
    ivl_run.run(chosen, tmp_path / "cut", resume=True)
    whole = rows_of(tmp_path / "one")
    assert whole == rows_of(tmp_path / "two") == rows_of(tmp_path / "cut")
    assert len(whole[0]) == chosen.budget
    assert runs[0].rollouts.theta.shape == (chosen.budget, 6)
    assert (np.ptp(runs[0].rollouts.theta, axis=0) > 0).all(), "every parameter is searched"
    assert len(runs[0].summary["mu"]) == len(runs[0].summary["recommended"]) == 6


def test_columns_of_the_store_have_the_names_of_the_form(six: Experiment, tmp_path: Path) -> None:
    ivl_run.run(six, tmp_path / "run")
    with sqlite3.connect(tmp_path / "run" / "run.sqlite") as db:
        rollout = [row[1] for row in db.execute("PRAGMA table_info(rollout)")]
        episode = [row[1] for row in db.execute("PRAGMA table_info(episode)")]
    names = six.policy.shape.names
    assert set(names) <= set(rollout)
    assert {f"{what}_{name}" for what in ("mu", "sigma", "recommended") for name in names} <= set(episode)
    assert not any("rrev_c" in column for column in rollout + episode)


def test_a_link_and_the_emulated_chip_store_the_same_bits(six: Experiment, tmp_path: Path) -> None:
    ivl_run.run(six, tmp_path / "here")
    with SilProcess(six.make_world()) as server:
        ivl_run.run(six, tmp_path / "link", uri=server.uri)
    ivl_run.run(six, tmp_path / "chip", uri="pil://")
    here = rows_of(tmp_path / "here")
    assert rows_of(tmp_path / "link") == here
    assert rows_of(tmp_path / "chip") == here
    journal = (tmp_path / "link" / "flights.jsonl").read_text().splitlines()
    assert len(journal) == six.budget
    assert '"threshold_vx_per_m"' in journal[0]


def test_the_image_is_chosen_as_the_library_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    image = tmp_path / "own.elf"
    image.write_bytes(b"")
    monkeypatch.setenv(pil.IMAGE_ENV, str(image))
    assert pil.image_of("pil://") == image
    named = tmp_path / "named.elf"
    named.write_bytes(b"")
    assert pil.image_of(f"pil://{named}") == named, "an image in the URI is the one that is meant"


def test_the_best_policy_is_found_by_repeated_long_searches(six: Experiment, tmp_path: Path) -> None:
    stages: list[tuple[int, int]] = []
    world = six.make_world()
    best = assess.find_best(world, six, on_stage=lambda k, n: stages.append((k, n)))
    assert best == assess.find_best(world, six, threads=1)
    assert best.search == "2 searches of 64 rollouts at most, the best refined in 3 clouds of 320 policies"
    assert stages == [(k, 6) for k in range(6)]
    assert len(best.theta) == 6
    result = ivl_run.run(six, tmp_path / "run")
    assert result.best == best
    assert result.summary["best"]["search"] == best.search


def test_a_long_search_of_six_parameters_finds_a_landing_policy(six: Experiment) -> None:
    check = six.check.model_copy(update={"effort": 0.1})
    assert assess.find_best(six.make_world(), six.model_copy(update={"check": check})).rate_four_leg > 0.9


def test_a_search_of_no_time_ends_no_worse_than_the_experiment_begins(six: Experiment) -> None:
    """Of 64 parameters hardly any policy lands, and a few hundred rollouts find none."""
    policy = policy_most(forms.by_name("most").names)
    chosen = experiment.from_data(six.model_dump(mode="json") | {"policy": policy}, "most.yaml")
    assert assess.find_best(chosen.make_world(), chosen).rate_four_leg > 0.9


def test_a_long_search_reaches_the_rate_of_the_grid(monkeypatch: pytest.MonkeyPatch) -> None:
    """On two parameters, where both can be flown, and in noise, where no policy always lands."""
    monkeypatch.undo()
    settings = ["sense.velocity_noise=0.1", "check.effort=0.2"]
    settings += [
        "check.grid.rrev_c_per_s={lo: 4.5, hi: 5.3, step: 0.05}",
        "check.grid.moment_y_Nmm={lo: 7.0, hi: 10.5, step: 0.5}",
    ]
    chosen = experiment.load("experiments/paper_vertical.yaml", settings)
    world = chosen.make_world()
    grid = assess.find_best(world, chosen)
    monkeypatch.setattr(assess, "GRID_DIMENSIONS_MAX", 1)
    long = assess.find_best(world, chosen)
    assert grid.search == "grid of 136 policies"
    assert long.search.startswith("8 searches of 512 rollouts")
    theta = np.array([grid.theta, long.theta])[..., None]
    outcomes = world.rollouts(2.5, 90.0, theta[:, 0], theta[:, 1], seed=99, stream=np.arange(3000))
    rate_grid, rate_long = four_leg(outcomes).mean(axis=1)
    assert 0.3 < rate_grid < 0.95, "where all policies land, nothing is compared"
    assert rate_long > rate_grid - 0.03
    assert long.rate_four_leg == pytest.approx(rate_long, abs=0.1), "what is told is not inflated by the selection"
