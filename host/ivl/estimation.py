"""How well the flight core knows the distance of the ceiling: approaches x sensor sets x estimators.

    cell = study("accelerate_hold", "camera50", "kalman", n=300)
    print(cell.error_median, cell.coverage)

Rollouts start from a hover and are judged at the trigger, the instant that counts. A rollout in which the distance was
never valid, or never certain enough, does not trigger before it hits the ceiling: no error, but no landing either.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ivl import experiment, model, sensing
from ivl.outcome import four_leg
from ivl.task import Task, settings_of

RREV_C_PER_S, MOMENT_Y_NMM = 4.8, 8.0
"""Policy of the study: the trigger is where the paper's policies have it."""
EXPERIMENT = "experiments/paper_vertical.yaml"
"""Landing gear, speed and angle of the study are those of the paper's vertical experiment."""
ACCELERATIONS_MPS2 = {"accelerate_hold": 4.3, "constant_acceleration": 1.8, "constant_rrev": 4.3, "region": 4.3}
"""Acceleration of each approach: that of the paper's experiment, and one that lasts until the trigger."""
TARGET_MEDIAN, TARGET_P90 = 0.05, 0.12
"""Relative error of the filter with camera50_delay20 in accelerate_hold."""
_SIGMA_M_MIN = 1.0e-6  # so that a source that claims to be perfect has a figure, too
COVERAGE = (0.90, 0.99)
"""An honest sigma: share of errors within two of it."""


@dataclass(frozen=True)
class Cell:
    """One row of the table.

    Attributes:
        approach: Name of the approach.
        sensors: Name of the sensor set.
        estimator: Name of the source of the distance.
        runs: Rollouts flown.
        triggered: Share that triggered before any contact with the ceiling.
        valid: Mean share of the approach's ticks, up to the trigger, with a valid distance.
        error_median: Median of |d - true d| / true d at the trigger; None without a trigger.
        error_p90: Its 90th percentile.
        nees: Mean of ((d - true d) / sigma)^2; 1 for an honest sigma.
        coverage: Share of errors within two sigma.
        speed_mps: Median of the true closing speed at the trigger.
        rrev_sigma_per_s: Standard deviation of the true RREV at the trigger: how well the instant was met.
        four_leg: Share of four-leg landings with the policy of the study, which is not adapted to the cell.
    """

    approach: str
    sensors: str
    estimator: str
    runs: int
    triggered: float
    valid: float
    error_median: float | None
    error_p90: float | None
    nees: float | None
    coverage: float | None
    speed_mps: float | None
    rrev_sigma_per_s: float | None
    four_leg: float

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


def make_task(approach: str, sensors: str, estimator: str, vehicle: str | None = None, **overrides: float) -> Task:
    """The task of one cell, from a hover; the vehicle is the experiment's if none is named."""
    chosen = experiment.load(EXPERIMENT, vehicle=vehicle, approach=approach, sensing=sensors, estimator=estimator)
    values = {"firmware.approach_accel": ACCELERATIONS_MPS2[approach], **overrides}
    return Task(**{**chosen.task(), "start": "flown", "overrides": settings_of(values, "the study")})


def study(
    approach: str,
    sensors: str,
    estimator: str,
    n: int,
    seed: int = 0,
    vehicle: str | None = None,
    threads: int | None = None,
) -> Cell:
    """Fly `n` rollouts of one cell and judge the distance at the trigger."""
    task = make_task(approach, sensors, estimator, vehicle)
    policy = np.full(n, RREV_C_PER_S), MOMENT_Y_NMM
    out = task.make_world().rollouts(
        task.speed_mps, task.angle_deg, *policy, seed=seed, start=task.start, threads=threads
    )
    in_time = (out.triggered == 1) & ~(out.t_trigger_s >= out.t_impact_s)
    judged = out[in_time]
    figures: dict[str, float | None] = dict.fromkeys(
        ("error_median", "error_p90", "nees", "coverage", "speed_mps", "rrev_sigma_per_s")
    )
    if judged.size:
        error = judged.d_trigger_m - judged.d_true_trigger_m
        relative = np.abs(error) / judged.d_true_trigger_m
        normal = error / np.maximum(judged.d_sigma_trigger_m, _SIGMA_M_MIN)
        figures = {
            "error_median": float(np.median(relative)),
            "error_p90": float(np.quantile(relative, 0.9)),
            "nees": float(np.mean(normal**2)),
            "coverage": float(np.mean(np.abs(normal) <= 2.0)),
            "speed_mps": float(np.median(judged.vz_trigger_mps)),
            "rrev_sigma_per_s": float(np.std(judged.vz_trigger_mps / judged.d_true_trigger_m)),
        }
    share = out.d_valid_norm[np.isfinite(out.d_valid_norm)]
    return Cell(
        approach, sensors, estimator, n,
        triggered=float(np.mean(in_time)),
        valid=float(share.mean()) if share.size else 0.0,
        four_leg=float(np.mean(four_leg(out))),
        **figures,
    )  # fmt: skip


def estimators_of(sensors: str) -> list[str]:
    """Sources of the distance for which a sensor set has what they need."""
    given = {name for name, quantity in model.load_sensors(sensors).quantities.items() if quantity.value != 0.0}
    has_rrev, has_range = "rrev.rate" in given or "camera.rate" in given, "range.rate" in given
    if "sense.inertial" not in given:
        return ["known_height", "known_height_predicted"]
    names = ["formula", "formula_unguarded"] if has_rrev else []
    names += ["kalman"] if has_rrev or has_range or "flow.rate" in given else []
    return names + (["range"] if has_range else [])


def all_cells(
    approaches: Sequence[str] = sensing.APPROACHES, sensors: Sequence[str] | None = None
) -> Iterator[tuple[str, str, str]]:
    """Every (approach, sensor set, estimator) that makes sense; a set that sees no ceiling at all is left out."""
    for approach in approaches:
        for name in sensors if sensors is not None else model.list_sensor_sets():
            for estimator in estimators_of(name):
                yield approach, name, estimator
