"""A sweep is a task and the paths that it varies: identity of trials, columns, groups, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from small_sweep import MAP, SMALL, fly, make, same_tables, write

from ivl import cli, report
from ivl.analysis import compact, rates
from ivl.errors import ConfigError, StoreError
from ivl.export.source import Choice, resolve
from ivl.plots import campaign
from ivl.report import sweep_page
from ivl.report.landings import Album
from ivl.rewards import RewardChoice
from ivl.sweep import config, plan, schema, store, summary
from ivl.sweep.config import Sweep

Capture = pytest.CaptureFixture[str]
NAME = ("wide_long", 3.5, 90.0, 1)
TINY: dict[str, Any] = {"gears": ["wide_long"], "speeds_mps": [2.5], "budget": 12, "trials": 2, "check_rollouts": 0}


def varied(tmp_path: Path, vary: dict[str, Any], **changes: Any) -> Sweep:
    return make(tmp_path, vary=vary, **changes)


def loaded(tmp_path: Path, *vary: str, **changes: Any) -> Sweep:
    return config.load_sweep(str(write(tmp_path / "sweep.yaml", {**SMALL, **changes})), [], vary)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two learners with two sensor sets."""
    folder = tmp_path_factory.mktemp("varied")
    vary = {"sensing": ["mocap", None], "learner.name": ["ephe", "cmaes"], "sense.phase_random": [1.0, 0.0]}
    return fly(varied(folder, vary, **TINY), folder / "run", 3)


def test_short_fields_and_varied_paths_mean_the_same_cells_and_trials(tmp_path: Path) -> None:
    short = make(tmp_path)
    rest = {name: value for name, value in SMALL.items() if name not in ("gears", "speeds_mps", "angles_deg")}
    axes = {"gear": SMALL["gears"], "speed_mps": {"first": 2.5, "last": 3.5, "count": 2}, "angle_deg": [60, 90]}
    long = config.load_sweep(str(write(tmp_path / "long.yaml", {**rest, "vary": axes})))
    assert (long.gear_names(), long.approaches()) == (short.gear_names(), short.approaches())
    assert plan.plan(long, 3) == plan.plan(short, 3)
    assert long.run_seed(*NAME) == short.run_seed(*NAME)
    assert long.experiment(*NAME) == short.experiment(*NAME)
    assert same_tables(fly(long, tmp_path / "a", 100), fly(short, tmp_path / "b", 100))


def test_one_value_needs_no_list(tmp_path: Path) -> None:
    rest = {name: value for name, value in SMALL.items() if name not in ("gears", "speeds_mps", "angles_deg")}
    one = {**rest, "gear": "wide_long", "speed_mps": 3.5, "angle_deg": 90.0}
    sweep = config.load_sweep(str(write(tmp_path / "one.yaml", one)))
    assert (sweep.gear_names(), sweep.approaches()) == (["wide_long"], [(3.5, 90.0)])
    assert sweep.run_seed(*NAME) == make(tmp_path).run_seed(*NAME)


def test_learners_share_the_seeds_of_a_trial_and_worlds_do_not(tmp_path: Path) -> None:
    plain = make(tmp_path).run_seed(*NAME)
    how = {"learner.name": ["ephe", "bo"], "n_rollouts": [6, 3], "policy.rrev_c_per_s.sigma0": [1.0, 0.5]}
    sweep = varied(tmp_path, how)
    assert {sweep.at(each).run_seed(*NAME) for each in sweep.variants()} == {plain}
    assert len(sweep.variants()) == 8
    what = {"sensing": ["mocap", "ideal"], "sense.latency": [0.0, 0.01]}
    sweep = varied(tmp_path, what)
    seeds = [sweep.at(each).run_seed(*NAME) for each in sweep.variants()]
    assert len({plain, *seeds}) == 5
    other_order = varied(tmp_path, dict(reversed(what.items())))
    assert plan.plan(other_order, 3) == plan.plan(sweep, 3)
    one = varied(tmp_path, {"sense.latency": [0.01], "sensing": ["mocap"]})
    assert one.at(one.variants()[0]).run_seed(*NAME) in seeds


