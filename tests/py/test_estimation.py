"""Sensor sets, approaches and estimators: what is read, and how well the distance is known."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

import ivl
from ivl import estimation, experiment, model, sensing
from ivl.cli import run as cli
from ivl.errors import ConfigError

SOURCE = "a test"


def write_set(path: Path, **groups: object) -> str:
    """A sensor set file; returns its path as text."""
    path.write_text(yaml.safe_dump({"name": path.stem, "doc": "For a test.", **groups}), encoding="utf-8")
    return str(path)


def rate(value: float) -> dict[str, object]:
    return {"rate": {"value": value, "unit": "Hz", "source": SOURCE}}


@pytest.mark.parametrize("vehicle", model.list_vehicles())
@pytest.mark.parametrize("name", model.list_sensor_sets())
def test_every_set_flies_on_every_vehicle(vehicle: str, name: str) -> None:
    world = ivl.World(vehicle, "wide_short", sensing=name)
    out = world.rollouts(2.5, 90.0, np.full(8, 4.8), 8.0, start="flown")
    assert np.isfinite(out.t_end_s).all()
    assert all(quantity.source for quantity in model.load_sensors(name).quantities.values())


def test_a_set_replaces_the_sensing_of_the_vehicle_as_a_whole() -> None:
    own, ideal = ivl.World("crazyflie21"), ivl.World("crazyflie21", sensing="ideal")
    assert own.params.values["sense.latency"] > 0.0
    for name, value in ideal.params.values.items():
        if name.partition(".")[0] in model.SENSING_GROUPS and name != "sense.pose_rate":
            assert ideal.params.origin[name] == "default", name
        elif name.partition(".")[0] not in model.SENSING_GROUPS:
            assert value == own.params.values[name], name


def test_the_ideal_set_gives_the_landings_of_the_papers_vehicle_to_the_bit() -> None:
    own = ivl.World("habas2021").rollouts(2.5, 90.0, np.linspace(4, 6, 16), 8.0, seed=3)
    ideal = ivl.World("habas2021", sensing="ideal").rollouts(2.5, 90.0, np.linspace(4, 6, 16), 8.0, seed=3)
    assert own.tobytes() == ideal.tobytes()


def test_included_sets_are_merged_later_ones_and_own_values_win(tmp_path: Path) -> None:
    first = write_set(tmp_path / "first.yaml", rrev=rate(30.0), range=rate(5.0))
    second = write_set(tmp_path / "second.yaml", rrev=rate(40.0))
    both = write_set(tmp_path / "both.yaml", includes=[first, second], flow=rate(7.0), range=rate(6.0))
    values = {name: quantity.value for name, quantity in model.load_sensors(both).quantities.items()}
    assert values == {"rrev.rate": 40.0, "range.rate": 6.0, "flow.rate": 7.0}


def test_faults_of_a_set_are_named(tmp_path: Path) -> None:
    wrong_group = write_set(tmp_path / "group.yaml", body={"mass": {"value": 1.0, "unit": "kg", "source": SOURCE}})
    with pytest.raises(ConfigError, match=r"group.yaml: body: not part of a sensor set"):
        model.load_sensors(wrong_group)
    loop = tmp_path / "loop.yaml"
    write_set(loop, includes=[str(loop)])
    with pytest.raises(ConfigError, match="circles"):
        model.load_sensors(str(loop))
    with pytest.raises(ConfigError, match=r"rrev.rate: value 501.0 is out of range"):
        model.load_sensors(write_set(tmp_path / "range.yaml", rrev=rate(501.0)))
    with pytest.raises(ConfigError, match=r"no sensor set 'camera5'.*camera50"):
        model.load_sensors("camera5")
    # two files that both set a flight parameter
    clash = write_set(
        tmp_path / "clash.yaml", firmware={"approach_accel": {"value": 2.0, "unit": "m/s^2", "source": SOURCE}}
    )
    with pytest.raises(ConfigError, match=r"approach_accel.*also given"):
        ivl.World("crazyflie21", sensing=clash)


def number(value: float, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit, "source": SOURCE}


def test_a_filter_s_noise_may_be_that_of_the_sensor(tmp_path: Path) -> None:
    firmware = {"rrev_sigma": {"from": "rrev.noise"}, "rrev_sigma_norm": number(0.3, "1")}
    camera = write_set(tmp_path / "camera.yaml", rrev={"noise": number(0.07, "1/s")}, firmware=firmware)
    quantity = model.load_sensors(camera).quantities["firmware.rrev_sigma"]
    assert (quantity.value, quantity.unit, quantity.source) == (0.07, "1/s", "as rrev.noise")
    assert ivl.World(sensing=camera).params.values["firmware.rrev_sigma"] == 0.07


def test_a_reference_follows_the_whole_set_unless_a_number_replaces_it(tmp_path: Path) -> None:
    camera = write_set(
        tmp_path / "camera.yaml", rrev={"noise": number(0.07, "1/s")}, firmware={"rrev_sigma": {"from": "rrev.noise"}}
    )
    noisy = write_set(tmp_path / "noisy.yaml", includes=[camera], rrev={"noise": number(0.2, "1/s")})
    fixed = write_set(tmp_path / "fixed.yaml", includes=[noisy], firmware={"rrev_sigma": number(0.1, "1/s")})
    sigma = "firmware.rrev_sigma"
    assert model.load_sensors(noisy).quantities[sigma].value == 0.2
    assert model.load_sensors(fixed).quantities[sigma].value == 0.1
    # what the vehicle really has may differ from what its filter expects
    assert ivl.World(sensing=noisy, **{"rrev.noise": 0.5}).params.values[sigma] == 0.2


@pytest.mark.parametrize(
    ("firmware", "complaint"),
    [
        ({"rrev_sigma": {"from": "rrev.nois"}}, r"rrev_sigma: from rrev.nois: unknown parameter.*'rrev.noise'"),
        ({"rrev_sigma": {"from": "rrev.max"}}, r"rrev_sigma: from rrev.max: the set gives it no number"),
        ({"rrev_sigma": {"from": "rrev.rate"}}, r"rrev_sigma: from rrev.rate: its unit is 'Hz', not '1/s'"),
        ({"rrev_sigma": {"from": "rrev.noise", "value": 1.0}}, r"rrev_sigma: value: unknown key"),
        ({"rrev_sigma": {"from": "firmware.rrev_sigma"}}, r"from firmware.rrev_sigma: the set gives it no number"),
        ({"rrev_sgma": {"from": "rrev.noise"}}, r"rrev_sgma: unknown parameter, did you mean 'firmware.rrev_sigma'"),
    ],
)
def test_a_reference_that_leads_nowhere_is_named(firmware: dict[str, object], complaint: str, tmp_path: Path) -> None:
    rrev = {"noise": number(0.07, "1/s"), "rate": number(50.0, "Hz")}
    path = write_set(tmp_path / "camera.yaml", rrev=rrev, firmware=firmware)
    with pytest.raises(ConfigError, match=complaint) as caught:
        model.load_sensors(path)
    assert str(caught.value).startswith("camera.yaml: firmware.")


@pytest.mark.parametrize("name", ["camera50_delay20", "camera100", "camera30_delay40", "camera50_ranger10"])
def test_the_shipped_filters_expect_the_noise_and_delay_of_their_camera(name: str) -> None:
    values = {key: quantity.value for key, quantity in model.load_sensors(name).quantities.items()}
    assert values["firmware.rrev_sigma_norm"] == values["rrev.noise_rel"]
    assert values["firmware.rrev_delay"] == values["rrev.delay"]


@pytest.fixture(scope="module")
def target() -> estimation.Cell:
    return estimation.study("accelerate_hold", "camera50_delay20", "kalman", n=600, seed=7)


def test_the_filter_keeps_its_targets_with_a_delayed_camera(target: estimation.Cell) -> None:
    assert target.triggered == 1.0
    assert target.error_median is not None
    assert target.error_median <= estimation.TARGET_MEDIAN
    assert target.error_p90 is not None
    assert target.error_p90 <= estimation.TARGET_P90
    assert target.coverage is not None
    assert estimation.COVERAGE[0] <= target.coverage <= estimation.COVERAGE[1]
    assert target.nees is not None
    assert 0.5 < target.nees < 1.5


def test_a_delay_that_is_not_compensated_costs_more_than_double(target: estimation.Cell) -> None:
    cell = estimation.study("accelerate_hold", "camera50_delay20_unknown", "kalman", n=300, seed=7)
    assert cell.error_median is not None
    assert target.error_median is not None
    assert cell.error_median > 2.0 * target.error_median


@pytest.mark.parametrize(
    ("sensors", "estimator"), [("flow", "kalman"), ("camera50", "formula"), ("imu", "known_height")]
)
def test_what_is_invalid_or_too_uncertain_never_triggers(sensors: str, estimator: str) -> None:
    cell = estimation.study("accelerate_hold", sensors, estimator, n=200)
    assert cell.triggered == 0.0
    assert cell.four_leg == 0.0
    assert cell.error_median is None
    assert cell.coverage is None


def test_a_limit_on_sigma_that_nothing_meets_keeps_the_trigger_from_firing() -> None:
    world = estimation.make_task("accelerate_hold", "camera50", "kalman", **{"firmware.d_sigma_max": 0.01}).make_world()
    out = world.rollouts(2.5, 90.0, np.full(64, 4.8), 8.0, start="flown")
    fired = out.triggered == 1
    assert (out.d_sigma_trigger_m[fired] <= 0.01 * out.d_trigger_m[fired]).all()
    assert fired.mean() < 0.1


def test_prediction_takes_the_hold_out_of_the_cue_and_the_latency_as_far_as_it_was_measured() -> None:
    held = estimation.study("accelerate_hold", "mocap", "known_height", n=200)
    told = estimation.study("accelerate_hold", "mocap", "known_height_predicted", n=200)
    assert held.error_median is not None
    assert told.error_median is not None
    assert told.error_median < 0.2 * held.error_median
    task = estimation.make_task("accelerate_hold", "mocap", "known_height_predicted", **{"firmware.pose_latency": 0.0})
    out = task.make_world().rollouts(task.speed_mps, task.angle_deg, np.full(200, 4.8), 8.0, start="flown")
    untold = np.nanmedian(np.abs(out.d_trigger_m / out.d_true_trigger_m - 1.0))
    assert 0.7 * held.error_median < untold < 1.1 * held.error_median


def test_approaches_differ_at_the_trigger_as_they_should() -> None:
    speed = {
        name: estimation.study(name, "ideal", "known_height_predicted", n=64).speed_mps for name in sensing.APPROACHES
    }
    assert speed["accelerate_hold"] == pytest.approx(2.5, abs=0.06)
    assert speed["constant_rrev"] == pytest.approx(1.5, abs=0.1)
    assert speed["constant_acceleration"] is not None
    assert speed["constant_acceleration"] > 2.6


def test_every_cell_of_the_table_can_be_built() -> None:
    cells = list(estimation.all_cells())
    assert len(set(cells)) == len(cells) > 50
    assert ("accelerate_hold", "camera50", "kalman") in cells
    assert not any(sensors == "imu" for _, sensors, _ in cells)


def test_the_onboard_experiment_flies_without_external_position() -> None:
    chosen = experiment.load("experiments/onboard_only.yaml")
    world = chosen.make_world()
    assert world.params.values["sense.inertial"] == 1.0
    assert world.params.values["firmware.d_source"] == 2.0
    with pytest.raises(ConfigError, match="estimator"):
        experiment.load("experiments/onboard_only.yaml", ["estimator=guess"])


def test_the_command_prints_one_object(capsys: pytest.CaptureFixture[str]) -> None:
    chosen = ["--approach", "accelerate_hold", "--sensors", "camera50", "--estimator", "kalman"]
    assert cli(["estimate", *chosen, "--runs", "40", "--json"]) == 0
    (cell,) = json.loads(capsys.readouterr().out)["cells"]
    assert cell["runs"] == 40
    assert cell["estimator"] == "kalman"
    assert 0.0 < cell["error_median"] < 0.3
    assert cli(["estimate", "--runs", "8", "--sensors", "ranger10"]) == 0
    assert "range" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments", [[], ["--all", "--sensors", "ideal"], ["--sensors", "ideal", "--approach", "fast"]]
)
def test_wrong_usage_of_the_command(arguments: list[str]) -> None:
    assert cli(["estimate", *arguments]) == 2
