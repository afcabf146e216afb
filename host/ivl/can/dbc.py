"""Frames of ivl.dbc as python-can messages and back, with every value checked before it is encoded."""

import math
from collections.abc import Mapping
from pathlib import Path

import cantools
from can import Message
from cantools.database.can import Database

from ivl.can.ident import N_NODES
from ivl.errors import ConfigError, IvlError

FILE = Path(__file__).parent / "ivl.dbc"
UNKNOWN = "unknown"
"""Name of the value that stands for a value that is not known."""


class RangeError(IvlError, ValueError):
    """A value is no number, or outside the range that ivl.dbc states for it."""


class Codec:
    """The frames of one node."""

    def __init__(self, node: int) -> None:
        """Read ivl.dbc; identifiers of `node` are that many higher than those of node 0."""
        if not 0 <= node < N_NODES:
            raise ConfigError(f"node: value {node} is out of range (allowed 0 .. {N_NODES - 1})")
        self.database = database(node)
        self._ids = {message.frame_id: message for message in self.database.messages}

    def encode(self, name: str, values: Mapping[str, float | None]) -> Message:
        """One frame; None stands for a value that is not known.

        Raises:
            RangeError: A value is not finite or out of range, or None where "unknown" cannot be said.
        """
        message = self.database.get_message_by_name(name)
        checked: dict[str, float | str] = {}
        for signal in message.signals:
            value = values[signal.name]
            if value is None:
                if UNKNOWN not in map(str, (signal.choices or {}).values()):
                    raise RangeError(f"{name}.{signal.name}: a value is needed")
                checked[signal.name] = UNKNOWN
                continue
            low, high = signal.minimum, signal.maximum
            if low is None or high is None or not (math.isfinite(value) and low <= value <= high):
                raise RangeError(f"{name}.{signal.name}: value {value} is out of range (allowed {low} .. {high})")
            checked[signal.name] = value
        return Message(
            arbitration_id=message.frame_id,
            is_extended_id=False,
            data=message.encode(checked, strict=False),
        )

    def decode(self, frame: Message) -> tuple[str, dict[str, float | str | None]] | None:
        """Name and values of a frame of this node; None if it is none.

        A value is text where ivl.dbc gives it a name, and None where that name is "unknown".
        """
        if frame.is_extended_id or frame.is_error_frame or frame.is_remote_frame:
            return None
        message = self._ids.get(frame.arbitration_id)
        if message is None or len(frame.data) != message.length:
            return None
        decoded = message.decode_simple(bytes(frame.data))
        values = {key: value if isinstance(value, int | float) else str(value) for key, value in decoded.items()}
        return message.name, {key: None if value == UNKNOWN else value for key, value in values.items()}


def database(node: int) -> Database:
    """The frames of one node, for any tool: `database(3).as_dbc_string()`."""
    frames = cantools.database.load_file(FILE)
    assert isinstance(frames, Database)
    for message in frames.messages:
        message.frame_id += node
    frames.refresh()
    return frames
