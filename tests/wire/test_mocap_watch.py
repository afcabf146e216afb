"""Which poses are believed, and what is said when none is: on made-up tracks, at 100 Hz."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ivl.errors import ConfigError, RolloutError
from ivl.links.packets import Phase
from ivl.mocap import config as configs
from ivl.mocap.config import MocapConfig
from ivl.mocap.guard import LossGuard
from ivl.mocap.watch import VELOCITY_S, Pose, Status, Watch, _from_segment_m, _Past, make_pose

DT_S = 0.01
LEVEL = (0.0, 0.0, 0.0, 1.0)


def config(**values: Any) -> MocapConfig:
    return MocapConfig(**{"system": "mock", "body": "cf", **values})


class Track:
    """A watch that is fed at 100 Hz; each pose differs from the last by at least a micrometre."""

    def __init__(self, in_flight: bool = False, **values: Any) -> None:
        self.watch, self.t_s, self.n = Watch(config(**values)), 0.0, 0
        self.in_flight = in_flight
        self.sent: list[Pose] = []

    def at(self, x_m: float, q_WB: tuple[float, float, float, float] = LEVEL, noise_m: float = 1e-6) -> Status:
        self.n += 1
        return self._take(Pose((x_m + self.n * noise_m, 0.0, 1.0), q_WB))

    def absent(self) -> Status:
        return self._take(None)

    def _take(self, pose: Pose | None) -> Status:
        self.t_s += DT_S
        believed = self.watch.take(self.t_s, pose, is_present=pose is not None, in_flight=self.in_flight)
        self.sent += [believed] if believed else []
        return self.watch.status(self.t_s)

    def settled(self, x_m: float = 0.0) -> "Track":
        while self.at(x_m) is not Status.GOOD:
            assert self.t_s < 1.0
        return self


def first(statuses: list[Status], wanted: Status) -> float:
    """Seconds until a status is first seen."""
    return (statuses.index(wanted) + 1) * DT_S


def test_first_pose_is_believed_after_it_has_settled() -> None:
    track = Track(settle_s=0.2)
    assert track.watch.status(0.0) is Status.CONNECTING
    statuses = [track.at(0.0) for _ in range(30)]
    assert set(statuses[:20]) == {Status.SETTLING}
    assert set(statuses[21:]) == {Status.GOOD}
    assert len(track.sent) in (9, 10)


def turned_rad(angle: float) -> tuple[float, float, float, float]:
    return (0.0, -math.sin(angle / 2), 0.0, math.cos(angle / 2))


@pytest.mark.parametrize("every", [1, 2, 5])
@pytest.mark.parametrize("accel_mps2", [3.0, 15.0])
def test_fast_flight_and_flip_are_believed(accel_mps2: float, every: int) -> None:
    """Speeds up to 6 m/s, turns up to 35 rad/s with 470 rad/s2, and stops dead at the ceiling; some frames are lost."""
    track = Track(in_flight=True).settled()
    x_m = v_mps = angle = rate = 0.0
    for i in range(120):
        v_mps, rate = min(v_mps + accel_mps2 * DT_S, 6.0), min(rate + 470.0 * DT_S, 35.0) if i > 60 else 0.0
        x_m, angle = x_m + v_mps * DT_S, angle + rate * DT_S
        status = track.at(x_m, turned_rad(angle)) if i % every == 0 else track.absent()
        assert status is Status.GOOD
    for i in range(60):  # hangs where it hit
        assert (track.at(x_m, turned_rad(angle)) if i % every == 0 else track.absent()) is Status.GOOD
    assert track.watch.counts.n_jumps == 0


@pytest.mark.parametrize("speed_mps", [0.0, 1.0, 3.0, 6.0])
def test_frames_that_come_late_and_in_a_bunch_are_no_jump(speed_mps: float) -> None:
    track, x_m = Track(in_flight=True), 0.0
    track.settled(0.0)
    for i in range(150):
        x_m += min(15.0 * DT_S * i, speed_mps) * DT_S
        late_s = 0.02 if i % 7 == 3 else 0.0109 if i % 7 == 4 else 0.0  # two frames at nearly the same moment
        track.t_s += late_s
        assert track.at(x_m) is Status.GOOD
        track.t_s -= late_s
    assert track.watch.counts.n_jumps == 0


def test_body_that_is_not_seen_is_lost_in_time_and_must_settle_again() -> None:
    track = Track(lost_s=0.1, settle_s=0.2).settled()
    statuses = [track.absent() for _ in range(20)]
    assert first(statuses, Status.LOST) == pytest.approx(0.105, abs=0.006)
    back = [track.at(0.5) for _ in range(30)]
    assert back[0] is Status.SETTLING
    assert first(back, Status.GOOD) == pytest.approx(0.21, abs=0.011)
    assert track.watch.counts.n_absent == 20
    assert track.watch.counts.n_jumps == 0


def test_short_occlusion_costs_nothing() -> None:
    track = Track(lost_s=0.1).settled()
    assert {track.absent() for _ in range(8)} == {Status.GOOD}
    assert track.at(0.05) is Status.GOOD


def test_silence_is_told_from_occlusion() -> None:
    track = Track(lost_s=0.1).settled()
    assert track.watch.status(track.t_s + 0.099) is Status.GOOD
    assert track.watch.status(track.t_s + 0.101) is Status.SILENT


def test_frozen_pose_is_seen_in_time_and_as_old_as_its_first_frame() -> None:
    track = Track(frozen_s=0.1).settled()
    track.at(0.5e-2)
    n_sent = len(track.sent)
    statuses = [track.at(0.5e-2, noise_m=0.0) for _ in range(3)]
    assert set(statuses) == {Status.GOOD}
    statuses = [track.at(0.5e-2, noise_m=0.0) for _ in range(20)]
    assert first(statuses, Status.FROZEN) <= 0.1
    assert track.watch.age_s(track.t_s) >= 0.2
    assert len(track.sent) - n_sent <= 10
    assert track.watch.counts.n_frozen == 1
    thawed = [track.at(0.5e-2) for _ in range(30)]
    assert thawed[0] is Status.SETTLING
    assert thawed[-1] is Status.GOOD


def test_a_frozen_pose_is_not_sent_from_the_limit_on() -> None:
    """Times that a float holds exactly: one step before the limit, at the limit, after it."""
    step_s, watch = 0.03125, Watch(config(frozen_s=0.25, settle_s=0.125, lost_s=0.0625))
    for n in range(6):
        watch.take(step_s * n, Pose((0.1, 0.2, 1.0 + 1e-6 * (n + 1)), LEVEL))
    frozen = Pose((0.1, 0.2, 1.0), LEVEL)
    believed = [watch.take(step_s * (6 + n), frozen) is not None for n in range(12)]
    assert believed == [True] * 8 + [False] * 4
    assert watch.counts.n_frozen == 1


def test_the_velocity_is_that_of_the_last_thirty_milliseconds() -> None:
    """A shorter time would make metres a second of a camera's noise, a longer one would forget that a body turns."""
    for step_s in (0.01, 0.004, 0.02):
        past = _Past()
        for n in range(40):
            past.add(step_s * n, Pose((0.001 * n * n, 0.0, 1.0), LEVEL))
        span_s = past.motion(config()).span_s
        assert VELOCITY_S - 1e-9 <= span_s <= VELOCITY_S + step_s + 1e-9


