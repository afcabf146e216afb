"""One end of the link on a bus: packets, heartbeats, and what is wrong with the bus."""

from dataclasses import asdict
from enum import StrEnum

import can

from ivl.can.dbc import Codec
from ivl.can.fragments import Joiner, Splitter
from ivl.can.ident import PRIO_SAFETY, prio_of
from ivl.can.outbox import N_PRIORITIES, Outbox
from ivl.errors import LinkError

HEARTBEAT_S = 0.1
TIMEOUT_S = 0.3
"""Without a heartbeat of the other end for so long, the link is down."""
TRY_S = 0.001
"""An interface may wait so long for room in its queue; what it refuses then is tried again later."""
_FOR_PEOPLE = N_PRIORITIES - 1
_U16 = 0xFFFF

_ERROR_CONTROLLER, _ERROR_BUS_OFF = 0x004, 0x040
"""Classes of an error frame, as Linux numbers them."""
_PASSIVE = 0x10 | 0x20


class State(StrEnum):
    """What a heartbeat says about the end that sends it."""

    RUNNING = "running"
    PEER_LOST = "peer_lost"
    NO_VEHICLE = "no_vehicle"
    STOPPED = "stopped"


_ADVICE = "look at cable, termination and bit rate, then start the gateway again"


class BusError(LinkError):
    """The bus cannot be used until somebody has looked at it; the gateway must be started again."""


class CanLink:
    """One end, at the host or at the vehicle; times are given by the caller."""

    def __init__(self, bus: can.BusABC, node: int, at_host: bool, fd: bool = False, heeds_errors: bool = True) -> None:
        """Speak with the other end of `node`'s link on `bus`; `heeds_errors`: error frames come from a controller."""
        self._heeds_errors = heeds_errors
        self._bus, self.codec = bus, Codec(node)
        self._splitter, self._joiner = Splitter(node, at_host, fd), Joiner(node, not at_host)
        self._own, self._peer = ("HEARTBEAT_HOST", "HEARTBEAT_VEHICLE")[:: 1 if at_host else -1]
        self._next_beat_s = self._t_heard_s = float("-inf")
        self._outbox = Outbox(lambda frame: bus.send(frame, timeout=TRY_S))
        self._peer_state: State | None = None
        self._n_beats = 0
        self.n_frames_in = self.n_error_frames = 0

    def hears_peer(self, t_s: float) -> bool:
        """Whether the other end was heard in time."""
        return t_s - self._t_heard_s <= TIMEOUT_S

    def is_up(self, t_s: float) -> bool:
        """Whether both ends hear each other, and nothing is wrong at the other one."""
        return self.hears_peer(t_s) and self._peer_state is State.RUNNING

    def peer_text(self, t_s: float) -> str:
        """The other end, for people."""
        if self._peer_state is None:
            return "not heard yet"
        return str(self._peer_state) if self.hears_peer(t_s) else f"silent for {t_s - self._t_heard_s:.1f} s"

    def send(self, packet: bytes, t_s: float) -> None:
        """Send a packet of 1 .. 31 bytes, now or as soon as the bus takes it; see `Outbox`.

        Raises:
            BusError: Nothing could be sent for a while.
        """
        self._put(self._splitter.split(packet), prio_of(packet[0]), t_s)

    def show(self, frame: can.Message, t_s: float) -> None:
        """Send a frame that people look at, after all others (errors as `send`)."""
        self._put([frame], _FOR_PEOPLE, t_s)

    def pump(self, t_s: float) -> bool:
        """Send what waits; returns whether anything still does.

        Raises:
            BusError: Nothing could be sent for a while.
        """
        self._outbox.pump(t_s)
        self._check_outbox(t_s)
        return self._outbox.is_waiting

    @property
    def is_waiting(self) -> bool:
        """Whether the bus has not taken all that was sent."""
        return self._outbox.is_waiting

    def _check_outbox(self, t_s: float) -> None:
        if self._outbox.refused_s(t_s) >= TIMEOUT_S:
            error = self._outbox.error
            self._outbox.drop_all()
            raise BusError(f"CAN bus: nothing could be sent for {TIMEOUT_S:g} s: {error}; {_ADVICE}")

    def _put(self, frames: list[can.Message], prio: int, t_s: float) -> None:
        self._outbox.put(frames, prio, t_s)
        self._check_outbox(t_s)

    def take(self, frame: can.Message, t_s: float) -> bytes | None:
        """Take a frame of the bus; the packet that it completes, if it does.

        Raises:
            BusError: It says that the bus is off, or that a controller has become error-passive.
        """
        self.n_frames_in += 1
        if frame.is_error_frame:
            self.n_error_frames += 1
            if self._heeds_errors:
                _check_error_frame(frame)
            return None
        packet = self._joiner.join(frame)
        if packet is None:
            self._take_heartbeat(frame, t_s)
        return packet

    def count_bad(self) -> None:
        """Something came that was no frame."""
        self._joiner.counts.n_bad += 1

    def beat(self, state: State, n_repeated: int, t_s: float) -> None:
        """Look at the bus and send a heartbeat, whenever it is time for it.

        Raises:
            BusError: As `send` and `take`.
        """
        if t_s < self._next_beat_s:
            return
        self._next_beat_s = t_s + HEARTBEAT_S
        self._check_state()
        self.say(state, n_repeated, t_s)

    def say(self, state: State, n_repeated: int, t_s: float) -> None:
        """Send a heartbeat now."""
        self._n_beats = (self._n_beats + 1) % 256
        counts = self._joiner.counts
        values = {
            "state": list(State).index(state),
            "count": self._n_beats,
            "n_missing": min(counts.n_missing, _U16),
            "n_bad": min(counts.n_bad, _U16),
            "n_repeated": min(n_repeated, _U16),
        }
        self._put([self.codec.encode(self._own, values)], PRIO_SAFETY, t_s)

    def report(self) -> dict[str, int]:
        """Counts since the start."""
        return {
            **asdict(self._joiner.counts),
            "n_frames_in": self.n_frames_in,
            "n_frames_out": self._outbox.n_sent,
            "n_unsent": self._outbox.n_unsent,
            "n_error_frames": self.n_error_frames,
        }

    def _take_heartbeat(self, frame: can.Message, t_s: float) -> None:
        decoded = self.codec.decode(frame)
        if decoded is not None and decoded[0] == self._peer and decoded[1]["state"] in list(State):
            self._t_heard_s, self._peer_state = t_s, State(str(decoded[1]["state"]))

    def _check_state(self) -> None:
        try:
            state = self._bus.state
        except NotImplementedError:  # an interface that cannot tell; error frames are still seen
            return
        if state is not can.BusState.ACTIVE:
            what = "error-passive" if state is can.BusState.PASSIVE else "bus-off"
            raise BusError(f"CAN bus: the controller is {what}; {_ADVICE}")


def _check_error_frame(frame: can.Message) -> None:
    if frame.arbitration_id & _ERROR_BUS_OFF:
        raise BusError(f"CAN bus: bus-off; {_ADVICE}")
    if frame.arbitration_id & _ERROR_CONTROLLER and len(frame.data) > 1 and frame.data[1] & _PASSIVE:
        raise BusError(f"CAN bus: the controller has become error-passive; {_ADVICE}")
