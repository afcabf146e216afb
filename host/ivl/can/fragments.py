"""A CRTP packet as CAN frames, and back.

Classic frames carry up to 8 bytes of payload, a packet up to 4 of them. A CAN FD frame carries a whole packet: since
its length can only be one of a few values, its first byte is the number of payload bytes, and zeros fill the rest.

Sequence numbers are counted for each priority, because a frame of a higher one may overtake. Frames of one priority
must be sent in order.
"""

from dataclasses import dataclass

from can import Message

from ivl.can.ident import N_FRAGMENTS_MAX, N_SEQUENCE, Ident, pack, prio_of, unpack

PAYLOAD_MAX = 30
"""Bytes of a CRTP packet after its header."""
CLASSIC_MAX = 8
_FD_SIZES = (8, 12, 16, 20, 24, 32)


class Splitter:
    """Makes frames of packets, for one node and direction."""

    def __init__(self, node: int, to_vehicle: bool, fd: bool) -> None:
        """All packets go to (or come from) `node`; `fd` makes one CAN FD frame of each."""
        self._node, self._to_vehicle, self._fd = node, to_vehicle, fd
        self._sequence = [0] * 8

    def split(self, packet: bytes) -> list[Message]:
        """Frames of one packet, in the order in which they must be sent.

        Raises:
            ValueError: The packet is empty, or longer than 31 bytes.
        """
        if not 1 <= len(packet) <= 1 + PAYLOAD_MAX:
            raise ValueError(f"a CRTP packet has 1 .. {1 + PAYLOAD_MAX} bytes, not {len(packet)}")
        header, payload = packet[0], packet[1:]
        prio = prio_of(header)
        sequence = self._sequence[prio]
        self._sequence[prio] = (sequence + 1) % N_SEQUENCE
        parts = [_fd_data(payload)] if self._fd else _classic_parts(payload)
        return [
            Message(
                arbitration_id=pack(
                    Ident(prio, self._node, self._to_vehicle, i == len(parts) - 1, i, sequence, header)
                ),
                is_extended_id=True,
                is_fd=self._fd,
                bitrate_switch=self._fd,
                data=part,
            )
            for i, part in enumerate(parts)
        ]


@dataclass
class Counts:
    """What a joiner has seen; never decreases. Without a fault each packet that was sent is in one of the first three.

    Attributes:
        n_packets: Packets put together.
        n_missing: Packets whose first frame did not arrive, by their sequence numbers (modulo 32).
        n_bad: Packets given up because a later fragment was missing or of the wrong size.
        n_doubled: Frames that arrived twice in a row, as CAN allows; the second one is ignored.
    """

    n_packets: int = 0
    n_missing: int = 0
    n_bad: int = 0
    n_doubled: int = 0


@dataclass
class _Stream:
    """Packets of one priority."""

    is_open: bool = False
    last: Ident | None = None
    payload: bytes = b""


class Joiner:
    """Puts packets of one node and direction together; never raises, whatever the bus carries."""

    def __init__(self, node: int, to_vehicle: bool) -> None:
        """Frames of other nodes and of the other direction are ignored."""
        self._node, self._to_vehicle = node, to_vehicle
        self._streams = [_Stream() for _ in range(8)]
        self._expected: list[int | None] = [None] * 8
        self.counts = Counts()

    def join(self, frame: Message) -> bytes | None:
        """Take one frame; the packet that it completes, if it does."""
        ident = self._ours(frame)
        if ident is None:
            return None
        stream = self._streams[ident.prio]
        if ident == stream.last:
            self.counts.n_doubled += 1
            return None
        if ident.fragment == 0:
            self._begin(stream, ident)
        elif not (stream.is_open and _continues(stream.last, ident)):
            self._give_up(stream)
            return None
        stream.last = ident
        return self._add(stream, ident, frame)

    def _ours(self, frame: Message) -> Ident | None:
        if not frame.is_extended_id or frame.is_error_frame or frame.is_remote_frame:
            return None
        ident = unpack(frame.arbitration_id)
        wanted = ident is not None and (ident.node, ident.to_vehicle) == (self._node, self._to_vehicle)
        return ident if wanted else None

    def _begin(self, stream: _Stream, ident: Ident) -> None:
        self._give_up(stream)
        expected = self._expected[ident.prio]
        if expected is not None:
            self.counts.n_missing += (ident.sequence - expected) % N_SEQUENCE
        self._expected[ident.prio] = (ident.sequence + 1) % N_SEQUENCE
        stream.is_open, stream.payload = True, b""

    def _give_up(self, stream: _Stream) -> None:
        self.counts.n_bad += stream.is_open
        stream.is_open = False

    def _add(self, stream: _Stream, ident: Ident, frame: Message) -> bytes | None:
        part = _fd_payload(frame.data) if frame.is_fd else bytes(frame.data)
        is_whole_part = ident.is_last or (not frame.is_fd and len(frame.data) == CLASSIC_MAX)
        if part is None or not is_whole_part or len(stream.payload) + len(part) > PAYLOAD_MAX:
            self._give_up(stream)
            return None
        stream.payload += part
        if not ident.is_last:
            return None
        stream.is_open = False
        self.counts.n_packets += 1
        return bytes([ident.header]) + stream.payload


def _continues(before: Ident | None, ident: Ident) -> bool:
    return before is not None and (before.fragment + 1, before.sequence, before.header) == (
        ident.fragment,
        ident.sequence,
        ident.header,
    )


def _classic_parts(payload: bytes) -> list[bytes]:
    parts = [payload[i : i + CLASSIC_MAX] for i in range(0, len(payload), CLASSIC_MAX)] or [b""]
    assert len(parts) <= N_FRAGMENTS_MAX
    return parts


def _fd_data(payload: bytes) -> bytes:
    data = bytes([len(payload)]) + payload
    size = next(size for size in _FD_SIZES if size >= len(data))
    return data.ljust(size, b"\0")


def _fd_payload(data: bytearray) -> bytes | None:
    """The payload of a CAN FD frame; None if its first byte makes no sense."""
    if not data or not data[0] < len(data) or data[0] > PAYLOAD_MAX:
        return None
    return bytes(data[1 : 1 + data[0]])
