"""Requests again until they are answered; log control one request at a time, and no step of it twice."""

from collections import deque
from dataclasses import dataclass

from ivl.can import requests

PERIOD_S = 0.05
LIMIT_S = 2.0


@dataclass
class _Waiting:
    packet: bytes
    t_first_s: float
    t_last_s: float


class Repeater:
    """At the host: what it asked and was not answered. Times are given by the caller.

    The host sends the steps that build a log block without waiting for answers. If the first one were lost and repeated
    later, the block would be another one; so each request of log control waits until the one before is answered.
    """

    def __init__(self, period_s: float = PERIOD_S, limit_s: float = LIMIT_S) -> None:
        """A request is due again every `period_s`, and given up after `limit_s`."""
        self._period_s, self._limit_s = period_s, limit_s
        self._waiting: dict[bytes, _Waiting] = {}
        self._log_control: deque[bytes] = deque()
        self._log_expected: bytes | None = None
        self.n_repeated = 0
        self.n_given_up = 0

    def offer(self, packet: bytes, t_s: float) -> list[bytes]:
        """Take a packet of the host; what is to be sent now."""
        if requests.is_log_control(packet):
            self._log_control.append(packet)
            return self._next_log_control(t_s)
        self._remember(packet, t_s)
        return [packet]

    def answered(self, packet: bytes, t_s: float) -> list[bytes]:
        """Take a packet of the vehicle; what is to be sent now."""
        for expected in [key for key in self._waiting if requests.answers(packet, key)]:
            del self._waiting[expected]
        return self._next_log_control(t_s)

    def due(self, t_s: float) -> list[bytes]:
        """What is to be sent now because time has passed."""
        for expected in [key for key, w in self._waiting.items() if t_s - w.t_first_s > self._limit_s]:
            del self._waiting[expected]
            self.n_given_up += 1
        again = [w for w in self._waiting.values() if t_s - w.t_last_s >= self._period_s]
        for waiting in again:
            waiting.t_last_s = t_s
        self.n_repeated += len(again)
        return [waiting.packet for waiting in again] + self._next_log_control(t_s)

    def clear(self) -> None:
        """Forget all, because the host is gone."""
        self._waiting.clear()
        self._log_control.clear()

    @property
    def n_waiting(self) -> int:
        """Requests that are not answered yet."""
        return len(self._waiting) + len(self._log_control)

    def _remember(self, packet: bytes, t_s: float) -> bytes | None:
        expected = requests.answer_of(packet)
        if expected is not None:
            # a newer request with the same answer takes the place of an older one
            self._waiting[expected] = _Waiting(packet, t_s, t_s)
        return expected

    def _next_log_control(self, t_s: float) -> list[bytes]:
        if not self._log_control or self._log_expected in self._waiting:
            return []
        packet = self._log_control.popleft()
        self._log_expected = self._remember(packet, t_s)
        return [packet]


class LogMemory:
    """Beside the vehicle: the last request of log control and its answer, so that no block is built twice."""

    def __init__(self) -> None:
        """Nothing yet."""
        self._request: bytes | None = None
        self._answer: bytes | None = None

    def forward(self, packet: bytes) -> tuple[bool, bytes | None]:
        """Whether a packet of the host goes on to the vehicle; if not, the answer from memory once there is one."""
        if not requests.is_log_control(packet):
            return True, None
        if packet == self._request and (self._answer is not None or requests.builds_block(packet)):
            return False, self._answer
        self._request, self._answer = packet, None
        return True, None

    def answered(self, packet: bytes) -> None:
        """Take a packet of the vehicle."""
        expected = None if self._request is None else requests.answer_of(self._request)
        if self._answer is None and expected is not None and requests.answers(packet, expected):
            self._answer = packet
