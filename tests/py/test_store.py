import json
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ivl import native, store
from ivl.errors import StoreError
from ivl.layout import Layout
from ivl.learning.recorder import Amendment, EpisodeRow
from ivl.quantity import Quantity
from ivl.rewards import RewardChoice
from ivl.store import RunStore

DTYPE = native.library().outcome_dtype
MANIFEST = {"schema_version": store.SCHEMA_VERSION, "seed": 0}
PAPER = RewardChoice(name="paper")
LAYOUT = Layout((Quantity("gap_m", "m", "first"), Quantity("push_N", "N", "second")), PAPER.reward.terms)
THETA = np.array([[4.0, 5.0], [4.1, 5.1], [0.1 + 0.2, 1e-17]])


def outcomes(n: int) -> np.ndarray:
    """Records with awkward values: NaN, subnormal, a large number, long fractions."""
    records = np.zeros(n, dtype=DTYPE)
    records["d_min_m"] = 1 / 3
    records["t_trigger_s"] = np.nan
    records["vx_impact_mps"] = -1.7e308
    records["vz_impact_mps"] = 5e-324
    records["leg_order"] = [4, 1, 3, 2]
    records["n_steps"] = 2**32 - 1
    return records


@pytest.fixture
def run(tmp_path: Path) -> Iterator[RunStore]:
    with RunStore.create(tmp_path / "run", "a: 1\n", MANIFEST, DTYPE, LAYOUT) as opened:
        yield opened


def plan(run: RunStore, episode: int = 0, trials: tuple[int, ...] = (0, 1)) -> None:
    streams = np.arange(3 * episode, 3 * episode + 3, dtype=np.uint64)
    run.plan(episode, trials, streams, [THETA + trial for trial in trials], [{"asked": episode}] * len(trials))


def score(run: RunStore, keys: list[tuple[int, int, int]], discarded: str = "") -> None:
    records = outcomes(len(keys))
    trial, episode, idx = np.array(keys).T
    assert len(set(episode.tolist())) == 1
    run.score(int(episode[0]), trial, idx, records, PAPER.score(records), discarded)


def row(trial: int, episode: int) -> EpisodeRow:
    return EpisodeRow(trial, episode, 3, (1.0, 2.0), (0.1, 0.2), (1.5, 2.5), 10.0, 0.5, float("nan"), False)


def test_a_new_folder_holds_config_manifest_and_an_empty_database(run: RunStore) -> None:
    assert (run.folder / "config.yaml").read_text() == "a: 1\n"
    assert json.loads((run.folder / "manifest.json").read_text()) == MANIFEST
    assert len(run.rollouts()) == 0
    assert run.episodes() == []
    assert run.learner_states() == {}


def test_commits_are_durable(run: RunStore) -> None:
    assert run._db.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert run._db.execute("PRAGMA synchronous").fetchone() == (2,)


def test_planned_rollouts_come_back_with_their_exact_policies(run: RunStore) -> None:
    plan(run)
    rows = run.rollouts(trial=1)
    assert rows.status.tolist() == ["planned"] * 3
    assert (rows.theta == THETA + 1).all()
    assert np.isnan(rows.reward).all()
    assert rows.stream.tolist() == [0, 1, 2]
    assert run.learner_states() == {0: {"asked": 0}, 1: {"asked": 0}}


def test_outcomes_come_back_bit_for_bit(run: RunStore) -> None:
    plan(run)
    score(run, [(0, 0, 2), (0, 0, 0)])
    rows = run.rollouts(trial=0)
    assert rows.status.tolist() == ["scored", "planned", "scored"]
    assert rows.outcomes[[0, 2]].tobytes() == outcomes(2).tobytes()
    paid = PAPER.score(outcomes(1))
    assert rows.reward[0] == paid.pop("total")[0]
    assert {name: values[0] for name, values in rows.terms.items()} == {name: value[0] for name, value in paid.items()}
    assert all(np.isnan(values[1]) for values in rows.terms.values())


def test_columns_are_named_after_the_policy_and_the_reward(run: RunStore) -> None:
    rollout, episode = (
        [column[1] for column in run._db.execute(f"PRAGMA table_info({table})")] for table in ("rollout", "episode")
    )
    assert rollout[6:12] == ["gap_m", "push_N", "reward", "reward_distance", "reward_angle", "reward_legs"]
    assert episode[3:9] == [f"{prefix}_{name}" for prefix in ("mu", "sigma", "recommended") for name in rollout[6:8]]


