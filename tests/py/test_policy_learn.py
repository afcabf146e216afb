"""Learning a policy for every approach, its file, its use and its judgement."""

import copy
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import policies
import pytest
import yaml
from policies import TASK

from ivl import cli, experiment, forms, native
from ivl.analysis.intervals import share_of_clusters, wilson
from ivl.errors import ConfigError
from ivl.outcome import clean, four_leg
from ivl.policy import assess as judging
from ivl.policy import file, general, use
from ivl.policy.file import PolicyFile
from ivl.policy.flying import Drawn, Place, PolicyTask, fly
from ivl.policy.learn import Progress, learn
from ivl.policy.region import PLANE, Region, Series
from ivl.policy.shape import GO, General
from ivl.seeds import Purpose
from ivl.sweep import config as sweep_config
from ivl.task import settings_of

ROOT = Path(__file__).parents[2]

STEEP = Region(speeds_mps=[2.3, 2.7], angles_deg=[75.0, 90.0])
Capture = pytest.CaptureFixture[str]


def tiny(**changes: Any) -> dict[str, Any]:
    """Raw data of an experiment that is learned within seconds: nearly vertical approaches."""
    task = {"vehicle": "habas2021", "gear": "wide_short", "gear_set": "as_simulated"}
    return {
        "name": "tiny",
        "doc": "Steep approaches.",
        "form": "polynomial2",
        "tasks": [{**task, "estimator": "known_height_predicted"}],
        "regions": [{"speeds_mps": [2.3, 2.7], "angles_deg": [75.0, 90.0]}],
        "map": {"n_speeds": 2, "n_angles": 2, "n_thresholds": 30, "moments_norm": [0.8], "tau_s": [0.1, 0.4]},
        "learner": {"name": "cmaes"},
        "search": {"n_candidates": 4, "n_approaches": 8, "n_iterations": 3, "n_select": 60},
        "go": {
            "region": {"speeds_mps": [0.5, 3.0], "angles_deg": [60.0, 90.0]}, "n_approaches": 200, "n_held_out": 100,
        },
        **changes,
    }  # fmt: skip


def tiny_experiment(**changes: Any) -> general.GeneralExperiment:
    return general.from_data(tiny(**changes), "tiny.yaml")


@pytest.fixture(scope="session")
def learned() -> PolicyFile:
    return learn(tiny_experiment())


@pytest.fixture
def by_hand() -> PolicyFile:
    return policies.by_hand()


@pytest.fixture
def path(by_hand: PolicyFile, tmp_path: Path) -> Path:
    file.save(by_hand, tmp_path / "g.yaml")
    return tmp_path / "g.yaml"


# ---- learning


def test_steep_approaches_are_learned_to_land_by_a_threshold_that_is_known(learned: PolicyFile) -> None:
    """The paper's own policy for 2.5 m/s straight up is 4.8 1/s; what is learned must land on fresh approaches."""
    shape = General("polynomial2")
    (threshold,) = shape.thresholds(learned.values, [0.0], [2.5])
    assert 4.2 < threshold < 5.8
    approaches = Series([STEEP], 99, Purpose.ASSESS).next(200)
    (outcomes,) = fly([Place.of(learned.tasks[0])], "polynomial2", shape.always_go(learned.values), approaches)
    assert four_leg(outcomes).mean() > 0.9
    assert clean(outcomes).mean() > 0.85


def test_it_says_how_it_was_learned(learned: PolicyFile) -> None:
    training, score = learned.training, learned.score
    assert training is not None
    assert score is not None
    assert training.learner.name == "cmaes"
    assert training.approaches == 3 * 8
    # map, three starts, search, choice among the start and three ends, go / no-go twice, and its effect
    assert training.rollouts == 30 * 4 + 3 * 8 + 3 * 4 * 8 + 4 * 60 + 2 * 300 + 60
    assert training.objective == pytest.approx(0.5 * (score.landed + score.clean))
    assert training.start_objective is not None
    assert training.objective >= training.start_objective
    assert any(learned.theta[name].value != 0.0 for name in GO)


def test_equal_seeds_give_equal_files_and_others_do_not(learned: PolicyFile) -> None:
    assert learn(tiny_experiment(), threads=1) == learned
    assert learn(tiny_experiment(seed=1)).values != learned.values


@pytest.mark.parametrize("learner", ["ephe", "ephe_robust", "ephe_memory", "bo"])
def test_any_learner_searches(learner: str, learned: PolicyFile) -> None:
    found = learn(tiny_experiment(learner={"name": learner}))
    assert found.training is not None
    assert learned.training is not None
    assert found.training.learner.name == learner
    assert found.training.start_objective == learned.training.start_objective


