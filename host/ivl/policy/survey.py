"""Flights for the pictures of a policy: fresh approaches, by it, by the paper's policy and by the best of each cell.

The approaches are those on which `ivl policy assess` judges the plane, so pictures and numbers are of the same flights.
The paper's policy and the best of each cell are looked for on other approaches (`ivl.policy.cells`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ivl import forms
from ivl.outcome import Outcomes, four_leg
from ivl.policy import go
from ivl.policy.assess import fresh
from ivl.policy.cells import BestOfCells, best_of_cells
from ivl.policy.file import PolicyFile
from ivl.policy.flying import Place, fly, fly_own
from ivl.policy.general import MapSettings
from ivl.policy.go import BoolArray
from ivl.policy.region import PLANE, Approaches
from ivl.policy.shape import FloatArray, General

N_PATHS = 40
_TRACE_PERIOD_S = 0.002


@dataclass(frozen=True)
class Path:
    """One approach as the flight core senses it, up to its trigger (or its last valid cue before any contact).

    It has no points if it begins so near that there is no cue before it ends.

    Attributes:
        rrev_per_s: RREV, shape (n,).
        of_y_radps: OF_y, shape (n,).
        d_ceil_m: Sensed distance, shape (n,).
        triggered: Whether it ends with a flip.
        landed: Whether that flip landed.
    """

    rrev_per_s: FloatArray
    of_y_radps: FloatArray
    d_ceil_m: FloatArray
    triggered: bool
    landed: bool


@dataclass(frozen=True)
class Survey:
    """Outcomes of each place, shape (n,) each, of three policies on the same approaches; every approach is flown.

    Attributes:
        general: The form.
        theta: The policy's numbers.
        approaches: Approaches over the plane.
        constant: Threshold (1/s) and moment (N mm) of the paper's policy.
        best: Those of each cell.
        by_constant: Outcomes of the paper's policy.
        by_policy: Outcomes of the policy.
        by_best: Outcomes of the best of each approach's cell.
        paths: Some of the approaches as the flight core of the first place senses them.
    """

    general: General
    theta: FloatArray
    approaches: Approaches
    constant: tuple[float, float]
    best: BestOfCells
    by_constant: list[Outcomes]
    by_policy: list[Outcomes]
    by_best: list[Outcomes]
    paths: list[Path]

    @property
    def p_min(self) -> float:
        """The policy's own `go_p_min`."""
        return float(self.theta[self.general.go_p_min])

    def rates(self, flown: Sequence[Outcomes]) -> FloatArray:
        """Landing rate of each cell, shape (speeds, angles); NaN in a cell without approaches."""
        return self._shares([four_leg(outcomes) for outcomes in flown])

    def refused(self) -> FloatArray:
        """Share of the approaches of each cell that the policy's go / no-go refuses, likewise."""
        return self._shares([go.would_refuse(outcomes, self.p_min) for outcomes in self.by_policy])

    def decided(self) -> tuple[FloatArray, BoolArray]:
        """Probability at each decision, and whether the flight landed that was flown all the same."""
        parts = [(o["p_land"][asked], four_leg(o)[asked]) for o in self.by_policy for asked in [go.has_decided(o)]]
        p, landed = (np.concatenate(part) for part in zip(*parts, strict=True))
        return p, landed

    def _shares(self, true: Sequence[BoolArray]) -> FloatArray:
        cells, shape = self.best.cells, self.best.cells.shape
        cell = np.tile(cells.number_of(self.approaches.speed_mps, self.approaches.angle_deg), len(true))
        count = np.bincount(cell, minlength=shape[0] * shape[1])
        hits = np.bincount(cell, weights=np.concatenate(true), minlength=shape[0] * shape[1])
        return np.asarray((hits / np.where(count > 0, count, np.nan)).reshape(shape))


def survey(
    policy: PolicyFile,
    n_approaches: int,
    seed: int = 0,
    constant: tuple[float, float] | None = None,
    grid: MapSettings | None = None,
    threads: int | None = None,
) -> Survey:
    """Fly what the pictures show, on what the policy was learned on.

    Args:
        policy: A policy for every approach.
        n_approaches: Approaches over the plane, flown by three policies each.
        seed: Their seed, and that of the search for the best of each cell.
        constant: Threshold (1/s) and moment (N mm) of the paper's policy; omitted: the best of the grid.
        grid: Cells, thresholds and moments; omitted: those of an experiment that does not say otherwise.
        threads: Worker threads; omitted: all processors.

    Raises:
        ConfigError: The policy is of a form for one approach.
        ArgumentError: `constant` is out of range.
    """
    general, theta = General(policy.form), np.array(policy.values)
    places = [Place.of(task) for task in policy.tasks]
    approaches = fresh(PLANE, n_approaches, seed)
    free = general.always_go(theta)
    if constant is not None:
        forms.by_name(forms.PAPER).to_si(constant)
    best = best_of_cells(grid or MapSettings(), PLANE, seed, places, threads=threads)
    constant = constant or best.of_all
    return Survey(
        general=general,
        theta=theta,
        approaches=approaches,
        constant=constant,
        best=best,
        by_constant=fly(places, forms.PAPER, constant, approaches, threads),
        by_policy=fly(places, general.form.name, free, approaches, threads),
        by_best=fly_own(places, forms.PAPER, best.of(approaches), approaches, threads),
        paths=[_path(places[0], general, free, approaches, i) for i in range(min(N_PATHS, n_approaches))],
    )


def _path(place: Place, general: General, theta: FloatArray, approaches: Approaches, i: int) -> Path:
    trace = place.world.trace(
        float(approaches.speed_mps[i]),
        float(approaches.angle_deg[i]),
        *theta.tolist(),
        form=general.form.name,
        seed=approaches.seed,
        stream=int(approaches.stream[i]),
        start=place.task.start,
        period_s=_TRACE_PERIOD_S,
    )
    rows, outcome = trace.rows, trace.outcome
    ends_s = [t for t in (float(outcome.t_trigger_s), float(outcome.t_impact_s)) if np.isfinite(t)]
    seen = rows[(rows.t_s <= min(ends_s, default=np.inf)) & (rows.rrev_per_s > 0) & (rows.d_sensed_m > 0)]
    triggered = bool(outcome.triggered)
    points = np.column_stack([seen.rrev_per_s, seen.of_y_radps, seen.d_sensed_m])
    if triggered:  # the trigger lies between two rows
        points = np.vstack([points, [outcome.rrev_trigger, outcome.of_y_trigger, outcome.d_trigger_m]])
    landed = four_leg(np.array([outcome], dtype=outcome.dtype))
    return Path(points[:, 0], points[:, 1], points[:, 2], triggered, bool(landed[0]))
