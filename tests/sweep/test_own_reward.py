"""A reward that only this file knows: it learns, is stored, resumed, swept and shown, without a change elsewhere."""

import base64
import gzip
import json
import re
import sqlite3
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import Field
from small_sweep import fly, make

from ivl import experiment, report, run
from ivl.cli import run as command
from ivl.experiment import Experiment
from ivl.export.source import Choice, resolve
from ivl.outcome import Outcomes
from ivl.quantity import Quantity
from ivl.rewards import REWARDS, Options, Reward, RewardChoice
from ivl.sweep import store


class FeetOptions(Options):
    """Options that no other reward has."""

    per_foot: float = Field(default=0.001, gt=0, description="paid for each foot")


def feet(outcomes: Outcomes, options: FeetOptions) -> Mapping[str, np.ndarray]:
    """A return far from the paper's scale: its total is a product, not the sum of the terms."""
    count = options.per_foot * np.asarray(outcomes["n_legs"], dtype=np.float64)
    time_s = np.asarray(outcomes["t_end_s"], dtype=np.float64)
    return {"feet": count, "time_s": time_s, "total": (count + 1e-4) / (1.0 + time_s)}


@pytest.fixture(autouse=True)
def own_reward(monkeypatch: pytest.MonkeyPatch) -> RewardChoice:
    terms = (Quantity("feet", "1", "feet that hold"), Quantity("time_s", "s", "time of flight"))
    monkeypatch.setitem(REWARDS, "feet", Reward("feet", "Pays for feet and haste.", terms, feet, FeetOptions))
    return RewardChoice(name="feet", options={"per_foot": 0.002})


@pytest.fixture
def chosen(tmp_path: Path, own_reward: RewardChoice) -> Experiment:
    sweep = make(tmp_path, learner={"name": "bo"}, reward=own_reward.model_dump(), n_rollouts=4, budget=16)
    data = sweep.experiment("wide_long", 3.5, 90.0, 0).model_dump()
    grid = {"rrev_c_per_s": {"lo": 4.0, "hi": 5.0, "step": 0.5}, "moment_y_Nmm": {"lo": 7.0, "hi": 9.0, "step": 1.0}}
    return experiment.from_data({**data, "check": {"n_fresh": 5, "effort": 0.01, "grid": grid}}, "own.yaml")


def test_a_run_learns_stores_resumes_and_reports(chosen: Experiment, own_reward: RewardChoice, tmp_path: Path) -> None:
    def interrupt(progress: Any) -> None:
        if progress.episode == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.run(chosen, tmp_path / "cut", hooks=run.Hooks(on_episode=interrupt))
    result = run.run(run.read_config(tmp_path / "cut")[0], tmp_path / "cut", resume=True)
    whole = run.run(chosen, tmp_path / "whole")
    assert result.rollouts.outcomes.tobytes() == whole.rollouts.outcomes.tobytes()
    expected = own_reward.score(result.rollouts.outcomes)
    assert (result.rollouts.reward == expected["total"]).all()
    assert (result.rollouts.terms["time_s"] == expected["time_s"]).all()
    with sqlite3.connect(tmp_path / "cut" / "run.sqlite") as db:
        (sums,) = db.execute("SELECT sum(reward_feet), sum(reward_time_s) FROM rollout").fetchall()
        said = db.execute("SELECT name, unit, doc FROM quantity WHERE role='terms'").fetchall()
    assert sums == pytest.approx((expected["feet"].sum(), expected["time_s"].sum()))
    assert said == [("feet", "1", "feet that hold"), ("time_s", "s", "time of flight")]

    shown = carried(report.write(tmp_path / "whole").path)
    assert shown["terms"] == [list(row) for row in said]
    best = next(shown["landings"][e["landing"]] for e in shown["learn"]["notable"] if e["what"] == "best return")
    assert best["outcome"]["reward"] == pytest.approx(expected["total"].max(), rel=1e-4)
    assert set(best["outcome"]["terms"]) == {"feet", "time_s"}
    assert shown["learn"]["limits"][-1][1] == pytest.approx(1.06 * expected["total"].max())
    facts = resolve(tmp_path / "whole", Choice()).facts
    assert float(facts["reward.total"]) == expected["total"].max()
    assert {"reward.feet", "reward.time_s"} <= set(facts)


def test_a_sweep_has_the_terms_as_columns(own_reward: RewardChoice, tmp_path: Path) -> None:
    sweep = make(tmp_path, reward=own_reward.model_dump(), gears=["wide_long"], angles_deg=[90.0])
    run = fly(sweep, tmp_path / "run", 100)
    rollouts, trials, episodes = store.read_rollouts(run), store.read_trials(run), store.read_episodes(run)
    assert rollouts["reward_feet"].tolist() == pytest.approx((0.002 * rollouts["n_legs"]).tolist())
    assert (rollouts["reward_time_s"] == rollouts["t_end_s"]).all()
    assert store.read_frame(run, "rollouts").attrs["units"]["reward_time_s"] == "s"
    for row in trials.itertuples():
        own = rollouts[(rollouts["seed"] == row.seed) & (rollouts["episode"] >= row.n_episodes - 3)]
        assert row.reward_mean_time_s == pytest.approx(own["reward_time_s"].mean())
    assert episodes["reward_mean_feet"].mean() == pytest.approx(rollouts["reward_feet"].mean())
    assert carried(report.write(run).path)["terms"][1] == ["time_s", "s", "time of flight"]


def test_a_reward_whose_terms_changed_is_not_resumed(
    chosen: Experiment, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run.run(chosen, tmp_path / "run")
    renamed = Reward("feet", "", (Quantity("toes", "1", "toes"),), feet, FeetOptions)
    monkeypatch.setitem(REWARDS, "feet", renamed)
    with pytest.raises(run.StoreError, match="the terms of its reward or the parameters of its policy changed"):
        run.run(chosen, tmp_path / "run", resume=True)


def test_the_command_line_knows_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["list", "rewards", "--json"]) == 0
    (entry,) = (e for e in json.loads(capsys.readouterr().out)["rewards"] if e["name"] == "feet")
    assert entry["options"] == {"weights": {}, "per_foot": 0.001}
    assert entry["terms"]["time_s"] == {"unit": "s", "doc": "time of flight"}


def carried(page: Path) -> dict[str, Any]:
    """The data inside of a page."""
    found = re.search(r'id="data">([^<]*)<', page.read_text(encoding="utf-8"))
    assert found
    return dict(json.loads(gzip.decompress(base64.b64decode(found[1]))))