def test_the_search_moves_a_start_that_misses_to_where_it_lands(by_hand: PolicyFile) -> None:
    off = list(by_hand.values)
    off[0] -= 0.9  # 35 ms too early
    begin = file.make(by_hand.shape, off, [TASK], None, None)
    search = {"n_candidates": 8, "n_approaches": 24, "n_iterations": 12, "n_select": 100, "spread_per_s": 1.5}
    found = learn(tiny_experiment(search=search), start=begin)
    assert found.training is not None
    assert found.training.start_objective is not None
    assert found.training.objective is not None
    assert found.training.objective > found.training.start_objective + 0.2


def test_two_tasks_count_both() -> None:
    tasks = [tiny()["tasks"][0], {**tiny()["tasks"][0], "gear": "narrow_short"}]
    both = learn(tiny_experiment(tasks=tasks))
    assert [task.gear for task in both.tasks] == ["wide_short", "narrow_short"]
    assert both.score is not None
    assert both.score.flights == 2 * 60


def test_a_family_takes_the_place_of_each_task_s_vehicle() -> None:
    task = {"vehicle": "crazyflie21", "gear": "wide_long", "gear_set": "table1", "estimator": "known_height_predicted"}
    drawn = {"n_vehicles": 3, "seed": 1}
    regions = [{"speeds_mps": [3.0, 3.5], "angles_deg": [75.0, 90.0]}]
    found = learn(tiny_experiment(tasks=[task], drawn=drawn, regions=regions))
    assert found.training is not None
    assert found.score is not None
    assert found.training.family == Drawn(n_vehicles=3, seed=1)
    assert found.score.flights == 3 * 60
    members = Place.of(found.tasks[0]).members(Drawn(n_vehicles=3, seed=1), Purpose.FAMILY)
    # each vehicle has approaches of its own, which are many together
    approaches = Series([Region.model_validate(regions[0])], 0, Purpose.SELECT).for_each(3, 60)
    assert len(set(np.concatenate([batch.stream for batch in approaches]))) == 3 * 60
    assert found.training.approaches == 3 * 3 * 8
    flown = fly(members, "polynomial2", General("polynomial2").always_go(found.values), approaches)
    assert found.score.landed == pytest.approx(np.mean([four_leg(o).mean() for o in flown]))
    assert found.sealed() == found


