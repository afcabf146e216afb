"""The data of the pages against the runs they are made of, and the file against what was promised of it."""

import base64
import gzip
import json
import re
import shutil
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import policies
import pytest

from ivl import cli, report
from ivl.errors import ConfigError, StoreError
from ivl.policy import assess, file
from ivl.policy.shape import General
from ivl.report.landings import thinned
from ivl.report.page import encode
from ivl.sweep import store

SIZE_MAX = 8_000_000


def carried(page: Path) -> dict[str, Any]:
    """The data inside of a page."""
    found = re.search(r'id="data">([^<]*)<', page.read_text(encoding="utf-8"))
    assert found
    return dict(json.loads(gzip.decompress(base64.b64decode(found[1]))))


def decode(column: dict[str, Any]) -> np.ndarray:
    return np.array([np.nan if v is None else v * column["unit"] for v in column["values"]])


@pytest.fixture(scope="module")
def learn_data(learn_page: Path) -> dict[str, Any]:
    return carried(learn_page)


@pytest.fixture(scope="module")
def sweep_data(sweep_page: Path) -> dict[str, Any]:
    return carried(sweep_page)


def test_a_page_is_one_small_file_that_refers_to_nothing(learn_page: Path, sweep_page: Path) -> None:
    for page in (learn_page, sweep_page):
        text = page.read_text(encoding="utf-8")
        assert page.stat().st_size < SIZE_MAX
        assert not re.search(r'(src|href)="(?!data:)', text)
        assert "connect-src 'none'" in text
        assert "{{" not in re.sub(r">[A-Za-z0-9+/=]{1000,}<", "", text).split("<script>")[0]


def test_equal_runs_give_equal_files(learn_run: Path, learn_page: Path, tmp_path: Path) -> None:
    again = report.write(learn_run, tmp_path / "again.html")
    assert again.path.read_bytes() == learn_page.read_bytes()
    assert again.size_bytes == learn_page.stat().st_size


def test_every_rollout_of_a_learning_run_can_be_replayed(learn_run: Path, learn_data: dict[str, Any]) -> None:
    rollouts = learn_data["learn"]["rollouts"]
    with sqlite3.connect(learn_run / "run.sqlite") as db:
        stored = db.execute(
            "SELECT rrev_c_per_s, moment_y_Nmm, reward, out_n_legs FROM rollout ORDER BY episode, idx"
        ).fetchall()
    assert len(stored) == len(rollouts["landing"]) == 24
    for number, (rrev, moment, reward, n_legs) in zip(rollouts["landing"], stored, strict=True):
        landing = learn_data["landings"][number]
        assert landing["spec"]["theta"] == [rrev, moment]
        assert landing["outcome"]["n_legs"] == n_legs
        assert landing["outcome"]["reward"] == pytest.approx(reward, abs=0.01)
    assert decode(rollouts["theta"][0]) == pytest.approx([row[0] for row in stored], abs=6e-4)


def test_the_search_begins_where_it_began_and_ends_with_the_last_episode(
    learn_run: Path, learn_data: dict[str, Any]
) -> None:
    (search,) = learn_data["learn"]["episodes"]
    summary = json.loads((learn_run / "result.json").read_text())
    mu = [decode(column) for column in search["mu"]]
    assert [mu[0][0], mu[1][0]] == [4.8, 8.0]
    assert [mu[0][-1], mu[1][-1]] == pytest.approx(summary["mu"], abs=1e-3)
    assert search["at"] == [0, 4, 8, 12, 16, 20, 24]


def test_best_is_best_and_worst_is_worst(learn_data: dict[str, Any]) -> None:
    rewards = decode(learn_data["learn"]["rollouts"]["reward"])
    notable = {entry["what"]: learn_data["landings"][entry["landing"]] for entry in learn_data["learn"]["notable"]}
    assert notable["best return"]["outcome"]["reward"] == pytest.approx(np.nanmax(rewards), abs=0.01)
    assert notable["worst return"]["outcome"]["reward"] == pytest.approx(np.nanmin(rewards), abs=0.01)