def test_resting_body_with_noise_is_not_frozen() -> None:
    track = Track(frozen_s=0.02).settled()
    assert {track.at(0.0, noise_m=1e-7) for _ in range(200)} == {Status.GOOD}


def test_freeze_is_not_looked_for_if_so_configured() -> None:
    track = Track(frozen_s=None).settled()
    assert {track.at(0.0, noise_m=0.0) for _ in range(100)} == {Status.GOOD}


@pytest.mark.parametrize("in_flight", [False, True])
def test_single_outlier_is_told_dropped_and_forgotten(in_flight: bool) -> None:
    track = Track(in_flight).settled()
    assert track.at(0.5) is Status.JUMPED
    assert track.at(0.0) is Status.GOOD
    assert max(pose.p_W_m[0] for pose in track.sent) < 0.01
    assert track.watch.counts.n_jumps == 1


@pytest.mark.parametrize("in_flight", [False, True])
@pytest.mark.parametrize("n_unseen", range(10))
@pytest.mark.parametrize("jump_m", [0.15, 0.2, 0.55, 5.0, -0.15, -1.0])
def test_body_that_stands_still_cannot_have_jumped(jump_m: float, n_unseen: int, in_flight: bool) -> None:
    track = Track(in_flight).settled()
    n_sent = len(track.sent)
    for _ in range(n_unseen):
        track.absent()
    assert track.at(jump_m) is Status.JUMPED
    statuses = {track.at(jump_m) for _ in range(15)}
    assert statuses == {Status.JUMPED}
    assert len(track.sent) == n_sent
    assert track.watch.counts.n_jumps == 1


