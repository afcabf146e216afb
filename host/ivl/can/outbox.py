"""Frames on their way to a bus that may be full: none waits in the loop, and no packet is sent in part for long.

An interface takes as many frames as its queue holds (SocketCAN: 10 as it comes) and refuses the next one. What is
refused is tried again until its packet is too old; then the rest of that packet is dropped, since a part of it is of no
use to anybody. Packets of one priority leave in order, those of a higher one before them.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import can

N_PRIORITIES = 8
SEND_S = 0.05
"""So long a packet is tried."""


@dataclass
class _Waiting:
    frames: deque[can.Message]
    until_s: float


class Outbox:
    """Frames that a bus has not taken yet; times are given by the caller."""

    def __init__(self, send: Callable[[can.Message], None]) -> None:
        """Give frames to `send`, which raises CanError or OSError if it does not take one."""
        self._send = send
        self._queues: list[deque[_Waiting]] = [deque() for _ in range(N_PRIORITIES)]
        self._t_refused_s: float | None = None
        self.error = ""
        """Why the last frame was refused; empty if none is waiting for that."""
        self.n_sent = 0
        self.n_unsent = 0
        """Frames that were dropped."""

    @property
    def is_waiting(self) -> bool:
        """Whether anything is left to be sent."""
        return any(self._queues)

    def refused_s(self, t_s: float) -> float:
        """For so long nothing could be sent; 0 if the last frame went out."""
        return 0.0 if self._t_refused_s is None else t_s - self._t_refused_s

    def put(self, frames: Sequence[can.Message], prio: int, t_s: float) -> None:
        """Take the frames of one packet, and send what goes.

        Args:
            frames: In the order in which they must leave.
            prio: 0 .. 7, 0 first.
            t_s: Now.
        """
        self._queues[prio].append(_Waiting(deque(frames), t_s + SEND_S))
        self.pump(t_s)

    def pump(self, t_s: float) -> None:
        """Send what the bus takes, and drop what is too old."""
        for queue in self._queues:
            while queue and queue[0].until_s < t_s:
                self.n_unsent += len(queue.popleft().frames)
        for queue in self._queues:
            while queue:
                while queue[0].frames:
                    if not self._goes(queue[0].frames[0], t_s):
                        return
                    queue[0].frames.popleft()
                queue.popleft()

    def drop_all(self) -> None:
        """Nothing will be sent any more."""
        for queue in self._queues:
            self.n_unsent += sum(len(waiting.frames) for waiting in queue)
            queue.clear()

    def _goes(self, frame: can.Message, t_s: float) -> bool:
        try:
            self._send(frame)
        except (can.CanError, OSError) as error:
            self.error = str(error)
            self._t_refused_s = t_s if self._t_refused_s is None else self._t_refused_s
            return False
        self.error, self._t_refused_s = "", None
        self.n_sent += 1
        return True
