import json
from pathlib import Path

import numpy as np
import pytest
from small_sweep import MAP, SMALL, fly, make, write

from ivl import World, cli, family
from ivl.sweep import config, store


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
    file = write(tmp_path / "sweep.yaml", {**SMALL, "angles_deg": [30.0, 200.0]})
    assert cli.run(["sweep", str(file)]) == 2
    assert capsys.readouterr().err == "ivl: sweep.yaml: angles_deg: 200.0 is out of range (0 .. 180 deg)\n"


def test_a_run_that_is_complete_is_summed_up_for_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = fly(make(tmp_path), tmp_path / "run", size=4)
    assert cli.run(["sweep", str(tmp_path / "sweep.yaml"), "--out", str(run), "--resume"]) == 0
    printed = capsys.readouterr()
    assert f"run folder: {run}" in printed.err
    lines = {line[:34].strip(): line[34:].strip() for line in printed.out.splitlines()}
    assert lines["rollouts per s"] == "-"
    assert lines["landing rate mean"].startswith("narrow_short 0.")


def test_a_map_over_a_family_tells_what_one_flip_does_on_all_its_vehicles(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    section = {"parameters": {"rotor.thrust_gain": {"share": 0.15, "source": "test"}}, "seed": 2}
    task = {"vehicle": "crazyflie21", "gear_set": "table1", "gears": ["wide_long"], "family": section}
    axes: dict[str, list[float]] = {
        "d_ceil_m": [0.3, 0.5, 0.7],
        "moment_Nmm": [5.0, 9.0],
        "speeds_mps": [2.5, 3.0],
        "angles_deg": [90.0],
    }
    file = write(tmp_path / "map.yaml", {**MAP, **task, **axes})
    run = tmp_path / "run"
    assert cli.run(["map", str(file), "--family", "11", "--out", str(run), "--workers", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["family"]["wide_long"]
    points = store.read_map(run)
    assert len(points) == 11 * 2 * 6
    rate = np.empty((11, 2, 6))
    for _, row in points.iterrows():
        point = 2 * axes["d_ceil_m"].index(row["d_ceil_m"]) + axes["moment_Nmm"].index(row["moment_Nmm"])
        cell = axes["speeds_mps"].index(row["speed_mps"])
        rate[int(row["vary.family.member"]), cell, point] = row["n_four_leg"] / row["n"]
    best = rate.mean(axis=0).argmax(axis=-1)
    of_vehicle = np.sort(rate[:, [0, 1], best].mean(axis=1))
    assert told["vehicles"] == 11
    assert told["mean"] == pytest.approx(of_vehicle.mean(), abs=1e-4)
    assert told["worst_tenth"] == pytest.approx(of_vehicle[:2].mean(), abs=1e-4)
    assert told["share_solved"] == pytest.approx((of_vehicle >= 0.8).mean(), abs=1e-4)
    assert told["own_best"] == pytest.approx(rate.max(axis=-1).mean(), abs=1e-4)
    assert told["worst_tenth"] < told["mean"] <= told["own_best"]


def test_a_sweep_over_a_family_learns_on_each_of_its_vehicles(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    task = {"vehicle": "crazyflie21", "gear_set": "table1", "gears": ["wide_long"], "speeds_mps": [2.5], "trials": 1}
    file = write(tmp_path / "sweep.yaml", {**SMALL, **task, "angles_deg": [90.0]})
    run = tmp_path / "run"
    assert cli.run(["sweep", str(file), "--family", "3", "--out", str(run), "--workers", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    trials = store.read_trials(run)
    assert sorted(trials["vary.family.member"]) == [0.0, 1.0, 2.0]
    assert "groups" not in found
    assert found["family"]["wide_long"]["vehicles"] == 3
    assert found["family"]["wide_long"]["mean"] == pytest.approx(trials["landing_rate_four_leg_norm"].mean(), abs=1e-4)
    sweep = config.load_sweep(str(file), [], ["family.member=0,1,2"])
    expected = family.members(World("crazyflie21", "wide_long", "table1"), 3, 0)
    assert [w.params.digest() for w in sweep.worlds().values()] == [w.params.digest() for w in expected]
