"""What only a software vehicle has: a reset, landings by specification, their true outcome, time in lock-step.

The parameters are in group `sil`; a vehicle without it is flown as a drone is.
"""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from ivl import native
from ivl.errors import LinkError
from ivl.links.packets import Phase, Request
from ivl.links.tables import LogBlock, Session
from ivl.links.vehicle import Command, Vehicle
from ivl.world import START_CODES

MEMORY_OUTCOME = 0x1E
_MAGIC = 0x4F4C5649
_HEADER = "<4L"
_AS_FLOWN = 255
_RESET_S, _SEEN_S, _ENDED_S = 2.0, 0.06, 70.0
_LAND_S, _LANDED_S = 3.0, 15.0


@dataclass(frozen=True)
class Spec:
    """A landing that a software vehicle begins exactly there, and with the random numbers, where the library does."""

    speed_mps: float
    angle_deg: float
    rrev_c_per_s: float
    moment_y_Nmm: float
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
        number = self._session.memory(MEMORY_OUTCOME)
        if number is None:
            raise LinkError(f"{self._session.uri}: the software vehicle has no outcome memory (0x1E)")
        self._memory = number
        self._block = LogBlock(("sil.episode", "sil.ended"), 20)
        self._session.start_log(self._block)

    def prepare(self, spec: Spec) -> int:
        """Tell the start of the next approach; returns the number of the landing before it."""
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
            }
        )
        return self._header()[1]

    def wait_for_outcome(self, before: int, policy_seq: int) -> np.ndarray[Any, np.dtype[np.void]]:
        """Let time pass until the landing after number `before` is over; returns its outcome, shape (1,).

        Raises:
            RolloutError: It did not end.
            LinkError: The outcome is of another landing or policy.
        """
        self._vehicle.wait(lambda: self._ended(before), _ENDED_S, "end of the landing")
        magic, episode, size, seq = self._header()
        dtype = native.library().outcome_dtype
        if (magic, size, seq) != (_MAGIC, dtype.itemsize, policy_seq) or episode == before:
            raise LinkError(
                f"outcome: landing {episode} of policy {seq} with {size} bytes (expected one after {before}, of policy "
                f"{policy_seq}, {dtype.itemsize} bytes)"
            )
        data = self._session.read_memory(self._memory, struct.calcsize(_HEADER), size, "outcome")
        return np.frombuffer(data, dtype=dtype).copy()

    def _ended(self, before: int) -> bool:
        values = self._block.values
        return bool(values) and values["sil.episode"] != before and bool(values["sil.ended"])

    def _header(self) -> tuple[int, int, int, int]:
        data = self._session.read_memory(self._memory, 0, struct.calcsize(_HEADER), "outcome: header")
        magic, episode, size, seq = struct.unpack(_HEADER, data)
        return magic, episode, size, seq

    def close(self) -> None:
        """Let the next approach begin where the vehicle hovers."""
        if not self._session.cf.lost:
            self._session.write({"sil.start": _AS_FLOWN})


def reset(vehicle: Vehicle) -> None:
    """Put a software vehicle into the air at its start point, hovering and armed; returns when its logs show that."""
    vehicle.session.write({"sil.reset": 1})
    vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _RESET_S)
    vehicle.pause(_SEEN_S)


def put_on_floor(vehicle: Vehicle) -> None:
    """What a person does with a drone that hangs or lies somewhere: it stands upright on the floor, motors off."""
    reset(vehicle)
    vehicle.land(0.0, _LAND_S)
    vehicle.wait(lambda: not vehicle.is_flying(), _LANDED_S, "landing", 0.2)


def is_sil(session: Session) -> bool:
    """Whether the vehicle is a software vehicle."""
    return session.has_param("sil.reset")


def _halves(number: int) -> tuple[int, int]:
    return number & 0xFFFF_FFFF, number >> 32
