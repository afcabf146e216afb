"""Go / no-go: the probability of a landing at the point of decision, and the least one that is flown.

The point of decision is where the flight core itself puts it: with an estimate that is x (or z) alone, what it reports
as its probability tells that coordinate. So the same flights are flown twice, and nothing of the core is repeated here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl.outcome import Outcomes, four_leg
from ivl.policy.flying import Place, fly
from ivl.policy.region import Approaches
from ivl.policy.shape import FloatArray, General, features

_STEPS, _SMALL = 100, 1e-9
_P_MIN, _P_MAX = 0.02, 0.98
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Decided:
    """Approaches that came to a decision and were flown whatever it was.

    Attributes:
        x: Where, in the core's coordinates, shape (n,).
        z: Likewise.
        landed: Whether they landed, shape (n,).
        strike: Whether body or rotors struck the ceiling and they did not land, shape (n,).
        n_flights: Flights of one pass, those without a decision among them.
    """

    x: FloatArray
    z: FloatArray
    landed: BoolArray
    strike: BoolArray
    n_flights: int


def strikes(outcomes: Outcomes) -> BoolArray:
    """True where body or rotors struck the ceiling in a flight that did not land."""
    touched = (outcomes["body_contact"] != 0) | (outcomes["base_contact"] != 0)
    return np.asarray(touched & ~four_leg(outcomes))


def has_decided(outcomes: Outcomes) -> BoolArray:
    """True where the policy's estimate was asked; it is never 0 (an approach that begins too near has no cue yet)."""
    return np.asarray(np.nan_to_num(outcomes["p_land"]) > 0)


def would_refuse(outcomes: Outcomes, p_min: float) -> BoolArray:
    """True where a policy that always goes would have refused with this `go_p_min`: also without any cue."""
    return np.asarray((outcomes["decided"] == 1) & (outcomes["p_land"] < p_min))


def fly_decisions(
    general: General,
    places: Sequence[Place],
    theta: FloatArray,
    approaches: Sequence[Approaches],
    threads: int | None = None,
) -> Decided:
    """Fly a policy that always goes, on the approaches of each place, and find out where it would have decided."""
    told = np.stack([general.telling(theta, axis) for axis in (0, 1)])
    parts = []
    for outcomes in fly(places, general.form.name, told, approaches, threads):
        decided = has_decided(outcomes[0])
        p = outcomes["p_land"][:, decided]
        x, z = np.log(p / (1.0 - p))
        flown = outcomes[0][decided]
        parts.append((x, z, four_leg(flown), strikes(flown)))
    x, z, landed, strike = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Decided(x, z, landed, strike, sum(map(len, approaches)))


def fit(decided: Decided, ridge: float) -> FloatArray:
    """Coefficients of the log-odds of a landing, shape (10,): Newton's method on the likelihood with a ridge.

    The ridge weighs coefficients of features in units of their own spread, and spares the constant.
    """
    raw = features(decided.x, decided.z)
    mean, spread = raw[:, 1:].mean(axis=0), raw[:, 1:].std(axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    design = np.column_stack([np.ones(len(raw)), (raw[:, 1:] - mean) / spread])
    y = decided.landed.astype(np.float64)
    penalty = np.full(design.shape[1], ridge)
    penalty[0] = _SMALL
    w = np.zeros(design.shape[1])
    loss = _loss(design, y, penalty, w)
    for _ in range(_STEPS):
        p = _logistic(design @ w)
        gradient = design.T @ (p - y) + penalty * w
        hessian = design.T @ (design * (p * (1 - p))[:, None]) + np.diag(penalty)
        step = np.linalg.solve(hessian, gradient)
        scale = 1.0
        while (new := _loss(design, y, penalty, w - scale * step)) > loss and scale > _SMALL:
            scale *= 0.5
        w, gain, loss = w - scale * step, loss - new, new
        if gain <= _SMALL * max(1.0, loss):
            break
    slopes = w[1:] / spread
    return np.append(w[0] - slopes @ mean, slopes)


def _logistic(t: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * t)))


def _loss(design: FloatArray, y: FloatArray, penalty: FloatArray, w: FloatArray) -> float:
    t = design @ w
    return float(np.sum(np.logaddexp(0.0, t) - y * t) + 0.5 * np.sum(penalty * w * w))


def probabilities(coefficients: FloatArray, decided: Decided) -> FloatArray:
    """Probability of a landing at each point of decision, shape (n,)."""
    return _logistic(features(decided.x, decided.z) @ coefficients)


def choose_p_min(p: FloatArray, decided: Decided, strikes_avoided_min: float, refused_good_max: float) -> float:
    """The least probability that is flown.

    Of those that avoid enough strikes and refuse few enough approaches that would land, the middle one; if there is
    none, the largest that refuses few enough.

    Args:
        p: Probability of a landing at each point of decision.
        decided: What came of it.
        strikes_avoided_min: Share of all strikes.
        refused_good_max: Share of all approaches.
    """
    tried = np.linspace(_P_MIN, _P_MAX, 97)
    refused = p[None, :] < tried[:, None]
    avoided = (refused & decided.strike).sum(axis=1) / max(int(decided.strike.sum()), 1)
    good = (refused & decided.landed).sum(axis=1) / decided.n_flights
    few = good <= refused_good_max
    # nothing to avoid, or no way to avoid it at that price: always go
    if not few.any() or not decided.strike.any():
        return 0.0
    both = np.flatnonzero(few & (avoided >= strikes_avoided_min))
    index = both[len(both) // 2] if both.size else np.flatnonzero(few)[-1]
    return float(tried[index])


def auc(p: FloatArray, landed: BoolArray) -> float:
    """Area under the curve: the share of pairs of a landing and a failure in which the landing has the larger p."""
    n_good, n_bad = int(landed.sum()), int((~landed).sum())
    if not n_good or not n_bad:
        return float("nan")
    values, index, count = np.unique(p, return_inverse=True, return_counts=True)
    del values
    rank = (np.cumsum(count) - 0.5 * (count - 1))[index]  # ties have their mean rank
    return float((rank[landed].sum() - 0.5 * n_good * (n_good + 1)) / (n_good * n_bad))


@dataclass(frozen=True)
class Bins:
    """Decisions in equal bins of the probability.

    Attributes:
        edges: Edges of the bins, 0 .. 1, shape (n + 1,).
        count: Decisions in each, shape (n,).
        p: Their mean probability; NaN where there are none.
        landed: Their share of landings; NaN where there are none.
    """

    edges: FloatArray
    count: npt.NDArray[np.intp]
    p: FloatArray
    landed: FloatArray


def binned(p: FloatArray, landed: BoolArray, n_bins: int = 10) -> Bins:
    """Probabilities and what came of them, in bins."""
    bins = np.minimum((p * n_bins).astype(np.intp), n_bins - 1)
    count = np.bincount(bins, minlength=n_bins)
    some = np.where(count > 0, count, np.nan)
    means = [np.bincount(bins, weights=values, minlength=n_bins) / some for values in (p, landed)]
    return Bins(np.linspace(0.0, 1.0, n_bins + 1), count, *means)


def calibration_error(p: FloatArray, landed: BoolArray, n_bins: int = 10) -> float:
    """Mean distance of the share of landings from the mean probability, over equal bins of p, weighed by their size."""
    if not p.size:
        return float("nan")
    bins = binned(p, landed, n_bins)
    return float(np.nansum(bins.count * np.abs(bins.landed - bins.p)) / bins.count.sum())
