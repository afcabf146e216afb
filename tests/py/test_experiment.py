from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ivl import experiment
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.rewards import RewardChoice

Data = dict[str, Any]


def changed(data: Data, path: str, value: Any) -> Data:
    """The data with one field set (or, with Ellipsis, removed)."""
    *parents, last = path.split(".")
    target = data
    for key in parents:
        target = target[key]
    if value is ...:
        del target[last]
    else:
        target[last] = value
    return data


@pytest.mark.parametrize("path", experiment.list_experiments())
def test_every_shipped_experiment_is_valid_and_found_from_any_directory(
    path: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    chosen = experiment.load(path)
    assert chosen.make_world()
    assert Path(path).stem == chosen.name


def test_the_vertical_experiment_is_the_paper_s() -> None:
    chosen = experiment.load("experiments/paper_vertical.yaml")
    assert (chosen.speed_mps, chosen.angle_deg, chosen.gear, chosen.vehicle) == (2.5, 90.0, "wide_short", "habas2021")
    assert (chosen.policy.rrev_c_per_s.mu0, chosen.policy.moment_y_Nmm.mu0) == (4.0, 5.0)
    assert (chosen.policy.rrev_c_per_s.sigma0, chosen.policy.moment_y_Nmm.sigma0) == (1.5, 1.5)
    assert (chosen.n_rollouts, chosen.budget) == (8, 160)


def test_the_noise_experiment_changes_the_sensing_and_nothing_else() -> None:
    plain, noise = (experiment.load(f"experiments/paper_vertical{x}.yaml") for x in ("", "_noise"))
    values = {name: setting.value for name, setting in noise.overrides.items()}
    assert values == {
        "sense.position_noise": 0.01,
        "sense.velocity_noise": 0.05,
        "sense.latency": 0.01,
        "rotor.thrust_scatter": 0.02,
    }
    same = {"name", "doc", "overrides"}
    assert plain.model_dump(exclude=same) == noise.model_dump(exclude=same)


def test_the_resolved_text_reads_back_as_the_same_experiment(small: Experiment, tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_text(small.to_yaml())
    assert experiment.load(str(tmp_path / "x.yaml")) == small


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("speed_mps", -1.0, "small.yaml: speed_mps: value -1.0"),
        ("speed_mps", "2.5", "small.yaml: speed_mps: value '2.5'"),
        ("speed_mps", "1e-6", "write the number without them"),
        ("speed_mps", True, "small.yaml: speed_mps: value True"),
        ("speed_mps", float("nan"), "small.yaml: speed_mps: value nan"),
        ("vehicle", ..., "small.yaml: vehicle: is missing"),
        ("colour", "red", "small.yaml: colour: unknown key (value 'red')"),
        ("start", "at_trigger", "small.yaml: start: value 'at_trigger'"),
        ("budget", 18, "budget 18 is not a multiple of n_rollouts 4"),
        ("policy.rrev_c_per_s.mu0", 9.0, "policy.rrev_c_per_s.mu0: value 9.0 is out of range (allowed 0 .. 7 1/s)"),
        ("policy.rrev_c_per_s.bounds", [7.0, 0.0], "bounds"),
        ("policy.rrev_c_per_s.bounds", [7.0], "policy.rrev_c_per_s.bounds"),
        ("learner.name", "sgd", "no learner 'sgd'"),
        ("learner.options", {"k": 3}, "options of RobustEPHE: k: unknown key"),
        ("reward", {"name": "money"}, "no reward 'money'"),
        ("reward", {"options": {"d_floor_m": 0.0}}, "reward.options.d_floor_m: value 0.0"),
        ("check.grid.rrev_c_per_s", {"lo": 2.0, "hi": 1.0, "step": 0.1}, "lo 2.0 must be below hi 1.0"),
        ("overrides", {"sense.latncy": {"value": 0.1, "unit": "s", "source": "x"}}, "did you mean 'sense.latency'"),
        (
            "overrides",
            {"sense.latency": {"value": 1.0, "unit": "s", "source": "x"}},
            "out of range (allowed 0 .. 0.1 s)",
        ),
        ("overrides", {"sense.latency": {"value": 0.01, "unit": "ms", "source": "x"}}, "has unit 'ms', not 's'"),
        ("overrides", {"sense.latency": 0.01}, "overrides.sense.latency"),
        ("seed", -1, "small.yaml: seed: value -1"),
        ("name", "a/b", "small.yaml: name: value 'a/b'"),
        ("name", "..", "small.yaml: name: value '..'"),
        ("name", ".hidden", "small.yaml: name: value '.hidden'"),
        ("name", "-x", "small.yaml: name: value '-x'"),
        ("name", "x" * 65, "small.yaml: name: value 'xxx"),
    ],
)
def test_a_faulty_experiment_is_refused_in_one_line(small_data: Data, path: str, value: Any, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        experiment.from_data(changed(small_data, path, value), "small.yaml")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("setting", "read"),
    [
        ("speed_mps=3.0", lambda e: e.speed_mps == 3.0),
        ("learner.options.shrink_min=0.8", lambda e: e.learner.options == {"shrink_min": 0.8}),
        ("policy.rrev_c_per_s.bounds=[1.0, 8.0]", lambda e: e.policy.rrev_c_per_s.bounds == [1.0, 8.0]),
        ("sense.latency=0.02", lambda e: e.overrides["sense.latency"].value == 0.02),
        ("sense.latency=0.02", lambda e: e.overrides["sense.latency"].unit == "s"),
        ("gear_set=table1", lambda e: e.gear_set == "table1"),
        ("reward.name=authors_code", lambda e: e.reward == RewardChoice(name="authors_code")),
    ],
)
def test_a_setting_changes_one_field(small_file: Path, setting: str, read: Callable[[Experiment], bool]) -> None:
    assert read(experiment.load(str(small_file), [setting]))


