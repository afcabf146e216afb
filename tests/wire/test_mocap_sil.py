"""The whole way of a pose: software vehicle, cameras, a real client in its process, checks, and back into the vehicle.

It flies by these poses and by nothing else.
"""

import json
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from ivl import cli, forms
from ivl.cli import mocap as mocap_cli
from ivl.errors import RolloutError
from ivl.links import sil
from ivl.links.deadlines import Deadlines
from ivl.links.packets import Phase, Request
from ivl.links.tables import LogBlock, Session
from ivl.links.vehicle import Command, Vehicle
from ivl.mocap import watch
from ivl.mocap.config import MocapConfig
from ivl.mocap.guard import LossGuard
from ivl.mocap.simulated import SimulatedRoom
from ivl.mocap.stream import Mocap
from ivl.mocap.watch import Status
from ivl.silproc import SilProcess
from ivl.world import World

# A busy machine delays frames: what is slow there is not lost.  The vehicle lives slower than this machine, so that a
# loss that the host notices after a second, and a second that poses need to settle, are short for it.
CONFIG = MocapConfig(system="simulator", body="cf21", lost_s=1.0, frozen_s=1.0, settle_s=1.05)
SPEED = 0.3
# the vehicle itself may fly on its last pose, and without its host, for longer than that, so that it is the host who
# notices; poses that a busy machine delivers late look fast; and a loss that begins with the flip is noticed in it
LIMITS = {
    "ivl.speed_abort": 50.0,
    "ivl.stale_s_max": 1.0,
    "ivl.host_s_max": 10.0,
    "ivl.link_s_max": 10.0,
    "ivl.p_sigma_max": 10.0,
    "ivl.abort_hover_s": 0.3,
    "ivl.land_speed": 1.5,
    "ivl.attached_s": 0.5,
}
SLACK_M, SLACK_RAD = 0.3, 1.0
"""Frames that come in a bunch seem to be microseconds apart: what the body moves between two of them is no jump."""
DEADLINE_S = 60.0
LOG_PERIOD_MS = 10


class PhaseLog(LogBlock):
    """Every phase that the vehicle's log tells, in the link's thread, however late the test's own thread looks."""

    def __init__(self) -> None:
        self.phases: list[Phase] = []
        super().__init__(("ivl.phase",), LOG_PERIOD_MS)

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, value)
        if name == "values" and value and self.phases[-1:] != [value["ivl.phase"]]:
            self.phases.append(Phase(value["ivl.phase"]))


class Lab:
    """A software vehicle that hovers by motion capture."""

    def __init__(self, process: SilProcess, session: Session) -> None:
        self.process, self.session, self.vehicle = process, session, Vehicle(session)
        self.room = SimulatedRoom(session, CONFIG.body)
        self.mocap = Mocap(CONFIG, session.cf.extpos, self.room.request(CONFIG))
        self.asked: list[str] = []
        self.log = PhaseLog()
        session.start_log(self.log)
        sil.reset(self.vehicle)
        self.vehicle.configure(World("habas2021", "wide_short", "as_simulated"))
        session.write(LIMITS)
        session.write({"ivl.commit": 77})
        self.wait(lambda: self.vehicle.config.values.get("ivl.cfg_seq") == 77, "limits")
        assert self.vehicle.config.values["ivl.cfg_status"] == 0
        self.mocap.start()

    def close(self) -> None:
        self.mocap.close()
        self.room.close()

    @property
    def phases(self) -> list[Phase]:
        return self.log.phases

    def wait(self, condition: Callable[[], Any], what: str) -> None:
        self.vehicle.wait(lambda: bool(condition()), DEADLINE_S, what, 0.02)

    def wait_for(self, phase: Phase) -> None:
        self.wait(lambda: self.phases[-1:] == [phase] == [self.vehicle.phase], phase.name)

    def hover(self) -> LossGuard:
        """Reset into the air and hover under the flight core; returns the guard of this flight."""
        self.mocap.guard = None
        self.vehicle.command = Command(Request.IDLE)
        # the vehicle was put elsewhere: only when the cameras have followed may it fly by them
        self.session.write({"sil.pose_source": 0})
        sil.reset(self.vehicle)
        self.wait(self.is_tracked, "cameras that have followed the reset")
        self.session.write({"sil.pose_source": 1})
        self.wait_for_poses()
        self.vehicle.put_policy(forms.by_name("constant"), [4.8, 8.0])
        self.asked.clear()
        guard = self.mocap.guard = LossGuard(lambda: self.vehicle.phase, self.abort)
        self.vehicle.ask_for(Command(Request.HOVER, self.vehicle.position_W_m), (Phase.READY,), DEADLINE_S)
        self.wait_for_poses()
        self.wait_for(Phase.READY)
        del self.phases[:-1]  # READY stays: what follows may come before its next row of the log
        return guard

    def wait_for_poses(self) -> None:
        before = self.process.get("sil.n_pose")
        self.wait(lambda: self.process.get("sil.n_pose") >= before + 10, "poses in the vehicle")

    def is_tracked(self) -> bool:
        state, z_m = self.mocap.state(), self.process.get("simTruth.z")
        return state.status is Status.GOOD and abs(state.pose.p_W_m[2] - z_m) < 0.05

    def abort(self, why: str) -> None:
        self.asked.append(why)
        self.vehicle.command = Command(Request.ABORT)

    def approach(self, speed_mps: float) -> None:
        point = self.vehicle.position_W_m
        self.vehicle.command = Command(Request.APPROACH, point, speed_mps, math.pi / 2)

    def mend(self) -> None:
        self.room.frozen = self.room.occluded = self.room.silent = False
        self.room.shift_m = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def lab() -> Iterator[Lab]:
    world = World("habas2021", "wide_short", "as_simulated")
    with (
        pytest.MonkeyPatch.context() as patch,
        SilProcess(world, speed=SPEED) as process,
        Session(process.uri, Deadlines(answer_s=DEADLINE_S)) as session,
    ):
        patch.setattr(watch, "SLACK_M", SLACK_M)
        patch.setattr(watch, "SLACK_RAD", SLACK_RAD)
        lab = Lab(process, session)
        yield lab
        lab.close()


