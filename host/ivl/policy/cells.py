"""The best (RREV_c, M_yd) of each cell of speed and angle: what the paper's way gives, with a policy for each approach.

    best = best_of_cells(MapSettings(), BOX, seed, places)
    flown = fly_own(places, forms.PAPER, best.of(approaches), approaches)

Approaches are drawn all over a cell, by choice and judgement alike. At the middle of a cell the best policy would know
the one approach that it is judged on, and without noise other random numbers do not make that approach another one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl import forms
from ivl.outcome import Outcomes, four_leg
from ivl.policy.flying import FloatArray, Place, fly, fly_own, score
from ivl.policy.general import MapSettings
from ivl.policy.region import Approaches, Region
from ivl.policy.start import moment_most_Nmm, smooth
from ivl.seeds import Purpose, derive

_TIMING_S = 0.005
"""The grid is smoothed over this error of the trigger's instant: few approaches of a cell stand for all of it."""


@dataclass(frozen=True)
class Effort:
    """How many flights look for the best of a cell.

    Attributes:
        n_coarse: Approaches of each cell that fly the whole grid.
        n_finalists: Policies of each cell that fly on.
        n_choose: Approaches, others, that choose among those.
    """

    n_coarse: int = 2
    n_finalists: int = 5
    n_choose: int = 16


@dataclass(frozen=True)
class Cells:
    """Equal cells of a region; the angle runs faster.

    Attributes:
        speed_edges_mps: Edges along the speed, shape (n + 1,).
        angle_edges_deg: Edges along the angle, shape (m + 1,).
    """

    speed_edges_mps: FloatArray
    angle_edges_deg: FloatArray

    @staticmethod
    def of(region: Region, n_speeds: int, n_angles: int) -> "Cells":
        """So many along speed and angle."""
        (v_lo, v_hi), (a_lo, a_hi) = region.speeds_mps, region.angles_deg
        return Cells(np.linspace(v_lo, v_hi, n_speeds + 1), np.linspace(a_lo, a_hi, n_angles + 1))

    @property
    def shape(self) -> tuple[int, int]:
        """How many along speed and angle."""
        return len(self.speed_edges_mps) - 1, len(self.angle_edges_deg) - 1

    def number_of(self, speed_mps: FloatArray, angle_deg: FloatArray) -> npt.NDArray[np.intp]:
        """Number of the cell of each approach; one beyond the edges belongs to the cell at the edge."""
        found = []
        for values, edges in ((speed_mps, self.speed_edges_mps), (angle_deg, self.angle_edges_deg)):
            found.append(np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2))
        return np.asarray(found[0] * self.shape[1] + found[1])

    def draw(self, n: int, seed: int) -> Approaches:
        """Approaches, n of each cell side by side, anywhere in it."""
        rng = np.random.Generator(np.random.PCG64(seed))
        low_high = [(edges[:-1], edges[1:]) for edges in (self.speed_edges_mps, self.angle_edges_deg)]
        i, j = (index.reshape(-1).repeat(n) for index in np.indices(self.shape))
        speed, angle = (rng.uniform(lo[at], hi[at]) for (lo, hi), at in zip(low_high, (i, j), strict=True))
        return Approaches(speed, angle, np.arange(speed.size, dtype=np.uint64), seed)


@dataclass(frozen=True)
class BestOfCells:
    """What was found.

    Attributes:
        cells: The cells.
        theta: Threshold (1/s) and moment (N mm) of each cell, shape (cells, 2).
        of_all: Those of the one policy of the grid that is best over all cells.
        grid_flown: Flights of the grid in each place, shape (moments, thresholds, approaches).
        n_flights: What it cost.
    """

    cells: Cells
    theta: FloatArray
    of_all: tuple[float, float]
    grid_flown: list[Outcomes]
    n_flights: int

    def of(self, approaches: Approaches) -> FloatArray:
        """The policy of each approach's cell, shape (n, 2)."""
        return self.theta[self.cells.number_of(approaches.speed_mps, approaches.angle_deg)]

    def landable(self) -> FloatArray:
        """RREV, OF_y and distance at the triggers of all flips of the grid that landed, shape (n, 3)."""
        names = ("rrev_trigger", "of_y_trigger", "d_trigger_m")
        good = [outcomes[four_leg(outcomes) & (outcomes["triggered"] == 1)] for outcomes in self.grid_flown]
        return np.concatenate([np.column_stack([outcomes[name] for name in names]) for outcomes in good])


def best_of_cells(
    grid: MapSettings,
    region: Region,
    seed: int,
    places: Sequence[Place],
    effort: Effort | None = None,
    threads: int | None = None,
) -> BestOfCells:
    """Look for the policy of each cell with the best mean score in all places.

    Args:
        grid: Cells, thresholds and moments; its error of timing is not used.
        region: What the cells divide.
        seed: Of the approaches; those of the grid, and those that choose, meet none of another purpose.
        places: Where.
        effort: How many flights.
        threads: Worker threads; omitted: all processors.
    """
    used = effort or Effort()
    cells = Cells.of(region, grid.n_speeds, grid.n_angles)
    tau_s = np.linspace(grid.tau_s[0], grid.tau_s[1], grid.n_thresholds)
    moments = np.minimum(moment_most_Nmm(places) * np.array(grid.moments_norm), _moment_max_Nmm())
    policies = np.stack(np.broadcast_arrays(1.0 / tau_s, moments[:, None]), axis=-1)  # (moments, thresholds, 2)
    flown = fly(places, forms.PAPER, policies, cells.draw(used.n_coarse, derive(seed, Purpose.GRID)), threads)
    scores = _of_cells(flown, used.n_coarse)  # (moments, thresholds, cells)
    smoothed = smooth(scores, tau_s, _TIMING_S).reshape(-1, scores.shape[-1])
    finalists = policies.reshape(-1, 2)[np.argsort(-smoothed, axis=0)[: used.n_finalists]]  # (finalists, cells, 2)
    others = cells.draw(used.n_choose, derive(seed, Purpose.SELECT))
    chosen = _of_cells(
        fly_own(places, forms.PAPER, np.repeat(finalists, used.n_choose, axis=1), others, threads), used.n_choose
    )
    most = np.unravel_index(int(np.argmax(scores.mean(axis=-1))), scores.shape[:2])
    return BestOfCells(
        cells=cells,
        theta=finalists[chosen.argmax(axis=0), np.arange(scores.shape[-1])],
        of_all=(float(policies[most][0]), float(policies[most][1])),
        grid_flown=flown,
        n_flights=sum(outcomes.size for outcomes in flown) + len(places) * len(finalists) * len(others),
    )


def _of_cells(flown: Sequence[Outcomes], n: int) -> FloatArray:
    """Mean score of each cell over its n approaches and all places, shape (..., cells)."""
    scores = np.mean([score(outcomes) for outcomes in flown], axis=0)
    return np.asarray(scores.reshape(*scores.shape[:-1], -1, n).mean(axis=-1))


def _moment_max_Nmm() -> float:
    return float(forms.by_name(forms.PAPER).params[1].hi)
