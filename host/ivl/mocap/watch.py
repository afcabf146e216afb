"""Whether poses are fresh and true. Pure: times come from the caller.

A pose is believed if it lies within what a vehicle can do since the last one that was. A body that turns up elsewhere
is believed after its poses have agreed with each other for a while, as is one that comes back after a loss.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ivl.mocap.config import MocapConfig

SLACK_M = 0.01
SLACK_RAD = 0.05
"""What noise may add to a plausible motion between two frames."""
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


@dataclass
class _Run:
    """Poses that agree with each other and not with what was believed."""

    t_begin_s: float
    t_last_s: float
    pose: Pose
    is_jump: bool


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
        self._times_s: deque[float] = deque(maxlen=_N_INTERVALS)

    def take(self, t_s: float, pose: Pose | None, is_present: bool = True) -> Pose | None:
        """Take the body's pose in a frame; returns it if it is believed.

        Args:
            t_s: When the frame came.
            pose: None if the body is not in the frame, or its pose is no pose.
            is_present: The body is in the frame.
        """
        self.counts.n_frames += 1
        self._t_frame_s = t_s
        if pose is None:
            self.counts.n_absent += not is_present
            self.counts.n_unusable += is_present
            return None
        self._times_s.append(t_s)
        if self._is_frozen(t_s, pose) or not self._is_believed(t_s, pose):
            return None
        self._t_good_s, self.pose, self._run = t_s, pose, None
        return pose

    def status(self, now_s: float) -> Status:
        """What is known now."""
        if self._t_frame_s == -math.inf:
            return Status.CONNECTING
        if self._frozen and self.frame_age_s(now_s) <= self._config.lost_s:
            return Status.FROZEN
        if self.age_s(now_s) <= self._config.lost_s:
            return Status.GOOD
        if self.frame_age_s(now_s) > self._config.lost_s:
            return Status.SILENT
        if self._run is not None and now_s - self._run.t_last_s <= self._config.lost_s:
            return Status.JUMPED if self._run.is_jump else Status.SETTLING
        return Status.LOST

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
        return Rates(1e3 / float(np.mean(intervals_ms)), float(p50), float(p99), float(np.max(intervals_ms)))

    def _is_frozen(self, t_s: float, pose: Pose) -> bool:
        limit_s = self._config.frozen_s
        if pose != self._seen or limit_s is None:
            self._seen, self._t_same_s, self._frozen = pose, t_s, False
        elif t_s - self._t_same_s >= limit_s:
            self.counts.n_frozen += not self._frozen
            self._frozen = True
            self._t_good_s = min(self._t_good_s, self._t_same_s)
        return self._frozen

    def _is_believed(self, t_s: float, pose: Pose) -> bool:
        is_fresh = t_s - self._t_good_s <= self._config.lost_s
        run = self._run
        if run is not None and t_s - run.t_last_s > self._config.lost_s:
            run = None
        if run is not None and self._is_plausible(run.pose, pose, t_s - run.t_last_s):
            run.t_last_s, run.pose = t_s, pose
            return t_s - run.t_begin_s >= self._config.settle_s
        if is_fresh and self.pose is not None and self._is_plausible(self.pose, pose, t_s - self._t_good_s):
            return True
        self.counts.n_jumps += is_fresh
        is_jump = is_fresh or (run is not None and run.is_jump)
        self._run = _Run(t_s, t_s, pose, is_jump)
        return False

    def _is_plausible(self, before: Pose, after: Pose, span_s: float) -> bool:
        distance_m = math.dist(before.p_W_m, after.p_W_m)
        return (
            distance_m <= self._config.speed_mps_max * span_s + SLACK_M
            and angle_rad(before, after) <= self._config.rate_radps_max * span_s + SLACK_RAD
        )
