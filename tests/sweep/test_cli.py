import json
from pathlib import Path

import pytest
from small_sweep import MAP, SMALL, fly, make, write

from ivl import cli
from ivl.sweep import store


def test_a_dry_run_says_what_would_be_flown_and_flies_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["sweep", "sweeps/paper.yaml", "--learner", "ephe", "--workers", "2", "--dry-run", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["trials"], report["rollouts_at_most"]) == (7200, 1_324_800)
    assert (report["learner"], report["approaches"], len(report["gears"])) == ("ephe", 240, 6)
    assert list(tmp_path.iterdir()) == []


def test_a_map_is_flown_and_summed_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path / "map.yaml", {**MAP, "gears": ["wide_long"]})
    assert cli.run(["map", str(file), "--out", str(tmp_path / "run"), "--workers", "1", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["trials"], report["failed"], report["rollouts_flown"]) == (4, 0, 4 * 6 * 3)
    assert len(store.read_map(tmp_path / "run")) == 24


def test_wrong_files_and_folders_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path / "sweep.yaml", SMALL)
    assert cli.run(["sweep", "sweeps/nothing.yaml"]) == 2
    assert "shipped: sweeps/" in capsys.readouterr().err
    assert cli.run(["sweep", str(file), "--resume", "--out", str(tmp_path / "none")]) == 1
    assert "there is no run to resume" in capsys.readouterr().err
    assert cli.run(["sweep", str(file), "--set", "vehicle=nobody"]) == 2
    err = capsys.readouterr().err
    assert "no vehicle 'nobody'" in err
    assert err.count("\n") == 1  # nothing is told of a run folder that there will not be


def test_what_is_out_of_range_is_told_by_field_and_range_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path / "sweep.yaml", {**SMALL, "angles_deg": [30.0, 100.0]})
    assert cli.run(["sweep", str(file)]) == 2
    assert capsys.readouterr().err == "ivl: sweep.yaml: angles_deg: 100.0 is out of range (0 .. 90 deg)\n"


def test_a_run_that_is_complete_is_summed_up_for_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = fly(make(tmp_path), tmp_path / "run", size=4)
    assert cli.run(["sweep", str(tmp_path / "sweep.yaml"), "--out", str(run), "--resume"]) == 0
    printed = capsys.readouterr()
    assert f"run folder: {run}" in printed.err
    lines = {line[:34].strip(): line[34:].strip() for line in printed.out.splitlines()}
    assert lines["rollouts per s"] == "-"
    assert lines["landing rate mean"].startswith("narrow_short 0.")
