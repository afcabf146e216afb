import numpy as np
import pytest

import ivl
from ivl import assess, native
from ivl.assess import Best, Verdict
from ivl.experiment import Experiment, GridAxis
from ivl.layout import layout_of
from ivl.learning.loop import LearningRun, trials_of
from ivl.learning.recorder import EpisodeRow, RolloutRows
from ivl.source import WorldSource
from ivl.store import SCHEMA_VERSION, RunStore

GOOD, BAD = (4.8, 8.0), (2.0, 3.0)
BEST = Best(GOOD, 1.0, 1.0, 0)


def history(trials: list[list[tuple[float, float]]]) -> list[EpisodeRow]:
    """Episodes with the given recommendations."""
    return [
        EpisodeRow(trial, k, 4, policy, (0.1, 0.1), policy, 1.0, 0.0, 0.0, False)
        for trial, policies in enumerate(trials)
        for k, policy in enumerate(policies)
    ]


def rollouts(n_trials: int, n_legs: list[int], body: list[int] | None = None) -> RolloutRows:
    """The same 16 rollouts for every trial."""
    n = n_trials * 16
    outcomes = np.zeros(n, dtype=native.library().outcome_dtype)
    outcomes["n_legs"] = np.tile(n_legs, n_trials)
    outcomes["body_contact"] = np.tile(body or [0] * 16, n_trials)
    k = np.arange(n) % 16
    return RolloutRows(
        trial=np.arange(n) // 16,
        episode=k // 4,
        idx=k % 4,
        stream=k.astype(np.uint64),
        status=np.array(["scored"] * n),
        theta=np.zeros((n, 2)),
        reward=np.zeros(n),
        outcomes=outcomes,
    )


def judge(small: Experiment, world: ivl.World, trials: list[list[tuple[float, float]]], **kw: object) -> list[Verdict]:
    rows = rollouts(len(trials), **({"n_legs": [4] * 16} | kw))  # type: ignore[arg-type]
    return assess.judge(world, small, BEST, history(trials), rows)


def test_convergence_is_the_first_check_from_which_on_all_are_good(small: Experiment, world: ivl.World) -> None:
    trials = [
        [GOOD, GOOD, GOOD, GOOD],
        [BAD, BAD, GOOD, GOOD],
        [GOOD, GOOD, BAD, GOOD],
        [GOOD, GOOD, GOOD, BAD],
        [BAD, BAD, BAD, BAD],
    ]
    verdicts = judge(small, world, trials)
    assert [v.rollouts_to_convergence for v in verdicts] == [4, 12, 16, None, None]
    assert [v.solved for v in verdicts] == [True, True, True, False, False]
    assert [v.stuck for v in verdicts] == [False, False, False, True, True]
    assert verdicts[0].rate_four_leg == 1.0
    assert verdicts[4].rate_four_leg == 0.0


def test_a_vehicle_that_can_never_land_is_never_solved(small: Experiment, world: ivl.World) -> None:
    never = Best(GOOD, 0.0, 0.0, 0)
    for policies in ([BAD] * 4, [GOOD] * 4):
        (verdict,) = assess.judge(world, small, never, history([policies]), rollouts(1, [0] * 16))
        assert (verdict.solved, verdict.rollouts_to_convergence, verdict.stuck) == (False, None, False)
        assert verdict.failed_landings == verdict.failed_landings_total == 16


def test_failures_are_counted_up_to_convergence_and_in_all(small: Experiment, world: ivl.World) -> None:
    n_legs = [0, 4, 2, 4, 4, 4, 1, 4, 3, 4, 4, 0, 2, 4, 4, 4]
    body = [1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]
    solved, not_solved = judge(
        small, world, [[BAD, GOOD, GOOD, GOOD], [GOOD, GOOD, GOOD, BAD]], n_legs=n_legs, body=body
    )
    assert (solved.failed_landings, solved.failed_landings_total, solved.body_contacts) == (3, 5, 2)
    assert (not_solved.failed_landings, not_solved.failed_landings_total, not_solved.body_contacts) == (5, 5, 3)


def test_a_trial_that_stopped_keeps_its_last_recommendation(small: Experiment, world: ivl.World) -> None:
    assert judge(small, world, [[BAD, GOOD]])[0].rollouts_to_convergence == 8