def test_seeds_of_varied_worlds_stay_what_they_are_from_version_to_version(tmp_path: Path) -> None:
    sweep = varied(tmp_path, {"sensing": ["mocap", None], "sense.latency": [0.01]})
    seeds = [sweep.at(each).run_seed("wide_long", 2.5, 60.0, 0) for each in sweep.variants()]
    assert seeds == [2_341_122_677_070_237_282, 4_329_013_478_568_522_118]


def test_a_variant_has_the_values_in_its_fields_and_in_its_experiments(tmp_path: Path) -> None:
    sweep = varied(tmp_path, {"sensing": ["mocap"], "approach": ["constant_rrev"], "sense.latency": [0.01]})
    (each,) = sweep.variants()
    chosen = sweep.at(each).experiment(*NAME)
    assert (chosen.sensing, chosen.approach) == ("mocap", "constant_rrev")
    values = sweep.worlds()["wide_long|approach=constant_rrev|sense.latency=0.01|sensing=mocap"].params.values
    assert (values["sense.latency"], values["firmware.shape"]) == (0.01, 2.0)
    assert chosen.make_world().params.values == values
    (tmp_path / "again.yaml").write_text(sweep.to_yaml())
    assert config.load_sweep(str(tmp_path / "again.yaml")) == sweep


def test_varied_values_of_numpy_mean_the_same_cells(tmp_path: Path) -> None:
    data = yaml.safe_load(write(tmp_path / "sweep.yaml", SMALL).read_text())
    given = {"sensing": ["mocap"], "sense.latency": [0.01], "n_rollouts": [6]}
    numpy = {"sensing": [np.str_("mocap")], "sense.latency": [np.float64(0.01)], "n_rollouts": [np.int64(6)]}
    one, other = (Sweep.model_validate({**data, "vary": vary}) for vary in (given, numpy))
    assert other == one
    keys = [grid.at(each).key(*NAME[:3]) for grid in (one, other) for each in grid.variants()]
    assert keys[0] == keys[1]
    assert "numpy" not in other.to_yaml()


def test_a_gear_set_that_is_varied_brings_its_own_gears(tmp_path: Path) -> None:
    sweep = varied(tmp_path, {"gear_set": ["table1", "as_simulated"], "vehicle": ["habas2021"]}, gears=None)
    assert len(plan.plan(sweep, 100)) == 12
    keys = {sweep.at(each).key("wide_long", 2.5, 60.0) for each in sweep.variants()}
    assert keys == {f"habas2021|{name}|wide_long|2.5|60.0" for name in ("table1", "as_simulated")}


def test_every_varied_path_is_a_column_and_every_trial_is_there(run: Path) -> None:
    trials = store.read_trials(run)
    assert len(trials) == 8 * 2 * 2
    assert schema.varied_columns(trials) == ["vary.sense.phase_random", "vary.sensing"]
    assert set(trials["vary.sensing"]) == {"mocap", "null"}
    assert set(trials["learner"]) == {"ephe", "cmaes"}
    assert not trials.duplicated([*schema.cell_columns(trials), "trial"]).any()
    for kind in ("episodes", "rollouts"):
        assert set(schema.varied_columns(store.read_table(run, kind).column_names)) == set(
            schema.varied_columns(trials)
        )
    table = store.read_table(run, "trials")
    assert table.schema.field("vary.sense.phase_random").metadata[b"unit"] == b"1"
    by_learner = {name: part["seed"].tolist() for name, part in trials.groupby("learner", observed=True)}
    assert by_learner["ephe"] == by_learner["cmaes"]
    assert len(set(by_learner["ephe"])) == 16
    data = store.to_xarray(run)
    assert dict(data.sizes) == {
        "vary.sense.phase_random": 2, "vary.sensing": 2, "learner": 2, "gear": 1, "speed_mps": 1, "angle_deg": 2,
        "trial": 2,
    }  # fmt: skip
    assert not data["reward_mean"].isnull().any()


