"""What passes by, as frames of ivl.dbc: nothing is asked of the vehicle but the names of what its host logs."""

import struct
from dataclasses import dataclass

from can import Message

from ivl.can.dbc import Codec, RangeError
from ivl.can.ident import split_header
from ivl.links import packets

_LOG_TYPES = {1: "B", 2: "H", 3: "I", 4: "b", 5: "h", 6: "i", 7: "f", 8: "e"}
_TABLE, _CONTROL, _DATA, _APP = (5, 0), (5, 1), (5, 2), (13, 2)
_CREATE, _APPEND, _DELETE, _RESET, _ITEM = 0x06, 0x07, 0x02, 0x05, 0x02
_STATE = {
    "STATE_A": {"phase": "ivl.phase", "z": "stateEstimate.z", "vz": "stateEstimate.vz", "vbat": "pm.vbat"},
    "STATE_B": {"rule": "ivl.rule", "cause": "ivl.cause", "rrev": "ivl.rrev", "d_ceil": "ivl.d_ceil"},
}
"""Frame -> its signals and the logs that they show."""

_OFFERS_MAX = 4  # policies on their way that are remembered

_Entry = tuple[int, str]
"""Number of a log variable, and how `struct` names its type."""


class Observer:
    """Follows the packets between a host and a vehicle; never raises, whatever they hold."""

    def __init__(self) -> None:
        """Nothing is known yet."""
        self.values: dict[str, float] = {}
        self.policy: Policy | None = None
        self._offered: dict[tuple[int, int], dict[int, list[float]]] = {}
        self.t_changed_s = float("-inf")
        self._names: dict[int, str] = {}
        self._blocks: dict[int, list[_Entry]] = {}
        self._asked: set[int] = set()

    def from_host(self, packet: bytes) -> list[bytes]:
        """Take a packet of the host; questions to the vehicle: the names of what is logged and was not seen yet."""
        if split_header(packet[0]) == _APP:
            self._part(packet[1:])
        if split_header(packet[0]) != _CONTROL or len(packet) < 2:
            return []
        command, block = packet[1], packet[2] if len(packet) > 2 else 0
        if command == _RESET:
            self._blocks.clear()
        elif command == _DELETE:
            self._blocks.pop(block, None)
        elif command in (_CREATE, _APPEND) and len(packet) > 2:
            entries = self._entries(packet[3:])
            self._blocks[block] = entries if command == _CREATE else self._blocks.get(block, []) + entries
            return self._questions(entries)
        return []

    def from_vehicle(self, packet: bytes, t_s: float) -> bool:
        """Take a packet of the vehicle; False if it answers a question of ours, and is not for the host."""
        kind = split_header(packet[0])
        if kind == _DATA and len(packet) > 5:
            self._data(packet[1], packet[5:], t_s)
        elif kind == _TABLE and len(packet) > 5 and packet[1] == _ITEM:
            return self._item(int.from_bytes(packet[2:4], "little"), packet[5:])
        elif kind == _APP:
            self._echo(packet[1:])
        return True

    @staticmethod
    def _entries(payload: bytes) -> list[_Entry]:
        # a stray byte at the end of a full packet is no entry
        triples = [payload[i : i + 3] for i in range(0, len(payload) - 2, 3)]
        return [(int.from_bytes(t[1:], "little"), _LOG_TYPES.get(t[0] & 0xF, "")) for t in triples]

    def _questions(self, entries: list[_Entry]) -> list[bytes]:
        unknown = [number for number, _ in entries if number not in self._names and number not in self._asked]
        self._asked.update(unknown)
        return [struct.pack("<BBH", 0x50, _ITEM, number) for number in unknown]

    def _item(self, number: int, names: bytes) -> bool:
        parts = names.split(b"\0")
        if len(parts) >= 2:
            self._names[number] = b".".join(parts[:2]).decode("ascii", "replace")
        is_ours = number in self._asked
        self._asked.discard(number)
        return not is_ours

    def _data(self, block: int, data: bytes, t_s: float) -> None:
        entries = self._blocks.get(block, [])
        layout = "<" + "".join(code for _, code in entries)
        if not entries or struct.calcsize(layout) != len(data):
            return
        for (number, _), value in zip(entries, struct.unpack(layout, data), strict=True):
            if number in self._names:
                self.values[self._names[number]] = value
        self.t_changed_s = t_s

    def _echo(self, payload: bytes) -> None:
        echo = packets.decode(payload)
        if echo is not None and echo.type == packets.PacketType.POLICY_ECHO:
            key = (int(echo["seq_in_force"]), int(echo["crc_in_force"]))
            parts = self._offered.get(key, {})
            theta = [value for part in sorted(parts) for value in parts[part]]
            self.policy = Policy(*key, int(echo["form_in_force"]), tuple(theta))
            self._offered = {key: parts}

    def _part(self, payload: bytes) -> None:
        """The host's packets alone tell the parameters; the vehicle confirms them by their checksum."""
        part = packets.decode(payload)
        if part is not None and part.type == packets.PacketType.POLICY:
            key = (int(part["seq"]), int(part["crc"]))
            values = [value for name, value in part.values.items() if name.startswith("theta")]
            if key not in self._offered and len(self._offered) >= _OFFERS_MAX:
                self._offered.pop(next(iter(self._offered)))
            n_left = int(part["n"]) - len(values) * int(part["part"])
            self._offered.setdefault(key, {})[int(part["part"])] = values[: max(n_left, 0)]


@dataclass(frozen=True)
class Policy:
    """The policy in force, as far as it is known."""

    seq: int
    crc: int
    form: int
    theta: tuple[float, ...]
    """In SI; empty if the host was not heard when it sent them."""


class Telemetry:
    """Makes the frames that show what an observer knows."""

    def __init__(self, codec: Codec) -> None:
        """Frames of the codec's node."""
        self.observer = Observer()
        self.n_refused = 0
        self._codec = codec
        self._count = 0
        self._told: Policy | None = None

    def frames(self, t_s: float, fresh_s: float = 1.0) -> list[Message]:
        """State frames if something was logged in the last `fresh_s`, and the policy if it is another one."""
        frames: list[Message | None] = []
        if t_s - self.observer.t_changed_s <= fresh_s:
            self._count = (self._count + 1) % 256
            for name, signals in _STATE.items():
                values = {signal: self.observer.values.get(log) for signal, log in signals.items()}
                frames.append(self._encode(name, {**values, "count": self._count}))
        if self.observer.policy is not None and self.observer.policy != self._told:
            self._told = self.observer.policy
            frames.append(self._encode("POLICY", {"seq": self._told.seq, "crc": self._told.crc}))
            frames += [
                self._encode("POLICY_PARAM", {"form": self._told.form, "number": i, "value": value})
                for i, value in enumerate(self._told.theta)
            ]
        return [frame for frame in frames if frame is not None]

    def _encode(self, name: str, values: dict[str, float | None]) -> Message | None:
        try:
            return self._codec.encode(name, values)
        except RangeError:
            self.n_refused += 1
            return None
