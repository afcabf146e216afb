from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_sweep import MAP, SMALL, make, write

from ivl.errors import ConfigError
from ivl.sweep import config, plan


def test_the_paper_s_campaign_has_the_paper_s_size() -> None:
    paper = config.load_sweep("sweeps/paper.yaml")
    tasks = plan.plan(paper, 32)
    assert sum(len(task.trials) for task in tasks) == 16 * 15 * 6 * 5
    assert 7200 * paper.budget == 1_152_000
    assert paper.approaches()[0] == (0.25, 20.0)
    assert paper.approaches()[-1] == (4.0, 90.0)


@pytest.mark.parametrize("path", [p for p in config.list_sweeps() if "map" not in p])
def test_shipped_sweeps_load_and_come_back_from_their_own_text(path: str, tmp_path: Path) -> None:
    sweep = config.load_sweep(path)
    (tmp_path / "again.yaml").write_text(sweep.to_yaml())
    assert config.load_sweep(str(tmp_path / "again.yaml")) == sweep


def test_the_shipped_map_loads() -> None:
    assert config.load_map("sweeps/map.yaml").n_rollouts > 0


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"speeds_mps": [2.5, 2.5]}, "speeds_mps: a value is given twice"),
        ({"speeds_mps": [2.5, 60.0]}, r"speeds_mps: 60\.0 is out of range \(0\.1 \.\. 6 m/s\)"),
        ({"angles_deg": {"first": 0.0, "last": 220.0, "count": 3}}, r"angles_deg: 220\.0 is out of range"),
        ({"budget": 31}, "budget 31 is not a multiple of n_rollouts 6"),
        ({"learner": {"name": "nobody"}}, "no learner 'nobody'"),
        ({"mu0_range": {"rrev_c_per_s": [1.0, 8.0], "moment_y_Nmm": [3.0, 8.0]}}, "must lie in order inside"),
        ({"colour": "red"}, "colour: unknown key"),
        ({"overrides": {"sense.latency": {"value": 0.01, "unit": "ms", "source": "test"}}}, "has unit 'ms', not 's'"),
    ],
)
def test_what_is_wrong_is_named(changes: dict[str, Any], complaint: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=complaint):
        make(tmp_path, **changes)


def test_a_map_s_axes_are_checked_too(tmp_path: Path) -> None:
    path = write(tmp_path / "map.yaml", {**MAP, "d_ceil_m": [0.3, 20.0]})
    with pytest.raises(ConfigError, match=r"d_ceil_m: 20\.0 is out of range"):
        config.load_map(str(path))


def test_settings_reach_fields_and_world_parameters(tmp_path: Path) -> None:
    path = write(tmp_path / "sweep.yaml", SMALL)
    sweep = config.load_sweep(str(path), ["trials=3", "sense.latency=0.02"], learner="bo")
    assert (sweep.trials, sweep.learner.name) == (3, "bo")
    assert sweep.make_world("wide_long").params.values["sense.latency"] == 0.02


def test_every_part_of_a_trial_s_name_changes_its_seed_and_nothing_else_does(tmp_path: Path) -> None:
    sweep = make(tmp_path)
    names = [
        (g, v, a, k) for g in ("wide_long", "narrow_short") for v in (2.5, 3.5) for a in (60.0, 90.0) for k in (0, 1)
    ]
    seeds = {sweep.run_seed(*name) for name in names}
    seeds |= {make(tmp_path, seed=1).run_seed(*name) for name in names}
    seeds |= {make(tmp_path, gear_set="table1").run_seed(*name) for name in names}
    seeds |= {make(tmp_path, vehicle="crazyflie21").run_seed(*name) for name in names}
    assert len(seeds) == 4 * len(names)
    other = make(tmp_path, trials=7, speeds_mps=[3.5], learner={"name": "bo"}, budget=60)
    assert other.run_seed("wide_long", 3.5, 60.0, 1) == sweep.run_seed("wide_long", 3.5, 60.0, 1)