def test_a_varied_trial_is_what_the_sweep_with_that_value_alone_flies(run: Path, tmp_path: Path) -> None:
    one = varied(tmp_path, {"sense.phase_random": [0.0], "sensing": ["mocap"], "learner.name": ["cmaes"]}, **TINY)
    alone = store.read_trials(fly(one, tmp_path / "run", 1))
    trials = store.read_trials(run)
    chosen = (trials["vary.sensing"] == "mocap") & (trials["vary.sense.phase_random"] == 0.0)
    same = trials[chosen & (trials["learner"] == "cmaes")].reset_index(drop=True)
    names = [name for name in alone if alone[name].dtype != "category"]
    assert len(same) == len(alone) == 4
    assert same[names].equals(alone[names])


def test_rates_group_by_what_is_varied(run: Path) -> None:
    trials = store.read_trials(run)
    cells = rates.cell_rates(trials)
    assert len(cells) == 8 * 2
    assert (cells["n_trials"] == 2).all()
    assert len(rates.rollouts_to_rate(store.read_episodes(run))) == len(trials)


def test_a_page_tells_variants_apart_and_flies_their_landings_again_bit_for_bit(run: Path, tmp_path: Path) -> None:
    made = report.write(run, tmp_path / "page.html")
    assert made.n_different == 0
    assert made.n_landings == 32
    data, _ = sweep_page.collect(run, 100, lambda *_: None)
    assert ["Varied", "sensing: mocap, null; learner.name: ephe, cmaes; sense.phase_random: 1.0, 0.0"] in data["facts"]
    assert len(data["sweep"]["gears"]) == 8
    assert "wide_long, learner.name ephe, sense.phase_random 0.0, sensing mocap" in data["sweep"]["gears"]
    assert sorted(data["sweep"]["cells"]["gear"]) == sorted([*range(8)] * 2)
    flight = resolve(run, Choice(trial=1))
    assert "sensing" in flight.title


def test_an_album_keeps_worlds_apart_that_differ_in_sensing(run: Path) -> None:
    sweep, trials, album = config.load_sweep(str(run / "sweep.yaml")), store.read_trials(run), Album(RewardChoice())
    specs = {sweep_page.best_landing(sweep, row).sensing for _, row in trials.iterrows()}
    assert specs == {"mocap", None}
    for _, row in trials.iterrows():
        album.add(sweep_page.best_landing(sweep, row), "x", lambda _: True)
    assert len(album._worlds) == 4
    assert len(album.geometry) == 1


def test_what_has_no_place_for_a_varied_path_refuses_it(run: Path) -> None:
    with pytest.raises(ConfigError, match=r"has no column vary\."):
        compact.pack(store.read_trials(run), store.read_episodes(run))
    with pytest.raises(ConfigError, match=r"varies sense\.phase_random, sensing, which the figures do not tell apart"):
        campaign.load([run])


def test_parts_of_another_vary_are_refused(run: Path, tmp_path: Path) -> None:
    own = fly(varied(tmp_path, {"approach": ["constant_rrev"]}, **TINY), tmp_path / "run", 100)
    foreign = max((run / "tasks").glob("*.parquet"))
    for kind in ("tasks", "trials"):
        (own / kind / foreign.name).write_bytes((run / kind / foreign.name).read_bytes())
    with pytest.raises(StoreError, match=rf"{foreign.name}: other varied paths than in 000000\.parquet"):
        store.read_trials(own)
    table = pq.read_table(own / "trials" / "000000.parquet")
    assert table.column("vary.approach").to_pylist() == ["constant_rrev"] * 4


def test_a_map_varies_the_sensing(tmp_path: Path) -> None:
    file = write(tmp_path / "map.yaml", {**MAP, "gears": ["wide_long"], "vary": {"sense.latency": [0.0, 0.02]}})
    grid = config.load_map(str(file))
    points = store.read_map(fly(grid, tmp_path / "run", 2))
    assert len(points) == 2 * 4 * 2 * 3
    assert points.groupby("vary.sense.latency").size().to_dict() == {0.0: 24, 0.02: 24}
    with pytest.raises(ConfigError, match=r"learner\.name: unknown key"):
        config.load_map(str(file), [], ["learner.name=bo,ephe"])