def test_a_reward_s_options_stay_as_long_as_its_name_does(small_file: Path) -> None:
    settings = ["reward.options.d_floor_m=0.06", "reward.name=paper"]
    assert experiment.load(str(small_file), settings).reward == RewardChoice(options={"d_floor_m": 0.06})


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("speed_mps", "expected name=value"),
        ("=3", "expected name=value"),
        ("speed_mps='1e-6'", "write the number without them"),
        ("angle_deg=060", "value '060' is ambiguous"),
        ("sense.latency=1", "override: sense.latency: value 1.0 is out of range (allowed 0 .. 0.1 s)"),
        ("sense.latncy=0.01", "sense.latncy: unknown parameter, did you mean 'sense.latency'?"),
        ("speed_mps.x=1", "speed_mps is a value"),
        ("speed_mps=[", "--set speed_mps=["),
    ],
)
def test_a_faulty_setting_is_refused(small_file: Path, setting: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        experiment.load(str(small_file), [setting])
    assert message in str(caught.value)


def test_replacing_the_learner_drops_the_options_of_the_old_one(small_file: Path) -> None:
    chosen = experiment.load(str(small_file), ["speed_mps=2.0"], learner="cmaes", seed=7)
    assert (chosen.learner.name, chosen.learner.options, chosen.seed, chosen.speed_mps) == ("cmaes", {}, 7, 2.0)


def test_a_missing_file_is_answered_with_what_ships() -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml: no such file.*experiments/paper_vertical\.yaml"):
        experiment.load("none.yaml")


def test_a_file_that_is_no_mapping_is_refused(tmp_path: Path) -> None:
    (tmp_path / "list.yaml").write_text("- 1\n")
    with pytest.raises(ConfigError, match="expected a mapping of fields, got list"):
        experiment.load(str(tmp_path / "list.yaml"), ["speed_mps=1.0"])


def test_a_world_of_an_experiment_has_its_overrides(small_file: Path) -> None:
    world = experiment.load(str(small_file), ["sense.latency=0.02"]).make_world()
    assert world.params.values["sense.latency"] == 0.02
