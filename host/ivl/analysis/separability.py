"""How well cues tell success from failure: cross-validated AUC, with whole conditions held out.

AUC is the probability that a success gets a higher score than a failure: 0.5 is guessing, 1 is separation. A
classifier is trained on some conditions (V, phi) and scores the points of others that it has never seen, so that it
cannot win by remembering a condition whose trials end alike. A success is compared with failures of the same fold only,
since classifiers of different folds have scores of different scale (and to compare across folds biases the AUC below
0.5 where there is nothing to learn). The interval is the bootstrap over conditions of these scores (percentiles), since
points of one condition are not independent. It does not contain the training's own variation: on pure noise (1200
points, 240 conditions) it held 0.5 in 70 of 80 repetitions.

Two classifiers of different kinds are offered, because an answer that hangs on one of them says little about the cues:
`svm`, a support vector machine with a Gaussian kernel on standardised cues (smooth borders, oblique to the axes), and
`forest`, a random forest (borders along the axes). `linear`, a logistic regression, shows what a plane can do.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.ensemble import RandomForestClassifier  # type: ignore[import-untyped]
from sklearn.linear_model import LogisticRegression  # type: ignore[import-untyped]
from sklearn.model_selection import StratifiedGroupKFold  # type: ignore[import-untyped]
from sklearn.pipeline import make_pipeline  # type: ignore[import-untyped]
from sklearn.preprocessing import StandardScaler  # type: ignore[import-untyped]
from sklearn.svm import SVC  # type: ignore[import-untyped]

from ivl.analysis.intervals import Estimate

FOLDS, BOOTSTRAPS = 5, 200
N_POINTS_MAX = 6000
"""More points than this are thinned, whole conditions at a time: the kernel matrix grows with the square."""

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Separability:
    """How well one set of cues separates.

    Attributes:
        auc: Cross-validated AUC with its interval; `n` is the number of conditions.
        n_points: Points scored.
        n_success: Successes among them.
        model: Name of the classifier.
    """

    auc: Estimate
    n_points: int
    n_success: int
    model: str


def _svm(seed: int) -> Any:
    return make_pipeline(StandardScaler(), SVC(C=10.0, gamma=2.0, class_weight="balanced", random_state=seed))


def _forest(seed: int) -> Any:
    return RandomForestClassifier(60, min_samples_leaf=5, class_weight="balanced", random_state=seed)


def _linear(seed: int) -> Any:
    return make_pipeline(StandardScaler(), LogisticRegression(class_weight="balanced", random_state=seed))


MODELS: dict[str, Callable[[int], Any]] = {"svm": _svm, "forest": _forest, "linear": _linear}


def separability(
    cues: npt.ArrayLike, success: npt.ArrayLike, condition: npt.ArrayLike, model: str = "svm", seed: int = 0
) -> Separability:
    """Cross-validated AUC of telling success from failure by the cues.

    Args:
        cues: Shape (n, n_cues), finite; each cue in its own unit.
        success: Shape (n,).
        condition: Shape (n,); points of one condition are never split between training and test.
        model: A name of `MODELS`.
        seed: Of folds, classifier and bootstrap.

    Returns:
        The AUC; NaN with the interval 0 .. 1 if fewer than two conditions have a success or a failure each.

    Raises:
        ValueError: Shapes do not fit, a cue is not finite, or there is no such model.
    """
    x, y, group = _checked(cues, success, condition, model)
    rng = np.random.default_rng(seed)
    x, y, group = _thinned(x, y, group, rng)
    n_folds = min(FOLDS, *(len(np.unique(group[chosen])) for chosen in (y, ~y)))
    if n_folds < 2:
        auc = Estimate(float("nan"), 0.0, 1.0, len(np.unique(group)))
        return Separability(auc, len(y), int(y.sum()), model)
    wins = _fold_wins(x, y, group, n_folds, MODELS[model], seed)
    low, high = _bootstrap(wins, group, rng)
    auc = Estimate(_auc(wins, np.ones(len(y))), low, high, len(np.unique(group)))
    return Separability(auc, len(y), int(y.sum()), model)


def auc_gain(
    more: npt.ArrayLike, fewer: npt.ArrayLike, success: npt.ArrayLike, condition: npt.ArrayLike, seed: int = 0
) -> Estimate:
    """By how much one set of cues separates the same points better than another (`svm`): AUC of `more` - `fewer`.

    Folds and drawn conditions are the same for both, so that what they have in common cancels in the interval.

    Args:
        more: Cues, shape (n, n_cues).
        fewer: Other cues of the same points, shape (n, n_other).
        success: Shape (n,).
        condition: Shape (n,).
        seed: Of folds, classifier and bootstrap.

    Returns:
        The difference; NaN with the interval -1 .. 1 where `separability` gives NaN.

    Raises:
        ValueError: As `separability`.
    """
    rng = np.random.default_rng(seed)
    x, y, group = _checked(np.column_stack([more, fewer]), success, condition, "svm")
    x, y, group = _thinned(x, y, group, rng)
    n_folds = min(FOLDS, *(len(np.unique(group[chosen])) for chosen in (y, ~y)))
    if n_folds < 2:
        return Estimate(float("nan"), -1.0, 1.0, len(np.unique(group)))
    split = np.asarray(more).shape[1]
    sides = [_fold_wins(part, y, group, n_folds, MODELS["svm"], seed) for part in (x[:, :split], x[:, split:])]
    weights = [np.ones(len(y)), *_drawn_weights(group, rng)]
    values = [_auc(sides[0], weight) - _auc(sides[1], weight) for weight in weights]
    low, high = np.nanquantile(values[1:], (0.025, 0.975))
    return Estimate(values[0], float(low), float(high), len(np.unique(group)))


def _checked(
    cues: npt.ArrayLike, success: npt.ArrayLike, condition: npt.ArrayLike, model: str
) -> tuple[FloatArray, BoolArray, npt.NDArray[np.intp]]:
    x, y = np.asarray(cues, dtype=np.float64), np.asarray(success, dtype=bool)
    group = np.asarray(condition)
    if x.ndim != 2 or y.shape != (len(x),) or group.shape != y.shape:
        raise ValueError(f"separability: shapes {x.shape}, {y.shape}, {group.shape} do not fit")
    if not np.isfinite(x).all():
        raise ValueError("separability: a cue is not finite")
    if model not in MODELS:
        raise ValueError(f"separability: no model {model!r} (allowed {', '.join(MODELS)})")
    return x, y, np.unique(group, return_inverse=True)[1]


def _thinned(
    x: FloatArray, y: BoolArray, group: npt.NDArray[np.intp], rng: np.random.Generator
) -> tuple[FloatArray, BoolArray, npt.NDArray[np.intp]]:
    """At most `N_POINTS_MAX` points: so many conditions, drawn at random, as fit."""
    if len(y) <= N_POINTS_MAX:
        return x, y, group
    size = np.bincount(group)
    order = rng.permutation(len(size))
    kept = order[np.cumsum(size[order]) <= N_POINTS_MAX]
    chosen = np.isin(group, kept)
    return x[chosen], y[chosen], group[chosen]


@dataclass(frozen=True)
class _Wins:
    """One fold: indices of its successes and failures, and who beats whom, shape (n_success, n_failure): 1, 0.5, 0."""

    success: npt.NDArray[np.intp]
    failure: npt.NDArray[np.intp]
    wins: FloatArray


def _fold_wins(
    x: FloatArray, y: BoolArray, group: npt.NDArray[np.intp], n_folds: int, make: Callable[[int], Any], seed: int
) -> list[_Wins]:
    """Train without each fold's conditions, score the fold, compare its successes with its failures."""
    found = []
    folds = StratifiedGroupKFold(n_folds, shuffle=True, random_state=seed)
    for train, test in folds.split(x, y, group):
        classifier = make(seed).fit(x[train], y[train])
        if hasattr(classifier, "decision_function"):
            score = classifier.decision_function(x[test])
        else:
            score = classifier.predict_proba(x[test])[:, 1]
        good, bad = score[y[test]][:, None], score[~y[test]]
        found.append(_Wins(test[y[test]], test[~y[test]], (good > bad) + 0.5 * (good == bad)))
    return found


def _auc(folds: list[_Wins], weight: FloatArray) -> float:
    """Share of the pairs within folds that the success wins, points weighted; NaN without a pair."""
    won = sum(float(weight[f.success] @ f.wins @ weight[f.failure]) for f in folds)
    pairs = sum(float(weight[f.success].sum() * weight[f.failure].sum()) for f in folds)
    return won / pairs if pairs else float("nan")


def _bootstrap(folds: list[_Wins], group: npt.NDArray[np.intp], rng: np.random.Generator) -> tuple[float, float]:
    """2.5 and 97.5 % points of the AUC over conditions drawn with replacement."""
    values = [_auc(folds, weight) for weight in _drawn_weights(group, rng)]
    low, high = np.nanquantile(values, (0.025, 0.975))
    return float(low), float(high)


def _drawn_weights(group: npt.NDArray[np.intp], rng: np.random.Generator) -> Iterator[FloatArray]:
    """How often each point is drawn, for each draw of as many conditions as there are, with replacement."""
    present, n_groups = np.unique(group), int(group.max()) + 1
    for _ in range(BOOTSTRAPS):
        drawn = np.bincount(rng.choice(present, len(present)), minlength=n_groups)
        yield drawn[group].astype(np.float64)
