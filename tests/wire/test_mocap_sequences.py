"""Random sequences of what cameras, a vehicle and a strange body do to the watch and the guard of motion capture.

Rules, for whatever order things come in:

- a pose that the vehicle cannot have is not believed in flight, and never in the next frame;
- what is believed is a pose of a frame, of finite numbers and unit length;
- while the body is lost before the trigger, an abort is asked for at every look that is due, and the flight is not
  scored; from the trigger on none is asked for;
- a good body is never aborted; no input raises anything.
"""

import math
import os

import pytest
from hypothesis import Phase as Stage
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from ivl.errors import RolloutError
from ivl.links.packets import Phase
from ivl.mocap import watch
from ivl.mocap.config import MocapConfig
from ivl.mocap.guard import AGAIN_S, BEFORE_TRIGGER, IN_FLIP, LossGuard
from ivl.mocap.watch import Pose, Status, Watch, make_pose

N_SEQUENCES = int(os.environ.get("IVL_SEQUENCES", "40"))
FRAME_S = 0.01
CONFIG = MocapConfig(system="mock", body="ivl")
FAR_M = 0.15
played = {"sequences": 0, "frames": 0, "strange": 0, "aborts": 0}
odd = st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 1e308, 1e-308, 5.0])


class Machine(RuleBasedStateMachine):
    """A vehicle that moves as a vehicle can, and cameras that do not always see it."""

    @initialize(settles=st.booleans())
    def begin(self, settles: bool) -> None:
        played["sequences"] += 1
        self.watch = Watch(CONFIG)
        self.now_s = 10.0
        self.p_m = [0.0, 0.0, 1.0]
        self.v_mps = [0.0, 0.0, 0.0]
        self.t_true_s = -math.inf  # when a true pose was last believed
        self.phase = Phase.IDLE
        self.aborts: list[float] = []
        self.spoiled = 0
        self.t_lost_s: float | None = None
        self.guard = LossGuard(lambda: self.phase, lambda _: self.aborts.append(self.now_s), spoil=self.spoil)
        if settles:
            self.frames(40)

    def spoil(self, _reason: str) -> None:
        self.spoiled += 1

    # ---- frames

    def offer(self, pose: Pose | None, is_present: bool = True) -> Pose | None:
        played["frames"] += 1
        self.now_s += FRAME_S
        self.p_m = [p + v * FRAME_S for p, v in zip(self.p_m, self.v_mps, strict=True)]
        believed = self.watch.take(self.now_s, pose, is_present, self.guard.in_flight())
        if believed is not None:
            assert believed == pose, "a pose is believed that no frame had"
            assert all(map(math.isfinite, (*believed.p_W_m, *believed.q_WB)))
            assert math.hypot(*believed.q_WB) == pytest.approx(1.0)
        self.look()
        return believed

    def look(self) -> None:
        before = len(self.aborts)
        status = self.watch.status(self.now_s)
        last_s = self.aborts[-1] if self.aborts else -math.inf
        self.guard.look(status, str(status), self.now_s)
        asked = len(self.aborts) - before
        played["aborts"] += asked
        is_due = status is not Status.GOOD and self.phase in BEFORE_TRIGGER and self.now_s >= last_s + AGAIN_S
        if is_due:
            assert asked == 1, "a lost body before the trigger, and no abort"
            assert self.spoiled > 0, "a flight that was aborted is scored"
        if status is Status.GOOD or self.phase not in BEFORE_TRIGGER:
            assert asked == 0, "an abort that nothing asks for"

    def true_pose(self) -> Pose:
        # noise of cameras: no two poses are the same
        x, y, z = (p + 1e-6 * math.sin(1e3 * self.now_s + i) for i, p in enumerate(self.p_m))
        return Pose((x, y, z), (0.0, 0.0, 0.0, 1.0))

    @rule(n=st.integers(1, 60))
    def frames(self, n: int) -> None:
        for _ in range(n):
            if self.offer(self.true_pose()) is not None:
                self.t_true_s = self.now_s

    @rule(n=st.integers(1, 9), axis=st.integers(0, 2), away_m=st.floats(FAR_M, 3.0), sign=st.sampled_from([-1.0, 1.0]))
    def strange_body(self, n: int, axis: int, away_m: float, sign: float) -> None:
        """Another body is taken for the vehicle, near it but where it cannot be; the vehicle rests meanwhile."""
        self.v_mps = [0.0, 0.0, 0.0]
        for i in range(n):
            played["strange"] += 1
            values = list(self.true_pose().p_W_m)
            values[axis] += sign * away_m
            unseen_s = self.now_s + FRAME_S - self.t_true_s
            believed = self.offer(Pose((values[0], values[1], values[2]), (0.0, 0.0, 0.0, 1.0)))
            can_be_there = self.reach_m(unseen_s) >= away_m
            if not can_be_there and (i == 0 or self.guard.in_flight()):
                assert believed is None, "a pose that the vehicle cannot have is believed"

    def reach_m(self, unseen_s: float) -> float:
        """How far a vehicle can be from where it was believed, at the utmost; endless once it is lost."""
        if unseen_s > CONFIG.lost_s:
            return math.inf
        late_s = unseen_s + 1e-3 * CONFIG.jitter_ms_max + watch.VELOCITY_S
        return 4.0 * late_s + 0.5 * CONFIG.accel_mps2_max * late_s**2 + watch.SLACK_M

    @rule(n=st.integers(1, 15))
    def hidden(self, n: int) -> None:
        for _ in range(n):
            assert self.offer(None, is_present=False) is None

    @rule(values=st.lists(st.one_of(odd, st.floats()), max_size=9), up=st.sampled_from(["y", "z"]))
    def odd_pose(self, values: list[float], up: str) -> None:
        pose = make_pose(values, up)
        was_true_s = self.t_true_s
        if self.offer(pose) is not None:
            self.t_true_s = was_true_s if self.watch.pose is None else self.now_s
            self.p_m = list(self.watch.pose.p_W_m) if self.watch.pose else self.p_m

    @rule(n=st.integers(1, 20))
    def frozen(self, n: int) -> None:
        pose = self.true_pose()
        for _ in range(n):
            self.offer(pose)

    @rule(ms=st.integers(1, 700))
    def silence(self, ms: int) -> None:
        self.now_s += 1e-3 * ms
        self.v_mps = [0.0, 0.0, 0.0]
        self.look()

    # ---- the vehicle

    @rule(axis=st.integers(0, 2), dv_mps=st.floats(-0.15, 0.15))
    def accelerate(self, axis: int, dv_mps: float) -> None:
        self.v_mps[axis] = max(-3.0, min(3.0, self.v_mps[axis] + dv_mps))

    @rule(phase=st.sampled_from(list(Phase)))
    def enter(self, phase: Phase) -> None:
        self.phase = phase
        if phase is Phase.IDLE:
            self.end_of_flight()

    def end_of_flight(self) -> None:
        if self.guard.reason:
            with pytest.raises(RolloutError, match="aborted"):
                self.guard.check()
        self.guard.check()
        self.spoiled = 0

    @invariant()
    def flips_are_left_alone(self) -> None:
        if hasattr(self, "guard") and self.phase in IN_FLIP:
            before = len(self.aborts)
            self.look()
            assert len(self.aborts) == before


FEW = settings(
    max_examples=N_SEQUENCES, stateful_step_count=25, deadline=None, derandomize="IVL_SEQUENCES" not in os.environ
)


def test_no_sequence_of_frames_breaks_a_rule() -> None:
    run_state_machine_as_test(Machine, settings=FEW)
    print("mocap sequences:", " ".join(f"{name}={n}" for name, n in played.items()))


ENOUGH = settings(FEW, max_examples=300, phases=[Stage.generate])


def test_a_watch_that_believes_all_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Watch, "_is_believed", lambda *_: True)
    with pytest.raises(AssertionError, match="cannot have is believed"):
        run_state_machine_as_test(Machine, settings=ENOUGH)


def test_a_guard_that_does_not_look_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LossGuard, "look", lambda *_: None)
    with pytest.raises(AssertionError, match="a lost body before the trigger, and no abort"):
        run_state_machine_as_test(Machine, settings=ENOUGH)
