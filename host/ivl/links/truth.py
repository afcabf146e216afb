"""The outcome of a landing that was flown in a room: from the flight recorder, the resting pose and a person."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ivl import native
from ivl.belief.recording import pitch_deg
from ivl.links.packets import Phase, Recording
from ivl.links.vehicle import Snapshot
from ivl.outcome import end_code
from ivl.world import World, rotation

_TILT_DEG_MAX, _GAP_M_MAX = 25.0, 0.02


@dataclass(frozen=True)
class Resting:
    """Where the vehicle came to rest.

    Attributes:
        p_W_m: Position of the body origin, m.
        up_W: The body's z axis in the world: of a level ceiling, its z is 1 upright and -1 hanging. NaN if unknown.
    """

    p_W_m: tuple[float, float, float]
    up_W: tuple[float, float, float]

    @classmethod
    def of(cls, p_W_m: Sequence[float], q_WB: Sequence[float] | None) -> Self:
        """From position and attitude (unit quaternion x, y, z, w; None: unknown)."""
        x, y, z = (float(v) for v in p_W_m)
        up = np.full(3, np.nan) if q_WB is None else rotation(np.asarray(q_WB, dtype=np.float64))[:, 2]
        return cls((x, y, z), (float(up[0]), float(up[1]), float(up[2])))


def suggest_legs(resting: Resting, world: World) -> int:
    """Legs that hold, as far as height and tilt tell: 4, 2 (hangs, but tilted or low), or 0 (not at the ceiling)."""
    gap_m = float(world.surface.gap_m(resting.p_W_m))
    away = -float(np.dot(resting.up_W, world.surface.normal_W))  # 1 for a z axis straight out of the surface
    tilt_deg = math.degrees(math.acos(min(max(away, -1.0), 1.0)))
    level = tilt_deg <= _TILT_DEG_MAX and abs(gap_m - world.hanging_gap_m()) <= _GAP_M_MAX
    reach_m = world.derived()["reach_m"] + _GAP_M_MAX
    return 4 if level else (2 if gap_m <= reach_m else 0)


def outcome_of_flight(
    recording: Recording, snapshot: Snapshot, n_legs: int, body_contact: bool, resting: Resting, world: World
) -> np.ndarray[Any, np.dtype[np.void]]:
    """An outcome record, shape (1,), in the library's layout.

    Times count from the recorder's first row. The surface of a room is at rest. What a room cannot know (the order of
    the legs, steps of an integrator) stays 0, and numbers of a contact that was not seen stay NaN.
    """
    outcome = np.zeros(1, dtype=native.library().outcome_dtype)
    for name in outcome.dtype.names or ():
        if outcome.dtype[name].kind == "f":
            outcome[name] = np.nan
    rows = recording.rows
    gap_m = world.surface.gap_m(np.vstack([rows["p_W_m"], resting.p_W_m]))
    outcome["n_legs"], outcome["body_contact"] = n_legs, body_contact
    outcome["d_min_m"] = np.min(gap_m)
    outcome["n_ticks"] = len(rows)
    outcome["t_end_s"] = rows["t_s"][-1] if len(rows) else 0.0
    impact = _impact_row(recording, world)
    outcome["end_reason"] = end_code("contact_time" if impact is not None or n_legs else "missed")
    if recording.trigger_row is not None:
        _fill(outcome, rows, recording.trigger_row, "trigger")
        outcome["triggered"] = 1
        outcome["d_trigger_m"], outcome["rrev_trigger"] = snapshot.d_ceil_m, snapshot.rrev_per_s
        outcome["of_y_trigger"] = snapshot.of_y_radps
    if impact is not None:
        # the row in which a contact is felt is after it: how the vehicle came is in the row before
        _fill(outcome, rows, impact - 1, "impact")
        outcome["t_impact_s"] = rows["t_s"][impact]
        outcome["theta_impact_deg"] = pitch_deg(rows["q_WB"])[impact - 1]
    return outcome


def note_no_go(outcome: np.ndarray[Any, np.dtype[np.void]], nearest_m: float, aborted: bool) -> None:
    """Write into an outcome of shape (1,) that its approach was called off.

    The recorder has the highest point of a level-out that is short enough; the vehicle's logs have that of any.

    Args:
        outcome: What recorder and operator tell.
        nearest_m: Least distance from the surface in the level-out, inf if nobody has looked.
        aborted: Whether the level-out ended in an abort; as in the simulator, such a flight does not end as a no-go.
    """
    outcome["no_go"] = 1
    if not aborted:
        outcome["end_reason"] = end_code("no_go")
    outcome["d_min_m"] = np.fmin(outcome["d_min_m"], nearest_m)


def _impact_row(recording: Recording, world: World) -> int | None:
    """First row after the trigger with a specific force that no flip makes, or in which the core felt a contact."""
    if recording.trigger_row is None:
        return None
    record, _ = world.native_model.config()
    force_mps2 = np.linalg.norm(recording.rows["f_B_mps2"], axis=1)
    touched = (force_mps2 > float(record["ivl.contact_accel"][0])) | (recording.rows["phase"] == Phase.ATTACHED)
    touched[: recording.trigger_row + 1] = False
    return int(np.argmax(touched)) if touched.any() else None


def _fill(outcome: np.ndarray[Any, Any], rows: np.ndarray[Any, Any], row: int, when: str) -> None:
    outcome[f"t_{when}_s"] = rows["t_s"][row]
    outcome[f"vx_{when}_mps"], outcome[f"vz_{when}_mps"] = rows["v_W_mps"][row, 0], rows["v_W_mps"][row, 2]
    outcome[f"rate_{when}_radps"] = -rows["w_B_radps"][row, 1]
