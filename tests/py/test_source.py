import numpy as np
import pytest

import ivl
from ivl import cli, native
from ivl.errors import RolloutError
from ivl.experiment import Experiment
from ivl.source import Plan, WorldSource


def test_the_world_flies_a_plan_row_by_row_as_it_would_alone(small: Experiment) -> None:
    world = small.make_world()
    theta = np.array([[4.5, 7.0], [4.8, 8.0], [5.0, 9.0]])
    seed, stream = np.array([1, 2, 3], dtype=np.uint64), np.array([7, 8, 9], dtype=np.uint64)
    flown = list(WorldSource(world, small, threads=2).fly(Plan(theta, seed, stream)))
    index = np.concatenate([portion.index for portion in flown])
    assert sorted(index.tolist()) == [0, 1, 2]
    for portion in flown:
        assert portion.discarded == ""
        for i, outcome in zip(portion.index, portion.outcomes, strict=True):
            alone = world.rollouts(
                small.speed_mps, small.angle_deg, *theta[i], seed=seed[i], stream=stream[i], start=small.start
            )
            assert outcome.tobytes() == alone.tobytes()


def test_a_rollout_that_the_simulation_could_not_finish_is_discarded_with_the_reason(
    small: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = small.make_world()
    not_finite = next(code for code in range(20) if native.library().end_reason(code) == "not_finite")
    original = ivl.World.rollouts

    def broken(self: ivl.World, *args: object, **kw: object) -> np.recarray:
        outcomes = original(self, *args, **kw)  # type: ignore[arg-type]
        outcomes.end_reason[1] = not_finite
        return outcomes

    monkeypatch.setattr(ivl.World, "rollouts", broken)
    plan = Plan(np.full((3, 2), (4.8, 8.0)), np.zeros(3, dtype=np.uint64), np.arange(3, dtype=np.uint64))
    scored, discarded = WorldSource(world, small).fly(plan)
    assert (scored.index.tolist(), scored.discarded) == ([0, 2], "")
    assert (discarded.index.tolist(), discarded.discarded) == ([1], "simulation: not_finite")


@pytest.mark.parametrize(("speed_mps", "angle_deg"), [(0.1, 20.0), (0.1, 90.0), (0.12, 25.0)])
def test_a_start_in_the_ceiling_is_refused_and_not_learned_from(
    small: Experiment, speed_mps: float, angle_deg: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """The body reaches further up than the approach is long: speed x 1 s."""
    world, own = small.make_world(), small.model_copy(update={"speed_mps": speed_mps, "angle_deg": angle_deg})
    plan = Plan(np.full((3, 2), (4.8, 8.0)), np.zeros(3, dtype=np.uint64), np.arange(3, dtype=np.uint64))
    if speed_mps * np.sin(np.radians(angle_deg)) > 0.09:
        assert sum(len(portion.outcomes) for portion in WorldSource(world, own).fly(plan)) == 3
        return
    with pytest.raises(RolloutError, match="no landing can begin: the start lies in the ceiling"):
        list(WorldSource(world, own).fly(plan))
    trace = world.trace(speed_mps, angle_deg, 4.8, 8.0)
    assert world.end_reason(trace.outcome.end_reason) == "refused"
    policy = ["--rrev", "4.8", "--moment", "8", "--json"]
    assert cli.run(["rollout", "--speed", str(speed_mps), "--angle", str(angle_deg), *policy]) == 2
    assert capsys.readouterr().err.count("\n") == 1
