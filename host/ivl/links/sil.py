"""What only a software vehicle has: a reset, landings by specification, their true outcome, time in lock-step.

The parameters are in group `sil`; a vehicle without it is flown as a drone is.
"""

import math
import struct
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from ivl import native
from ivl.errors import LinkError
from ivl.links.packets import Phase, Request
from ivl.links.tables import LogBlock, Session
from ivl.links.vehicle import Command, Vehicle
from ivl.world import START_CODES, World

MEMORY_OUTCOME, MEMORY_WORLD = 0x1E, 0x1F
_MAGIC = 0x4F4C5649
_HEADER = "<5L"
_AS_FLOWN = 255
PLACE_AT_START = 2
"""Value of `sil.place` that puts the vehicle on the floor at its start point."""
_RESET_S, _SEEN_S, _ENDED_S = 2.0, 0.06, 70.0
_LANDED_S = 15.0


@dataclass(frozen=True)
class Spec:
    """A landing that a software vehicle begins exactly there, and with the random numbers, where the library does."""

    speed_mps: float
    angle_deg: float
    seed: int
    stream: int
    start: str


class Sil:
    """The extras of a software vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Start the log block of the extras.

        Raises:
            LinkError: It has no outcome memory.
        """
        self._vehicle, self._session = vehicle, vehicle.session
        self._draws = b""
        self._block = LogBlock(("sil.ended", "sil.rotor_V"), 20)
        self._session.start_log(self._block)
        x, y, z = self._session.read(("sil.start_x", "sil.start_y", "sil.start_z")).values()
        self._start_W_m = (x, y, z)

    def reset(self, spec: Spec) -> tuple[float, float, float]:
        """Put the vehicle into hover, and tell it how the next approach begins; returns where it hovers, in W, m."""
        seed, stream = _halves(spec.seed), _halves(spec.stream)
        self._session.write(
            {
                "sil.seed_lo": seed[0],
                "sil.seed_hi": seed[1],
                "sil.stream_lo": stream[0],
                "sil.stream_hi": stream[1],
                "sil.start": START_CODES[spec.start],
                "sil.speed": spec.speed_mps,
                "sil.angle": spec.angle_deg,
                "sil.reset": 1,
            }
        )
        self._draws = struct.pack("<QQ", spec.seed, spec.stream)
        self._block.values = {}
        return self._start_W_m

    def wait_for_outcome(self, policy_seq: int) -> np.ndarray[Any, np.dtype[np.void]]:
        """Let time pass until the landing is over; returns its outcome, shape (1,).

        Raises:
            RolloutError: It did not end.
            LinkError: The outcome is of another landing or policy.
        """
        self._vehicle.wait(lambda: bool(self._block.values.get("sil.ended")), _ENDED_S, "end of the landing")
        return last_outcome(self._session, policy_seq, self._draws)

    @property
    def rotor_V(self) -> float:
        """Voltage of the battery that drives the rotors when the last landing began; NaN: a supply that never sags."""
        return float(self._block.values.get("sil.rotor_V", 0.0)) or math.nan

    def close(self) -> None:
        """Let the next approach begin where the vehicle hovers."""
        if not self._session.cf.lost:
            self._session.write({"sil.start": _AS_FLOWN})


def last_outcome(session: Session, policy_seq: int, draws: bytes | None = None) -> np.ndarray[Any, np.dtype[np.void]]:
    """The outcome of the last landing that a software vehicle has brought to an end, shape (1,).

    Args:
        session: Of a software vehicle.
        policy_seq: Number of the policy that the landing flew.
        draws: Seed and stream of the landing as they were sent; None: those that the vehicle has.

    Raises:
        LinkError: It has none, or that of another landing or policy.
    """
    number = session.memory(MEMORY_OUTCOME)
    if number is None:
        raise LinkError(f"{session.uri}: the software vehicle has no outcome memory (0x1E)")
    dtype, size = native.library().outcome_dtype, struct.calcsize(_HEADER)
    data = session.read_memory(number, 0, size + dtype.itemsize, "outcome")
    magic, n_landing, found_size, seq, crc = struct.unpack(_HEADER, data[:size])
    if (magic, found_size, seq) != (_MAGIC, dtype.itemsize, policy_seq):
        raise LinkError(
            f"outcome: landing {n_landing} of policy {seq} with {found_size} bytes (expected one of policy "
            f"{policy_seq}, {dtype.itemsize} bytes)"
        )
    if draws is None:
        numbers = session.read(("sil.seed_lo", "sil.seed_hi", "sil.stream_lo", "sil.stream_hi")).values()
        draws = struct.pack("<4L", *map(int, numbers))
    if crc != zlib.crc32(draws + data[size:]):
        raise LinkError(f"outcome: landing {n_landing}: its check sum is that of other random numbers, or bytes")
    return np.frombuffer(data[size:], dtype=dtype).copy()


def reset(vehicle: Vehicle) -> None:
    """Put a software vehicle into the air at its start point, hovering and armed; returns when its logs show that."""
    vehicle.session.write({"sil.reset": 1})
    vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _RESET_S)
    vehicle.pause(_SEEN_S)


def differences(session: Session, world: World) -> list[str]:
    """What a software vehicle simulates otherwise than `world`: name, its value, and the value here.

    The configuration of the flight core (`firmware.*`) is left out: the host sends its own.

    Raises:
        LinkError: The vehicle does not tell, or is of another version.
    """
    here = {name: value for name, value in world.params.values.items() if not name.startswith("firmware.")}
    number = session.memory(MEMORY_WORLD)
    if number is None:
        raise LinkError(f"{session.uri}: the software vehicle does not tell its world (memory 0x1F): another version?")
    there = struct.unpack(f"<{len(here)}d", session.read_memory(number, 0, 8 * len(here), "simulated world"))
    units = native.library().params
    return [
        f"{name} {other:g} (here {value:g}) {units[name].unit}"
        for (name, value), other in zip(here.items(), there, strict=True)
        if other != value
    ]


def put_on_floor(vehicle: Vehicle, place_W_m: tuple[float, float] | None = None) -> None:
    """What a person does with a drone that hangs or lies somewhere: it stands upright on the floor, motors off.

    Args:
        vehicle: A software vehicle.
        place_W_m: Where on the floor, m; None: below the point to which a reset puts it.
    """
    reset(vehicle)  # a crash and a lock are forgotten
    session = vehicle.session
    x_m, y_m = session.read(("sil.start_x", "sil.start_y")).values()
    to_m = (x_m, y_m) if place_W_m is None else place_W_m
    session.write({"sil.start_x": to_m[0], "sil.start_y": to_m[1]})
    session.write({"sil.place": PLACE_AT_START})
    session.write({"sil.start_x": x_m, "sil.start_y": y_m})
    vehicle.wait(lambda: not vehicle.is_flying(), _LANDED_S, "landing", 0.2)
    vehicle.pause(_SEEN_S)


def is_sil(session: Session) -> bool:
    """Whether the vehicle is a software vehicle."""
    return session.has_param("sil.reset")


def _halves(number: int) -> tuple[int, int]:
    return number & 0xFFFF_FFFF, number >> 32
