"""The interface for notebooks: results as data frames and data sets, learning from Python, run folders read back."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ivl
from ivl import cli
from ivl.experiment import Experiment
from ivl.store import RunStore

SHORT = {
    "budget": 8,
    "n_rollouts": 4,
    "check.n_fresh": 5,
    "check.effort": 0.02,
    "check.grid": {
        "rrev_c_per_s": {"lo": 4.5, "hi": 5.0, "step": 0.25},
        "moment_y_Nmm": {"lo": 7.0, "hi": 9.0, "step": 1.0},
    },
}


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> ivl.LearnRun:
    """Two trials that a Python program has learned."""
    out = tmp_path_factory.mktemp("api") / "run"
    return ivl.learn("paper_vertical", learner="ephe", trials=2, seed=3, out=out, threads=1, **SHORT)


def test_a_frame_has_every_number_of_the_records_and_the_arguments(world: ivl.World) -> None:
    out = world.rollouts(np.array([2.0, 2.5])[:, None], 90.0, np.linspace(4.0, 6.0, 3), moment_y_Nmm=8.0, seed=5)
    frame = out.to_pandas()
    assert frame.shape[0] == 6
    assert frame["speed_mps"].tolist() == [2.0] * 3 + [2.5] * 3
    assert frame["rrev_c_per_s"].tolist() == [4.0, 5.0, 6.0] * 2
    assert frame["stream"].tolist() == list(range(6))
    assert (frame["leg_order_2"].to_numpy() == out.leg_order.reshape(-1, 4)[:, 1]).all()
    assert frame["end_reason"].tolist() == [world.end_reason(code) for code in out.end_reason.ravel()]
    assert np.array_equal(frame["rrev_trigger_per_s"], out.rrev_trigger.ravel(), equal_nan=True)
    assert frame.attrs["units"]["rrev_trigger_per_s"] == "1/s"
    assert all(frame.attrs["docs"][name] and frame.attrs["units"][name] for name in frame)
    row = frame.iloc[4]
    again = world.rollouts(row.speed_mps, 90.0, row.rrev_c_per_s, row.moment_y_Nmm, seed=5, stream=int(row.stream))
    assert again.tobytes() == out[1, 1].tobytes()


def test_a_selection_keeps_its_arguments_and_a_copy_of_another_shape_does_not(world: ivl.World) -> None:
    out = world.rollouts(2.5, 90.0, np.linspace(3.0, 6.0, 7), 8.0)
    late = out[out.rrev_trigger > 4.0]
    assert (late.to_pandas()["rrev_c_per_s"] > 3.9).all()
    assert len(late.to_pandas()) == len(late) < 7
    assert "rrev_c_per_s" not in out.reshape(1, 7).to_pandas()
    assert list(out[["n_legs", "t_end_s"]].to_pandas()) == ["n_legs", "t_end_s"]
    assert (out.copy().n_legs == out.n_legs).all()


def test_axes_of_a_data_set_are_called_as_what_changes_along_them(world: ivl.World) -> None:
    out = world.rollouts(np.array([2.0, 2.5])[:, None], [[30.0], [90.0]], np.array([4.0, 5.0, 6.0]), 8.0)
    data = out.to_xarray()
    assert dict(data.sizes) == {"axis_0": 2, "rrev_c_per_s": 3, "leg_order_i": 4}  # two things change along axis 0
    assert data["speed_mps"].dims == ("axis_0",)
    assert data["t_end_s"].attrs == {"units": "s", "long_name": "duration of the rollout"}
    assert "7 no_go" in data["end_reason"].attrs["codes"]
    assert float(data["t_end_s"].sel(rrev_c_per_s=5.0).isel(axis_0=1)) == out.t_end_s[1, 1]
    assert world.rollouts(2.5, 90.0, 4.8, 8.0).to_xarray()["n_legs"].dims == ()


def test_a_trace_says_what_it_is(world: ivl.World) -> None:
    trace = world.trace(2.5, 90.0, 4.8, 8.0)
    frame, data = trace.to_pandas(), trace.to_xarray()
    assert set(frame["phase"].unique()) <= set(trace.rows.codes["phase"].values())
    assert (frame["p_WB_m_3"].to_numpy() == trace.rows.p_WB_m[:, 2]).all()
    assert (data["t_s"].to_numpy() == trace.rows.t_s).all()
    assert data.attrs["end_reason"] == world.end_reason(trace.outcome.end_reason)
    assert trace.verdict in repr(trace)
    assert world.hover([[0.0, 0.0, 0.0, 1.0]], 0.1).to_pandas()["t_s"].iloc[-1] == pytest.approx(0.1, abs=0.01)


def test_a_result_says_in_words_what_came_of_it(world: ivl.World) -> None:
    out = world.rollouts(2.5, 90.0, np.full(9, 4.8), 8.0)
    landed, clean = int(ivl.four_leg(out).sum()), int(ivl.clean(out).sum())
    assert f"9 rollouts: {landed} landed, {clean} of them clean" in repr(out)
    assert out.fields["n_legs"].doc == "feet stuck at the end"
    assert "n_legs" in repr(out[["n_legs"]])


def test_frames_of_a_run_are_what_its_store_holds(learned: ivl.LearnRun) -> None:
    rollouts, episodes, trials = learned.rollouts(), learned.episodes(), learned.trials()
    with RunStore.open_reading(learned.folder, ivl.native.library().outcome_dtype) as store:
        rows, history = store.rollouts(), store.episodes()
    assert (rollouts["reward"].to_numpy() == rows.reward).all()
    assert (rollouts["rrev_c_per_s"].to_numpy() == rows.theta[:, 0]).all()
    assert (rollouts["n_legs"].to_numpy() == rows.outcomes["n_legs"]).all()
    assert episodes["mu_moment_y_Nmm"].tolist() == [row.mu[1] for row in history]
    assert rollouts.groupby("trial")["reward_legs"].count().tolist() == [8, 8]
    assert trials["run_seed"].tolist() == [3, 4]
    verdicts = json.loads((learned.folder / "result.json").read_text())["verdicts"]
    assert trials["check_rate_four_leg_norm"].tolist() == [v["rate_four_leg"] for v in verdicts]
    assert trials["solved"].tolist() == [v["solved"] for v in verdicts]
    for frame in (rollouts, episodes, trials):
        assert all(frame.attrs["docs"][name] and frame.attrs["units"][name] for name in frame)


def test_a_row_of_a_frame_can_be_flown_again(learned: ivl.LearnRun) -> None:
    row = learned.rollouts().iloc[11]
    names = learned.experiment.policy.shape.names
    trace = learned.fly({name: row[name] for name in names}, trial=int(row.trial), stream=int(row.stream))
    assert trace.outcome["t_end_s"] == row.t_end_s
    assert trace.outcome["d_min_m"] == row.d_min_m


def test_python_and_command_line_give_the_same_bits(learned: ivl.LearnRun, tmp_path: Path) -> None:
    words = ["learn", "paper_vertical", "--learner", "ephe", "--trials", "2", "--seed", "3", "--threads", "2"]
    words += [word for path, value in SHORT.items() for word in ("--set", f"{path}={json.dumps(value)}")]
    assert cli.run([*words, "--out", str(tmp_path / "run"), "--json"]) == 0
    other = ivl.load(tmp_path / "run")
    assert isinstance(other, ivl.LearnRun)
    assert other.rollouts().equals(learned.rollouts())
    assert other.trials().equals(learned.trials())


def test_a_run_that_was_cut_off_can_be_read_and_continued(learned: ivl.LearnRun, tmp_path: Path) -> None:
    def interrupt(_progress: Any) -> None:
        raise KeyboardInterrupt

    call = {"learner": "ephe", "trials": 2, "seed": 3, "out": tmp_path / "run", **SHORT}
    with pytest.raises(KeyboardInterrupt):
        ivl.learn("paper_vertical", on_episode=interrupt, **call)
    cut = ivl.load(tmp_path / "run")
    assert "not finished" in repr(cut)
    trials = cut.trials()
    assert trials["n_episodes"].tolist() == [1, 1]
    assert trials[["solved", "check_rate_four_leg_norm"]].isna().all().all()
    assert ivl.learn("paper_vertical", resume=True, **call).rollouts().equals(learned.rollouts())


def test_a_task_and_an_experiment_are_learned_too(small: Experiment, tmp_path: Path) -> None:
    task = ivl.Task(vehicle="crazyflie21", gear="wide_short", speed_mps=2.0, angle_deg=60.0)
    for what, name in ((task, "task"), (small, "small")):
        out = tmp_path / name
        run = ivl.learn(what, learner="ephe", out=out, **SHORT, **{"sense.latency": np.float64(0.01)})
        assert run.experiment.vehicle == what.vehicle
        assert run.experiment.speed_mps == what.speed_mps
        assert run.world().params.values["sense.latency"] == 0.01
        assert name in repr(run)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ivl.learn("paper_vertcal"), "did you mean 'paper_vertical'"),
        (lambda: ivl.learn(7), "int is nothing to learn"),
        (lambda: ivl.learn("paper_vertical", bugdet=8), "bugdet: unknown key, did you mean 'budget'"),
        (lambda: ivl.learn("paper_vertical", **{"sense.latncy": 0.1}), "did you mean 'sense.latency'"),
        (lambda: ivl.learn("paper_vertical", learner="efe"), "no learner 'efe'"),
        (lambda: ivl.learn("paper_vertical", reward="papr"), "no reward 'papr'"),
        (lambda: ivl.learn("paper_vertical", resume=True), "needs the run folder"),
        (lambda: ivl.sweep("smok"), "did you mean 'smoke'"),
        (lambda: ivl.sweep("smoke", trails=2), "trails: unknown key"),
        (lambda: ivl.load("/nowhere"), "holds no run"),
    ],
)
def test_mistakes_are_answered_with_a_hint(call: Any, message: str) -> None:
    with pytest.raises(ivl.IvlError, match=message):
        call()


def test_a_package_that_is_missing_is_named_with_what_installs_it(
    world: ivl.World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ivl.MissingError, match=r"pandas is not installed: pip install 'ivl\[frames\]'"):
        world.rollouts(2.5, 90.0, 4.8, 8.0).to_pandas()
