"""What a connected vehicle says of itself now. All is read as its logs told last; nothing is asked."""

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from ivl.export.flight import Flight
from ivl.links.connection import LinkQuality
from ivl.links.packets import Phase
from ivl.links.tables import LogBlock
from ivl.world import World

if TYPE_CHECKING:
    from ivl.links.tracking import Tracking
    from ivl.links.vehicle import Vehicle

_PATIENCE_S = 0.5
"""A ping that is not answered by then counts as lost here."""
_LOG_MS = 50
_ATTITUDE = ("stateEstimate.qx", "stateEstimate.qy", "stateEstimate.qz", "stateEstimate.qw")
_CUES = {"d_sensed_m": "ivl.d_ceil", "rrev_per_s": "ivl.rrev", "of_y_radps": "ivl.of_y"}
"""Columns of a trace, and the log variables that hold them; a distance of 0 is none."""


class Contact:
    """A connected vehicle, with the tracking system that follows it."""

    def __init__(self, vehicle: "Vehicle", tracking: "Tracking | None") -> None:
        """Add the logs that a view needs beside those of every flight; in the thread that flies.

        Raises:
            LinkError: The link is gone.
        """
        self.vehicle, self.tracking = vehicle, tracking
        self.attitude = LogBlock(_ATTITUDE, _LOG_MS)
        self.cues = LogBlock(tuple(_CUES.values()), _LOG_MS)
        for block in (self.attitude, self.cues):
            vehicle.session.start_log(block)

    @property
    def q_WB(self) -> tuple[float, ...] | None:
        """Attitude by the estimate; None before it is known."""
        values = self.attitude.values
        return tuple(float(values[name]) for name in _ATTITUDE) if values else None

    def told_cues(self) -> dict[str, float]:
        """Cues by the columns of a trace, NaN where the vehicle has none."""
        values = self.cues.values
        cues = {column: float(values.get(name, math.nan)) for column, name in _CUES.items()}
        return cues if cues["d_sensed_m"] > 0.0 else dict.fromkeys(cues, math.nan)

    def now(self, world: World) -> dict[str, Any]:
        """All that the page shows of it."""
        vehicle, session = self.vehicle, self.vehicle.session
        quality = session.quality(_PATIENCE_S)
        return {
            "uri": session.uri,
            "phase": world.phase_name(int(vehicle.phase)),
            "rule": _unless_none(vehicle.rule),
            "cause": _unless_none(vehicle.cause),
            "flies": vehicle.seems_to_fly,
            "stopped": vehicle.stopped,
            "p_W_m": vehicle.position_W_m,
            "q_WB": self.q_WB,
            "sigma_m": vehicle.position_sigma_m,
            "battery_V": vehicle.battery_V,
            "cues": self.told_cues(),
            "log_age_s": max(time.monotonic() - vehicle.watch.seen_s, 0.0),
            "link": _link(quality, session.silence_s),
            "tracking": _tracking(self.tracking),
        }

    def row(self, world: World) -> Flight | None:
        """The present moment as a flight of one row, in the columns of a trace; None before the pose is known."""
        p, q, phase = self.vehicle.position_W_m, self.q_WB, self.vehicle.phase
        if q is None or not math.isfinite(p[0]):
            return None
        return row_of(world, p, q, phase, self.told_cues())


def row_of(
    world: World, p_W_m: tuple[float, ...], q_WB: tuple[float, ...], phase: Phase, cues: dict[str, float]
) -> Flight:
    """One moment as a flight of one row, at the time of the computer's clock."""
    numbers = {"t_s": time.time(), **_numbered("p_WB_m", p_W_m), **_numbered("q_WB", q_WB), **cues, "phase": phase}
    columns = {name: np.array([value]) for name, value in numbers.items()}
    return Flight("live", columns, [world.phase_name(int(phase))], world)


def _numbered(name: str, values: tuple[float, ...]) -> dict[str, float]:
    return {f"{name}_{i + 1}": value for i, value in enumerate(values)}


def _unless_none(rule: str) -> str:
    return "" if rule == "none" else rule


def _link(quality: LinkQuality, silence_s: float) -> dict[str, Any]:
    return {
        "lost_share": quality.lost / quality.sent if quality.sent else math.nan,
        "p95_ms": 1000.0 * quality.p95_s,
        "silence_s": silence_s,
    }


def _tracking(tracking: "Tracking | None") -> dict[str, Any] | None:
    if tracking is None:
        return None
    state = tracking.mocap.state()
    return {
        "status": str(state.status),
        "text": state.text,
        "rate_hz": state.rates.rate_hz,
        "interval_p99_ms": state.rates.interval_p99_ms,
        "age_s": state.age_s,
    }