def test_a_trial_that_fails_tells_its_variant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ivl.sweep import trials

    def broken(*_: Any) -> None:
        raise ZeroDivisionError("no such cell")

    monkeypatch.setattr(trials, "run", broken)
    failed = store.read_frame(
        fly(varied(tmp_path, {"sensing": ["mocap", "ideal"]}, **TINY), tmp_path / "r", 9), "failures"
    )
    assert sorted(failed["vary.sensing"]) == ["ideal"] * 4 + ["mocap"] * 4


def test_the_command_line_shows_a_group_for_each_learner(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["--set", "sensing=camera50", "--set", "estimator=kalman", "--vary", "learner.name=ephe,bo"]
    small = ["--set", "budget=16", "--set", "speeds_mps=[2.5]", "--workers", "1"]
    assert cli.run(["sweep", "sweeps/smoke.yaml", *words, *small, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [group["learner.name"] for group in found["groups"]] == ["ephe", "bo"]
    assert (found["trials"], found["cells"]) == (24, 12)
    for group in found["groups"]:
        assert (group["cells"], group["trials"]) == (6, 12)
        assert set(group["landing_rate_mean"]) == {"narrow_short", "wide_long"}
    folder = Path(found["run"])
    manifest = store.read_manifest(folder)
    assert manifest["learner"] == "ephe, bo"
    assert manifest["parameters"]["wide_long"]["firmware.d_source"] == 2.0
    means = store.read_trials(folder).groupby(["learner", "gear"], observed=True)["landing_rate_four_leg_norm"].mean()
    for group in found["groups"]:
        for gear, value in group["landing_rate_mean"].items():
            assert value == pytest.approx(means[group["learner.name"], gear], abs=1e-4)
    again = ["sweep", "sweeps/smoke.yaml", *words, *small, "--resume", "--out", str(folder)]
    assert cli.run(again) == 0
    assert "\n\nlearner.name                       ephe\n" in capsys.readouterr().out
    assert cli.run([*again, "--vary", "sensing=mocap"]) == 2
    assert "--set sensing=camera50: sensing is varied" in capsys.readouterr().err
    assert cli.run([*again, "--vary", "approach=constant_rrev"]) == 1
    told = capsys.readouterr().err
    assert "cannot be resumed: vary: it has {'learner.name': ['ephe', 'bo']}, now" in told
    assert told.count("\n") == 1


def test_a_run_from_before_there_was_vary_is_resumed(tmp_path: Path) -> None:
    grid = make(tmp_path, **TINY)
    run = fly(grid, tmp_path / "run", 100)
    manifest = store.read_manifest(run)
    for name in ("vary", "sensing", "estimator", "approach", "gear", "speed_mps", "angle_deg"):
        del manifest["sweep"][name]
    (run / "manifest.json").write_text(json.dumps(manifest))
    from ivl.sweep import folder

    folder.open_run(run, grid, grid.worlds(), 100, resume=True).close()
    with pytest.raises(StoreError, match="cannot be resumed: sensing: it has None, now 'mocap'"):
        folder.open_run(run, grid.model_copy(update={"sensing": "mocap"}), grid.worlds(), 100, resume=True)


@pytest.mark.parametrize(
    ("vary", "complaint"),
    [
        ("sensign=mocap", "vary: sensign: unknown key, did you mean 'sensing'?"),
        ("sense.latncy=0.01", "vary: sense.latncy: unknown parameter, did you mean 'sense.latency'?"),
        ("seed=1,2", "vary: seed: unknown key"),
        ("trials=1,2", "vary: trials: unknown key"),
        ("sensing=", "vary.sensing: the list is empty"),
        ("sensing", "expected path=values"),
        ("sensing=mocap,mocap", "vary.sensing: a value is given twice"),
        ("sense.latency=0,0.0", "vary.sense.latency: a value is given twice"),
        ("speed_mps=1,2,1", "vary.speed_mps: a value is given twice"),
        ("speed_mps=1,200", "vary.speed_mps: 200.0 is out of range (0.1 .. 6 m/s)"),
        ("speed_mps=slow", "vary.speed_mps: value 'slow' is not a number"),
        ("sense.latency=0.0,0.5", "vary.sense.latency=0.5: override: sense.latency: value 0.5 is out of range"),
        ("sense.latency=0.0,'1e-3'", "numbers and other values are mixed; in quotes this is text"),
        ("estimator=kalmn,formula", "vary.estimator=kalmn: estimator: value 'kalmn': unknown estimator"),
        ("sensing=camera5,mocap", "no sensor set 'camera5', did you mean 'camera50'"),
        ("gear=wide_lng", "no gear 'wide_lng', did you mean 'wide_long'"),
        ("vehicle=nobody", "no vehicle 'nobody'"),
        ("learner.name=ephe,boo", "vary.learner.name=boo: learner: no learner 'boo'"),
        ("n_rollouts=6,7", "vary.n_rollouts=7: budget 30 is not a multiple of n_rollouts 7"),
        ("sensing=[[mocap]]", "vary.sensing: value ['mocap'] is not a single value"),
        ("speed_mps={first: 1.0, last: fast, count: 3}", "vary.speed_mps: last: value 'fast'"),
    ],
)
def test_what_is_wrong_with_a_varied_path_is_one_line(vary: str, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        loaded(tmp_path, vary)
    assert complaint in str(caught.value)
    assert str(caught.value).startswith("sweep.yaml: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("vary", [["sensing"], "sensing", {"sensing": "mocap"}, {1: [2]}])
def test_a_vary_of_another_shape_is_one_line(vary: Any, tmp_path: Path) -> None:
    for texts in ((), ("sensing=mocap",)):
        if isinstance(vary, dict) and texts and "sensing" in vary:
            continue  # the command line replaces it
        with pytest.raises(ConfigError, match=r"^sweep\.yaml: vary"):
            loaded(tmp_path, *texts, vary=vary)


def test_what_would_do_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="sensing is given twice"):
        loaded(tmp_path, "sensing=mocap", "sensing=ideal")
    file = str(write(tmp_path / "sweep.yaml", SMALL))
    with pytest.raises(ConfigError, match=r"--set sensing=mocap: sensing is varied"):
        config.load_sweep(file, ["sensing=mocap"], ["sensing=ideal"])
    with pytest.raises(ConfigError, match=r"--learner bo: learner.name is varied"):
        config.load_sweep(file, [], ["learner.name=ephe"], learner="bo")
    with pytest.raises(ConfigError, match="gear: is given twice, by gear and by gears"):
        config.load_sweep(file, ["gear=wide_long"])


def test_the_command_line_replaces_what_the_file_says_of_a_path(tmp_path: Path) -> None:
    sweep = loaded(tmp_path, "gear=wide_short", "speed_mps={first: 1.0, last: 2.0, count: 3}", "sensing=mocap, ideal")
    assert (sweep.gear_names(), sweep.gears) == (["wide_short"], None)
    assert sweep.approaches()[0] == (1.0, 60.0)
    assert len(sweep.approaches()) == 6
    assert sweep.vary["sensing"] == ["mocap", "ideal"]
    assert loaded(tmp_path, "sensing=flow", vary={"sensing": ["mocap"]}).vary == {"sensing": ["flow"]}


def test_a_plan_says_what_is_varied(tmp_path: Path) -> None:
    sweep = varied(tmp_path, {"n_rollouts": [6, 3], "budget": [30, 60]})
    told = summary.of_plan(sweep, 4)
    assert told["vary"] == {"n_rollouts": [6, 3], "budget": [30, 60]}
    assert told["trials"] == 4 * 16
    assert told["rollouts_at_most"] == 2 * 16 * (34 + 64)
    assert np.isfinite(told["tasks"])