@pytest.mark.parametrize("dim", [1, 3])
def test_a_policy_has_any_number_of_parameters(tmp_path: Path, dim: int) -> None:
    layout = Layout(tuple(Quantity(f"p{i}", "1", "") for i in range(dim)), PAPER.reward.terms)
    theta = np.arange(2.0 * dim).reshape(2, dim)
    known = EpisodeRow(0, 0, 2, (1.0,) * dim, (2.0,) * dim, (3.0,) * dim, 1.0, 0.5, 0.0, False)
    with RunStore.create(tmp_path / "run", "", MANIFEST, DTYPE, layout) as run:
        run.plan(0, [0], np.arange(2, dtype=np.uint64), [theta], [{}])
        run.finish_episode([known], [{}])
    with RunStore.open_existing(tmp_path / "run", DTYPE) as run:
        assert run.layout == layout
        assert (run.rollouts().theta == theta).all()
        assert run.episodes() == [known]
        assert run.rollouts(episode=1).theta.shape == (0, dim)


def test_a_discarded_rollout_keeps_its_reason(run: RunStore) -> None:
    plan(run)
    score(run, [(0, 0, 1)], discarded="wind")
    assert run.rollouts(trial=0).status[1] == "discarded"
    assert run._db.execute("SELECT discarded FROM rollout WHERE idx=1 AND trial=0").fetchone() == ("wind",)


@pytest.mark.parametrize("key", [(0, 0, 0), (9, 0, 0), (0, 1, 0)])
def test_scoring_what_was_not_planned_or_is_scored_already_is_refused_as_a_whole(run: RunStore, key: Any) -> None:
    plan(run)
    score(run, [(0, 0, 0)])
    with pytest.raises(StoreError, match="were not planned"):
        score(run, [(0, key[1], 1), key])
    assert run.rollouts(trial=0).status.tolist() == ["scored", "planned", "planned"]


def test_planning_an_episode_twice_is_refused_and_changes_nothing(run: RunStore) -> None:
    plan(run)
    with pytest.raises(sqlite3.IntegrityError):
        plan(run)
    assert len(run.rollouts()) == 6


def test_an_episode_and_the_learner_states_are_committed_together_or_not_at_all(run: RunStore) -> None:
    plan(run)
    with pytest.raises(ValueError, match="not JSON compliant"):
        run.finish_episode([row(0, 0), row(1, 0)], [{"told": 1}, {"told": float("nan")}])
    assert run.episodes() == []
    assert run.learner_states()[0] == {"asked": 0}
    run.finish_episode([row(0, 0), row(1, 0)], [{"told": 1}, {"told": 2}])
    assert [(r.trial, r.episode) for r in run.episodes()] == [(0, 0), (1, 0)]
    assert run.learner_states() == {0: {"told": 1}, 1: {"told": 2}}


def test_episode_rows_come_back_as_they_were(run: RunStore) -> None:
    run.finish_episode([row(0, 0)], [{}])
    back = run.episodes()[0]
    assert np.isnan(back.rate_clean)
    assert back.mu == (1.0, 2.0)
    assert (back.sigma, back.recommended, back.rate_four_leg, back.stopped) == ((0.1, 0.2), (1.5, 2.5), 0.5, False)


@pytest.mark.parametrize(
    ("texts", "rows"),
    [
        ([], None),
        ([None, None], None),
        (["[]"], None),
        ([None, "[1.0, null]"], [[np.nan, np.nan], [1.0, np.nan]]),
        (["[1.0, 2.0]", "[3.0, 4.0]"], [[1.0, 2.0], [3.0, 4.0]]),
    ],
)
def test_recordings_come_back_with_nothing_where_there_is_nothing(texts: list[str | None], rows: Any) -> None:
    back = store._recordings(texts)
    assert back is None if rows is None else np.array_equal(back, rows, equal_nan=True)


def test_an_amended_rollout_has_its_own_terms_and_no_other_has(run: RunStore) -> None:
    plan(run)
    score(run, [(0, 0, 0), (0, 0, 1)])
    whole = run.rollouts()
    own, other = whole.of_rows(np.array([0])), whole.of_rows(np.array([1]))
    terms = {name: np.array([1.0 + i]) for i, name in enumerate(own.terms)}
    made = Amendment(0, 0, 0, "2026-01-01T00:00:00+00:00", "anna", "seen", "legs 4", "legs 2")
    after = replace(own, status=np.array(["discarded"]), terms=terms, reward=np.array([7.0]))
    run.amend(after, "amended: seen", made, lambda: ([], {}))
    back = run.rollouts()
    assert {name: float(values[0]) for name, values in back.terms.items()} == {k: float(v[0]) for k, v in terms.items()}
    assert (back.reward[0], back.status[0]) == (7.0, "discarded")
    assert {name: float(values[1]) for name, values in back.terms.items()} == {
        name: float(values[0]) for name, values in other.terms.items()
    }


