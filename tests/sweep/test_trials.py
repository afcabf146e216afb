"""A trial depends on its own name alone; tables say what was flown."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from small_sweep import fly, make, same_tables

import ivl
from ivl import native, source
from ivl.layout import layout_of
from ivl.learners import LEARNERS, Entry, RobustEPHE
from ivl.learning.loop import LearningRun
from ivl.outcome import clean, four_leg
from ivl.source import WorldSource
from ivl.store import SCHEMA_VERSION, RunStore
from ivl.sweep import store, trials, work
from ivl.sweep.config import Sweep
from ivl.sweep.plan import DaskTask
from ivl.sweep.trials import Trial


class Stopping(RobustEPHE):
    """Stops after two episodes where the first return is odd: some trials of a batch, not all."""

    def stop(self) -> bool:
        return self._n_updates >= 2 and self.seed % 2 == 1


@pytest.fixture
def stopping(monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setitem(LEARNERS, "stopping", Entry(Stopping, "for tests"))
    return "stopping"


@pytest.mark.parametrize("learner", ["ephe", "bo"])
def test_a_trial_is_what_ivl_learn_does_with_its_seed(learner: str, tmp_path: Path) -> None:
    sweep = make(tmp_path, learner={"name": learner})
    world = sweep.make_world("wide_long")
    log = trials.run(sweep, world, [Trial(2.5, 60.0, 0), Trial(3.5, 90.0, 1)])
    chosen = sweep.experiment("wide_long", 3.5, 90.0, 1)
    assert chosen.seed == log.run_seed[1]
    dtype, manifest = native.library().outcome_dtype, {"schema_version": SCHEMA_VERSION}
    with RunStore.create(tmp_path / "run", chosen.to_yaml(), manifest, dtype, layout_of(chosen)) as run:
        LearningRun([chosen], WorldSource(world, chosen, 1), run).run()
        rollouts, episodes = run.rollouts(), run.episodes()
    assert (log.theta[1].reshape(-1, 2) == rollouts.theta).all()
    assert (log.reward[1].ravel() == rollouts.reward).all()
    assert (log.outcomes[1].ravel()["t_end_s"] == rollouts.outcomes["t_end_s"]).all()
    assert [list(row.recommended) for row in episodes] == log.recommended[1].tolist()
    assert [list(row.sigma) for row in episodes] == log.sigma[1].tolist()


@pytest.mark.parametrize(("size", "order"), [(1, -1), (3, 1), (8, -1)])
def test_tables_are_the_same_bits_however_trials_are_grouped_and_ordered(
    size: int, order: int, small: Sweep, reference: Path, tmp_path: Path
) -> None:
    run = fly(small, tmp_path / "run", size, order)
    assert len(store.read_trials(run)) == 16
    assert same_tables(run, reference)


def test_grouping_does_not_matter_to_the_default_learner_either(tmp_path: Path) -> None:
    sweep = make(tmp_path, learner={"name": "bo"}, gears=["wide_long"], budget=48)
    assert same_tables(fly(sweep, tmp_path / "one", 1, -1), fly(sweep, tmp_path / "many", 100))


def test_learners_are_paired(tmp_path: Path) -> None:
    runs = [fly(make(tmp_path, learner={"name": name}), tmp_path / name, 100) for name in ("ephe", "ephe_robust")]
    first, second = (store.read_trials(run) for run in runs)
    assert (first["seed"] == second["seed"]).all()
    assert not first["mu_rrev_c_per_s"].equals(second["mu_rrev_c_per_s"])


def test_the_best_rollout_can_be_replayed_bit_for_bit(reference: Path) -> None:
    table, flown = store.read_trials(reference), store.read_rollouts(reference)
    assert store.read_manifest(reference)["sweep"]["start"] == "imparted"
    for row in table.sample(4, random_state=0).itertuples():
        world = ivl.World(row.vehicle, row.gear, row.gear_set)
        flight = world.trace(
            row.speed_mps,
            row.angle_deg,
            row.best_rrev_c_per_s,
            row.best_moment_y_Nmm,
            seed=row.seed,
            stream=row.best_stream,
        )
        own = flown[(flown["seed"] == row.seed) & (flown["stream"] == row.best_stream)].iloc[0]
        assert flight.outcome.n_legs == row.best_n_legs == own["n_legs"]
        assert flight.outcome.t_end_s == own["t_end_s"]
        assert own["reward"] == row.best_reward == flown[flown["seed"] == row.seed]["reward"].max()


def test_the_rows_of_trials_are_what_their_rollouts_say(reference: Path) -> None:
    """Every figure of the trials table, computed again from the rollouts table by plain loops."""
    table, flown = store.read_trials(reference), store.read_rollouts(reference)
    for row in table.itertuples():
        own = flown[flown["seed"] == row.seed]
        last = own[own["episode"] >= row.n_episodes - 3]
        assert row.n_rollouts == len(own) == 30
        assert row.n_recent == len(last) == 18
        assert row.landing_rate_four_leg_norm == (last["n_legs"] >= 3).mean()
        assert row.landing_rate_clean_norm == ((last["n_legs"] >= 3) & (last["body_contact"] == 0)).mean()
        assert row.n_failed_landings == (own["n_legs"] < 3).sum()
        assert row.n_body_contacts == own["body_contact"].sum()
        assert row.reward_mean == pytest.approx(last["reward"].mean(), rel=1e-12)
        check_trigger(row, last[last["triggered"] == 1])
        check_contact(row, last)


def check_trigger(row: Any, triggered: pd.DataFrame) -> None:
    assert row.n_triggered == len(triggered)
    for column, name in (
        ("trigger_vx_mps", "vx_trigger_mps"), ("trigger_vz_mps", "vz_trigger_mps"), ("trigger_d_ceil_m", "d_trigger_m"),
        ("trigger_rrev_per_s", "rrev_trigger_per_s"), ("trigger_of_y_radps", "of_y_trigger_radps"),
    ):  # fmt: skip
        assert getattr(row, column) == pytest.approx(triggered[name].mean(), rel=1e-12, nan_ok=True)


def check_contact(row: Any, rollouts: pd.DataFrame) -> None:
    orders = rollouts[[f"leg_order_{i}" for i in range(1, 5)]].to_numpy().tolist()
    stuck = [order for order in orders if order[0] > 0]
    fore = [order for order in stuck if order[0] in (1, 4)]
    done = [order for order in fore if 2 in order or 3 in order]
    assert row.n_attached == len(stuck)
    assert row.fore_legs_first_norm == pytest.approx(len(fore) / len(stuck) if stuck else np.nan, nan_ok=True)
    assert row.swing_completed_norm == pytest.approx(len(done) / len(fore) if fore else np.nan, nan_ok=True)


def test_checks_fly_the_recommended_policy_with_random_numbers_of_their_own(small: Sweep, world: ivl.World) -> None:
    log = trials.run(small, world, [Trial(3.5, 90.0, 0)])
    again = world.rollouts(3.5, 90.0, *log.recommended[0, -1], seed=int(log.world_seed[0]), stream=np.arange(4))
    assert log.check.shape == (1, 4)
    assert not np.array_equal(again["t_end_s"], log.check[0]["t_end_s"])
    table = work.tables.trials_table(small, "wide_long", log).to_pandas()
    assert table["check_rate_four_leg_norm"][0] == four_leg(log.check).mean()
    assert table["check_rate_clean_norm"][0] == clean(log.check).mean()


def test_a_trial_that_its_learner_ends_leaves_the_others_as_they_were(stopping: str, tmp_path: Path) -> None:
    sweep = make(tmp_path, learner={"name": stopping}, gears=["wide_long"])
    run = fly(sweep, tmp_path / "run", 100)
    table, episodes = store.read_trials(run), store.read_episodes(run)
    short = table["learner_seed"] % 2 == 1
    assert 0 < short.sum() < len(table)
    assert (table["stopped"] == short).all()
    assert (table["n_episodes"] == np.where(short, 2, 5)).all()
    assert (table["n_rollouts"] == 6 * table["n_episodes"]).all()
    assert len(episodes) == table["n_episodes"].sum()
    assert len(store.read_rollouts(run)) == table["n_rollouts"].sum()
    assert same_tables(run, fly(sweep, tmp_path / "alone", 1))


def test_a_trial_that_raises_fails_alone_and_says_why(
    monkeypatch: pytest.MonkeyPatch, small: Sweep, reference: Path, tmp_path: Path
) -> None:
    run = fly_with_a_broken_cell(monkeypatch, small, tmp_path / "run")
    failed, good = store.read_frame(run, "failures"), store.read_trials(run)
    assert failed[["speed_mps", "angle_deg", "trial"]].to_numpy().tolist() == [[2.5, 90, 0], [2.5, 90, 1]] * 2
    assert (failed["error"] == "ZeroDivisionError: no such cell").all()
    assert failed["traceback"].str.contains("in break_one").all()
    expected = store.read_trials(reference)
    expected = expected[(expected["speed_mps"] != 2.5) | (expected["angle_deg"] != 90.0)].reset_index(drop=True)
    assert good.equals(expected)
    assert store.read_frame(run, "tasks")["n_failed"].sum() == 4


def fly_with_a_broken_cell(monkeypatch: pytest.MonkeyPatch, sweep: Sweep, run: Path) -> Path:
    good = trials.run

    def break_one(sweep: Sweep, world: ivl.World, names: list[Trial]) -> trials.Log:
        if any((t.speed_mps, t.angle_deg) == (2.5, 90.0) for t in names):
            raise ZeroDivisionError("no such cell")
        return good(sweep, world, names)

    with monkeypatch.context() as patch:
        patch.setattr(trials, "run", break_one)
        return fly(sweep, run, size=100)


def test_a_worker_with_another_library_refuses_before_it_unpacks_the_world(small: Sweep) -> None:
    with pytest.raises(ivl.NativeError, match="is not that of the client"):
        work.run_packed(
            small, b"of another shape", DaskTask(0, "wide_long", (Trial(2.5, 60.0, 0),)), "0" * 64, "", 60.0
        )


def test_rollouts_that_the_simulation_gave_up_are_not_learned_from(
    monkeypatch: pytest.MonkeyPatch, small: Sweep, world: ivl.World
) -> None:
    monkeypatch.setattr(source, "valid", lambda outcomes: np.arange(outcomes.size) % 6 > 0)
    log = trials.run(small, world, [Trial(2.5, 60.0, 0)])
    table = work.tables.trials_table(small, "wide_long", log).to_pandas().iloc[0]
    assert table["n_discarded"] == 5
    assert table["n_recent"] == 15
    assert np.isnan(log.reward[0, :, 0]).all()
    assert table["best_stream"] % 6 != 0
    assert (work.tables.episodes_table(small, "wide_long", log).to_pandas()["n_scored"] == 5).all()
