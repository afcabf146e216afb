import math
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from ivl import experiment, native
from ivl.errors import RolloutError
from ivl.experiment import Experiment
from ivl.layout import layout_of
from ivl.learners import EpheBelief
from ivl.learning.loop import LearningRun, Progress, recent_rate, trials_of
from ivl.learning.recorder import EpisodeRow
from ivl.source import Flown, Plan, WorldSource
from ivl.store import SCHEMA_VERSION, RunStore

DTYPE = native.library().outcome_dtype
LAYOUT = layout_of(experiment.load("experiments/paper_vertical.yaml"))
N_TRIALS = 3


def create(folder: Path) -> RunStore:
    return RunStore.create(folder, "", {"schema_version": SCHEMA_VERSION}, DTYPE, LAYOUT)


def reopen(folder: Path) -> RunStore:
    return RunStore.open_existing(folder, DTYPE)


def contents(folder: Path) -> list[list[tuple[object, ...]]]:
    """Every row of every table, exactly."""
    with reopen(folder) as store:
        tables = ("rollout", "episode", "learner")
        return [store._db.execute(f"SELECT * FROM {table} ORDER BY 1, 2").fetchall() for table in tables]


def learn(experiment: Experiment, store: RunStore, n_trials: int = N_TRIALS) -> None:
    LearningRun(trials_of(experiment, n_trials), WorldSource(experiment.make_world(), experiment), store).run()


@pytest.fixture
def whole(small: Experiment, tmp_path: Path) -> list[list[tuple[object, ...]]]:
    """What an uninterrupted run leaves."""
    with create(tmp_path / "whole") as store:
        learn(small, store)
    return contents(tmp_path / "whole")


class Portions:
    """A source that returns a plan in small portions, last row first, as a slow vehicle would."""

    def __init__(self, source: WorldSource, size: int = 3) -> None:
        self.source, self.size = source, size

    def fly(self, plan: Plan) -> Iterator[Flown]:
        (flown,) = self.source.fly(plan)
        order = flown.index[::-1]
        for first in range(0, len(order), self.size):
            rows = order[first : first + self.size]
            yield Flown(rows, flown.outcomes[rows])

    def battery_V(self) -> float:
        return math.nan


class Failing(Portions):
    """A source that breaks down after some portions."""

    def __init__(self, source: WorldSource, portions: int) -> None:
        super().__init__(source)
        self.left = portions

    def fly(self, plan: Plan) -> Iterator[Flown]:
        for flown in super().fly(plan):
            if self.left == 0:
                raise RolloutError("link lost")
            self.left -= 1
            yield flown


class Discarding(Portions):
    """A source whose operator discards the rollouts of some places within the episode."""

    def __init__(self, source: WorldSource, rejected: set[int]) -> None:
        super().__init__(source, size=1)
        self.rejected = rejected

    def fly(self, plan: Plan) -> Iterator[Flown]:
        for flown in super().fly(plan):
            discarded = int(plan.stream[flown.index[0]]) % 4 in self.rejected
            yield Flown(flown.index, flown.outcomes, "wind" if discarded else "")


