"""Approaches and estimators by name, as settings of the flight core."""

APPROACHES = ("accelerate_hold", "constant_acceleration", "constant_rrev", "region")
"""Shapes of the approach, in the order of the flight core's numbers."""

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
