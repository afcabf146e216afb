"""Which CRTP packets of a host may be sent again until their answer arrives, and which answer is theirs.

Only requests that may be executed twice are listed: reading tables, parameters, memory and versions, writing a value to
a named place, starting and stopping log blocks. Set-points, commands of the supervisor, positions and the app channel
are not: sent late, they would do harm, or their sender repeats them itself.
"""

from collections.abc import Callable

from ivl.can.ident import split_header

_PARAM, _MEMORY, _LOG, _SUPERVISOR, _PLATFORM, _LINK = 0x2, 0x4, 0x5, 0x9, 0xD, 0xF
_LOG_BUILD = (0x00, 0x01, 0x06, 0x07)
_LOG_RESET = 0x05
_SET_BY_NAME = 0x00
_ITEM_LENGTHS = {0x00: 2, 0x01: 1, 0x02: 3, 0x03: 1}
"""Commands of a table of contents -> bytes that an answer repeats (the two of version 1 have a one-byte number)."""


def _table(payload: bytes) -> bytes | None:
    length = _ITEM_LENGTHS.get(payload[0])
    return None if length is None else payload[:length]


def _log_control(payload: bytes) -> bytes | None:
    return payload[:1] if payload[0] == _LOG_RESET else payload[:2]


def _memory_info(payload: bytes) -> bytes | None:
    return payload[:2]


def _param_misc(payload: bytes) -> bytes | None:
    if payload[0] != _SET_BY_NAME:
        return payload[:3]
    names = payload.split(b"\0")
    return b"\0".join(names[:3]) + b"\0" if len(names) > 3 else None


def _first(n_bytes: int) -> Callable[[bytes], bytes | None]:
    return lambda payload: payload[:n_bytes] if len(payload) >= n_bytes else None


_RULES: dict[tuple[int, int], Callable[[bytes], bytes | None]] = {
    (_PARAM, 0): _table,
    (_PARAM, 1): _first(2),
    (_PARAM, 2): _first(2),
    (_PARAM, 3): _param_misc,
    (_MEMORY, 0): _memory_info,
    (_MEMORY, 1): _first(5),
    (_MEMORY, 2): _first(5),
    (_LOG, 0): _table,
    (_LOG, 1): _log_control,
    (_SUPERVISOR, 0): lambda payload: bytes([payload[0] | 0x80]),
    (_PLATFORM, 1): _first(1),
    (_LINK, 1): lambda _: b"",
}
"""Port and channel -> how the payload of the answer begins; None: not a request that may be repeated."""


def answer_of(request: bytes) -> bytes | None:
    """Header (without its link bits) and first payload bytes of the answer to a request.

    Args:
        request: A whole packet of the host.

    Returns:
        None if the packet must not be sent again.
    """
    rule = _RULES.get(split_header(request[0]))
    if rule is None or len(request) < 2:
        return None
    begin = rule(request[1:])
    return None if begin is None else bytes([request[0] & 0xF3]) + begin


def answers(packet: bytes, expected: bytes) -> bool:
    """Whether a packet of the vehicle is the answer that `answer_of` named."""
    return (bytes([packet[0] & 0xF3]) + packet[1:]).startswith(expected)


def is_log_control(packet: bytes) -> bool:
    """Whether a packet builds, starts, stops or deletes log blocks, or answers such a request."""
    return split_header(packet[0]) == (_LOG, 1) and len(packet) > 1


def builds_block(packet: bytes) -> bool:
    """Whether a packet creates a log block or appends to one: done twice, variables would be in it twice."""
    return is_log_control(packet) and packet[1] in _LOG_BUILD


def is_arming(packet: bytes) -> bool:
    """Whether a packet arms the motors, in the protocol's present or older form."""
    return packet[0] & 0xF3 in (0x91, 0xD0) and packet[1:2] == b"\x01" and packet[2:3] not in (b"", b"\0")
