"""Motion capture as the host uses it: poses to the vehicle, and state for preflight, landing and people.

with Mocap(config, cf.extpos) as mocap:
    mocap.guard = LossGuard(lambda: vehicle.phase, abort)
    mocap.wait_until_good()
    ...
"""

import math
import threading
import time
from dataclasses import asdict, dataclass
from types import TracebackType
from typing import Any, Protocol, Self

from ivl.errors import LinkError
from ivl.mocap.config import MocapConfig
from ivl.mocap.frame import FlightFrame
from ivl.mocap.guard import Guard
from ivl.mocap.tracker import Frame, Tracker, request_of
from ivl.mocap.watch import Counts, Pose, Rates, Status, Watch, make_pose

TICK_S = 0.01
START_S = 5.0
"""What starting the process may take on a busy machine, before its `connect_s` begins."""
_EARLY = 0.25
"""Share of the sending period by which a pose may be sent early, so that jitter does not halve the rate."""


class PoseSink(Protocol):
    """Takes poses: `cf.extpos` of a cflib Crazyflie."""

    def send_extpose(self, x: float, y: float, z: float, qx: float, qy: float, qz: float, qw: float) -> None:
        """Send one; metres, unit quaternion body to world."""
        ...


@dataclass(frozen=True)
class MocapState:
    """What is known at one moment.

    Attributes:
        status: Whether the pose is to be believed, and why not.
        text: The same for people.
        age_s: Of the last pose that is believed; infinite before the first.
        pose: That pose.
        rates: Frames with the body over the last seconds.
        counts: Events since the start.
        n_sent: Poses sent to the vehicle.
        n_restarts: Connections after the first.
        n_strange: Lines of the present process that were no event of it.
        bodies: Names of the bodies in the last frame.
        sink_error: Why the last pose could not be sent; empty if it could.
    """

    status: Status
    text: str
    age_s: float
    pose: Pose | None
    rates: Rates
    counts: Counts
    n_sent: int
    n_restarts: int
    n_strange: int
    bodies: tuple[str, ...]
    sink_error: str

    def to_json(self) -> dict[str, Any]:
        """Plain data; what is not a number is None."""
        data = {**asdict(self), **asdict(self.rates), **asdict(self.counts), "status": str(self.status)}
        del data["rates"], data["counts"]
        finite = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in data.items()}
        return {**finite, "pose": None if self.pose is None else asdict(self.pose), "bodies": list(self.bodies)}


