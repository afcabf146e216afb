"""Whether poses are fresh and true. Pure: times come from the caller.

A pose is believed if a vehicle can have come there since the last one that was: carried on by its velocity or stopped
on the way, and accelerated by what its motors and gravity can do. A body that turns up elsewhere has jumped: it is
believed after its poses have agreed with each other for a while, as is one that comes back after a loss; in flight it
is not believed again, since another body that was taken for the vehicle agrees with itself as well.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ivl.mocap.config import MocapConfig

SLACK_M = 0.01
SLACK_RAD = 0.05
"""What noise may add to a plausible motion between two frames."""
VELOCITY_S = 0.03
"""Over so long the velocity is the difference of two poses: noise of cameras makes millimetres a second of it."""
_N_INTERVALS = 500


class Status(StrEnum):
    """What is known about the body."""

    CONNECTING = "connecting"
    GOOD = "good"
    SETTLING = "settling"
    LOST = "lost"
    SILENT = "silent"
    FROZEN = "frozen"
    JUMPED = "jumped"
    FAILED = "failed"


@dataclass(frozen=True)
class Pose:
    """A pose in W: position (m), and quaternion body to world (x, y, z, w; unit length)."""

    p_W_m: tuple[float, float, float]
    q_WB: tuple[float, float, float, float]


@dataclass(frozen=True)
class Rates:
    """Frames with the body over the last seconds: rate, median, 99 % and largest interval; NaN before two frames."""

    rate_hz: float = math.nan
    interval_p50_ms: float = math.nan
    interval_p99_ms: float = math.nan
    interval_ms_max: float = math.nan


@dataclass
class Counts:
    """Events since the start: frames, frames without the body, with an unusable pose; freezes, jumps."""

    n_frames: int = 0
    n_absent: int = 0
    n_unusable: int = 0
    n_frozen: int = 0
    n_jumps: int = 0


def make_pose(values: list[float] | None, up: str = "z") -> Pose | None:
    """A pose from x, y, z, qx, qy, qz, qw; None if it is none.

    Args:
        values: Seven numbers in the axes of the tracking system.
        up: Axis that points up there. With "y", world and body axes are turned by 90 degrees about x.
    """
    if values is None or len(values) != 7 or not all(map(math.isfinite, values)):
        return None
    length = math.hypot(*values[3:])
    if not 0.95 <= length <= 1.05:
        return None
    x, y, z, (qx, qy, qz, qw) = *values[:3], (q / length for q in values[3:])
    return Pose((x, y, z), (qx, qy, qz, qw)) if up == "z" else Pose((x, -z, y), (qx, -qz, qy, qw))


def angle_rad(a: Pose, b: Pose) -> float:
    """Angle of the rotation between two attitudes, 0 .. pi."""
    dot = abs(sum(p * q for p, q in zip(a.q_WB, b.q_WB, strict=True)))
    return 2.0 * math.acos(min(dot, 1.0))


@dataclass(frozen=True)
class _Motion:
    """The last pose that is believed, and how the body moved until then.

    Attributes:
        t_s: Time of the pose.
        pose: The pose.
        v_W_mps: Mean velocity over the last `span_s`, in W.
        rate_radps: Mean of the angular rate over that time, without its direction.
        span_s: That time.
    """

    t_s: float
    pose: Pose
    v_W_mps: tuple[float, float, float]
    rate_radps: float
    span_s: float

    @staticmethod
    def of(before: tuple[float, Pose], now: tuple[float, Pose], config: MocapConfig) -> "_Motion":
        """From two believed poses with their times; frames that come in a bunch do not make a body fast."""
        (t_before_s, first), (t_s, last) = before, now
        span_s = max(t_s - t_before_s, VELOCITY_S)
        v = [(b - a) / span_s for a, b in zip(first.p_W_m, last.p_W_m, strict=True)]
        slower = min(1.0, config.speed_mps_max / max(math.hypot(*v), 1e-9))
        rate_radps = min(angle_rad(first, last) / span_s, config.rate_radps_max)
        return _Motion(t_s, last, (v[0] * slower, v[1] * slower, v[2] * slower), rate_radps, span_s)

    def reaches(self, t_s: float, pose: Pose, config: MocapConfig) -> bool:
        """Whether the body can be at a pose at a time.

        The velocity is that of half a span ago. Frames may be late by the jitter that is allowed, so that a body which
        moves seems to be ahead of the time; one at rest does not.
        """
        gap_s = max(t_s - self.t_s, 0.0)
        late_s = gap_s + config.jitter_ms_max * 1e-3
        change_s2 = 0.5 * gap_s * (gap_s + self.span_s)
        away_m = _from_segment_m(self.pose.p_W_m, [v * late_s for v in self.v_W_mps], pose.p_W_m)
        turned_rad = angle_rad(self.pose, pose)
        return (
            away_m <= config.accel_mps2_max * change_s2 + SLACK_M
            and turned_rad <= self.rate_radps * late_s + config.angular_accel_radps2_max * change_s2 + SLACK_RAD
        )


def _from_segment_m(begin: Sequence[float], way: Sequence[float], point: Sequence[float]) -> float:
    """Distance of a point from what lies between `begin` and `begin + way`."""
    to = [p - b for p, b in zip(point, begin, strict=True)]
    length2 = sum(w * w for w in way)
    share = sum(t * w for t, w in zip(to, way, strict=True)) / length2 if length2 > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.hypot(*(t - share * w for t, w in zip(to, way, strict=True)))


class _Past:
    """The last poses of a body, as far as its velocity needs them."""

    def __init__(self) -> None:
        """Nothing yet."""
        self._poses: deque[tuple[float, Pose]] = deque()

    def add(self, t_s: float, pose: Pose) -> "_Past":
        """The next pose; returns itself."""
        self._poses.append((t_s, pose))
        while len(self._poses) > 2 and t_s - self._poses[1][0] >= VELOCITY_S:
            self._poses.popleft()
        return self

    def moves_to(self, t_s: float, pose: Pose, config: MocapConfig) -> bool:
        """Whether a pose goes on with the motion; not known of a single one."""
        return len(self._poses) > 1 and self.motion(config).reaches(t_s, pose, config)

    def motion(self, config: MocapConfig) -> _Motion:
        """Where it was last, and how it moved."""
        return _Motion.of(self._poses[0], self._poses[-1], config)


@dataclass
class _Run:
    """Poses that agree with each other and not with what was believed."""

    t_begin_s: float
    t_last_s: float
    pose: Pose
    is_jump: bool
    past: _Past


class Watch:
    """Follows one body."""

    def __init__(self, config: MocapConfig) -> None:
        """Nothing was seen yet."""
        self.counts = Counts()
        self.pose: Pose | None = None
        self._config = config
        self._t_frame_s = self._t_good_s = self._t_same_s = -math.inf
        self._seen: Pose | None = None
        self._frozen = False
        self._run: _Run | None = None
        self._past = _Past()
        self._motion: _Motion | None = None
        self._strayed = False
        self._times_s: deque[float] = deque(maxlen=_N_INTERVALS)

    def take(self, t_s: float, pose: Pose | None, is_present: bool = True, in_flight: bool = False) -> Pose | None:
        """Take the body's pose in a frame; returns it if it is believed.

        Args:
            t_s: When the frame came.
            pose: None if the body is not in the frame, or its pose is no pose.
            is_present: The body is in the frame.
            in_flight: The vehicle flies: after a jump only what can be its own motion is believed until it does not.
        """
        self._strayed = self._strayed and in_flight
        self.counts.n_frames += 1
        self._t_frame_s = t_s
        if pose is None:
            self.counts.n_absent += not is_present
            self.counts.n_unusable += is_present
            return None
        self._times_s.append(t_s)
        if self._is_frozen(t_s, pose) or not self._is_believed(t_s, pose, in_flight):
            return None
        self._t_good_s, self.pose, self._run = t_s, pose, None
        self._strayed = False
        self._motion = self._past.add(t_s, pose).motion(self._config)
        return pose

    def status(self, now_s: float) -> Status:
        """What is known now."""
        if self._t_frame_s == -math.inf:
            return Status.CONNECTING
        if self._frozen and self.frame_age_s(now_s) <= self._config.lost_s:
            return Status.FROZEN
        run = self._run if self._run is not None and now_s - self._run.t_last_s <= self._config.lost_s else None
        if run is not None and run.is_jump:
            return Status.JUMPED
        if self.age_s(now_s) <= self._config.lost_s:
            return Status.GOOD
        if self.frame_age_s(now_s) > self._config.lost_s:
            return Status.SILENT
        return Status.LOST if run is None else Status.SETTLING

    def age_s(self, now_s: float) -> float:
        """Age of the last believed pose, infinite before the first; a frozen one is as old as its first frame."""
        return now_s - self._t_good_s

    def frame_age_s(self, now_s: float) -> float:
        """Age of the last frame, with the body or without it; infinite before the first."""
        return now_s - self._t_frame_s

    def rates(self, now_s: float, span_s: float = 5.0) -> Rates:
        """Statistics of the frames of the last `span_s`."""
        recent = np.array([t for t in self._times_s if now_s - t <= span_s])
        if len(recent) < 2:
            return Rates()
        intervals_ms = np.diff(recent) * 1e3
        p50, p99 = np.percentile(intervals_ms, (50, 99))
        mean_ms = float(np.mean(intervals_ms))
        rate_hz = 1e3 / mean_ms if mean_ms > 0.0 else math.nan  # the same frame again and again has none
        return Rates(rate_hz, float(p50), float(p99), float(np.max(intervals_ms)))

    def _is_frozen(self, t_s: float, pose: Pose) -> bool:
        limit_s = self._config.frozen_s
        if pose != self._seen or limit_s is None:
            self._seen, self._t_same_s, self._frozen = pose, t_s, False
        elif t_s - self._t_same_s >= limit_s:
            self.counts.n_frozen += not self._frozen
            self._frozen = True
            self._t_good_s = min(self._t_good_s, self._t_same_s)
        return self._frozen

    def _is_believed(self, t_s: float, pose: Pose, in_flight: bool) -> bool:
        is_fresh = t_s - self._t_good_s <= self._config.lost_s
        is_own = self._motion is not None and self._motion.reaches(t_s, pose, self._config)
        run = self._run
        if run is not None and t_s - run.t_last_s > self._config.lost_s:
            run = None
        # what moves as the run does is the run's, though its own motion may by now have come that far, too
        is_its = run is not None and run.past.moves_to(t_s, pose, self._config)
        if (
            run is not None
            and (is_its or not (is_fresh and is_own))
            and self._agree(run.pose, pose, t_s - run.t_last_s)
        ):
            return self._settles(run, t_s, pose)
        if is_fresh and is_own:
            return True
        is_jump = self._motion is not None and not is_own
        self.counts.n_jumps += is_jump
        self._strayed = self._strayed or (is_jump and in_flight)
        self._run = _Run(t_s, t_s, pose, is_jump, _Past().add(t_s, pose))
        return False

    def _settles(self, run: _Run, t_s: float, pose: Pose) -> bool:
        """A further pose of a run; whether that is enough of them."""
        run.t_last_s, run.pose = t_s, pose
        if t_s - run.t_begin_s < self._config.settle_s or self._strayed:
            run.past.add(t_s, pose)
            return False
        self._past = run.past
        return True

    def _agree(self, before: Pose, after: Pose, span_s: float) -> bool:
        """Whether two poses of a run can be one body, of which nothing else is known."""
        return (
            math.dist(before.p_W_m, after.p_W_m) <= self._config.speed_mps_max * span_s + SLACK_M
            and angle_rad(before, after) <= self._config.rate_radps_max * span_s + SLACK_RAD
        )
