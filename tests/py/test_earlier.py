"""Runs that begin with the flights of earlier ones."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ivl import cli, experiment, run
from ivl.errors import ConfigError, StoreError
from ivl.experiment import Experiment
from ivl.learning.earlier import gather, meta_of
from ivl.seeds import Purpose, derive


def of(small: Experiment, **change: Any) -> Experiment:
    return experiment.from_data({**small.model_dump(mode="json"), **change}, "small.yaml")


@pytest.fixture
def before(finished: Path) -> Path:
    """The folder of the earlier run."""
    return finished


@pytest.mark.parametrize("learner", ["ephe_memory", "ephe", "cmaes"])
def test_every_learner_is_told_what_was_flown_before(
    small: Experiment, before: Path, tmp_path: Path, learner: str
) -> None:
    chosen = of(small, learner={"name": learner}, seed=3)
    result = run.run(chosen, tmp_path / "new", earlier=[before])
    assert result.summary["earlier"] == {"runs": [str(before)], "rollouts": 16}
    assert len(result.rollouts) == chosen.budget
    told = chosen.make_learner(derive(3, Purpose.LEARNER))
    old = run._read_run(before).rollouts
    for episode in range(4):
        own = old.episode == episode
        told.tell(old.theta[own], old.reward[own], meta_of(old.outcomes[own], None))
    assert (told.ask() == result.rollouts.theta[:4]).all()


def test_what_was_flown_is_scored_by_the_new_reward(small: Experiment, before: Path) -> None:
    old = run._read_run(before).rollouts
    earlier = gather([run._read_run(before)], small, None, each=False)
    assert (earlier.theta == old.theta).all()
    assert small.reward.score(earlier.outcomes)["total"] == pytest.approx(old.reward)


def test_several_runs_are_told_in_order_and_each_episode_apart(small: Experiment, before: Path, tmp_path: Path) -> None:
    run.run(of(small, seed=8), tmp_path / "second")
    both = gather([run._read_run(before), run._read_run(tmp_path / "second")], small, None, each=False)
    assert both.group.tolist() == [k // 4 for k in range(32)]
    again = type(both).of_bytes(both.to_bytes())
    assert again.outcomes.tobytes() == both.outcomes.tobytes()
    assert (again.theta == both.theta).all()
    assert (again.runs, again.notes, again.recordings) == (both.runs, both.notes, None)


def test_a_run_goes_on_when_the_earlier_one_is_gone(small: Experiment, before: Path, tmp_path: Path) -> None:
    class Cut(RuntimeError):
        """The run is cut off."""

    def cut(_: Any) -> None:
        raise Cut

    for when in ("on_start", "on_episode"):
        with pytest.raises(Cut):
            run.run(of(small, seed=3), tmp_path / when, earlier=[before], hooks=run.Hooks(**{when: cut}))
    whole = run.run(of(small, seed=3), tmp_path / "whole", earlier=[before])
    shutil.rmtree(before)
    for when in ("on_start", "on_episode"):
        resumed = run.run(of(small, seed=3), tmp_path / when, resume=True)
        assert (resumed.rollouts.theta == whole.rollouts.theta).all()
        assert {**resumed.summary, "run_dir": ""} == {**whole.summary, "run_dir": ""}
    with pytest.raises(ConfigError, match=r"--from: .* is resumed with the flights that it began with: leave it out"):
        run.run(of(small, seed=3), tmp_path / "whole", resume=True, earlier=[tmp_path / "on_start"])
    (tmp_path / "whole" / "earlier.npz").write_bytes(b"other")
    with pytest.raises(StoreError, match=r"earlier\.npz: is not as it was written"):
        run.run(of(small, seed=3), tmp_path / "whole", resume=True)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gear": "narrow_long"}, r"gear: flown with wide_short, here narrow_long"),
        ({"gear_set": "table1"}, r"gear_set: flown with as_simulated, here table1"),
        ({"vehicle": "crazyflie21"}, r"vehicle: flown with habas2021, here crazyflie21"),
        ({"start": "flown"}, r"start: flown with imparted, here flown"),
        ({"speed_mps": 2.2}, r"speed_mps: flown at 2\.5, here 2\.2 \(allowed within 0\.11 m/s\)"),
        ({"angle_deg": 87.0}, r"angle_deg: flown at 90, here 87 \(allowed within 2 deg\)"),
        (
            {"overrides": {"body.mass": {"value": 0.05, "unit": "kg", "source": "test"}}},
            r"body\.mass: 0\.03584 there, 0\.05 kg here",
        ),
        (
            {"overrides": {"sense.latency": {"value": 0.02, "unit": "s", "source": "test"}}},
            r"sense\.latency: 0 there, 0\.02 s here",
        ),
    ],
)
def test_flights_of_another_task_are_refused(
    small: Experiment, before: Path, tmp_path: Path, change: Any, message: str
) -> None:
    with pytest.raises(ConfigError, match=rf"^--from {before}: {message}$"):
        run.run(of(small, **change), tmp_path / "new", earlier=[before])
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed_mps": 2.55}, "speed_mps: flown at 2.5, here 2.55"),
        ({"angle_deg": 88.5}, "angle_deg: flown at 90, here 88.5"),
        (
            {"overrides": {"body.mass": {"value": 0.037, "unit": "kg", "source": "test"}}},
            "body.mass: 0.03584 there, 0.037 kg here",
        ),
    ],
)
def test_what_differs_a_little_is_told(
    small: Experiment, before: Path, tmp_path: Path, change: Any, message: str
) -> None:
    notes: list[str] = []
    result = run.run(of(small, **change), tmp_path / "new", earlier=[before], hooks=run.Hooks(on_note=notes.append))
    assert f"{before}: {message}" in result.summary["warnings"]
    assert f"{before}: {message}" in notes


def test_policies_outside_the_bounds_are_left_out(small: Experiment, before: Path) -> None:
    theta = run._read_run(before).rollouts.theta
    policy = small.model_dump(mode="json")["policy"]
    lo = float(np.median(theta[:, 1]))
    narrow = {**policy, "moment_y_Nmm": {"mu0": 0.5 * (lo + 10), "sigma0": 0.1, "bounds": [lo, 10.0]}}
    n_outside = int((theta[:, 1] < lo).sum())
    earlier = gather([run._read_run(before)], of(small, policy=narrow), None, each=False)
    assert len(earlier.theta) == 16 - n_outside
    assert earlier.notes == (f"{before}: {n_outside} flights are left out: policies outside the bounds of the search",)


def test_trials_and_files_are_no_earlier_run(small: Experiment, small_file: Path, tmp_path: Path, before: Path) -> None:
    run.run(small, tmp_path / "three", n_trials=3)
    with pytest.raises(ConfigError, match="holds 3 trials: earlier flights are those of a run without --trials"):
        run.run(small, tmp_path / "new", earlier=[tmp_path / "three"])
    with pytest.raises(ConfigError, match=r"is a file: name a run folder \(--policy FILE begins with"):
        run.run(small, tmp_path / "new", earlier=[small_file])
    with pytest.raises(StoreError, match="holds no run"):
        run.run(small, tmp_path / "new", earlier=[tmp_path / "nothing"])
    each = experiment.load("experiments/transfer.yaml", learner="bo")
    with pytest.raises(ConfigError, match=r"--from: family\.member: each: the flights of one vehicle"):
        run.run(each, tmp_path / "new", n_trials=2, earlier=[before])


def test_the_command_takes_several(
    small_file: Path, before: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["learn", str(small_file), "--from", str(before), "--from", str(before), "--out", str(tmp_path / "new")]
    assert cli.run([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["earlier"]["rollouts"] == 32
    assert cli.run(["learn", "--resume", "--out", str(tmp_path / "new"), "--from", str(before)]) == 2
    assert "leave it out" in capsys.readouterr().err