@pytest.mark.parametrize("aside_m", [(0.25, 0.0), (0.0, 0.5), (0.0, -0.5), (0.12, 0.3)])
@pytest.mark.parametrize("n_unseen", [1, 3, 5])
def test_body_that_flies_cannot_have_jumped(aside_m: tuple[float, float], n_unseen: int) -> None:
    """In an approach at 2.5 m/s; another body is aside, ahead or behind."""
    track, z_m = Track(in_flight=True).settled(), 0.0
    for i in range(60):
        z_m += min(8.0 * i * DT_S, 2.5) * DT_S
        track._take(Pose((1e-6 * i, 0.0, 1.0 + z_m), LEVEL))
    z_m += 2.5 * n_unseen * DT_S
    for _ in range(n_unseen):
        track.absent()
    status = track._take(Pose((aside_m[0], 0.0, 1.0 + z_m + 2.5 * DT_S + aside_m[1]), LEVEL))
    assert status is Status.JUMPED
    assert track.watch.counts.n_jumps == 1


@pytest.mark.parametrize("jump_m", [0.15, 0.3, 0.9, 5.0])
def test_body_that_jumps_and_stays_is_not_followed_until_it_has_settled(jump_m: float) -> None:
    track = Track(lost_s=0.1, settle_s=0.3).settled()
    n_sent = len(track.sent)
    statuses = [track.at(jump_m) for _ in range(40)]
    assert set(statuses[:29]) == {Status.JUMPED}
    assert len([pose for pose in track.sent[n_sent:] if pose.p_W_m[0] > 0.1]) == pytest.approx(40 - 30, abs=1)
    assert statuses[-1] is Status.GOOD
    assert track.watch.counts.n_jumps == 1


@pytest.mark.parametrize("n_unseen", [0, 5, 12])
def test_another_body_is_never_followed_in_flight_and_the_own_one_is(n_unseen: int) -> None:
    track = Track(in_flight=True).settled()
    n_sent = len(track.sent)
    for _ in range(n_unseen):
        track.absent()
    for k in range(3):  # also when it is not seen for a while in between
        assert Status.GOOD not in {track.at(0.55 + 0.2 * k) for _ in range(200)}
        for _ in range(30 * (k + 1)):
            track.absent()
    assert len(track.sent) == n_sent
    assert track.watch.counts.n_jumps >= 1
    # down and carried away: it may be anywhere
    track.in_flight = False
    assert [track.at(3.0) for _ in range(40)][-1] is Status.GOOD


def test_own_body_that_is_back_in_time_is_believed_in_flight() -> None:
    track = Track(in_flight=True).settled()
    for _ in range(5):
        assert track.at(0.55) is Status.JUMPED
    assert track.at(0.0) is Status.GOOD
    for _ in range(20):
        track.absent()
    assert [track.at(0.1) for _ in range(40)][-1] is Status.GOOD


def test_body_that_moves_while_it_settles_is_believed_after_it() -> None:
    track = Track(settle_s=0.2)
    statuses = [track.at(3.0 * i * DT_S) for i in range(60)]
    assert set(statuses[30:]) == {Status.GOOD}
    assert track.watch.counts.n_jumps == 0


def test_swapped_markers_that_turn_the_body_are_a_jump() -> None:
    track = Track().settled()
    turned = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))
    statuses = [track.at(0.0, turned) for _ in range(15)]
    assert set(statuses) == {Status.JUMPED}


def test_old_run_of_poses_does_not_count_as_settled() -> None:
    track = Track(settle_s=0.2, lost_s=0.1)
    track.at(0.0)
    for _ in range(50):
        track.absent()
    assert track.at(0.0) is Status.SETTLING
    assert track.sent == []


@given(values=st.lists(st.floats(), min_size=0, max_size=9))
def test_any_numbers_give_a_pose_or_none(values: list[float]) -> None:
    pose = make_pose(values)
    assert pose is None or math.isclose(math.hypot(*pose.q_WB), 1.0)


def test_unusable_pose_counts_and_ages() -> None:
    watch = Watch(config())
    assert make_pose([0, 0, 0, 0, 0, 0, 0]) is None
    assert make_pose([math.nan, 0, 0, 0, 0, 0, 1]) is None
    watch.take(1.0, None, is_present=True)
    assert watch.counts.n_unusable == 1
    assert watch.status(1.0) is Status.LOST


