import json
from pathlib import Path

import pytest
from small_sweep import MAP, SMALL, write

from ivl import cli
from ivl.sweep import store


def test_a_dry_run_says_what_would_be_flown_and_flies_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["sweep", "sweeps/paper.yaml", "--learner", "ephe", "--workers", "2", "--dry-run", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["trials"], report["rollouts_at_most"]) == (7200, 1_152_000)
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
    assert "no vehicle 'nobody'" in capsys.readouterr().err
