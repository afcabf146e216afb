import json
from pathlib import Path

import numpy as np
import pytest

import ivl
from ivl import cli, experiment, native, run, store
from ivl.errors import StoreError
from ivl.experiment import Experiment
from ivl.store import RunStore


def test_a_run_leaves_config_manifest_rollouts_and_result(small: Experiment, small_run: run.RunResult) -> None:
    assert run.read_config(small_run.folder) == (small, None)
    manifest = json.loads((small_run.folder / "manifest.json").read_text())
    assert manifest["parameters"]["body.mass"] == {"value": 0.03584, "from": "habas2021.yaml"}
    assert manifest["units"]["out_t_impact_s"] == "s"
    saved = json.loads((small_run.folder / "result.json").read_text())
    assert {key: saved[key] for key in small_run.summary} == json.loads(json.dumps(small_run.summary))
    assert saved["verdicts"][0]["trial"] == 0
    assert len(small_run.rollouts) == small.budget


def test_the_summary_of_one_run_has_the_keys_that_scripts_rely_on(small_run: run.RunResult) -> None:
    summary = small_run.summary
    assert list(summary)[:7] == [
        "solved", "rollouts_to_convergence", "mu", "sigma",
        "landing_rate_four_leg", "landing_rate_clean", "failed_landings",
    ]  # fmt: skip
    assert summary["run_dir"] == str(small_run.folder)
    assert isinstance(summary["solved"], bool)


def test_the_summary_agrees_with_what_was_flown(small_run: run.RunResult) -> None:
    n_legs = small_run.rollouts.outcomes["n_legs"]
    assert small_run.summary["landing_rate_four_leg"] == pytest.approx((n_legs[-12:] >= 3).mean())
    assert small_run.summary["failed_landings_total"] == (n_legs < 3).sum()
    assert small_run.summary["mu"] == list(small_run.history[-1].mu)


def test_trials_are_summarised_together(small: Experiment, tmp_path: Path) -> None:
    result = run.run(small, tmp_path / "run", n_trials=3)
    assert result.summary["trials"] == 3
    assert [v.trial for v in result.verdicts] == [0, 1, 2]
    assert len(result.rollouts) == 3 * small.budget


def test_hooks_are_called_on_the_way(small: Experiment, tmp_path: Path) -> None:
    calls: list[str] = []
    hooks = run.Hooks(
        on_start=lambda folder: calls.append(folder.name),
        on_episode=lambda progress: calls.append(f"episode {progress.episode}"),
        on_stage=lambda stage, n: calls.append(f"stage {stage} of {n}"),
    )
    run.run(small, tmp_path / "run", hooks=hooks)
    assert calls == ["run"] + [f"episode {k}" for k in (1, 2, 3, 4)] + [f"stage {k} of 4" for k in range(4)]


def test_resuming_a_finished_run_gives_the_same_result_and_flies_no_grid(
    small: Experiment, small_run: run.RunResult, finished: Path
) -> None:
    stages: list[int] = []
    hooks = run.Hooks(on_stage=lambda stage, _: stages.append(stage))
    again = run.run(small, finished, resume=True, hooks=hooks)
    assert again.summary == {**small_run.summary, "run_dir": str(finished)}
    assert stages == []


def test_an_interrupted_run_resumes_to_the_same_result(
    small: Experiment, small_run: run.RunResult, tmp_path: Path
) -> None:
    def interrupt(progress: object) -> None:
        if getattr(progress, "episode") == 2:  # noqa: B009
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.run(small, tmp_path / "cut", hooks=run.Hooks(on_episode=interrupt))
    resumed = run.run(small, tmp_path / "cut", resume=True)
    assert resumed.rollouts.outcomes.tobytes() == small_run.rollouts.outcomes.tobytes()
    assert {**resumed.summary, "run_dir": ""} == {**small_run.summary, "run_dir": ""}


@pytest.mark.parametrize(
    ("change", "n_trials", "message"),
    [
        ({"seed": 1}, None, "cannot be resumed: seed: it has 0, now 1"),
        ({"budget": 20}, None, "cannot be resumed: budget: it has 16, now 20"),
        ({}, 2, "cannot be resumed: trials: it has None, now 2"),
    ],
)
def test_a_run_of_another_configuration_is_not_resumed(
    small: Experiment, finished: Path, change: dict[str, int], n_trials: int | None, message: str
) -> None:
    with pytest.raises(StoreError, match=message):
        run.run(small.model_copy(update=change), finished, n_trials, resume=True)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("library_sha256", "native library changed"),
        ("model_sha256", "vehicle or gear files changed"),
        ("numerics", "it was computed by other, here is .* would not continue bit for bit"),
    ],
)
def test_a_run_whose_world_changed_is_not_resumed(small: Experiment, finished: Path, key: str, message: str) -> None:
    path = finished / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), key: "other"}))
    with pytest.raises(StoreError, match=message):
        run.run(small, finished, resume=True)


@pytest.mark.parametrize("command", [["learn", "--resume", "--out"], ["report"], ["export"]])
def test_a_run_of_an_older_version_is_refused_in_one_line_that_names_both(
    small_file: Path, finished: Path, capsys: pytest.CaptureFixture[str], command: list[str]
) -> None:
    folder = finished
    path = folder / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "schema_version": 1, "ivl_version": "0.0.9"}))
    (folder / "config.yaml").write_text("form: of old\n")
    before = {file: file.read_bytes() for file in folder.iterdir()}
    assert cli.run([*command, str(folder)]) != 0
    line = f"{folder}: written by ivl 0.0.9 with schema version 1; this is ivl {ivl.__version__}, which reads schema"
    complaint = capsys.readouterr().err
    assert f"{line} version {store.SCHEMA_VERSION} alone" in complaint
    assert len(complaint.splitlines()) == 1
    assert {file: file.read_bytes() for file in folder.iterdir()} == before
    with pytest.raises(StoreError, match=r"written by ivl 0\.0\.9"):
        run.run(experiment.load(str(small_file)), folder, resume=True)


def test_a_run_flown_elsewhere_is_not_continued_in_the_simulator(small: Experiment, finished: Path) -> None:
    path = finished / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "uri": "radio://0"}))
    with pytest.raises(StoreError, match="uri: it has radio://0, now None"):
        run.run(small, finished, resume=True)


def test_a_run_is_not_overwritten(small: Experiment, finished: Path) -> None:
    with pytest.raises(StoreError, match="holds a run already"):
        run.run(small, finished)


def test_resuming_where_nothing_is_says_so(small: Experiment, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="there is no run to resume"):
        run.run(small, tmp_path / "none", resume=True)


def test_default_folders_are_numbered_and_the_newest_is_resumed(
    small: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(StoreError, match="there is no run to resume; name its folder with --out"):
        run.default_folder(small, None, resume=True)
    first = run.default_folder(small, None, resume=False)
    assert first == Path("runs/small-ephe_robust-seed0")
    second = run.default_folder(small, None, resume=False)
    assert second == Path("runs/small-ephe_robust-seed0-2")
    assert run.default_folder(small, None, resume=True) == second
    assert run.default_folder(small, 100, resume=False) == Path("runs/small-ephe_robust-seed0-x100")


def test_a_run_can_be_read_with_sqlite_alone(small_run: run.RunResult, finished: Path) -> None:
    with RunStore.open_existing(finished, native.library().outcome_dtype) as store:
        query = "SELECT count(*), avg(out_n_legs) FROM rollout WHERE status = 'scored'"
        assert store._db.execute(query).fetchone() == (16, np.mean(small_run.rollouts.outcomes["n_legs"]))