def test_landing_flown_by_motion_capture(lab: Lab) -> None:
    guard = lab.hover()
    lab.approach(2.5)
    lab.wait_for(Phase.DONE)
    assert Phase.FLIP in lab.phases
    snapshot = lab.vehicle.snapshot()
    assert snapshot.rrev_per_s >= 4.8
    assert snapshot.d_ceil_m == pytest.approx(snapshot.vz_mps / snapshot.rrev_per_s, rel=0.01)
    assert 1.0 < snapshot.vz_mps < 6.0
    assert lab.asked == []
    assert guard.n_aborts == 0
    # what was sent came out of the vehicle's log, through cameras and client, and is what the vehicle took
    assert 0 < lab.process.get("sil.n_pose") <= lab.mocap.state().n_sent

    def is_seen_where_it_is() -> bool:
        state, true_W_m = lab.mocap.state(), [lab.process.get(f"simTruth.{axis}") for axis in "xyz"]
        return state.status is Status.GOOD and state.pose.p_W_m == pytest.approx(true_W_m, abs=0.02)

    lab.wait(is_seen_where_it_is, "the pose of a vehicle that hangs at rest")


@pytest.mark.parametrize(
    ("fault", "value", "text"),
    [
        ("frozen", True, "has not changed by a bit"),
        ("occluded", True, "cf21 is not seen"),
        ("silent", True, "no frame"),
        ("shift_m", (0.0, 7.0, 0.0), "cf21 has jumped"),
    ],
)
def test_loss_in_hover_aborts(lab: Lab, fault: str, value: Any, text: str) -> None:
    guard = lab.hover()
    setattr(lab.room, fault, value)
    lab.wait_for(Phase.ABORTED)
    lab.mend()
    assert text in lab.asked[0]
    assert guard.n_aborts == 1
    with pytest.raises(RolloutError, match=text):
        guard.check()
    assert lab.phases == [Phase.READY, Phase.ABORTED]


@pytest.mark.parametrize("fault", ["frozen", "occluded"])
def test_loss_in_the_approach_aborts(lab: Lab, fault: str) -> None:
    guard = lab.hover()
    lab.approach(0.8)
    lab.wait_for(Phase.APPROACH)
    setattr(lab.room, fault, True)
    lab.wait_for(Phase.ABORTED)
    lab.mend()
    assert guard.n_aborts == 1
    assert Phase.FLIP not in lab.phases


def test_vehicle_comes_down_by_poses_that_are_back_in_time(lab: Lab) -> None:
    lab.hover()
    lab.room.occluded = True
    lab.wait_for(Phase.ABORTED)
    lab.mend()
    lab.wait(lambda: lab.vehicle.rule == "landed", "landing")
    assert lab.process.get("simTruth.z") == pytest.approx(0.0, abs=0.1)


def test_loss_in_the_flip_interrupts_nothing(lab: Lab) -> None:
    guard = lab.hover()
    lab.approach(2.5)
    lab.wait(lambda: lab.vehicle.phase >= Phase.FLIP, "flip")
    lab.room.occluded = True
    lab.wait_for(Phase.DONE)
    lab.wait(lambda: guard.n_ignored, "the loss")
    lab.mend()
    assert lab.asked == []
    assert (guard.n_aborts, guard.n_ignored) == (0, 1)
    assert Phase.ABORTED not in lab.phases
    assert lab.vehicle.command.request is Request.APPROACH
    assert Phase.COAST in lab.phases


def test_program_tracks_a_software_vehicle(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "room.yaml"
    file.write_text("system: simulator\nbody: cf21\nlost_s: 1.0\nfrozen_s: 1.0\nsettle_s: 1.05\n")
    with SilProcess(World("crazyflie21")) as process:

        def watch_until_sent(tracking: Mocap, seconds: float | None, quiet: bool) -> None:
            assert (seconds, quiet) == (1.0, True)
            end_s = time.monotonic() + DEADLINE_S
            while process.get("sil.n_pose") <= 20 or tracking.state().status is not Status.GOOD:
                assert time.monotonic() < end_s
                time.sleep(0.05)

        monkeypatch.setattr(mocap_cli, "_watch", watch_until_sent)
        cli.run(["mocap", "--config", str(file), "--uri", process.uri, "--seconds", "1.0", "--json"])
        report = json.loads(capsys.readouterr().out)
        assert report["status"] == "good"
        assert 20 < report["n_sent"] <= process.get("sil.n_pose")
        assert process.get("sil.pose_source") == 0
        assert process.get("stabilizer.estimator") == 2
        assert process.get("locSrv.extPosStdDev") == pytest.approx(0.01)
