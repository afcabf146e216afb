"""Trials that fly vehicles of their own, and what is said of them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ivl import assess, cli, experiment, family, landing, margin, run
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.outcome import four_leg
from ivl.source import Plan, TrialSource, WorldSource

COARSE = [
    "check.grid.rrev_c_per_s.step=0.5", "check.grid.moment_y_Nmm.step=3.0", "check.effort=0.02", "check.n_fresh=20",
    "start=imparted", "n_rollouts=2", "budget=8",
]  # fmt: skip


def each(learner: str = "ephe_robust", *more: str) -> Experiment:
    return experiment.load("experiments/transfer.yaml", [*COARSE, *more], learner=learner)


def test_trial_k_flies_member_k_and_the_files_stay_as_they_are() -> None:
    chosen = each("ephe_robust", "family.seed=5")
    nominal = chosen.nominal_world_of(chosen.gear)
    expected = family.members(nominal, 4, 5, chosen.family)
    digests = [world.params.digest() for world in chosen.trial_worlds(4)]
    assert digests == [world.params.digest() for world in expected]
    assert digests == [chosen.trial(k).make_world().params.digest() for k in range(4)]
    assert len({*digests, nominal.params.digest()}) == 5
    assert chosen.make_world().params.digest() == digests[0]
    assert [chosen.trial(k).family.member for k in (0, 3)] == [0, 3]
    assert "member: each" in chosen.to_yaml()


def test_without_each_all_trials_fly_the_same_vehicle() -> None:
    chosen = experiment.load("experiments/transfer.yaml", ["family.member=2"])
    assert [chosen.trial(k).family.member for k in (0, 3)] == [2, 2]
    assert len(chosen.trial_worlds(7)) == 1


@pytest.mark.parametrize("member", ["all", "-1", "10000", "1.5", "true", "[1]"])
def test_a_member_is_a_number_or_each(member: str) -> None:
    with pytest.raises(ConfigError, match=r"family\.member: value .*must be null, each or .* \(allowed 0 \.\. 9999\)"):
        experiment.load("experiments/transfer.yaml", [f"family.member={member}"])


def test_there_are_not_more_trials_than_members() -> None:
    with pytest.raises(ConfigError, match=r"family\.member: each: trial 10000 has no member \(allowed 10000 trials\)"):
        each().trial_worlds(10_001)


def test_each_row_of_a_plan_is_flown_by_the_vehicle_of_its_trial() -> None:
    chosen = each()
    worlds = chosen.trial_worlds(3)
    trial = np.array([2, 0, 1, 0, 2])
    theta = np.array([[3.9, 8.0], [4.1, 7.0], [4.0, 9.0], [3.7, 8.5], [4.4, 6.0]])
    seed, stream = np.arange(5, dtype=np.uint64) + 7, np.arange(5, dtype=np.uint64)
    found: dict[int, Any] = {}
    for flown in TrialSource(worlds, chosen, threads=2, record=True).fly(Plan(theta, seed, stream, trial)):
        assert flown.recordings is not None
        for row, outcome, features in zip(flown.index, flown.outcomes, flown.recordings, strict=True):
            found[int(row)] = (outcome.tobytes(), features.tobytes())
    for row in range(5):
        one = Plan(theta[row : row + 1], seed[row : row + 1], stream[row : row + 1])
        flown = next(WorldSource(worlds[trial[row]], chosen, 1, True).fly(one))
        assert flown.recordings is not None
        assert found[row] == (flown.outcomes[0].tobytes(), flown.recordings[0].tobytes())


def test_a_run_over_vehicles_judges_each_by_its_own_best_policy(tmp_path: Path) -> None:
    chosen = each()
    told: list[tuple[int, int]] = []
    hooks = run.Hooks(on_drone=lambda trial, n: told.append((trial, n)))
    result = run.run(chosen, tmp_path / "run", n_trials=3, hooks=hooks)
    summary = result.summary
    assert told == [(0, 3), (1, 3), (2, 3)]
    worlds = chosen.trial_worlds(3)
    bests = [assess.Best.of_dict(data) for data in json.loads((tmp_path / "run" / "best.json").read_text())]
    assert bests == [assess.find_best(world, chosen.trial(k)) for k, world in enumerate(worlds)]
    rollouts = result.rollouts
    failed = [int((~four_leg(rollouts.of_trial(k).outcomes)).sum()) for k in range(3)]
    beyond = [n - 8 * (1 - best.rate_four_leg) for n, best in zip(failed, bests, strict=True)]
    assert summary["failed_landings"]["mean"] == pytest.approx(np.mean(failed))
    assert summary["failed_landings_beyond_best"]["mean"] == pytest.approx(np.mean(beyond))
    assert summary["solved"] == sum(
        v.rate_four_leg >= 0.9 * b.rate_four_leg for v, b in zip(result.verdicts, bests, strict=True)
    )
    assert summary["flights_to_solved"] == summary["rollouts_to_convergence"]
    assert set(summary["failed_landings"]) >= {"mean", "p90"}
    assert summary["model_fits"] is None
    spec = landing.of_rollout(chosen, 2, rollouts.of_trial(2).theta[3].tolist(), 3)
    assert spec.fly()[1].outcome.tobytes() == rollouts.of_trial(2).outcomes[3].tobytes()
    config, n_trials = run.read_config(tmp_path / "run")
    assert (config.family.member, n_trials) == ("each", 3)
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert (
        manifest["parameters"]["body.mass"]["value"] == chosen.nominal_world_of(chosen.gear).params.values["body.mass"]
    )


def test_a_vehicle_is_learned_alike_alone_and_beside_others(tmp_path: Path) -> None:
    together = run.run(each(), tmp_path / "together", n_trials=3)
    alone = run.run(each().trial(2), tmp_path / "alone")
    own = together.rollouts.of_trial(2)
    assert (own.theta == alone.rollouts.theta).all()
    assert own.outcomes.tobytes() == alone.rollouts.outcomes.tobytes()
    assert alone.verdicts[0].solved == together.verdicts[2].solved
    assert alone.verdicts[0].rate_four_leg == together.verdicts[2].rate_four_leg


def test_one_trial_is_a_run_over_one_vehicle(tmp_path: Path) -> None:
    summary = run.run(each(), tmp_path / "run", n_trials=1).summary
    assert (summary["trials"], len(summary["best"])) == (1, 1)
    assert set(summary["flights_to_solved"]) == {"median", "p90"}


def test_a_judgement_that_was_cut_off_goes_on_where_it_was(tmp_path: Path) -> None:
    class Cut(RuntimeError):
        """The run is cut off."""

    def cut(trial: int, _: int) -> None:
        if trial == 2:
            raise Cut

    with pytest.raises(Cut):
        run.run(each(), tmp_path / "run", 3, hooks=run.Hooks(on_drone=cut))
    assert len(json.loads((tmp_path / "run" / "best.json").read_text())) == 2
    told: list[int] = []
    again = run.run(each(), tmp_path / "run", 3, resume=True, hooks=run.Hooks(on_drone=lambda k, _: told.append(k)))
    assert told == [2]
    whole = run.run(each(), tmp_path / "whole", 3)
    assert {**again.summary, "run_dir": ""} == {**whole.summary, "run_dir": ""}


def test_a_link_flies_one_vehicle(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"family\.member: each: pil:// flies one vehicle: name a member"):
        run.run(each(), tmp_path / "run", n_trials=2, uri="pil://")


def test_the_command_prints_one_object_and_tells_people_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["learn", "experiments/transfer.yaml", "--learner", "bo", "--trials", "2"]
    words += [word for setting in COARSE for word in ("--set", setting)]
    assert cli.run([*words, "--out", str(tmp_path / "a"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["learner"], found["trials"], found["model_fits"]) == ("bo", 2, None)
    assert cli.run([*words, "--out", str(tmp_path / "b")]) == 0
    text = capsys.readouterr().out
    assert f"{found['solved']} of 2 vehicles" in text
    assert f"mean {found['failed_landings']['mean']:.1f}, " in text


# ---- margin, and ties


def test_of_equal_policies_the_judge_takes_the_widest(small: Experiment, world: Any) -> None:
    grid = {"rrev_c_per_s": {"lo": 4.5, "hi": 5.4, "step": 0.1}, "moment_y_Nmm": {"lo": 5.0, "hi": 10.0, "step": 0.5}}
    data = small.model_dump(mode="json")
    data["check"] = {**data["check"], "grid": grid, "effort": 0.2}
    chosen = experiment.from_data(data, "small")
    best = assess.find_best(world, chosen)
    assert best.rate_four_leg == 1.0
    assert best.margin_rate is not None
    assert best.largest_margin_rate is not None
    theta = assess._grid(assess._axes(chosen))
    rates = four_leg(world.rollouts(2.5, 90.0, theta[:, :1], theta[:, 1:], stream=np.arange(40), seed=5)).mean(axis=1)
    equal = theta[rates == 1.0]
    margins = assess.margin_rates(world, chosen, equal, 20)
    assert len(equal) > 5
    assert margins[np.flatnonzero((equal == best.theta).all(axis=1))[0]] > np.median(margins)
    assert best.margin_rate <= best.largest_margin_rate + 1e-12
    assert best.largest_margin_rate > margins.max() - 0.1


def test_the_margin_rate_is_the_mean_over_errors_of_timing_and_moment(small: Experiment, world: Any) -> None:
    theta = np.array([[4.8, 8.0], [5.3, 8.0]])
    rng = np.random.default_rng(1)
    late_s, moment = rng.uniform(-0.01, 0.01, 1500), rng.uniform(-0.1, 0.1, 1500)
    for policy, found in zip(theta, assess.margin_rates(world, small, theta, 60), strict=True):
        rrev = 1 / (1 / policy[0] - late_s)
        out = world.rollouts(2.5, 90.0, rrev, np.minimum(policy[1] * (1 + moment), 10.0), seed=9)
        assert found == pytest.approx(four_leg(out).mean(), abs=0.08)


def test_a_recommendation_on_a_bound_is_told_with_what_stepping_back_costs(small: Experiment, world: Any) -> None:
    inside = margin.report(world, small, np.array([4.8, 8.0]))
    assert inside["on_bound"] == []
    assert 0.0 < inside["rate"] <= 1.0
    told = margin.report(world, small, np.array([4.9, 10.0]))
    (entry,) = told["on_bound"]
    assert (entry["parameter"], entry["bound"], entry["is_all_there_is"]) == ("moment_y_Nmm", "upper", False)
    back = entry["stepped_back"]
    assert back["theta"][1] == pytest.approx(9.0)
    assert back["cost"] == pytest.approx(told["rate"] - back["rate"])
    (line,) = margin.sentences(told, small)
    assert line.startswith("M_yd 10.00 N mm is the upper bound of the search; at ")
    assert "the margin rate is" in line


def test_all_the_moment_there_is_is_told_inside_the_bounds_too(small_data: dict[str, Any], world: Any) -> None:
    small_data["policy"]["moment_y_Nmm"]["bounds"] = [0.0, 15.0]
    chosen = experiment.from_data(small_data, "small.yaml")
    largest = world.derived()["pitch_moment_max_Nmm"]
    told = margin.report(world, chosen, np.array([5.0, largest]))["on_bound"]
    assert [(entry["parameter"], entry["is_all_there_is"]) for entry in told] == [("moment_y_Nmm", True)]
    assert margin.report(world, chosen, np.array([5.0, 0.95 * largest]))["on_bound"] == []
    assert "is all the moment there is" in margin.sentences({"on_bound": told}, chosen)[0]


def test_a_lower_bound_is_told_too(small: Experiment, world: Any) -> None:
    entries = margin.report(world, small, np.array([0.0, 0.0]))["on_bound"]
    assert [(entry["parameter"], entry["bound"]) for entry in entries] == [
        ("rrev_c_per_s", "lower"), ("moment_y_Nmm", "lower")
    ]  # fmt: skip
    assert entries[1]["stepped_back"]["theta"][1] == pytest.approx(1.0)
