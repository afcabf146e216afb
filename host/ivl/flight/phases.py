"""What the phases of the flight core and the logged distances tell about a flight."""

import numpy as np

from ivl.flight.store import FloatArray

IDLE, READY, APPROACH, FLIP, COAST, ATTACHED, DONE, ABORTED, LEVEL_OUT = range(9)
"""Numbers of ivl_types.h."""
_N_MIN, _SPREAD_M = 10, 0.01


def trigger(phase: FloatArray) -> tuple[int | None, FloatArray]:
    """Row of the first sample after the trigger, None if it did not fire; and the column `triggered`."""
    fired = (phase >= FLIP) & (phase < ABORTED)
    triggered = np.logical_or.accumulate(fired)
    return (int(np.argmax(fired)) if fired.any() else None), triggered.astype(np.float64)


def plane(height_m: FloatArray) -> float:
    """The height on which heights of a plane agree, m; NaN if they are too few, or half of them differ by 1 cm."""
    height_m = height_m[np.isfinite(height_m)]
    if len(height_m) < _N_MIN:
        return float("nan")
    low_m, middle_m, high_m = np.percentile(height_m, (25, 50, 75))
    return round(float(middle_m), 3) if high_m - low_m <= _SPREAD_M else float("nan")