class Mocap:
    """A thread that reads the tracking system and sends poses."""

    def __init__(
        self,
        config: MocapConfig,
        sink: PoseSink | None = None,
        request: dict[str, Any] | None = None,
        frame: FlightFrame | None = None,
    ) -> None:
        """Nothing runs until `start`.

        Args:
            config: Checked configuration.
            sink: Where poses go.
            request: What the process is told, if it does not follow from the configuration (system `simulator`).
            frame: The flight frame in the axes of the tracking system; None: they are the same.

        Raises:
            LinkError: The computer of the tracking system cannot be found.
        """
        self.config = config
        self.guard: Guard | None = None
        """Told of each state; set before a flight."""
        self._request = request if request is not None else request_of(config)
        self._sink, self._frame = sink, frame or FlightFrame()
        self._watch = Watch(config)
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ivl-mocap", daemon=True)
        self._tracker: Tracker | None = None
        self._t_alive_s = self._t_due_s = -math.inf
        self._n_sent = self._n_restarts = 0
        self._has_connected = False
        self._bodies: tuple[str, ...] = ()
        self._failure = self._sink_error = ""
        self._is_dead = False

    def start(self) -> None:
        """Start the process and the thread."""
        self._tracker, self._t_alive_s = Tracker(self._request), time.monotonic()
        self._thread.start()

    def close(self) -> None:
        """End thread and process; again does nothing."""
        self._ended.set()
        if self._thread.ident is not None:
            self._thread.join()
        if self._tracker is not None:
            self._tracker.close()
            self._tracker = None

    def __enter__(self) -> Self:
        """Start."""
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    def state(self) -> MocapState:
        """What is known now; from any thread."""
        with self._lock:
            return self._state(time.monotonic())

    def wait_until_good(self, timeout_s: float | None = None) -> MocapState:
        """Return when the pose is good.

        Args:
            timeout_s: Default: what the configuration gives for connecting, and the start of the process.

        Raises:
            LinkError: It is not within that time; the message says why.
        """
        limit_s = self.config.connect_s + START_S if timeout_s is None else timeout_s
        end_s = time.monotonic() + limit_s
        while (state := self.state()).status is not Status.GOOD:
            if time.monotonic() >= end_s or (state.status is Status.FAILED and timeout_s is None):
                raise LinkError(f"motion capture: {state.text}")
            time.sleep(TICK_S)
        return state

    def problems(self) -> list[str]:
        """What speaks against a flight now, one line each; empty if nothing does."""
        state, config = self.state(), self.config
        if state.status is not Status.GOOD:
            return [f"motion capture: {state.text}"]
        found = []
        if not state.rates.rate_hz >= config.rate_hz_min:
            found.append(f"motion capture: {state.rates.rate_hz:.0f} Hz (rate_hz_min {config.rate_hz_min:g})")
        if not state.rates.interval_p99_ms <= config.jitter_ms_max:
            found.append(
                f"motion capture: 99 % of the intervals within {state.rates.interval_p99_ms:.0f} ms "
                f"(jitter_ms_max {config.jitter_ms_max:g})"
            )
        if state.sink_error:
            found.append(f"motion capture: poses do not reach the vehicle: {state.sink_error}")
        return found

    # ---- the thread

    def _run(self) -> None:
        """Follow the body; if that fails, for any reason, the body is lost, and the guard is told so to the end."""
        try:
            self._follow()
        except Exception as error:  # noqa: BLE001 - a guard that is silent would let a vehicle fly on
            with self._lock:
                self._failure, self._is_dead = f"motion capture itself failed: {type(error).__name__}: {error}", True
            while not self._ended.wait(TICK_S):
                self._tell_guard_of_failure()

    def _tell_guard_of_failure(self) -> None:
        """Tell it, and go on telling it: it may be the guard itself that has failed, perhaps once only."""
        try:
            if self.guard is not None:
                self.guard.look(Status.FAILED, f"motion capture: {self._failure}", time.monotonic())
        except Exception as error:  # noqa: BLE001 - see `_run`
            with self._lock:
                self._failure = f"the guard failed: {type(error).__name__}: {error}"

    def _follow(self) -> None:
        assert self._tracker is not None
        while not self._ended.is_set():
            frames = self._tracker.poll(TICK_S)
            guard = self.guard
            in_flight = guard is not None and guard.in_flight()
            with self._lock:
                n_jumps = self._watch.counts.n_jumps
                believed = [(frame.t_s, pose) for frame in frames if (pose := self._take(frame, in_flight)) is not None]
                self._failure = self._tracker.failure
                now_s = time.monotonic()
                state = self._state(now_s)
                # also one that was over before anybody looked
                status = Status.JUMPED if self._watch.counts.n_jumps > n_jumps else state.status
                text = self._text(status, now_s)
            for t_s, pose in believed:
                self._send(t_s, pose)
            if guard is not None:
                guard.look(status, f"motion capture: {text}", now_s)
            self._restart_if_silent(now_s, bool(frames))

    def _take(self, frame: Frame, in_flight: bool) -> Pose | None:
        self._bodies = tuple(frame.bodies)
        values = frame.bodies.get(self.config.body)
        pose = None if values is None else make_pose(values, self.config.up)
        pose = None if pose is None else self._frame.into(pose)
        return self._watch.take(frame.t_s, pose, is_present=values is not None, in_flight=in_flight)

    def _send(self, t_s: float, pose: Pose) -> None:
        period_s = 1.0 / self.config.send_hz
        if self._sink is None or t_s < self._t_due_s - _EARLY * period_s:
            return
        # on a steady grid, but never behind it
        self._t_due_s = max(self._t_due_s + period_s, t_s)
        try:
            self._sink.send_extpose(*pose.p_W_m, *pose.q_WB)
            self._n_sent += 1
            self._sink_error = ""
        except (LinkError, OSError, AttributeError, RuntimeError) as error:
            # cflib's link may be closed between its own test and its use: AttributeError
            self._sink_error = str(error) or type(error).__name__

    def _restart_if_silent(self, now_s: float, has_frames: bool) -> None:
        assert self._tracker is not None
        if has_frames:
            self._t_alive_s, self._has_connected = now_s, True
        # one that has not brought a frame yet is ended by its own `connect_s`: cut short, it might never get there
        is_over = self._has_connected or self._failure
        if now_s - self._t_alive_s > (self.config.restart_s if is_over else self.config.connect_s + START_S):
            self._tracker.close()
            self._tracker, self._t_alive_s = Tracker(self._request), time.monotonic()
            self._has_connected = False
            self._n_restarts += 1

    def _state(self, now_s: float) -> MocapState:
        status = self._watch.status(now_s)
        if self._failure and (self._is_dead or status is not Status.GOOD):
            status = Status.FAILED
        return MocapState(
            status,
            self._text(status, now_s),
            self._watch.age_s(now_s),
            self._watch.pose,
            self._watch.rates(now_s),
            Counts(**asdict(self._watch.counts)),
            self._n_sent,
            self._n_restarts,
            0 if self._tracker is None else self._tracker.n_strange,
            self._bodies,
            self._sink_error,
        )

    def _text(self, status: Status, now_s: float) -> str:
        c, age_s = self.config, self._watch.age_s(now_s)
        others = ", ".join(self._bodies) or "none"
        return {
            Status.CONNECTING: f"connecting to {c.system} {c.host}".rstrip(),
            Status.GOOD: "good",
            Status.SETTLING: f"{c.body} is back, not yet for {c.settle_s:g} s",
            Status.LOST: f"{c.body} is not seen for {age_s:.2f} s (bodies that are: {others})",
            Status.SILENT: f"no frame from {c.system} for {self._watch.frame_age_s(now_s):.2f} s",
            Status.FROZEN: f"the pose of {c.body} has not changed by a bit for {age_s:.2f} s: frozen",
            Status.JUMPED: f"{c.body} has jumped",
            Status.FAILED: f"{c.system} {c.host}".rstrip() + f": {self._failure}",
        }[status]
