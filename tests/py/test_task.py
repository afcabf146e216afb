"""What is flown is spelled once: experiment, landing, study and options come to the same task and the same world."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

import ivl
from ivl import cli, estimation, experiment, landing, model, yamlfile
from ivl.cli.task_options import EQUIPMENT, FLAGS, Chosen
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.landing import LandingSpec
from ivl.settings import check_path
from ivl.task import Setup, SurfaceChoice, Task

Capture = pytest.CaptureFixture[str]
ONBOARD = "experiments/onboard_only.yaml"
POLICY = ["--rrev", "4.8", "--moment", "8"]


def flown(capsys: Capture, *arguments: str) -> dict[str, Any]:
    assert cli.run(["rollout", *POLICY, *arguments, "--json"]) == 0
    return dict(json.loads(capsys.readouterr().out))


def test_an_experiment_is_a_task_and_makes_its_world() -> None:
    chosen = experiment.load(ONBOARD)
    task = Task(**chosen.task())
    assert task.make_world().params == chosen.make_world().params
    assert task.make_world().params.values["firmware.d_source"] == 2.0
    with pytest.raises(ValidationError):
        task.gear = "wide_long"  # type: ignore[misc]


def test_every_field_of_the_task_reaches_the_world_or_the_rollout() -> None:
    task = experiment.load("experiments/paper_vertical.yaml")
    changes = {
        "vehicle": "crazyflie21", "gear": "wide_long", "gear_set": "table1", "sensing": "camera50",
        "estimator": "kalman", "approach": "constant_rrev", "surface": SurfaceChoice(angle_deg=135.0),
    }  # fmt: skip
    assert {*changes, "texture"} == set(EQUIPMENT)
    digests = {task.make_world().params.digest()}
    digests |= {task.model_copy(update={name: value}).make_world().params.digest() for name, value in changes.items()}
    looking = task.model_copy(update={"sensing": "aideck60"})
    digests |= {looking.model_copy(update={"texture": name}).make_world().params.digest() for name in ("dots", "lines")}
    assert len(digests) == 3 + len(changes)
    rest = set(Task.model_fields) - set(changes) - {"texture"}
    assert rest == {"speed_mps", "angle_deg", "start", "overrides", "family"}


def test_a_landing_of_a_run_has_all_of_its_task() -> None:
    chosen = experiment.load(ONBOARD, ["approach=constant_rrev", "sense.gyro_noise=0.01"])
    spec = landing.of_rollout(chosen, 0, (4.8, 8.0), 3)
    assert spec.task() == chosen.task()
    assert spec.make_world().params == chosen.make_world().params


def test_a_specification_takes_numbers_alone_as_overrides(tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_text(
        "{speed_mps: 2.5, angle_deg: 90.0, rrev_c_per_s: 4.8, moment_y_Nmm: 8.0, overrides: {sense.latency: 0.02}}"
    )
    spec = landing.load(tmp_path / "x.yaml")
    assert (spec.overrides["sense.latency"].value, spec.overrides["sense.latency"].unit) == (0.02, "s")
    assert (spec.vehicle, spec.gear, spec.gear_set) == ("habas2021", "wide_short", model.DEFAULT_GEAR_SET)
    (tmp_path / "y.yaml").write_text(
        "{speed_mps: 2.5, angle_deg: 90.0, rrev_c_per_s: 4.8, moment_y_Nmm: 8.0, overrides: {sense.latncy: 0.02}}"
    )
    with pytest.raises(ConfigError, match=r"y\.yaml: .*did you mean 'sense\.latency'"):
        landing.load(tmp_path / "y.yaml")


def test_the_study_of_estimators_flies_the_paper_s_experiment() -> None:
    paper = experiment.load("experiments/paper_vertical.yaml")
    task = estimation.make_task("constant_rrev", "camera50", "kalman")
    for name in ("vehicle", "gear", "gear_set", "speed_mps", "angle_deg"):
        assert getattr(task, name) == getattr(paper, name)
    assert (task.start, task.approach, task.sensing, task.estimator) == ("flown", "constant_rrev", "camera50", "kalman")


def test_options_settings_and_an_experiment_come_to_the_same_landing(capsys: Capture) -> None:
    place = ["--speed", "2.5", "--angle", "90"]
    by_options = flown(
        capsys, *place, "--gear-set", "as_simulated", "--sensors", "camera50_ranger10", "--estimator", "kalman",
        "--start", "flown",
    )  # fmt: skip
    assert by_options == flown(capsys, "--experiment", ONBOARD)
    texts = ("gear_set=as_simulated", "sensing=camera50_ranger10", "estimator=kalman", "start=flown")
    assert by_options == flown(capsys, *place, *(word for text in texts for word in ("--set", text)))
    world = experiment.load(ONBOARD).make_world()
    out = world.rollouts(2.5, 90.0, 4.8, 8.0, start="flown")
    assert by_options["t_end_s"] == out.t_end_s[()]
    assert by_options != flown(capsys, "--experiment", ONBOARD, "--speed", "3.5")
    at_trigger = flown(capsys, "--experiment", ONBOARD, "--start", "at_trigger", "--distance", "0.8")
    assert (at_trigger["triggered"], at_trigger["t_trigger_s"] < 0.1) == (1, True)


def test_options_of_a_command_change_its_experiment() -> None:
    chosen = Chosen({"gear": "wide_long"}, ["sensing=mocap", "sense.latency=0.02"], ONBOARD)
    data = chosen.fields()
    assert (data["gear"], data["sensing"], data["vehicle"]) == ("wide_long", "mocap", "habas2021")
    assert chosen.make_world().params.values["sense.latency"] == 0.02


def test_one_set_of_landing_gears_is_the_default_of_every_command(capsys: Capture) -> None:
    spec = LandingSpec(speed_mps=2.5, angle_deg=90.0, rrev_c_per_s=4.8, moment_y_Nmm=8.0)
    assert ivl.World().gear_set == spec.gear_set == Chosen().make_world().gear_set == model.DEFAULT_GEAR_SET
    assert Experiment.model_fields["gear_set"].default == model.DEFAULT_GEAR_SET
    for command in ("rollout", "sil"):
        assert cli.run([command, "--help"]) == 0
        assert f"[default: {model.DEFAULT_GEAR_SET}]" in " ".join(capsys.readouterr().out.split())


def test_every_field_of_the_task_has_an_option_and_a_text() -> None:
    assert set(FLAGS) == set(Task.model_fields) - {"overrides", "family"}
    assert all(Task.model_fields[name].description for name in FLAGS)
    assert set(Setup.model_fields) < set(Task.model_fields)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--speed", "2.5"], "--angle is missing (or --experiment"),
        (["--speed", "2.5", "--angle", "185"], "angle_deg: value 185.0 is out of range (allowed 0 .. 180 deg)"),
        (["--speed", "2.5", "--angle", "90", "--estimator", "guess"], "estimator: value 'guess': unknown estimator"),
        (["--speed", "2.5", "--angle", "90", "--approach", "fast"], "approach: value 'fast': unknown approach"),
        (["--speed", "2.5", "--angle", "90", "--set", "sensng=mocap"], "sensng: unknown key, did you mean 'sensing'?"),
        (["--experiment", ONBOARD, "--set", "sensng=mocap"], "onboard_only.yaml: sensng: unknown key"),
        (["--experiment", ONBOARD, "--gear", "wide_long", "--set", "gear=wide_short"], "already given by --gear"),
        (["--experiment", ONBOARD, "--sensors", "camera5"], "no sensor set 'camera5'"),
    ],
)
def test_what_is_wrong_is_one_line(arguments: list[str], complaint: str, capsys: Capture) -> None:
    assert cli.run(["rollout", *POLICY, *arguments]) == 2
    printed = capsys.readouterr().err
    assert complaint in printed
    assert printed.count("\n") == 1


def test_the_software_vehicle_takes_the_same_options(tmp_path: Path) -> None:
    both = []
    for name, arguments in (
        ("a", ["--experiment", ONBOARD]),
        ("b", ["--vehicle", "habas2021", "--gear-set", "as_simulated", "--sensors", "camera50_ranger10"]),
    ):
        arguments += ["--estimator", "kalman"]
        assert cli.run(["sil", *arguments, "--write-model", str(tmp_path / name)]) == 0
        both.append((tmp_path / name).read_text())
    assert both[0] == both[1]


def test_the_software_vehicle_turns_if_nobody_says_which(tmp_path: Path) -> None:
    path = tmp_path / "model"
    for arguments, torque in (([], 1.0), (["--set", "vehicle=habas2021"], 0.0), (["--vehicle", "habas2021"], 0.0)):
        assert cli.run(["sil", *arguments, "--write-model", str(path)]) == 0
        values = dict(line.split(" ", 1) for line in path.read_text().splitlines())
        assert float.fromhex(values["aero.yaw_torque"]) == torque


@pytest.mark.parametrize(
    ("path", "complaint"),
    [
        ("learner.nme", "learner.nme: unknown key, did you mean 'learner.name'?"),
        ("speed_mps.x", "speed_mps is a value, it has no field 'x'"),
        ("sense.latncy", "unknown parameter, did you mean 'sense.latency'?"),
        ("zzz", "zzz: unknown key (the nearest is "),
    ],
)
def test_a_path_that_is_none_is_answered_with_the_nearest(path: str, complaint: str) -> None:
    with pytest.raises(ConfigError) as caught:
        check_path(path, Experiment, "x.yaml")
    assert str(caught.value).startswith("x.yaml: ")
    assert complaint in str(caught.value)


def test_paths_of_a_model_go_down_into_its_models() -> None:
    paths = yamlfile.paths(Experiment)
    assert {"vehicle", "estimator", "learner.name", "policy.rrev_c_per_s.mu0", "reward.options.d_floor_m"} <= set(paths)
    assert paths["learner.options"]
    assert paths["overrides"]
    assert not paths["learner.name"]
    for path in ("learner.options.k", "overrides.x", "flown", "sense.latency"):
        check_path(path, Experiment, "x.yaml")


def test_a_sensor_set_that_nobody_varies_flies_the_same_bits_by_name_and_by_task() -> None:
    task = Task(vehicle="habas2021", gear="wide_short", sensing="mocap", speed_mps=2.5, angle_deg=90.0)
    rrev_c_per_s = np.linspace(4.0, 6.0, 8)
    direct = ivl.World(sensing="mocap").rollouts(2.5, 90.0, rrev_c_per_s, 8.0)
    assert task.make_world().rollouts(2.5, 90.0, rrev_c_per_s, 8.0).tobytes() == direct.tobytes()


def test_the_files_that_the_design_sends_people_to_are_there() -> None:
    root = Path(__file__).parents[2]
    text = (root / "docs" / "DESIGN.md").read_text(encoding="utf-8")
    rows = text.partition("How to add\n")[2].partition("\n## ")[0]
    named = re.findall(r"`((?:firmware|sim_sil|host)/[\w/.]+)`", rows)
    assert len(named) >= 8
    assert [path for path in named if not (root / path).exists()] == []
    for name, path in re.findall(r"`([A-Z_0-9]+)` (?:of|in) `([\w/.]+)`", rows):
        assert re.search(rf"^(?:#define )?{name}\b", (root / path).read_text(encoding="utf-8"), re.MULTILINE), (
            name,
            path,
        )


def test_an_override_that_contradicts_the_estimator_is_refused() -> None:
    data = {"vehicle": "habas2021", "gear": "wide_long", "speed_mps": 2.5, "angle_deg": 90.0}
    source = {"value": 0.0, "unit": "1", "source": "a test"}
    with pytest.raises(ConfigError, match=r"overrides\.firmware\.d_source: 0 contradicts estimator 'kalman'"):
        yamlfile.validate(Task, {**data, "estimator": "kalman", "overrides": {"firmware.d_source": source}}, "a.yaml")
    agreed = {**data, "estimator": "known_height", "overrides": {"firmware.d_source": source}}
    assert yamlfile.validate(Task, agreed, "a.yaml").world_settings()["firmware.d_source"] == 0.0