def test_vehicles_do_not_share_their_approaches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few approaches of each of many vehicles would else be few approaches."""
    task = {**tiny()["tasks"][0], "vehicle": "crazyflie21", "gear": "wide_long", "gear_set": "table1"}
    met: dict[tuple[int, int], int] = {}
    flown: list[int] = []

    def spy(places: list[Place], form: str, theta: Any, approaches: Any, threads: Any = None) -> Any:
        flown.append(len(places))
        for place, batch in zip(places, approaches, strict=True):
            for stream in batch.stream:
                assert met.setdefault((batch.seed, int(stream)), id(place)) == id(place)
        return fly(places, form, theta, approaches, threads)

    for module in ("search", "learn", "go"):
        monkeypatch.setattr(f"ivl.policy.{module}.fly", spy)
    regions = [{"speeds_mps": [3.0, 3.5], "angles_deg": [75.0, 90.0]}]
    learn(tiny_experiment(tasks=[task], drawn={"n_vehicles": 3}, regions=regions))
    assert set(flown) == {3}
    assert len(met) > 3 * (3 * 8 + 60 + 200 + 100)


def test_a_family_of_a_vehicle_without_sigmas_is_said() -> None:
    with pytest.raises(ConfigError, match="family: vehicle habas2021, gear as_simulated/wide_short: no parameter has"):
        learn(tiny_experiment(drawn={"n_vehicles": 2}))
    with pytest.raises(ConfigError, match=r"drawn\.n_vehicles: value 0"):
        tiny_experiment(drawn={"n_vehicles": 0})


def test_an_interruption_keeps_the_best_so_far() -> None:
    def interrupt(at: Progress) -> None:
        if at.stage == "search" and at.done > 0.5:
            raise KeyboardInterrupt

    found = learn(tiny_experiment(), interrupt)
    assert found.training is not None
    assert found.training.interrupted
    assert found.training.objective is None
    assert found.theta["go_p_min"].value == 0.0


def test_an_interruption_before_there_is_anything_gives_nothing() -> None:
    def interrupt(_: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        learn(tiny_experiment(), interrupt)


def test_a_region_without_any_landing_is_said() -> None:
    hopeless = [{"speeds_mps": [0.25, 0.3], "angles_deg": [20.0, 25.0]}]
    with pytest.raises(ConfigError, match="no approach of these regions ends in a landing"):
        learn(tiny_experiment(regions=hopeless))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"form": "constant"}, "form constant: is not for every approach"),
        ({"form": "no"}, "policy form 'no' is unknown"),
        ({"regions": ["boxx"]}, r"regions\.0: .*unknown region \(allowed box, plane"),
        ({"regions": [{"speeds_mps": [3.0, 2.0], "angles_deg": [20.0, 90.0]}]}, "speeds_mps: 3.0 must be below 2.0"),
        ({"regions": [{"speeds_mps": [2.0, 30.0], "angles_deg": [20.0, 90.0]}]}, "30.0 is out of range"),
        ({"learner": {"name": "nobody"}}, "no learner 'nobody'"),
        ({"learner": {"name": "ephe", "options": {"n_bst": 2}}}, "n_bst"),
        ({"tasks": []}, "tasks"),
        ({"map": {"moments_norm": [0.0]}}, "moments_norm"),
        ({"serach": {}}, "serach: unknown key .*did you mean 'search'"),
    ],
)
def test_a_wrong_experiment_is_refused_in_one_line(change: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=rf"^tiny\.yaml: .*{told}") as error:
        tiny_experiment(**change)
    assert "\n" not in str(error.value)


def test_settings_reach_every_task_and_further_files_add_theirs(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(tiny(name=name)))
    paths = [str(tmp_path / "a.yaml"), str(tmp_path / "b.yaml")]
    loaded = general.load(paths, ["gear=wide_long", "sense.latency=0.02", "search.n_select=5"], seed=4)
    assert [task.gear for task in loaded.tasks] == ["wide_long", "wide_long"]
    assert [task.overrides["sense.latency"].value for task in loaded.tasks] == [0.02, 0.02]
    assert (loaded.search.n_select, loaded.seed, loaded.name) == (5, 4, "a")
    assert general.load(["experiments/general.yaml"]).form == "polynomial3"
    with pytest.raises(ConfigError, match="learn it with ivl policy learn"):
        experiment.load("experiments/general.yaml")
    with pytest.raises(ConfigError, match="for ivl learn"):
        general.load(["experiments/paper_vertical.yaml"])


# ---- the file


def test_a_file_reads_back_as_it_was(learned: PolicyFile, by_hand: PolicyFile, tmp_path: Path) -> None:
    for policy in (learned, by_hand):
        file.save(policy, tmp_path / "p.yaml")
        again = file.load(tmp_path / "p.yaml")
        assert again == policy
        assert again.values == policy.values
        assert again.checksum == policy.checksum
        assert [entry.name for entry in tmp_path.iterdir()] == ["p.yaml"]


def test_own_files_of_a_task_go_with_the_policy(by_hand: PolicyFile, tmp_path: Path) -> None:
    """No path of the machine that wrote it: the folder is moved, the originals are gone."""
    own, there, elsewhere = tmp_path / "my own", tmp_path / "there", tmp_path / "else where"
    own.mkdir()
    there.mkdir()
    task = by_hand.tasks[0]
    vehicle, gears = own / "my vehicle.yaml", own / "gears.yml"
    shutil.copy(ROOT / "host" / "ivl" / "vehicles" / f"{task.vehicle}.yaml", vehicle)
    shutil.copy(ROOT / "host" / "ivl" / "gears" / f"{task.gear_set}.yaml", gears)
    changed = task.model_copy(update={"vehicle": str(vehicle), "gear_set": str(gears)})
    policy = by_hand.model_copy(update={"tasks": [changed, task]}).sealed()
    file.save(policy, there / "p.yaml")
    assert str(tmp_path) not in (there / "p.yaml").read_text()
    shutil.rmtree(own)
    there.rename(elsewhere)
    again = file.load(elsewhere / "p.yaml")
    assert again.tasks[1] == task
    assert again.tasks[0].vehicle.startswith(f"{elsewhere}/files/my vehicle-")
    flown = [Place.of(t).world.rollouts(2.5, 80.0, *again.values, form=again.form) for t in (again.tasks[0], task)]
    assert flown[0].tobytes() == flown[1].tobytes()
    # written again elsewhere it is the same file
    there.mkdir()
    file.save(again, there / "p.yaml")
    assert (there / "p.yaml").read_bytes() == (elsewhere / "p.yaml").read_bytes()
    # a copy that is gone is said in one line
    shutil.rmtree(elsewhere / "files")
    with pytest.raises(ConfigError, match="my vehicle-"):
        Place.of(file.load(elsewhere / "p.yaml").tasks[0])


def test_a_file_of_numbers_alone_is_enough(by_hand: PolicyFile, tmp_path: Path) -> None:
    data = by_hand.model_dump(mode="json")
    short = {name: data[name] for name in ("ivl_policy", "form", "theta", "tasks")}
    (tmp_path / "p.yaml").write_text(yaml.safe_dump({**short, "digest": "none"}))
    assert file.load(tmp_path / "p.yaml").values == by_hand.values
    (tmp_path / "p.yaml").write_text(yaml.safe_dump(short))
    with pytest.raises(ConfigError, match=r"^p\.yaml: digest: is missing \(digest: none accepts a policy that was"):
        file.load(tmp_path / "p.yaml")


@pytest.mark.parametrize("name", ["digest", "form_table", "crc", "made_by"])
def test_a_file_says_what_it_was_made_for_and_what_has_changed(name: str, path: Path) -> None:
    """Each mark is looked at by itself: the digest of a file whose marks are wrong may be right."""
    data = yaml.safe_load(path.read_text())
    assert data["made_by"] == native.library().digest()
    assert data["crc"] == f"{file.load(path).checksum:08x}"
    data[name] = data[name][:-1] + ("0" if data[name][-1] != "0" else "1")
    if name != "digest":
        data["digest"] = file._digest(data)
    path.write_text(yaml.safe_dump(data))
    if name == "made_by":  # of another version of the simulator: told, not refused
        assert file.load(path).made_by == data["made_by"]
        return
    with pytest.raises(ConfigError, match=rf"^g\.yaml: {name}: value '.*\(digest: none accepts") as error:
        file.load(path)
    assert "\n" not in str(error.value)


def test_a_changed_number_is_flown_if_the_file_says_so(path: Path, capsys: Capture) -> None:
    data = yaml.safe_load(path.read_text())
    data["theta"]["r_0_per_s"]["value"] = 5.5
    data["digest"] = "none"
    path.write_text(yaml.safe_dump(data))
    assert file.load(path).values[0] == 5.5
    assert "none: written or changed by hand" in run(["policy", "show", str(path)], capsys)


def test_a_digest_is_that_of_the_file_whatever_the_defaults_are(path: Path) -> None:
    """The default of another version must not take the place of what a file said, nor of what it did not say."""
    data = yaml.safe_load(path.read_text())
    for name, default in (("approach", PolicyTask.model_fields["approach"].default), ("start", "flown")):
        without = copy.deepcopy(data)
        assert without["tasks"][0].pop(name) == default
        path.write_text(yaml.safe_dump(without))
        with pytest.raises(ConfigError, match=r"digest: .*changed after it was written"):
            file.load(path)
        # as an earlier version would have written it, that knew no such field
        path.write_text(yaml.safe_dump({**without, "digest": file._digest(without)}))
        assert file.load(path).tasks[0].gear == "wide_short"


@pytest.mark.parametrize(
    ("where", "value", "told"),
    [
        (("theta", "r_0_per_s", "value"), 5.5, "digest: .*changed after it was written"),
        (("theta", "r_0_per_s", "value"), 99.0, r"r_0_per_s: value 99.0 is out of range \(allowed -40 .. 40 1/s\)"),
        (("theta", "r_0_per_s", "value"), "many", r"theta\.r_0_per_s\.value: value 'many'"),
        (("theta", "r_0_per_s", "unit"), "Hz", r"theta\.r_0_per_s: unit 'Hz' \(the form polynomial2 has '1/s'\)"),
        (("theta", "r_0_per_s"), None, r"theta\.r_0_per_s"),
        (("theta", "r_zero"), {"value": 1.0, "unit": "1/s"}, r"theta\.r_zero: unknown key"),
        (("form",), "polynomial9", "policy form 'polynomial9' is unknown"),
        (("form",), "bilinear", r"theta\.r_00_per_s: is missing"),
        (("ivl_policy",), 2, "ivl_policy: value 2"),
        (("tasks",), [], "tasks"),
        (("tasks", 0, "gear"), 3, r"tasks\.0\.gear"),
        (("digest",), "0" * 64, "digest"),
    ],
)
def test_a_damaged_file_is_refused_with_the_field(path: Path, where: tuple[Any, ...], value: Any, told: str) -> None:
    data = yaml.safe_load(path.read_text())
    place = data
    for key in where[:-1]:
        place = place[key]
    place[where[-1]] = value
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(ConfigError, match=rf"^g\.yaml: .*{told}") as error:
        file.load(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "- 1", "form: [", "ivl_policy: 1"])
def test_what_is_no_policy_is_refused(text: str, path: Path) -> None:
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"^g\.yaml: "):
        file.load(path)


def test_a_missing_file_and_a_folder_that_is_not_there_are_said(by_hand: PolicyFile, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no\.yaml: cannot be read"):
        file.load(tmp_path / "no.yaml")
    with pytest.raises(ConfigError, match="cannot be written"):
        file.save(by_hand, tmp_path / "no" / "p.yaml")


# ---- judging


def test_an_assessment_is_what_a_direct_count_says(by_hand: PolicyFile) -> None:
    found = judging.assess(by_hand, n_approaches=300, seed=5)
    shape, place = General("polynomial2"), Place.of(TASK)
    approaches = Series([PLANE], 5, Purpose.ASSESS).next(300)
    counted = []
    for theta in (shape.always_go(by_hand.values), np.array(by_hand.values)):
        counted.append(
            place.world.rollouts(
                approaches.speed_mps, approaches.angle_deg, *theta, form="polynomial2",
                seed=approaches.seed, stream=np.arange(300), start="flown",
            )
        )  # fmt: skip
    free, own = counted
    landed, refused = free.n_legs >= 3, own.no_go == 1
    assert found.plane.landed.value == landed.mean()
    assert found.plane.clean.value == (landed & (free.body_contact == 0)).mean()
    assert found.plane.landed.low < landed.mean() < found.plane.landed.high
    assert found.go is not None
    strike = ~landed & ((free.body_contact == 1) | (free.base_contact == 1))
    assert 10 < refused.sum() < 290
    assert found.go.strikes_avoided.value == (refused & strike).sum() / strike.sum()
    assert found.go.refused_good.value == (refused & landed).sum() / 300
    assert found.go.no_go.value == refused.mean()
    assert found.go.level_out_contacts + found.go.contacts_before == (refused & np.isfinite(own.t_impact_s)).sum()
    told = free.p_land > 0
    pairs = free.p_land[told & landed][:, None] - free.p_land[told & ~landed][None, :]
    assert found.go.auc == pytest.approx(((pairs > 0) + 0.5 * (pairs == 0)).mean())
    assert found.box.landed.value > 0.9
    # the flips of the two are the same, as far as both flip
    both = (own.triggered == 1) & (free.triggered == 1)
    assert (own.n_legs[both] == free.n_legs[both]).all()


def test_an_assessment_is_repeatable_and_of_fresh_approaches(by_hand: PolicyFile) -> None:
    first, again, other = (judging.assess(by_hand, n_approaches=60, seed=seed).as_dict() for seed in (1, 1, 2))
    assert first == again != other
    text = json.dumps(first, allow_nan=False)
    assert set(json.loads(text)) == {"box", "plane", "shaped", "go", "vehicles"}
    assert {"landed", "clean"} <= set(first["box"])
    assert {"auc", "calibration_error", "strikes_avoided", "refused_good", "level_out_contacts"} <= set(first["go"])


def test_an_assessment_of_a_family_counts_its_vehicles(by_hand: PolicyFile) -> None:
    task = TASK.model_copy(update={"vehicle": "crazyflie21", "gear": "wide_long", "gear_set": "table1"})
    drawn = Drawn(n_vehicles=11, seed=5)
    found = judging.assess(by_hand, [task], 40, 5, family=drawn)
    members = Place.of(task).members(drawn, Purpose.FAMILY_ASSESS)
    learned_on = Place.of(task).members(drawn, Purpose.FAMILY)
    assert not {m.world.params.digest() for m in members} & {m.world.params.digest() for m in learned_on}
    flown = fly(
        members, "polynomial2", General("polynomial2").always_go(by_hand.values),
        Series([PLANE], 5, Purpose.ASSESS).next(40),
    )  # fmt: skip
    shares = np.array([four_leg(o).mean() for o in flown])
    assert found.plane.landed.value == pytest.approx(shares.mean())
    assert found.plane.worst_tenth == pytest.approx(np.sort(shares)[:2].mean())
    assert found.plane.n_flights == 11 * 40
    landed = np.stack([four_leg(outcomes) for outcomes in flown])
    vehicle, approach = np.indices(landed.shape)
    assert found.plane.landed == share_of_clusters(landed, np.ones(landed.shape), vehicle, approach)
    # flights of one vehicle are alike: all at once they would seem to tell more
    assert found.plane.landed.high - found.plane.landed.low > np.ptp(wilson(landed.mean(), landed.size))
    assert str(found.vehicles) == "11 drawn ones (seed 5); the policy was learned over those of the files"
    assert found.as_dict()["plane"]["landed_worst_tenth"] == found.plane.worst_tenth
    assert "landed_worst_tenth" not in judging.assess(by_hand, n_approaches=20).as_dict()["plane"]


def test_several_tasks_tell_no_more_than_their_approaches(by_hand: PolicyFile) -> None:
    """The same task twice is the same flights twice."""
    once, twice = (judging.assess(by_hand, [TASK] * n, n_approaches=150, seed=4) for n in (1, 2))
    assert twice.plane.n_flights == 2 * once.plane.n_flights
    for name in ("landed", "clean"):
        one, two = getattr(once.plane, name), getattr(twice.plane, name)
        assert two.value == one.value
        assert (two.low, two.high) == pytest.approx((one.low, one.high), abs=0.003)
    assert once.go is not None
    assert twice.go is not None
    for name in ("strikes_avoided", "refused_good", "no_go", "landed_of_flown"):
        one, two = getattr(once.go, name), getattr(twice.go, name)
        assert (two.low, two.high) == pytest.approx((one.low, one.high), abs=0.01)


def test_a_contact_before_the_refusal_is_none_of_the_level_out(by_hand: PolicyFile) -> None:
    """A ranger of 10 Hz sees the ceiling late: some approaches touch it before anything is decided, some afterwards."""
    late = TASK.model_copy(update={"sensing": "ranger10", "estimator": None})
    found = judging.assess(by_hand, [late], n_approaches=400, seed=3).go
    assert found is not None
    world, approaches = Place.of(late).world, Series([PLANE], 3, Purpose.ASSESS).next(400)
    counts = {"approach": 0, "level_out": 0}
    for i in range(400):
        flight = world.trace(
            approaches.speed_mps[i], approaches.angle_deg[i], *by_hand.values, form="polynomial2",
            seed=approaches.seed, stream=int(approaches.stream[i]), start="flown",
        )  # fmt: skip
        if flight.outcome.no_go and np.isfinite(flight.outcome.t_impact_s):
            rows = flight.rows[flight.rows.t_s < flight.outcome.t_impact_s]
            counts[world.phase_name(rows.phase[-1])] += 1
    assert (found.contacts_before, found.level_out_contacts) == (counts["approach"], counts["level_out"])
    assert counts["approach"] > 0


def test_a_shaped_approach_has_room_also_where_the_task_asks_for_less(by_hand: PolicyFile) -> None:
    near, far = (
        by_hand.model_copy(update={"tasks": [TASK.model_copy(update={"overrides": settings_of(room, "test")})]})
        for room in ({"start.room": 0.5}, {"start.room": judging.SHAPED_ROOM_M})
    )
    shaped = [judging.assess(policy, n_approaches=60).shaped for policy in (by_hand, near, far)]
    assert shaped[0] == shaped[1] == shaped[2]


# ---- use


def test_a_policy_begins_the_search_of_an_experiment(by_hand: PolicyFile) -> None:
    begun = experiment.load("experiments/paper_vertical.yaml", [], use.as_start(by_hand), learner="ephe")
    assert begun.policy.form == "polynomial2"
    assert begun.policy.mu0 == by_hand.values
    assert begun.gear_set == "as_simulated"
    held = General("polynomial2").go_p_min
    asked = begun.make_learner(0).ask(20)
    assert np.ptp(asked[:, :held], axis=0).min() > 0.05
    assert np.ptp(asked[:, held:], axis=0).max() < 1e-3
    own = experiment.load("experiments/paper_vertical.yaml", ["speed_mps=1.2"], use.on_its_task(by_hand))
    assert (own.start, own.estimator, own.speed_mps) == ("flown", "known_height_predicted", 1.2)


def test_a_policy_of_the_same_form_keeps_spreads_and_bounds() -> None:
    constant = file.make(forms.by_name("constant"), [4.7, 8.1], [TASK], None, None)
    begun = experiment.load("experiments/paper_vertical.yaml", [], use.as_start(constant))
    assert begun.policy.mu0 == [4.7, 8.1]
    assert begun.policy.parameters[0].sigma0 == 1.5
    assert begun.check.grid
    outside = file.make(forms.by_name("constant"), [9.0, 8.1], [TASK], None, None)
    with pytest.raises(ConfigError, match=r"rrev_c_per_s\.mu0: value 9.0 is out of range"):
        experiment.load("experiments/paper_vertical.yaml", [], use.as_start(outside))


def test_a_sweep_flies_a_policy_as_it_is(by_hand: PolicyFile) -> None:
    grid = sweep_config.load_sweep("sweeps/smoke.yaml", [], [], use.as_it_is(by_hand, None))
    assert grid.learner.name == "fixed"
    trial = grid.experiment("wide_long", 2.5, 60.0, 0)
    learner = trial.make_learner(3)
    learner.tell(learner.ask(), np.arange(8.0))
    assert (learner.ask(5) == np.array(by_hand.values)).all()
    assert (learner.result.sigma == 0.0).all()
    searching = sweep_config.load_sweep("sweeps/smoke.yaml", [], [], use.as_it_is(by_hand, "ephe"), learner="ephe")
    assert searching.learner.name == "ephe"


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (["--vary", "learner.name=ephe,bo"], "vary: learner.name: --policy says what is flown"),
        (["--vary", "learner.options.n_best=2,3"], "vary: learner.options.n_best: --policy says what is flown"),
        (["--vary", "policy.r_0_per_s.mu0=4.0,5.0"], "vary: policy.r_0_per_s.mu0: --policy says what is flown"),
        (["--set", "learner.name=ephe"], "learner.name: value 'ephe': --policy flies without a search"),
        (["--set", "policy.r_0_per_s.mu0=5.1"], "policy: --policy says the numbers, and a setting says others"),
        (["--set", "mu0_range.r_0_per_s=[5.0, 5.1]"], "mu0_range"),
        (["--learner", "ephe", "--vary", "policy.m_0_Nmm.mu0=8.0,9.0"], "vary: policy.m_0_Nmm.mu0"),
    ],
)
def test_a_sweep_of_a_policy_does_not_learn_whoever_asks_for_it(
    path: Path, tmp_path: Path, capsys: Capture, said: list[str], told: str
) -> None:
    out = tmp_path / "run"
    arguments = ["sweep", "sweeps/smoke.yaml", "--policy", str(path), "--out", str(out), "--dry-run", *said]
    assert cli.run(arguments) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert cli.run(arguments[: -len(said)]) == 0


def test_a_sweep_may_begin_with_a_policy_and_compare_options_of_a_learner(path: Path) -> None:
    said = ["--learner", "ephe", "--vary", "learner.options.n_best=2,3", "--dry-run"]
    assert cli.run(["sweep", "sweeps/smoke.yaml", "--policy", str(path), *said]) == 0


def run(arguments: list[str], capsys: Capture, code: int = 0) -> str:
    assert cli.run(arguments) == code, capsys.readouterr().err
    return capsys.readouterr().out


def test_commands_learn_show_and_judge(tmp_path: Path, capsys: Capture, learned: PolicyFile) -> None:
    task, out = tmp_path / "tiny.yaml", tmp_path / "g.yaml"
    task.write_text(yaml.safe_dump(tiny()))
    data = json.loads(run(["policy", "learn", str(task), "--out", str(out), "--json"], capsys))
    assert data["digest"] == learned.digest
    assert file.load(out) == learned
    shown = json.loads(run(["policy", "show", str(out), "--json"], capsys))
    assert len(shown["table"]["threshold_per_s"]) == len(shown["table"]["vz_mps"])
    text = run(["policy", "show", str(out)], capsys)
    for word in ("polynomial2", "r_xx_per_s", "cmaes", "2.3 to 2.7 m/s", "R* (1/s)", f"{learned.checksum:08x}"):
        assert word in text
    judged = ["policy", "assess", str(out), "--approaches", "40"]
    own = json.loads(run([*judged, "--json"], capsys))
    late = json.loads(run([*judged, "--set", "sense.latency=0.05", "--json"], capsys))
    assert own["box"]["flights"] == 40
    assert late["box"]["landed"] < own["box"]["landed"]
    assert "body strikes avoided" in run(judged, capsys)


def test_a_landing_is_flown_on_what_the_policy_was_learned_on(path: Path, capsys: Capture, by_hand: PolicyFile) -> None:
    told = json.loads(run(["rollout", "--policy", str(path), "--speed", "2.5", "--angle", "60", "--json"], capsys))
    outcome = Place.of(TASK).world.rollouts(2.5, 60.0, *by_hand.values, form=by_hand.form, start="flown", stream=0)
    assert told["n_legs"] == 4
    assert told["t_impact_s"] == float(outcome["t_impact_s"])
    slow = json.loads(run(["rollout", "--policy", str(path), "--speed", "0.6", "--angle", "60", "--json"], capsys))
    assert (slow["end_reason"], slow["no_go"], slow["n_legs"], slow["t_impact_s"]) == ("no_go", 1, 0, None)
    other = ["rollout", "--policy", str(path), "--gear", "narrow_long", "--speed", "2.5", "--angle", "60", "--json"]
    assert json.loads(run(other, capsys))["t_impact_s"] != told["t_impact_s"]


def test_the_approach_of_a_policy_is_said_and_never_guessed(path: Path, capsys: Capture) -> None:
    fly = ["fly", "--uri", "udp://127.0.0.1:9", "--policy", str(path)]
    for more, told in (
        ([], "--speed is missing: a policy file says no approach"),
        (["--speed", "2"], "--angle is missing"),
        (["--set", "speed_mps=2.0"], "--angle is missing"),
    ):
        assert cli.run([*fly, *more]) == 2
        assert told in capsys.readouterr().err
    for more in (["--speed", "2", "--angle", "60"], ["experiments/paper_vertical.yaml"]):
        assert cli.run([*fly, *more]) == 1, "nobody listens there"
        assert "nobody listens" in capsys.readouterr().err


def test_which_of_several_tasks_is_flown_is_said_and_never_guessed(
    by_hand: PolicyFile, tmp_path: Path, capsys: Capture
) -> None:
    others = [TASK.model_copy(update={"gear": gear}) for gear in ("narrow_long", "wide_short")]
    path, model = tmp_path / "g.yaml", str(tmp_path / "model.txt")
    file.save(file.make(by_hand.shape, by_hand.values, [TASK, *others], None, None), path)
    rollout = ["rollout", "--policy", str(path), "--speed", "2.5", "--angle", "60", "--json"]
    fly = ["fly", "--uri", "udp://127.0.0.1:9", "--policy", str(path), "--speed", "2.5", "--angle", "60"]
    sil = ["sil", "--policy", str(path), "--write-model", model]
    for command, wanted in ((rollout, 0), (fly, 1), (sil, 0)):
        assert cli.run(command) == 2
        told = capsys.readouterr().err
        assert "3 tasks that differ in gear (wide_short, narrow_long): say which, for example --set gear=" in told
        assert told.count("\n") == 1
        assert cli.run([*command, "--set", "gear=narrow_long"]) == wanted
        capsys.readouterr()


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (["--set", "speed_mps=1.2"], "--set speed_mps=1.2: speed_mps cannot be set: the approaches are drawn"),
        (["--set", "angle_deg=60"], "angle_deg cannot be set"),
        (["--start", "at_trigger"], "start: value 'at_trigger'"),
        (["--set", "start=at_trigger"], "start: value 'at_trigger'"),
    ],
)
def test_what_an_assessment_draws_or_cannot_fly_is_not_set(
    path: Path, capsys: Capture, said: list[str], told: str
) -> None:
    assert cli.run(["policy", "assess", str(path), "--approaches", "10", *said]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_the_help_of_an_assessment_says_what_is_flown_unless_told(capsys: Capture) -> None:
    assert cli.run(["policy", "assess", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert text.count("default: as it was learned") == 9
    assert "default: habas2021" not in text
    assert "trigger" not in text


def test_an_assessment_says_which_vehicles_fly(learned: PolicyFile) -> None:
    assert learned.training is not None
    over = learned.training.model_copy(update={"family": Drawn(n_vehicles=6, seed=1)})
    family = file.make(learned.shape, learned.values, learned.tasks, over, learned.score)
    found = judging.assess(family, n_approaches=20)
    assert str(found.vehicles) == "those of the files; the policy was learned over 6 drawn ones (seed 1)"
    assert found.as_dict()["vehicles"] == {"drawn": None, "learned_over": {"n_vehicles": 6, "seed": 1}}


def test_a_score_says_what_go_no_go_does(learned: PolicyFile) -> None:
    """It is of every approach flown, and beside it of the same approaches with the policy's own go / no-go."""
    score, training = learned.score, learned.training
    assert score is not None
    assert training is not None
    approaches = Series(training.regions, training.seed, Purpose.SELECT).next(60)
    (own,) = fly([Place.of(learned.tasks[0])], learned.form, learned.values, approaches)
    assert learned.theta["go_p_min"].value > 0
    assert score.with_go is not None
    assert score.with_go.refused == (own["no_go"] == 1).mean()
    assert (score.with_go.landed, score.with_go.clean) == (four_leg(own).mean(), clean(own).mean())
    (free,) = fly(
        [Place.of(learned.tasks[0])], learned.form, General(learned.form).always_go(learned.values), approaches
    )
    assert (score.landed, score.clean) == (four_leg(free).mean(), clean(free).mean())


@pytest.mark.parametrize("more", [["--rrev", "4.8"], ["--moment", "8"], ["--form", "constant"], ["--theta", "4.8,8"]])
def test_two_words_for_a_policy_are_refused(path: Path, capsys: Capture, more: list[str]) -> None:
    assert cli.run(["rollout", "--policy", str(path), "--speed", "2.5", "--angle", "60", *more]) == 2
    assert f"already given by {more[0]}" in capsys.readouterr().err


def test_a_start_of_another_form_is_refused(path: Path, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump(tiny(form="bilinear")))
    arguments = ["policy", "learn", str(tmp_path / "tiny.yaml"), "--out", str(tmp_path / "n.yaml")]
    assert cli.run([*arguments, "--policy", str(path)]) == 2
    assert "the policy to start from is of the form polynomial2" in capsys.readouterr().err
    assert not (tmp_path / "n.yaml").exists()
