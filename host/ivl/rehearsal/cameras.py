"""Motion capture of a vehicle whose time goes step by step: judged by the vehicle's time, not by the wall's.

The true poses come from the vehicle's own log, a hundred a second. What is believed of them is the business of the same
watch that judges real cameras. The vehicle's simulated motion capture stands for the poses that a host would send: it
is switched off (`sil.pose_source`) while the host would send none.
"""

import threading
from collections import deque
from collections.abc import Callable

import numpy as np

from ivl.check import Check
from ivl.links.clock import Clock, Pace
from ivl.links.tables import Session
from ivl.links.tracking import check_of
from ivl.links.truth import Resting
from ivl.links.vehicle import Vehicle
from ivl.mocap.config import MocapConfig
from ivl.mocap.guard import LossGuard
from ivl.mocap.simulated import SimulatedRoom
from ivl.mocap.watch import Status, Watch, make_pose

OTHER = (0.9, -0.8, 0.02, 0.0, 0.0, 0.0, 1.0)
"""Pose of another body, which stands on the floor of the room."""
NOISE_M = 1e-4
_SETTLE_S, _STEP_S = 3.0, 0.1


class Cameras:
    """Cameras around one software vehicle in lock-step. Faults are attributes that can be set at any time."""

    def __init__(self, session: Session, config: MocapConfig) -> None:
        """Begin to look; `config` has the limits.

        Raises:
            LinkError: The vehicle tells no true pose.
        """
        self.drops = False
        """They lose the body."""
        self.swaps = False
        """They take the other body for it."""
        self._session, self._config = session, config
        self._frames: deque[tuple[float, list[float] | None]] = deque()
        self._lock = threading.Lock()
        self._watch, self._guard, self._now_s = Watch(config), LossGuard(lambda: 0, _ignore), 0.0
        self._is_on = True
        self._rng = np.random.default_rng(0)
        session.write({"sil.pose_source": 0})
        self._room = SimulatedRoom(session, config.body)
        self._room.show(self)

    # ---- what the room asks of whoever sees its frames

    def send(self, frame: dict[str, list[float] | None]) -> None:
        """A frame; in the link's thread."""
        with self._lock:
            self._frames.append((self._room.time_s, frame[self._config.body]))

    def close(self) -> None:
        """Nothing to give back."""

    # ---- between two steps of time

    def look(self) -> None:
        """Judge the frames that have come, tell the guard, and let the vehicle have its poses or not."""
        with self._lock:
            frames, self._frames = list(self._frames), deque()
        n_jumps = self._watch.counts.n_jumps
        for self._now_s, truth in frames:
            self._take(self._now_s, truth)
        status = Status.JUMPED if self._watch.counts.n_jumps > n_jumps else self._watch.status(self._now_s)
        if status is Status.CONNECTING:
            return
        self._guard.look(status, self._text(status), self._now_s)
        if self._is_on != (status is Status.GOOD):
            self._is_on = not self._is_on
            self._session.write({"sil.pose_source": int(not self._is_on)})

    def _take(self, t_s: float, truth: list[float] | None) -> None:
        if self.drops or truth is None:
            self._watch.take(t_s, None, is_present=False, in_flight=self._guard.in_flight())
            return
        seen = self._other() if self.swaps else truth
        self._watch.take(t_s, make_pose(seen), in_flight=self._guard.in_flight())

    def _other(self) -> list[float]:
        """The other body, with the noise that cameras have: a pose that never changes is a frozen one."""
        place = np.array(OTHER[:3]) + self._rng.normal(0.0, NOISE_M, 3)
        return [*place.tolist(), *OTHER[3:]]

    def _text(self, status: Status) -> str:
        return f"motion capture: {self._config.body}: {status} for {self._watch.age_s(self._now_s):.2f} s"

    # ---- as `ivl.links.tracking.Tracking`

    def watch_over(self, vehicle: Vehicle) -> None:
        """From now on a loss before the trigger aborts the flight, and keeps it from being scored."""
        self._guard = LossGuard(
            lambda: int(vehicle.phase), vehicle.abort, flies=lambda: vehicle.seems_to_fly, spoil=vehicle.spoil
        )

    def wait_until_good(self, vehicle: Vehicle) -> None:
        """Let time pass until the body is seen, or has not been for so long that it is a problem."""
        end_s = vehicle.clock.now_s() + _SETTLE_S
        while self.problems() and vehicle.clock.now_s() < end_s:
            vehicle.clock.pause(_STEP_S)

    def problems(self) -> list[str]:
        """What speaks against a flight now, one line each."""
        status = self._watch.status(self._now_s)
        return [] if status is Status.GOOD else [self._text(status)]

    def checks(self) -> list[Check]:
        """One check for each thing that speaks against a flight now."""
        return [check_of(text) for text in self.problems()]

    def resting(self) -> Resting | None:
        """Where the cameras see the vehicle; None if they do not."""
        pose = self._watch.pose
        if pose is None or self._watch.age_s(self._now_s) > self._config.restart_s:
            return None
        return Resting.of(pose.p_W_m, pose.q_WB)


class Watched:
    """A clock after each step of which somebody looks."""

    def __init__(self, clock: Clock, look: Callable[[], None]) -> None:
        """`look` is called after each pause."""
        self._clock, self._look, self.pace = clock, look, clock.pace

    pace: Pace

    def now_s(self) -> float:
        """As the clock has it."""
        return self._clock.now_s()

    def pause(self, span_s: float) -> None:
        """Let time pass, and look."""
        self._clock.pause(span_s)
        self._look()

    def close(self) -> None:
        """Give time back."""
        self._clock.close()


def _ignore(reason: str) -> None:
    """Nobody flies yet whom a loss could abort."""
    del reason