def test_a_sweep_page_has_every_cell_with_its_rate(sweep_run: Path, sweep_data: dict[str, Any]) -> None:
    sweep, trials = sweep_data["sweep"], store.read_trials(sweep_run)
    cells = sweep["cells"]
    assert len(cells["gear"]) == 12
    rate, low, high = (decode(cells[name]) for name in ("rate", "lo", "hi"))
    for i in range(12):
        own = trials[
            (trials["gear"] == sweep["gears"][cells["gear"][i]])
            & (trials["speed_mps"] == sweep["speeds"][cells["speed"][i]])
            & (trials["angle_deg"] == sweep["angles"][cells["angle"][i]])
        ]
        assert len(own) == 2
        assert rate[i] == pytest.approx(own["landing_rate_four_leg_norm"].mean(), abs=6e-4)
    assert (low <= rate).all()
    assert (rate <= high).all()


def test_the_landing_of_a_cell_is_the_best_of_its_trials(sweep_run: Path, sweep_data: dict[str, Any]) -> None:
    sweep, trials = sweep_data["sweep"], store.read_trials(sweep_run)
    for i, number in enumerate(sweep["cells"]["landing"]):
        landing = sweep_data["landings"][number]
        own = trials[
            (trials["gear"] == landing["spec"]["gear"])
            & (trials["speed_mps"] == landing["spec"]["speed_mps"])
            & (trials["angle_deg"] == landing["spec"]["angle_deg"])
        ]
        assert sweep["gears"][sweep["cells"]["gear"][i]] == landing["spec"]["gear"]
        assert landing["outcome"]["reward"] == pytest.approx(own["best_reward"].max(), abs=0.01)


def test_the_search_of_each_trial_is_its_own(sweep_run: Path, sweep_data: dict[str, Any]) -> None:
    trials, episodes = sweep_data["sweep"]["trials"], sweep_data["sweep"]["episodes"]
    keys = ["gear", "speed_mps", "angle_deg", "trial"]
    stored = store.read_episodes(sweep_run)
    mu = decode(episodes["mu"][0])
    for i in range(len(trials["cell"])):
        cell = trials["cell"][i]
        places = [("gear", "gears"), ("speed", "speeds"), ("angle", "angles")]
        name = [sweep_data["sweep"][many][sweep_data["sweep"]["cells"][one][cell]] for one, many in places]
        own = stored[(stored[keys] == pd.Series([*name, trials["trial"][i]], index=keys)).all(axis=1)]
        part = mu[trials["first_episode"][i] : trials["first_episode"][i] + trials["n_episodes"][i]]
        assert part[0] == 4.0
        assert part[1:] == pytest.approx(own["mu_rrev_c_per_s"].to_numpy(), abs=6e-3)


def test_fewer_landings_make_a_smaller_page_and_every_cell_comes_first(sweep_run: Path, tmp_path: Path) -> None:
    made = report.write(sweep_run, tmp_path / "few.html", n_landings_max=12)
    assert made.n_landings == 12
    assert min(carried(made.path)["sweep"]["cells"]["landing"]) >= 0
    assert made.n_different == 0


def unsealed(run: Path) -> sqlite3.Connection:
    """The database of a run, without the seals that would tell of what a test writes into it."""
    db = sqlite3.connect(run / "run.sqlite")
    db.execute("DROP TABLE seal")
    return db