def test_y_up_turns_world_and_body() -> None:
    # tilted by +0.2 rad about the system's x axis, which stays x; its y is up, its z points to the right (W -y)
    pose = make_pose([1.0, 2.0, 3.0, math.sin(0.1), 0.0, 0.0, math.cos(0.1)], up="y")
    assert pose is not None
    assert pose.p_W_m == (1.0, -3.0, 2.0)
    assert pose.q_WB == pytest.approx((math.sin(0.1), 0.0, 0.0, math.cos(0.1)))
    heading = make_pose([0.0, 0.0, 0.0, 0.0, math.sin(0.3), 0.0, math.cos(0.3)], up="y")
    assert heading is not None
    assert heading.q_WB == pytest.approx((0.0, 0.0, math.sin(0.3), math.cos(0.3)))


def test_a_single_pose_says_nothing_of_a_motion_and_two_do() -> None:
    here, there = Pose((0.0, 0.0, 1.0), LEVEL), Pose((0.01, 0.0, 1.0), LEVEL)
    past = _Past().add(0.0, here)
    assert not past.moves_to(0.01, here, config())
    assert past.add(0.01, there).moves_to(0.02, Pose((0.02, 0.0, 1.0), LEVEL), config())
    assert not past.moves_to(0.02, Pose((5.0, 0.0, 1.0), LEVEL), config())