def test_a_learner_with_a_belief_hears_of_the_battery_before_each_episode(
    small: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[float] = []
    monkeypatch.setattr(EpheBelief, "take_battery", lambda _, battery_V: heard.append(battery_V))
    monkeypatch.setattr(WorldSource, "battery_V", lambda _: 3.9)
    chosen = small.learner.model_copy(update={"name": "ephe_belief", "options": {}})
    believing = small.model_copy(update={"learner": chosen})
    with create(tmp_path / "run") as store:
        LearningRun(trials_of(believing, 2), WorldSource(small.make_world(), small), store).run()
    assert heard == [3.9] * 8, "two trials, four episodes"


def test_a_run_flies_its_budget_and_reports_every_episode(small: Experiment, tmp_path: Path) -> None:
    seen: list[Progress] = []
    with create(tmp_path / "run") as store:
        LearningRun(trials_of(small, 2), WorldSource(small.make_world(), small), store).run(seen.append)
        rollouts = store.rollouts()
    assert [p.episode for p in seen] == [1, 2, 3, 4]
    assert [len(p.rows) for p in seen] == [2] * 4
    assert seen[-1].n_flown == 32
    assert seen[-1].rollouts_per_s > 0
    assert (rollouts.status == "scored").all()
    assert rollouts.stream[rollouts.trial == 1].tolist() == list(range(16))


def test_episode_rows_agree_with_the_rollouts(small: Experiment, tmp_path: Path) -> None:
    with create(tmp_path / "run") as store:
        learn(small, store, 1)
        rollouts, episodes = store.rollouts(), store.episodes()
    for row in episodes:
        chosen = rollouts.episode == row.episode
        assert row.n_scored == chosen.sum() == 4
        assert row.reward_mean == rollouts.reward[chosen].mean()
        assert row.rate_four_leg == (rollouts.outcomes["n_legs"][chosen] >= 3).mean()
    assert recent_rate(episodes) == pytest.approx(np.mean([row.rate_four_leg for row in episodes[-3:]]))


def test_trial_k_of_many_is_the_single_run_with_its_seed(small: Experiment, tmp_path: Path) -> None:
    with create(tmp_path / "many") as store:
        learn(small, store)
        many = store.rollouts(trial=2)
    alone_experiment = small.model_copy(update={"seed": small.seed + 2})
    with create(tmp_path / "one") as store:
        learn(alone_experiment, store, 1)
        alone = store.rollouts()
    assert many.theta.tobytes() == alone.theta.tobytes()
    assert many.outcomes.tobytes() == alone.outcomes.tobytes()


def test_the_order_in_which_results_come_does_not_matter(
    small: Experiment, tmp_path: Path, whole: list[list[tuple[object, ...]]]
) -> None:
    with create(tmp_path / "run") as store:
        LearningRun(trials_of(small, N_TRIALS), Portions(WorldSource(small.make_world(), small)), store).run()
    assert contents(tmp_path / "run") == whole


@pytest.mark.parametrize("portions", [0, 1, 3, 4, 5, 9, 14])
def test_a_run_continues_after_its_source_broke_down(
    small: Experiment, tmp_path: Path, whole: list[list[tuple[object, ...]]], portions: int
) -> None:
    world_source = WorldSource(small.make_world(), small)
    with create(tmp_path / "run") as store:
        run = LearningRun(trials_of(small, N_TRIALS), Failing(world_source, portions), store)
        with pytest.raises(RolloutError, match="link lost"):
            run.run()
    with reopen(tmp_path / "run") as store:
        learn(small, store)
    assert contents(tmp_path / "run") == whole


def killed_at_commit(experiment: Experiment, folder: Path, n: int, before: bool) -> bool:
    """Run in a forked process that kills itself around its n-th commit; True if it lived to the end."""
    child = os.fork()
    if child == 0:
        try:
            kill_at_commit(n, before)
            learn(experiment, reopen(folder) if (folder / "manifest.json").exists() else create(folder))
            os._exit(0)
        finally:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    if os.WIFEXITED(status):
        assert os.WEXITSTATUS(status) == 0
        return True
    assert os.WTERMSIG(status) == signal.SIGKILL
    return False


def kill_at_commit(n: int, before: bool) -> None:
    """From here on the n-th transaction of this process ends in SIGKILL, just before or just after its COMMIT."""
    original = RunStore._transaction
    count = 0

    @contextmanager
    def deadly(store: RunStore) -> Iterator[None]:
        nonlocal count
        count += 1
        with original(store):
            yield
            if count == n and before:
                os.kill(os.getpid(), signal.SIGKILL)
        if count == n:
            os.kill(os.getpid(), signal.SIGKILL)

    RunStore._transaction = deadly  # type: ignore[method-assign]


@pytest.mark.parametrize("before", [True, False])
def test_a_run_killed_around_any_commit_continues_bit_for_bit(
    small: Experiment, tmp_path: Path, whole: list[list[tuple[object, ...]]], before: bool
) -> None:
    n_commits = 1 + 3 * small.n_episodes
    for n in range(1, n_commits + 1):
        folder = tmp_path / f"killed-{n}"
        assert not killed_at_commit(small, folder, n, before)
        with reopen(folder) if (folder / "manifest.json").exists() else create(folder) as store:
            learn(small, store)
        assert contents(folder) == whole


def test_a_run_killed_again_and_again_gets_to_the_same_end(
    small: Experiment, tmp_path: Path, whole: list[list[tuple[object, ...]]]
) -> None:
    kills = 0
    while not killed_at_commit(small, tmp_path / "run", 2, before=kills % 2 == 0):
        kills += 1
        assert kills < 60
    assert kills > 5
    assert contents(tmp_path / "run") == whole


@pytest.mark.parametrize("learner", ["ephe", "cmaes", "bo"])
def test_every_kind_of_learner_continues_in_mid_episode(small: Experiment, tmp_path: Path, learner: str) -> None:
    chosen = small.model_copy(update={"learner": small.learner.model_copy(update={"name": learner})})
    with create(tmp_path / "whole") as store:
        learn(chosen, store, 1)
    source = Failing(WorldSource(chosen.make_world(), chosen), portions=5)
    with create(tmp_path / "run") as store, pytest.raises(RolloutError):
        LearningRun([chosen], source, store).run()
    with reopen(tmp_path / "run") as store:
        learn(chosen, store, 1)
    assert contents(tmp_path / "run") == contents(tmp_path / "whole")


def test_discarded_rollouts_do_not_count(small: Experiment, tmp_path: Path) -> None:
    source = Discarding(WorldSource(small.make_world(), small), {1})
    with create(tmp_path / "run") as store:
        LearningRun([small], source, store).run()
        rollouts, episodes = store.rollouts(), store.episodes()
    assert (rollouts.status == "discarded").sum() == 4
    assert [row.n_scored for row in episodes] == [3] * 4


def test_an_episode_of_which_everything_was_discarded_changes_nothing(small: Experiment, tmp_path: Path) -> None:
    source = Discarding(WorldSource(small.make_world(), small), {0, 1, 2, 3})
    with create(tmp_path / "run") as store:
        LearningRun([small], source, store).run()
        episodes = store.episodes()
    assert {row.mu for row in episodes} == {(4.8, 8.0)}
    assert np.isnan(recent_rate(episodes))


def test_a_finished_run_flies_nothing_more(small: Experiment, tmp_path: Path) -> None:
    with create(tmp_path / "run") as store:
        learn(small, store)
        before = store._db.total_changes
        learn(small, store)
        assert store._db.total_changes == before


def test_a_learner_that_stops_is_not_asked_again(
    small: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ivl.learners.ephe.EPHE.stop", lambda self: self.result.n_updates == 2)
    with create(tmp_path / "run") as store:
        learn(small, store, 2)
        assert [(row.trial, row.episode, row.stopped) for row in store.episodes()] == [
            (0, 0, False), (0, 1, True), (1, 0, False), (1, 1, True)
        ]  # fmt: skip


def test_recent_rate_covers_the_last_three_episodes_of_each_trial() -> None:
    def row(trial: int, episode: int, rate: float) -> EpisodeRow:
        return EpisodeRow(trial, episode, 8, (0, 0), (0, 0), (0, 0), 0.0, rate, rate / 2, False)

    history = [row(0, k, rate) for k, rate in enumerate((1.0, 0.0, 0.5, 1.0))] + [row(1, 0, 0.25)]
    assert recent_rate(history, trial=0) == pytest.approx(0.5)
    assert recent_rate(history) == pytest.approx((0.0 + 0.5 + 1.0 + 0.25) / 4)
    assert recent_rate(history, trial=0, clean_only=True) == pytest.approx(0.25)