def test_landings_that_do_not_come_out_as_recorded_are_counted(learn_run: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(learn_run, run)
    with unsealed(run) as db:
        db.execute("UPDATE rollout SET out_d_min_m = out_d_min_m + 1e-15 WHERE episode = 0 AND idx = 0")
    made = report.write(run)
    assert made.n_different == 1
    facts = dict(carried(made.path)["facts"])
    assert facts["Landings to replay"] == "24, flown again, 1 differ from the record"


def test_a_run_that_was_cut_off_has_a_page(learn_run: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(learn_run, run)
    (run / "result.json").unlink()
    with unsealed(run) as db:
        db.execute("DELETE FROM episode WHERE episode >= 3")
        db.execute("DELETE FROM rollout WHERE episode > 3")
        db.execute("UPDATE rollout SET status='planned', reward=NULL, out_n_legs=NULL WHERE episode = 3 AND idx > 1")
    data = carried(report.write(run).path)
    assert sum(number >= 0 for number in data["learn"]["rollouts"]["landing"]) == 14
    assert dict(data["facts"])["Verdict"] == "not judged: the run was cut off"


def test_a_run_without_any_result_is_refused(learn_run: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(learn_run, run)
    with unsealed(run) as db:
        db.execute("DELETE FROM episode")
        db.execute("DELETE FROM rollout")
    with pytest.raises(StoreError, match="no rollout is finished"):
        report.write(run)


def test_what_is_no_run_is_refused(tmp_path: Path, learn_run: Path) -> None:
    with pytest.raises(StoreError, match="holds no run"):
        report.write(tmp_path)
    with pytest.raises(ConfigError, match="the report cannot be written"):
        report.write(learn_run, tmp_path / "missing" / "page.html")


def test_thinning_keeps_the_number_and_spreads() -> None:
    assert thinned(range(5), 9) == {0, 1, 2, 3, 4}
    assert thinned(range(100), 4) == {0, 25, 50, 75}
    assert thinned(range(3), 0) == set()


def test_a_column_reads_back_within_half_a_unit() -> None:
    values = np.array([1.2345, np.nan, -0.0049, 7.0])
    assert decode(encode(values, 0.01)) == pytest.approx(values, abs=0.005001, nan_ok=True)


def test_the_page_of_a_policy_has_the_numbers_of_its_assessment(policy_page: Path) -> None:
    data = carried(policy_page)
    judged = assess.assess(policies.by_hand(), n_approaches=30)
    shown = {name: text for name, text, _ in data["policy"]["numbers"]["rows"]}
    assert judged.go is not None
    assert shown["box: land"] == f"{100 * judged.box.landed.value:.1f} %"
    assert shown["plane: land clean"] == f"{100 * judged.plane.clean.value:.1f} %"
    assert shown["go / no-go: refused"] == f"{100 * judged.go.no_go.value:.1f} %"
    assert [picture["name"] for picture in data["policy"]["pictures"]] == [
        "policy_surface", "policy_rates", "policy_flow_space", "policy_go",
    ]  # fmt: skip


def test_the_flights_of_a_policy_are_flown_as_the_page_says(policy_page: Path) -> None:
    data = carried(policy_page)
    landing, no_go, spared = data["landings"]
    assert landing["outcome"]["four_leg"]
    assert landing["outcome"]["t_no_go_s"] is None
    assert (no_go["outcome"]["no_go"], no_go["outcome"]["n_legs"], no_go["outcome"]["t_trigger_s"]) == (1, 0, None)
    assert "level_out" in [name for _, name in no_go["phases"]]
    assert no_go["outcome"]["t_no_go_s"] in [t for t, _ in no_go["phases"]]
    assert no_go["outcome"]["verdict"].startswith("no_go at P ")
    assert spared["spec"]["theta"] != no_go["spec"]["theta"]
    assert all(spared["spec"][n] == no_go["spec"][n] for n in ("speed_mps", "angle_deg", "seed", "stream"))
    assert spared["outcome"]["no_go"] == 0
    assert ["Landings to replay", "3, flown again, each as recorded"] in data["facts"]


def test_the_page_of_a_policy_refers_to_nothing_and_is_small(policy_page: Path) -> None:
    text = policy_page.read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="(?!data:)', text)
    assert policy_page.stat().st_size < 2_000_000


def test_a_page_of_a_policy_that_cannot_be_written_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file.save(policies.by_hand(), tmp_path / "g.yaml")
    assert cli.run(["policy", "report", str(tmp_path / "g.yaml"), "--out", str(tmp_path / "no" / "p.html")]) == 2
    assert "there is no folder" in capsys.readouterr().err
    assert (
        cli.run(["policy", "report", str(tmp_path / "g.yaml"), "--out", str(tmp_path / "p.html"), "--rrev", "4"]) == 2
    )
    assert "--moment is missing" in capsys.readouterr().err


def test_a_policy_that_refuses_nothing_has_a_page_without_a_no_go(tmp_path: Path) -> None:
    theta = General("polynomial2").always_go(policies.good_theta())
    file.save(file.make(General("polynomial2").form, theta, [policies.TASK], None, None), tmp_path / "g.yaml")
    page = tmp_path / "page.html"
    assert cli.run(["policy", "report", str(tmp_path / "g.yaml"), "--out", str(page), "--approaches", "6"]) == 0
    data = carried(page)
    assert [entry["what"] for entry in data["policy"]["notable"]] == ["landing"]
    assert data["landings"][0]["outcome"]["four_leg"]
