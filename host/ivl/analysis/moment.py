"""M_yd over the policy region: how much of it the cues explain, with a plane and with any smooth map.

R2 is cross-validated with whole conditions held out, over all out-of-fold predictions together: 1 is exact, 0 is no
better than the mean, below 0 worse. What the cues cannot explain is partly freedom, not error: at fast approaches a
whole range of moments lands equally well, and which of them a learner ends with is chance.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.ensemble import RandomForestRegressor  # type: ignore[import-untyped]
from sklearn.linear_model import LinearRegression  # type: ignore[import-untyped]
from sklearn.model_selection import GroupKFold  # type: ignore[import-untyped]

from ivl.analysis.intervals import Estimate

FOLDS, BOOTSTRAPS = 5, 200

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Explained:
    """How much of M_yd the cues explain.

    Attributes:
        linear: R2 of a linear map; `n` of all three is the number of conditions.
        nonlinear: R2 of a random forest.
        gain: nonlinear - linear, with the interval of the paired bootstrap over conditions.
        n_points: Points.
    """

    linear: Estimate
    nonlinear: Estimate
    gain: Estimate
    n_points: int


def explained(cues: npt.ArrayLike, moment_Nmm: npt.ArrayLike, condition: npt.ArrayLike, seed: int = 0) -> Explained:
    """Cross-validated R2 of M_yd from the cues.

    Args:
        cues: Shape (n, n_cues), finite.
        moment_Nmm: Shape (n,), finite, N mm.
        condition: Shape (n,); points of one condition are never split between training and test.
        seed: Of the forest and the bootstrap.

    Returns:
        R2 with intervals; NaN with fewer than two conditions or without any spread of the moment.

    Raises:
        ValueError: Shapes do not fit or a value is not finite.
    """
    x, y = np.asarray(cues, dtype=np.float64), np.asarray(moment_Nmm, dtype=np.float64)
    group = np.asarray(condition)
    if x.ndim != 2 or y.shape != (len(x),) or group.shape != y.shape:
        raise ValueError(f"explained: shapes {x.shape}, {y.shape}, {group.shape} do not fit")
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError("explained: a value is not finite")
    names, group = np.unique(group, return_inverse=True)
    if len(names) < 2 or np.ptp(y) == 0:
        nothing = Estimate(float("nan"), float("nan"), float("nan"), len(names))
        return Explained(nothing, nothing, nothing, len(y))
    models = (LinearRegression(), RandomForestRegressor(60, min_samples_leaf=5, random_state=seed))
    residual = np.stack([_residual(model, x, y, group) for model in models])
    values = _r2(residual, y, np.ones(len(y)))
    drawn = _bootstrap(residual, y, group, np.random.default_rng(seed))
    drawn = np.vstack([drawn, drawn[1] - drawn[0]])
    low, high = np.quantile(drawn, (0.025, 0.975), axis=1)
    three = (*values, values[1] - values[0])
    linear, nonlinear, gain = (
        Estimate(float(v), float(a), float(b), len(names)) for v, a, b in zip(three, low, high, strict=True)
    )
    return Explained(linear, nonlinear, gain, len(y))


def _residual(model: Any, x: FloatArray, y: FloatArray, group: npt.NDArray[np.intp]) -> FloatArray:
    """Error of each point's prediction by a model that has not seen its condition."""
    predicted: FloatArray = np.full(len(y), np.nan)
    for train, test in GroupKFold(min(FOLDS, int(group.max()) + 1)).split(x, y, group):
        predicted[test] = model.fit(x[train], y[train]).predict(x[test])
    return y - predicted


def _r2(residual: FloatArray, y: FloatArray, weight: FloatArray) -> FloatArray:
    spread = (weight * (y - np.average(y, weights=weight)) ** 2).sum()
    explained_share: FloatArray = 1.0 - (weight * residual**2).sum(axis=1) / spread
    return explained_share


def _bootstrap(
    residual: FloatArray, y: FloatArray, group: npt.NDArray[np.intp], rng: np.random.Generator
) -> FloatArray:
    """R2 of each model over conditions drawn with replacement, shape (n_models, n_draws)."""
    n_groups, drawn = int(group.max()) + 1, []
    for _ in range(BOOTSTRAPS):
        weight = np.bincount(rng.integers(0, n_groups, n_groups), minlength=n_groups)[group].astype(np.float64)
        if np.ptp(y[weight > 0]) > 0:
            drawn.append(_r2(residual, y, weight))
    values: FloatArray = np.array(drawn).T
    return values
