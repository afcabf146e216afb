"""Approaches and estimators by name, as settings of the flight core."""

APPROACHES = ("accelerate_hold", "constant_acceleration", "constant_rrev", "region")
"""Shapes of the approach, in the order of the flight core's numbers."""

APPROACH_DOCS = {
    "accelerate_hold": "speeds up to the approach speed, and holds it",
    "constant_acceleration": "speeds up all the way, and has the approach speed at the ceiling",
    "constant_rrev": "closes in so that RREV stays as it is",
    "region": "speeds up, and may flip anywhere in a region of speeds",
}
"""What `ivl list approaches` says."""

ESTIMATOR_DOCS = {
    "known_height": "height of the ceiling as configured, less the last position that came",
    "known_height_predicted": "the same, carried on by the velocity to the present tick",
    "formula": "from RREV and the accelerometer by a formula, with guards",
    "formula_unguarded": "the same without guards, to show what they are for",
    "kalman": "from RREV and the accelerometer by a Kalman filter",
    "range": "from a range finder that looks up",
}
"""What `ivl list estimators` says."""

ESTIMATORS: dict[str, dict[str, float]] = {
    "known_height": {"firmware.d_source": 0.0, "firmware.d_predict": 0.0},
    "known_height_predicted": {"firmware.d_source": 0.0, "firmware.d_predict": 1.0},
    "formula": {"firmware.d_source": 1.0},
    "formula_unguarded": {
        "firmware.d_source": 1.0,
        "firmware.accel_min": 0.0,
        "firmware.denom_min": 0.001,
        "firmware.d_sigma_max": 10.0,
    },
    "kalman": {"firmware.d_source": 2.0},
    "range": {"firmware.d_source": 3.0},
}
"""Sources of the ceiling's distance; formula_unguarded shows what the guards are for."""


def approach_settings(name: str) -> dict[str, float]:
    """Parameters that make the flight core fly an approach; none for the default one."""
    return {"firmware.shape": float(APPROACHES.index(name))} if name != APPROACHES[0] else {}


def estimator_settings(name: str | None) -> dict[str, float]:
    """Parameters that make the flight core use a source; none if `name` is None."""
    return dict(ESTIMATORS[name]) if name is not None else {}
