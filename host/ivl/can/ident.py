"""The 29-bit identifier of a frame that carries (a part of) a CRTP packet.

From the most significant bit, which wins the arbitration when it is 0:

prio 3, magic 5, node 4, direction 1, last 1, fragment 2, sequence 5, CRTP header 8
"""

from dataclasses import dataclass

N_NODES = 16
N_FRAGMENTS_MAX = 4
N_SEQUENCE = 32
MAGIC = 0b10110
"""Tells our frames from those of another protocol on the same bus."""

PRIO_SAFETY = 0
PRIO_SETPOINT = 2
PRIO_REQUEST = 4
PRIO_STREAM = 6

_PORT_CONSOLE, _PORT_SETPOINT, _PORT_LOG, _PORT_POSITION = 0x0, 0x3, 0x5, 0x6
_PORT_GENERIC, _PORT_HIGH_LEVEL, _PORT_SUPERVISOR = 0x7, 0x8, 0x9


@dataclass(frozen=True)
class Ident:
    """What an identifier says.

    Attributes:
        prio: 0 .. 7, 0 wins.
        node: The vehicle, 0 .. 15.
        to_vehicle: Direction; False: from the vehicle.
        is_last: No fragment follows.
        fragment: Number of this fragment, 0 .. 3.
        sequence: Number of the packet within its node, direction and prio, modulo 32.
        header: First byte of the CRTP packet.
    """

    prio: int
    node: int
    to_vehicle: bool
    is_last: bool
    fragment: int
    sequence: int
    header: int


def pack(ident: Ident) -> int:
    """The identifier's 29 bits."""
    word = 0
    for value, n_bits in (
        (ident.prio, 3),
        (MAGIC, 5),
        (ident.node, 4),
        (ident.to_vehicle, 1),
        (ident.is_last, 1),
        (ident.fragment, 2),
        (ident.sequence, 5),
        (ident.header, 8),
    ):
        if not 0 <= value < 1 << n_bits:
            raise ValueError(f"{ident}: {value} does not fit into {n_bits} bits")
        word = word << n_bits | int(value)
    return word


def unpack(word: int) -> Ident | None:
    """What 29 bits say; None if the frame is not ours."""
    if word >> 21 & 0x1F != MAGIC:
        return None
    return Ident(
        prio=word >> 26 & 0x7,
        node=word >> 17 & 0xF,
        to_vehicle=bool(word >> 16 & 1),
        is_last=bool(word >> 15 & 1),
        fragment=word >> 13 & 0x3,
        sequence=word >> 8 & 0x1F,
        header=word & 0xFF,
    )


def split_header(header: int) -> tuple[int, int]:
    """Port and channel of a CRTP header."""
    return header >> 4, header & 0x3


def prio_of(header: int) -> int:
    """Priority of a packet by its port: what stops a vehicle overtakes what moves it, and streams wait for requests."""
    port, channel = split_header(header)
    if (port, channel) == (_PORT_SUPERVISOR, 1):
        return PRIO_SAFETY
    if port in (_PORT_SETPOINT, _PORT_POSITION, _PORT_GENERIC, _PORT_HIGH_LEVEL):
        return PRIO_SETPOINT
    if port == _PORT_CONSOLE or (port, channel) == (_PORT_LOG, 2):
        return PRIO_STREAM
    return PRIO_REQUEST