def test_seeds_stay_what_they_are_from_version_to_version(tmp_path: Path) -> None:
    assert make(tmp_path).run_seed("wide_long", 2.5, 60.0, 0) == 8_114_317_638_956_716_484


def test_a_drawn_start_differs_between_trials_and_lies_in_its_range(tmp_path: Path) -> None:
    sweep = make(tmp_path, mu0_range={"rrev_c_per_s": [1.0, 5.0], "moment_y_Nmm": [3.0, 8.0]})
    starts = [sweep.experiment("wide_long", 2.5, 60.0, k).policy for k in range(50)]
    rrev = [p.rrev_c_per_s.mu0 for p in starts]
    moment = [p.moment_y_Nmm.mu0 for p in starts]
    assert len(set(rrev)) == 50
    assert 1.0 <= min(rrev) < 1.5 < 4.5 < max(rrev) <= 5.0
    assert 3.0 <= min(moment) < 4.0 < 7.0 < max(moment) <= 8.0


@pytest.mark.parametrize("size", [1, 3, 5, 100])
def test_a_plan_has_every_trial_once_whatever_the_size_of_its_tasks(size: int, tmp_path: Path) -> None:
    tasks = plan.plan(make(tmp_path), size)
    trials = [(task.gear, trial) for task in tasks for trial in task.trials]
    assert len(trials) == len(set(trials)) == 2 * 4 * 2
    assert max(len(task.trials) for task in tasks) <= size
    assert [task.number for task in tasks] == list(range(len(tasks)))


def test_tasks_are_small_enough_to_share_and_large_enough_to_pay() -> None:
    paper = config.load_sweep("sweeps/paper.yaml")
    assert plan.good_size(paper, 2) == plan.SIZE_MAX
    assert plan.good_size(paper, 100) == 10
    assert plan.good_size(paper, 10_000) == 27  # sqrt(7200 / 10): too few trials to keep so many busy
    large = paper.model_copy(update={"trials": 50_000})
    assert plan.good_size(large, 2) == plan.SIZE_MAX
    assert plan.good_size(large, 10_000) == 1000  # tasks end no faster than the client takes them back


def test_a_start_that_is_drawn_is_not_varied(tmp_path: Path) -> None:
    drawn = {"rrev_c_per_s": [1.0, 5.0], "moment_y_Nmm": [3.0, 8.0]}
    with pytest.raises(ConfigError, match="mu0_range draws the start of every trial"):
        make(tmp_path, mu0_range=drawn, vary={"policy.rrev_c_per_s.mu0": [3.0, 5.0]})


@pytest.mark.parametrize("kind", [int, np.float64, np.float32, np.float16, np.int64, np.uint8, np.longdouble])
def test_a_seed_follows_from_numbers_whatever_type_they_have(tmp_path: Path, kind: Any) -> None:
    sweep, chart = make(tmp_path), config.load_map(str(write(tmp_path / "map.yaml", MAP)))
    assert sweep.key("wide_long", kind(2), kind(60)) == "habas2021|as_simulated|wide_long|2.0|60.0"
    assert sweep.run_seed("wide_long", kind(2), kind(60), 1) == sweep.run_seed("wide_long", 2.0, 60.0, 1)
    assert chart.cell_seed("wide_long", kind(2), kind(60)) == chart.cell_seed("wide_long", 2.0, 60.0)


def test_seeds_of_fractions_are_those_of_the_same_number(tmp_path: Path) -> None:
    sweep = make(tmp_path)
    plain = sweep.run_seed("wide_long", 2.5, 60.0, 0)
    assert {sweep.run_seed("wide_long", kind(2.5), 60.0, 0) for kind in (np.float64, np.float32, np.float16)} == {plain}
    assert sweep.run_seed("wide_long", np.float64(2.6), 60.0, 0) == sweep.run_seed("wide_long", 2.6, 60.0, 0)