def test_what_a_learner_expects_is_kept_as_numbers_or_not_at_all(run: RunStore) -> None:
    run.finish_episode([replace(row(0, 0), insight={"expected_rate": 0.5})], [{}])
    assert run.episodes()[0].insight == {"expected_rate": 0.5}
    with pytest.raises(ValueError, match="not JSON compliant"):
        run.finish_episode([replace(row(0, 1), insight={"expected_rate": float("nan")})], [{}])
    assert len(run.episodes()) == 1


def test_learner_states_keep_big_integers(run: RunStore) -> None:
    run.finish_episode([row(0, 0)], [{"state": 2**128 - 1}])
    assert run.learner_states()[0] == {"state": 2**128 - 1}


def test_a_run_is_found_again_after_closing(tmp_path: Path) -> None:
    with RunStore.create(tmp_path / "run", "a: 1\n", MANIFEST, DTYPE, LAYOUT) as run:
        plan(run)
    with RunStore.open_existing(tmp_path / "run", DTYPE) as run:
        assert len(run.rollouts()) == 6


def test_a_folder_with_a_run_is_not_overwritten(run: RunStore) -> None:
    run.close()
    with pytest.raises(StoreError, match="holds a run already: continue it with --resume"):
        RunStore.create(run.folder, "", MANIFEST, DTYPE, LAYOUT)


def test_a_folder_with_something_else_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(StoreError, match=r"is not empty \(thesis\.tex"):
        RunStore.create(tmp_path, "", MANIFEST, DTYPE, LAYOUT)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


@pytest.mark.parametrize(
    "left",
    ["run.sqlite-journal", "run.sqlite-wal", "run.sqlite-shm", "config.yaml", ".ivl-0123456789abcdef.part.json"],
)
def test_a_creation_that_was_cut_off_is_started_over(tmp_path: Path, left: str) -> None:
    (tmp_path / "run.sqlite").write_bytes(b"half a file")
    (tmp_path / left).write_text("a")
    with RunStore.create(tmp_path, "a: 1\n", MANIFEST, DTYPE, LAYOUT) as run:
        assert len(run.rollouts()) == 0


def test_a_run_is_locked_against_other_processes_until_its_process_ends(run: RunStore) -> None:
    code = (
        "import sys; from pathlib import Path; from ivl.store import RunStore; from ivl import native\n"
        "RunStore.open_existing(Path(sys.argv[1]), native.library().outcome_dtype)"
    )
    command = [sys.executable, "-c", code, str(run.folder)]
    first = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "another process is working on this run" in first.stderr
    run.close()
    second = subprocess.run(command, capture_output=True, text=True, check=False)
    assert second.returncode == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "holds no run"),
        ("{", "cannot be read"),
        ("[]", "expected an object"),
        ('{"schema_version": 99}', "ivl of unknown version with schema version 99; this is ivl"),
    ],
)
def test_a_folder_that_cannot_be_continued_is_refused(tmp_path: Path, text: str | None, message: str) -> None:
    if text is not None:
        (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(StoreError, match=message):
        RunStore.open_existing(tmp_path, DTYPE)


def test_a_run_with_other_outcome_columns_is_refused(run: RunStore) -> None:
    run._db.execute("ALTER TABLE rollout RENAME COLUMN out_d_min_m TO out_other")
    run.close()
    with pytest.raises(StoreError, match="other columns") as first:
        RunStore.open_existing(run.folder, DTYPE)
    # who was refused does not hold the folder, even while somebody still looks at the error
    with pytest.raises(StoreError, match="other columns"):
        RunStore.open_existing(run.folder, DTYPE)
    assert first.traceback


def test_a_damaged_database_is_refused(tmp_path: Path) -> None:
    RunStore.create(tmp_path, "", MANIFEST, DTYPE, LAYOUT).close()
    for name in ("run.sqlite-wal", "run.sqlite-shm"):
        (tmp_path / name).unlink(missing_ok=True)
    (tmp_path / "run.sqlite").write_bytes(b"not a database, but long enough to look at" * 100)
    with pytest.raises(StoreError, match=r"run\.sqlite: "):
        RunStore.open_existing(tmp_path, DTYPE)


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="file/run: cannot be written"):
        RunStore.create(tmp_path / "file" / "run", "", MANIFEST, DTYPE, LAYOUT)