def test_a_verdict_does_not_depend_on_the_other_trials(small: Experiment, world: ivl.World) -> None:
    noisy = small.model_copy(update={"policy": small.policy})
    edge = (4.62, 7.0)
    together = judge(noisy, world, [[edge] * 4, [GOOD] * 4, [edge] * 4])
    alone = judge(noisy, world, [[edge] * 4])
    assert together[0] == alone[0]


def test_the_best_policy_lands_and_its_search_is_reproducible(small: Experiment, world: ivl.World) -> None:
    stages: list[tuple[int, int]] = []
    best = assess.find_best(world, small, on_stage=lambda k, n: stages.append((k, n)))
    assert stages == [(0, 4), (1, 4), (2, 4), (3, 4)]
    assert best.rate_four_leg > 0.9
    assert 4.5 <= best.theta[0] <= 5.0
    assert 7.0 <= best.theta[1] <= 9.0
    assert best == assess.find_best(world, small, threads=1)


def test_the_best_policy_beats_every_point_of_its_grid(small: Experiment) -> None:
    grid = {**small.check.grid, "moment_y_Nmm": GridAxis(lo=3, hi=8, step=1)}
    chosen = small.model_copy(update={"check": small.check.model_copy(update={"effort": 0.2, "grid": grid})})
    world = ivl.World("habas2021", "wide_short", "as_simulated", **{"sense.velocity_noise": 0.05})
    best = assess.find_best(world, chosen)
    theta = assess._grid(assess._axes(chosen))
    out = world.rollouts(2.5, 90.0, theta[:, :1], theta[:, 1:], stream=np.arange(300), seed=99)
    rates = ivl.four_leg(out).mean(axis=1)
    assert best.rate_four_leg > rates.max() - 0.07


@pytest.mark.parametrize(
    ("lo", "hi", "step", "n", "last"), [(0.5, 10.0, 0.05, 191, 10.0), (1.0, 2.0, 0.3, 4, 1.9), (0.0, 0.3, 0.1, 4, 0.3)]
)
def test_a_grid_axis_covers_its_range(lo: float, hi: float, step: float, n: int, last: float) -> None:
    grid = assess._grid([GridAxis(lo=lo, hi=hi, step=step), GridAxis(lo=0.0, hi=1.0, step=1.0)])
    values = np.unique(grid[:, 0])
    assert len(values) == n
    assert values[-1] == pytest.approx(last)


def verdict(rollouts_needed: int | None, failed: int, stuck: bool = False) -> Verdict:
    return Verdict(0, rollouts_needed is not None, rollouts_needed, 1.0, 0.5, failed, failed + 1, 2, stuck)


def test_summary_counts_trials_that_never_converged_as_infinitely_late() -> None:
    summary = assess.summarise([verdict(8, 5), verdict(16, 6), verdict(24, 7), verdict(None, 99, stuck=True)])
    assert (summary["trials"], summary["solved"], summary["stuck"], summary["stuck_trials"]) == (4, 3, 0.25, 1)
    assert summary["rollouts_to_convergence"] == {"median": 16.0, "p90": None}
    assert summary["failed_landings"]["median"] == 6.0
    assert summary["landing_rate_clean"] == 0.5


def test_summary_begins_with_the_keys_that_scripts_rely_on() -> None:
    keys = list(assess.summarise([verdict(8, 5)]))
    assert keys[:3] == ["trials", "solved", "rollouts_to_convergence"]
    assert {"failed_landings", "stuck"} <= set(keys)


def test_a_real_run_is_judged_from_its_store(small: Experiment, world: ivl.World, tmp_path: object) -> None:
    dtype = native.library().outcome_dtype
    manifest = {"schema_version": SCHEMA_VERSION}
    with RunStore.create(tmp_path / "run", "", manifest, dtype, layout_of(small)) as store:  # type: ignore[operator]
        LearningRun(trials_of(small, 2), WorldSource(world, small), store).run()
        verdicts = assess.judge(world, small, BEST, store.episodes(), store.rollouts())
        failed = (store.rollouts(trial=1).outcomes["n_legs"] < 3).sum()
    assert verdicts[1].failed_landings_total == failed


def test_a_search_goes_on_where_the_vehicle_refuses_a_part_of_the_box(
    small: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(assess, "GRID_DIMENSIONS_MAX", 1)
    chosen = small.model_copy(update={"check": small.check.model_copy(update={"effort": 0.05})})
    world = ivl.World("habas2021", "wide_short", "as_simulated", **{"firmware.flip_moment_max": 0.0085})
    best = assess.find_best(world, chosen)
    assert best.rate_four_leg > 0.5
    assert best.theta[1] <= 8.5
