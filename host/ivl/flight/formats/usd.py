"""Binary logs of the Crazyflie's micro-SD card (usddeck of the firmware, versions 1 and 2 of the file).

Little-endian: 0xBC, version (u16), number of kinds of event (u16); for each kind its number (u16), its name up to a
zero byte, its number of variables (u16), and each variable as "group.name(type)" up to a zero byte, the type as a
letter of Python's struct module. Then events: number (u16), time (version 1: u32 ms; 2: u64 us), the variables. At
the end the CRC-32 of everything before.
"""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ivl.errors import ConfigError
from ivl.flight import bitcraze, streams
from ivl.flight import table as border
from ivl.flight.log import Format, Given, Log
from ivl.flight.store import Flight
from ivl.flight.table import Table, Values

_MAGIC, _CRC_BYTES = 0xBC, 4
_HEADER = struct.Struct("<BHH")
_TIME = {1: ("<u4", 1e-3), 2: ("<u8", 1e-6)}
_TYPES = {"B": "<u1", "b": "<i1", "H": "<u2", "h": "<i2", "I": "<u4", "i": "<i4", "f": "<f4", "e": "<f2"}
_CLOCK = "The vehicle's clock, from the first sample of each flight on: "


@dataclass(frozen=True)
class _Kind:
    """One kind of event: its name and the layout of its records."""

    name: str
    dtype: np.dtype[np.void]


def load(paths: Sequence[Path], given: Given) -> Log:
    """Read card files, each a recording of its own."""
    flights: list[Flight] = []
    clocks: dict[str, None] = {}
    for path in paths:
        found = [
            bitcraze.stream(name, table, border.clock(table, "time", scale), given)
            for name, table, scale in tables(path)
        ]
        members, clock = bitcraze.flights(streams.known(found, given, str(path)))
        flights += members
        clocks[clock] = None
    return Log(flights, paths, bitcraze.FRAMES, _CLOCK + " | ".join(clocks), notes=bitcraze.NOTES)


FORMAT = Format("usd", "binary log of the Crazyflie's micro-SD card", load)


def tables(path: Path) -> list[tuple[str, Table, float]]:
    """Every kind of event that the file has: its name, its variables with "time", and the seconds in a unit of time.

    Raises:
        ConfigError: The file is none of the card's, of another version, cut off, or damaged.
    """
    data = border.read_bytes(path)
    if data[0] != _MAGIC:
        raise ConfigError(f"{path}: begins with {data[0]:#04x}: a log of a micro-SD card begins with {_MAGIC:#04x}")
    if len(data) < _HEADER.size + _CRC_BYTES:
        raise ConfigError(f"{path}: is cut off after {len(data)} bytes")
    _, version, n_kinds = _HEADER.unpack_from(data)
    if version not in _TIME:
        raise ConfigError(f"{path}: version {version} of the file (allowed 1, 2)")
    body, told = data[:-_CRC_BYTES], int.from_bytes(data[-_CRC_BYTES:], "little")
    if (crc := zlib.crc32(body)) != told:
        raise ConfigError(f"{path}: CRC-32 is {crc:08x}, the file says {told:08x}: damaged, or never closed")
    kinds, at = _kinds(path, body, n_kinds, _TIME[version][0])
    starts = _walk(path, body, at, kinds)
    raw = np.frombuffer(body, dtype=np.uint8)
    result = []
    for number, kind in kinds.items():
        order, offsets = (np.array(part, dtype=np.intp) for part in starts[number])
        if len(offsets):
            records = raw[offsets[:, None] + np.arange(kind.dtype.itemsize)].reshape(-1).view(kind.dtype)
            names = list(kind.dtype.fields or ())[1:]
            with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN
                columns: dict[str, Values] = {name: records[name].astype(np.float64) for name in names}
            result.append((kind.name, Table(path, columns, order, "event"), _TIME[version][1]))
    if not result:
        raise ConfigError(f"{path}: holds no event")
    return result


def _kinds(path: Path, body: bytes, n_kinds: int, time_type: str) -> tuple[dict[int, _Kind], int]:
    """Kinds of events by their numbers, and where the events begin."""
    kinds: dict[int, _Kind] = {}
    at = _HEADER.size
    for _ in range(n_kinds):
        number, at = _u16(path, body, at)
        name, at = _text(path, body, at)
        n_variables, at = _u16(path, body, at)
        fields = [("number", "<u2"), ("time", time_type)]
        for _ in range(n_variables):
            variable, at = _text(path, body, at)
            stem, letter = variable[:-3], variable[-2:-1]
            if variable[-3:] != f"({letter})" or letter not in _TYPES or not stem or stem in dict(fields):
                raise ConfigError(
                    f"{path}: byte {at}: '{border.shorten(variable)}' is no variable of event {border.shorten(name)}"
                )
            fields.append((stem, _TYPES[letter]))
        if number in kinds:
            raise ConfigError(f"{path}: byte {at}: event {number} is there twice")
        kinds[number] = _Kind(name, np.dtype(fields))
    return kinds, at


def _walk(path: Path, body: bytes, at: int, kinds: dict[int, _Kind]) -> dict[int, tuple[list[int], list[int]]]:
    """For each kind the numbers of its events, counted from 1 in the file, and where they begin."""
    starts: dict[int, tuple[list[int], list[int]]] = {number: ([], []) for number in kinds}
    sizes = {number: kind.dtype.itemsize for number, kind in kinds.items()}
    event = 0
    while at < len(body):
        event += 1
        number = int.from_bytes(body[at : at + 2], "little")
        if number not in sizes:
            raise ConfigError(f"{path}: event {event} at byte {at}: there is no kind {number}")
        if at + sizes[number] > len(body):
            raise ConfigError(f"{path}: event {event} at byte {at}: is cut off")
        starts[number][0].append(event)
        starts[number][1].append(at)
        at += sizes[number]
    return starts


def _u16(path: Path, body: bytes, at: int) -> tuple[int, int]:
    if at + 2 > len(body):
        raise ConfigError(f"{path}: byte {at}: the list of events is cut off")
    return int.from_bytes(body[at : at + 2], "little"), at + 2


def _text(path: Path, body: bytes, at: int) -> tuple[str, int]:
    end = body.find(0, at)
    if end < 0:
        raise ConfigError(f"{path}: byte {at}: the list of events is cut off")
    try:
        return body[at:end].decode("ascii"), end + 1
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: byte {at}: is no name") from error
