"""Who makes time pass for the vehicle: the wall clock, or the host, step by step (lock-step)."""

import time
from dataclasses import dataclass
from typing import Protocol

from ivl.errors import LinkError
from ivl.links.tables import LogBlock, Session


@dataclass(frozen=True)
class Pace:
    """Steps of vehicle time.

    Attributes:
        beat_s: Between two commands, the vehicle's proof that its host lives.
        poll_s: Between two looks for an answer of the vehicle.
    """

    beat_s: float
    poll_s: float


FINE = Pace(beat_s=0.08, poll_s=0.01)
"""12.5 Hz: of six commands in a row, one must arrive."""
COARSE = Pace(beat_s=0.2, poll_s=0.06)
"""Fewer round trips, for a vehicle whose time waits until it has heard its host."""

_TIME_SEEN_S = 2.0
_CATCH_UP_MS = 200


class Clock(Protocol):
    """Vehicle time as the host sees it."""

    pace: Pace

    def now_s(self) -> float:
        """Time, s, from an arbitrary zero."""
        ...

    def pause(self, span_s: float) -> None:
        """Return when the vehicle has lived for another `span_s`, s."""
        ...

    def close(self) -> None:
        """Give time back."""
        ...


class WallClock:
    """The vehicle lives in real time."""

    pace = FINE

    def now_s(self) -> float:
        """Monotonic clock, s."""
        return time.monotonic()

    def pause(self, span_s: float) -> None:
        """Sleep."""
        time.sleep(span_s)

    def close(self) -> None:
        """Nothing to give back."""


class LockStep:
    """A software vehicle whose time stands still until it is told how far to go.

    All packets sent before a step are taken in that step, and all that it sends have arrived when `pause` returns, so a
    flight is a function of the packets alone: the same on a busy machine and on an idle one.
    """

    def __init__(self, session: Session, pace: Pace = FINE) -> None:
        """Stop the vehicle's time, and learn where it stands.

        Raises:
            LinkError: The vehicle does not tell its time.
        """
        self._session, self.pace = session, pace
        block = LogBlock(("sil.time_ms",), 10)
        session.write({"sil.lockstep": 0})
        session.start_log(block)
        began_s = time.monotonic()
        while not block.values:
            session.check()
            if time.monotonic() - began_s > _TIME_SEEN_S:
                raise LinkError(f"{session.uri}: log variable sil.time_ms did not come within {_TIME_SEEN_S:g} s")
            time.sleep(0.002)
        session.write({"sil.lockstep": 1})
        self._block = block
        self._now_ms = int(block.values["sil.time_ms"]) + _CATCH_UP_MS
        self._run()

    def now_s(self) -> float:
        """Vehicle time since its boot, s."""
        return self._now_ms * 1e-3

    def pause(self, span_s: float) -> None:
        """Let the vehicle live for `span_s`, rounded to whole milliseconds, at least one."""
        self._now_ms += max(round(span_s * 1e3), 1)
        self._run()

    def _run(self) -> None:
        self._session.write({"sil.run_to_ms": self._now_ms})

    def close(self) -> None:
        """Let time pass as it did when the vehicle was started, unless the link is gone.

        What it was before this host came may be what a host that died has left.
        """
        if not self._session.cf.lost:
            self._session.write({"sil.lockstep": self._session.default("sil.lockstep")})
