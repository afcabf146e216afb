"""What helps to find things: lists, new files, schemas, and the landing that a run recommends."""

import json
import sys
from pathlib import Path

import pytest

import ivl
from ivl import cli, experiment, model, native, sensing, template
from ivl.cli.listing import Kind


@pytest.mark.parametrize("kind", [kind.value for kind in Kind])
def test_everything_is_listed_with_what_it_is(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["list", kind, "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out).values()
    assert found
    assert all(entry["name"] and entry["doc"] for entry in found)
    assert cli.run(["list", kind]) == 0
    lines = capsys.readouterr().out
    assert all(entry["name"] in lines for entry in found)


def test_every_parameter_approach_and_estimator_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["list", "--json"]) == 0
    found = {
        kind: [entry["name"] for entry in entries] for kind, entries in json.loads(capsys.readouterr().out).items()
    }
    assert found["params"] == list(native.library().params)
    assert found["approaches"] == list(sensing.APPROACHES) == list(sensing.APPROACH_DOCS)
    assert found["estimators"] == list(sensing.ESTIMATORS) == list(sensing.ESTIMATOR_DOCS)
    assert cli.run(["list"]) == 0
    assert "sense.latency" not in capsys.readouterr().out


@pytest.mark.parametrize("base", experiment.list_experiments())
def test_a_new_experiment_flies_what_its_base_flies(base: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    made = template.write_experiment(path, base)
    read = experiment.load(str(path))
    assert read == made
    assert read.name == "mine"
    assert read.task() == experiment.load(base).task()
    text = path.read_text()
    for name in type(read).model_fields:
        line = next(i for i, line in enumerate(text.splitlines()) if line.startswith(f"{name}:"))
        assert text.splitlines()[line - 1].startswith("# "), f"{name} has no comment"
    assert max(len(line) for line in text.splitlines() if line.startswith("#")) <= 120


@pytest.mark.parametrize("base", model.list_vehicles())
def test_a_new_vehicle_is_a_copy_with_a_name_of_its_own(base: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    assert cli.run(["init", str(path), "--vehicle", base]) == 0
    copy, shipped = model.load_vehicle(str(path)), model.load_vehicle(base)
    assert (copy.name, copy.doc, copy.quantities) == ("mine", shipped.doc, shipped.quantities)


@pytest.mark.parametrize("name", ["yes", "12", "null", "1e3"])
def test_a_new_vehicle_keeps_a_name_that_yaml_would_read_as_something_else(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.yaml"
    assert cli.run(["init", str(path), "--vehicle", "habas2021"]) == 0
    assert model.load_vehicle(str(path)).name == name


@pytest.mark.parametrize("base", model.list_gear_sets())
def test_new_landing_gears_are_a_copy(base: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    assert cli.run(["init", str(path), "--gear-set", base]) == 0
    for gear in model.list_gears(base):
        assert model.load_gear(gear, str(path)).quantities == model.load_gear(gear, base).quantities


def test_one_kind_of_file_is_written_and_its_base_exists(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.yaml"
    assert cli.run(["init", str(path), "--vehicle", "habas2021", "--gear-set", "table1"]) == 2
    assert cli.run(["init", str(path), "--vehicle", "habas2020"]) == 2
    assert cli.run(["init", str(path), "--gear-set", "table2"]) == 2
    assert "did you mean 'habas2021'" in capsys.readouterr().err
    assert not path.exists()


def test_a_file_that_exists_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.yaml"
    assert cli.run(["init", str(path)]) == 0
    before = path.read_bytes()
    assert cli.run(["init", str(path)]) == 2
    assert cli.run(["init", str(tmp_path / "mine.txt")]) == 2
    assert cli.run(["init", str(tmp_path / "a b.yaml")]) == 2
    assert cli.run(["init", str(tmp_path / "b.yaml"), "--like", "paper_vertcal"]) == 2
    assert "did you mean 'paper_vertical'" in capsys.readouterr().err
    assert path.read_bytes() == before


@pytest.mark.parametrize("kind", template.kinds())
def test_a_schema_knows_the_fields_of_its_files(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["schema", kind]) == 0
    found = json.loads(capsys.readouterr().out)
    model = template._models()[kind]
    assert set(found["properties"]) == set(model.model_fields)
    assert found["additionalProperties"] is False


def test_what_a_run_learned_is_flown(small: ivl.Experiment, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "run"
    run = ivl.learn(small, out=folder)
    capsys.readouterr()
    assert cli.run(["rollout", "--run", str(folder), "--json"]) == 0
    flown = json.loads(capsys.readouterr().out)
    spec = run.landing().model_copy(update={"seed": 0, "stream": 0})
    assert flown["d_min_m"] == spec.fly()[1].outcome["d_min_m"]
    assert cli.run(["rollout", "--run", str(folder), "--speed", "2.0"]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("verdict")
    assert cli.run(["rollout", "--run", str(folder), "--rrev", "4"]) == 2
    assert "already given by --rrev" in capsys.readouterr().err


def test_a_command_whose_packages_are_missing_says_what_installs_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "pyarrow" or name.startswith("ivl.sweep.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert cli.run(["sweep", "smoke", "--dry-run"]) == 1
    assert "pyarrow is not installed: pip install 'ivl[sweep]'" in capsys.readouterr().err
