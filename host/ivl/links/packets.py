"""Packets of the app channel and the flight recorder, laid out by the library's own tables.

parts = encode_policy(7, forms.by_name("constant"), [4.8, 8.0])
echo = decode(received)          # None if it is none of ours
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import forms, native
from ivl.errors import LinkError

RECORD_MAGIC = 0x524C5649
RECORD_VERSION = 2
RECORD_NO_ROW = 0xFFFF


class PacketType(IntEnum):
    """First byte of a packet; see firmware/core/ivl_wire.h."""

    POLICY = 0x01
    COMMAND = 0x02
    READING = 0x03
    POLICY_ECHO = 0x81
    COMMAND_ECHO = 0x82
    CONFIG_ECHO = 0x83


class Status(IntEnum):
    """What an echo says."""

    OK = 0
    RANGE = -1
    PHASE = -2
    NO_CONTROLLER = -3
    FORM = -4
    CRC = -5
    INCOMPLETE = -6


class Request(IntEnum):
    """What the operator wants."""

    IDLE = 0
    HOVER = 1
    APPROACH = 2
    ABORT = 3


class Phase(IntEnum):
    """Phases of a landing, as in firmware/core/ivl_types.h."""

    IDLE = 0
    READY = 1
    APPROACH = 2
    FLIP = 3
    COAST = 4
    ATTACHED = 5
    DONE = 6
    ABORTED = 7
    LEVEL_OUT = 8


STATUS_TEXT = {
    Status.OK: "done",
    Status.RANGE: "out of range",
    Status.PHASE: "not in this phase",
    Status.NO_CONTROLLER: "another controller is selected",
    Status.FORM: "its firmware does not have this form of policies",
    Status.CRC: "what arrived does not have the checksum that was sent",
    Status.INCOMPLETE: "parts of it did not arrive",
}


@dataclass(frozen=True)
class Packet:
    """One received packet: its type and its members."""

    type: PacketType
    values: Mapping[str, int | float]

    def __getitem__(self, name: str) -> int | float:
        """A member by name."""
        return self.values[name]


_TYPES = frozenset(PacketType)


def encode(kind: PacketType, **values: float) -> bytes:
    """Bytes of a packet; every member must be given.

    Raises:
        ValueError: A member is missing, unknown, or does not fit its type.
    """
    dtype = _dtype(kind)
    if set(values) != set(dtype.names or ()):
        raise ValueError(f"{kind.name}: members are {', '.join(dtype.names or ())}, not {', '.join(values)}")
    record = np.zeros(1, dtype=dtype)
    for name, value in values.items():
        try:
            record[name] = value
        except OverflowError as error:
            raise ValueError(f"{kind.name}: {name}: value {value!r} does not fit into {dtype[name]}") from error
    head = bytes((kind, native.library().wire_version()))
    return head + record.tobytes()[len(head) :]


def encode_policy(seq: int, form: forms.Form, theta: npt.ArrayLike) -> list[bytes]:
    """The packets that bring a policy, in order: theta in the units of the form.

    Raises:
        ArgumentError: theta is not one of the form.
    """
    names = [name for name in _dtype(PacketType.POLICY).names or () if name.startswith("theta")]
    values, crc = form.to_si(theta), form.crc(theta)
    packets = []
    for part, first in enumerate(range(0, form.n, len(names))):
        own = values[first : first + len(names)].tolist() + [0.0] * len(names)
        thetas = dict(zip(names, own, strict=False))
        packets.append(encode(PacketType.POLICY, seq=seq, crc=crc, form=form.number, n=form.n, part=part, **thetas))
    return packets


def encode_reading(rrev_per_s: float | None, of_y_radps: float | None = None, age_s: float = 0.0) -> bytes:
    """Bytes of READING: what a camera saw of the ceiling, `age_s` ago; None stands for what it did not see."""
    valid = (rrev_per_s is not None) + 2 * (of_y_radps is not None)
    return encode(
        PacketType.READING, valid=valid, age_s=age_s, rrev_per_s=rrev_per_s or 0.0, of_y_radps=of_y_radps or 0.0
    )


def decode(data: bytes) -> Packet | None:
    """A packet of the vehicle; None unless type, version and size are right."""
    if len(data) < 2 or data[0] not in _TYPES or data[1] != native.library().wire_version():
        return None
    kind = PacketType(data[0])
    dtype = _dtype(kind)
    if len(data) != dtype.itemsize:
        return None
    record = np.frombuffer(data, dtype=dtype)[0]
    return Packet(kind, MappingProxyType({name: record[name].item() for name in dtype.names or ()}))


@dataclass(frozen=True)
class Recording:
    """A downloaded flight recorder.

    Attributes:
        n_cycle: Its number since the start of the vehicle.
        policy_seq: Number of the policy that triggered or was called off, 0 if neither happened.
        policy_crc: Its checksum.
        trigger_row: Row of the trigger tick, None if the trigger did not fire.
        tick_hz: Rows per second.
        rows: Structured array in SI units, shape (n_rows,): t_s from the first row on, p_W_m (3), v_W_mps (3),
            q_WB (4; x, y, z, w), w_B_radps (3), f_B_mps2 (3), d_ceil_m, thrust_N (4), phase, rule.
    """

    n_cycle: int
    policy_seq: int
    policy_crc: int
    trigger_row: int | None
    tick_hz: float
    rows: np.ndarray[Any, np.dtype[np.void]]

    def to_csv(self) -> str:
        """The rows as text, one column for each component, units in the names."""
        columns = {}
        for name in self.rows.dtype.names or ():
            parts = self.rows[name].reshape(len(self.rows), -1)
            axes = {1: ("",), 3: ("_x", "_y", "_z"), 4: ("_x", "_y", "_z", "_w") if name == "q_WB" else "1234"}
            for axis, values in zip(axes[parts.shape[1]], parts.T, strict=True):
                stem, _, unit = name.partition("_")
                columns[name + axis if not unit or name == "q_WB" else f"{stem}{axis}_{unit}"] = values
        lines = [",".join(columns)]
        lines += [",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True)]
        return "\n".join(lines) + "\n"


_ROW_NAMES = {
    "p": "p_W_m", "v": "v_W_mps", "q": "q_WB", "w": "w_B_radps", "f": "f_B_mps2", "d": "d_ceil_m", "thrust": "thrust_N",
}  # fmt: skip


def record_header(data: bytes) -> Mapping[str, int | float]:
    """Header of the flight recorder.

    Raises:
        LinkError: It is none, or of another version.
    """
    dtype = native.library().layout(native.LAYOUT_RECORD_HEADER)[1]
    header = np.frombuffer(data[: dtype.itemsize], dtype=dtype)[0]
    values = {name: header[name].item() for name in dtype.names or ()}
    row_size = native.library().layout(native.LAYOUT_RECORD_ROW)[1].itemsize
    found = (values["magic"], values["version"], values["row_size"])
    if found != (RECORD_MAGIC, RECORD_VERSION, row_size):
        raise LinkError(f"flight recorder: its header {found} is of another version than {RECORD_VERSION}")
    return MappingProxyType(values)


def record_rows(header: Mapping[str, int | float], data: bytes) -> Recording:
    """The recording whose rows are in `data`, which begins behind the header."""
    fields, raw_dtype = native.library().layout(native.LAYOUT_RECORD_ROW)
    raw = np.frombuffer(data, dtype=raw_dtype, count=int(header["n_rows"]))
    shapes = [("t_s", "f8", ())]
    shapes += [(_ROW_NAMES.get(name, name), _si_type(name), raw_dtype[name].shape) for name in fields if name != "t_us"]
    rows = np.zeros(len(raw), dtype=shapes)
    if len(raw):
        rows["t_s"] = (raw["t_us"] - raw["t_us"][0]).astype(np.uint32) * 1e-6
    for name, field in fields.items():
        if name != "t_us":
            rows[_ROW_NAMES.get(name, name)] = raw[name] / field.default if name in _ROW_NAMES else raw[name]
    rows["thrust_N"] *= header["thrust_N_max"]
    begin_row = int(header["trigger_row"])
    # a recording may also begin with a level-out
    is_trigger = begin_row != RECORD_NO_ROW and rows["phase"][begin_row] != Phase.LEVEL_OUT
    return Recording(
        int(header["n_cycle"]),
        int(header["policy_seq"]),
        int(header["policy_crc"]),
        begin_row if is_trigger else None,
        float(header["tick_hz"]),
        rows,
    )


def _si_type(name: str) -> str:
    return "f8" if name in _ROW_NAMES else "u1"


@cache
def _dtype(kind: PacketType) -> np.dtype[np.void]:
    return native.library().layout(kind)[1]