def test_a_velocity_is_that_of_the_span_and_of_no_longer_time() -> None:
    # at rest for as long as the span, then 1 m/s: each pose is exactly on the span's grid
    past = _Past()
    for i in range(4):
        past.add(i * VELOCITY_S, Pose((0.0, 0.0, 1.0), LEVEL))
    assert len(past._poses) == 2
    past.add(4 * VELOCITY_S, Pose((VELOCITY_S, 0.0, 1.0), LEVEL))
    assert past.motion(config()).v_W_mps == pytest.approx((1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("point", "away_m"),
    [((-3.0, 0.0, 4.0), 5.0), ((1.0, 2.0, 0.0), 2.0), ((5.0, 0.0, 4.0), 5.0), ((2.0, 0.0, 0.0), 0.0)],
)
def test_distance_from_a_segment_of_two_metres(point: tuple[float, float, float], away_m: float) -> None:
    assert _from_segment_m((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), point) == pytest.approx(away_m)
    assert _from_segment_m((2.0, 0.0, 0.0), (0.0, 0.0, 0.0), (2.0, 1.0, 0.0)) == 1.0


def test_the_same_frame_again_and_again_has_no_rate() -> None:
    watch = Watch(config())
    for _ in range(3):
        watch.take(5.0, Pose((0.0, 0.0, 1.0), LEVEL))
    assert math.isnan(watch.rates(5.0).rate_hz)
    assert watch.rates(5.0).interval_ms_max == 0.0


def test_rates_of_a_known_rhythm() -> None:
    watch, t_s = Watch(config()), 0.0
    for i in range(200):
        t_s += 0.030 if i == 150 else 0.010
        watch.take(t_s, Pose((i * 1e-6, 0.0, 0.0), LEVEL))
    rates = watch.rates(t_s)
    assert rates.interval_p50_ms == pytest.approx(10.0)
    assert rates.interval_ms_max == pytest.approx(30.0)
    assert rates.rate_hz == pytest.approx(199 / (198 * 0.010 + 0.030))
    assert math.isnan(watch.rates(t_s + 60.0).rate_hz)


# ---- what a loss means for a flight


class Flight:
    def __init__(self, phase: Phase) -> None:
        self.phase, self.asked = phase, list[str]()
        self.guard = LossGuard(lambda: self.phase, self.asked.append)

    def look(self, status: Status, seconds: float, begin_s: float = 0.0) -> None:
        for i in range(round(seconds / DT_S)):
            self.guard.look(status, "why", begin_s + i * DT_S)


@pytest.mark.parametrize("phase", [Phase.READY, Phase.APPROACH])
@pytest.mark.parametrize("status", [s for s in Status if s is not Status.GOOD])
def test_loss_before_the_trigger_asks_for_an_abort_again_and_again(phase: Phase, status: Status) -> None:
    flight = Flight(phase)
    flight.look(Status.GOOD, 1.0)
    assert flight.asked == []
    flight.look(status, 0.5, begin_s=1.0)
    assert flight.asked[0] == flight.guard.reason == "why"
    assert 8 <= len(flight.asked) <= 11
    assert (flight.guard.n_aborts, flight.guard.n_ignored) == (1, 0)
    flight.look(Status.GOOD, 0.1, begin_s=1.5)
    flight.look(status, 0.1, begin_s=1.6)
    assert flight.guard.n_aborts == 2


@pytest.mark.parametrize("phase", [Phase.FLIP, Phase.COAST, Phase.ATTACHED])
def test_nothing_interrupts_a_flip(phase: Phase) -> None:
    flight = Flight(phase)
    flight.look(Status.LOST, 0.5)
    flight.look(Status.FROZEN, 0.5, begin_s=0.5)
    assert flight.asked == []
    assert (flight.guard.n_aborts, flight.guard.n_ignored) == (0, 1)


@pytest.mark.parametrize("phase", [Phase.IDLE, Phase.DONE, Phase.ABORTED])
def test_nothing_is_asked_where_nothing_flies(phase: Phase) -> None:
    flight = Flight(phase)
    flight.look(Status.LOST, 0.5)
    assert flight.asked == []


@pytest.mark.parametrize("phase", list(Phase))
@pytest.mark.parametrize("flies", [False, True])
def test_loss_before_the_trigger_spoils_the_flight_whether_or_not_an_abort_comes(phase: Phase, flies: bool) -> None:
    asked, spoiled = list[str](), list[str]()
    guard = LossGuard(lambda: phase, asked.append, lambda: flies, spoiled.append)
    guard.look(Status.GOOD, "good", 0.0)
    assert (asked, spoiled) == ([], [])
    guard.look(Status.JUMPED, "why", 0.01)
    is_before = phase in (Phase.READY, Phase.APPROACH, Phase.LEVEL_OUT)
    # on the way to the start another controller flies; a vehicle that has landed or aborted is none of these
    assert bool(spoiled) is (is_before or (flies and phase in (Phase.IDLE, Phase.DONE)))
    assert bool(asked) is is_before


def test_flight_with_an_abort_is_not_scored() -> None:
    flight = Flight(Phase.APPROACH)
    flight.guard.check()
    flight.look(Status.FROZEN, 0.1)
    with pytest.raises(RolloutError, match="aborted: why"):
        flight.guard.check()
    flight.guard.check()


def test_loss_that_lasts_from_flip_into_the_next_approach_aborts_that() -> None:
    flight = Flight(Phase.FLIP)
    flight.look(Status.LOST, 0.1)
    flight.phase = Phase.READY
    flight.look(Status.LOST, 0.1, begin_s=0.1)
    assert flight.guard.n_aborts == 1


# ---- files


def test_every_example_is_good() -> None:
    assert configs.list_configs() == ["mock", "optitrack", "qualisys", "simulator", "vicon", "vrpn"]
    for name in configs.list_configs():
        assert configs.load(name).system == name


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("system: vicon\nbody: cf\n", "system vicon needs a host"),
        ("system: mock\nbody: cf\nhost: a\n", "system mock has no host"),
        ("system: kinect\nbody: cf\n", "system: value 'kinect'"),
        ("system: mock\nbody: ''\n", "body: value ''"),
        ("system: mock\nbody: cf\nlost_s: 5.0\n", "lost_s: value 5.0: .*less than or equal to 1"),
        ("system: mock\nbody: cf\nsettle_s: 0.1\n", r"settle_s 0\.1 must be above lost_s 0\.1"),
        ("system: mock\nbody: cf\nsend_hz: .nan\n", "send_hz: value nan"),
        ("system: mock\nbody: cf\nsend_hz: 1_00\n", "line 3, column 10: value .1_00. is ambiguous"),
        ("system: mock\nbody: cf\nrate: 100\n", "rate: unknown key"),
        ("[1, 2]\n", "expected a mapping"),
    ],
)
def test_wrong_file_is_told_with_field_and_value(text: str, wrong: str, tmp_path: Any) -> None:
    file = tmp_path / "lab.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=rf"lab\.yaml: .*{wrong}"):
        configs.load(str(file))


def test_section_of_a_lab_file(tmp_path: Any) -> None:
    file = tmp_path / "lab.yaml"
    file.write_text("ceiling_m: 2.5\nmocap:\n  system: mock\n  body: cf\n  position_sigma_m: 0.002\n")
    assert configs.load(str(file)).vehicle_params() == {
        "stabilizer.estimator": 2, "locSrv.extPosStdDev": 0.002, "locSrv.extQuatStdDev": 0.03
    }  # fmt: skip
    with pytest.raises(ConfigError, match="no such file, and no such example"):
        configs.load("nosuch")
