import numpy as np
import pytest
from sklearn.metrics import roc_auc_score

from ivl.analysis import separability as module
from ivl.analysis.separability import MODELS, auc_gain, separability

N_CONDITIONS, PER_CONDITION = 120, 5
CONDITION = np.repeat(np.arange(N_CONDITIONS), PER_CONDITION)


def points(n_cues: int = 3) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(len(CONDITION), n_cues))


@pytest.mark.parametrize("model", ["svm", "forest"])
def test_an_enclosed_region_separates_and_a_plane_cannot_find_it(model: str) -> None:
    x = points()
    inside = (x**2).sum(axis=1) < 2
    assert separability(x, inside, CONDITION, model).auc.low > 0.95
    assert separability(x, inside, CONDITION, "linear").auc.value < 0.65


def test_the_cue_that_matters_is_missed_when_left_out() -> None:
    x = points()
    success = np.abs(x[:, 2]) < 0.7
    with_it, without = separability(x, success, CONDITION), separability(x[:, :2], success, CONDITION)
    assert with_it.auc.low > 0.95
    assert without.auc.low < 0.55 < 0.65 > without.auc.value


def test_the_gain_of_a_cue_is_known_better_than_the_difference_of_two_intervals() -> None:
    x = points()
    success = (x**2).sum(axis=1) < 2
    both = [separability(cues, success, CONDITION).auc for cues in (x, x[:, :2])]
    gain = auc_gain(x, x[:, :2], success, CONDITION)
    assert gain.value == pytest.approx(both[0].value - both[1].value)
    assert gain.low > 0
    assert gain.high - gain.low < sum(auc.high - auc.low for auc in both)
    assert auc_gain(x, x, success, CONDITION).high == 0
    noise = np.random.default_rng(5).normal(size=(len(x), 1))
    assert auc_gain(np.column_stack([x, noise]), x, success, CONDITION).value < 0
    assert np.isnan(auc_gain(x, x, np.ones(len(x), dtype=bool), CONDITION).value)


@pytest.mark.parametrize("model", ["svm", "linear"])
def test_permuted_labels_give_one_half(model: str) -> None:
    x, rng = points(), np.random.default_rng(1)
    success = (x**2).sum(axis=1) < 2
    values = [separability(x, rng.permutation(success), CONDITION, model).auc.value for _ in range(12)]
    assert np.mean(values) == pytest.approx(0.5, abs=0.03)


def test_no_condition_is_in_training_and_test() -> None:
    """Labels that are the condition's own coin toss can be remembered, but not foreseen (120 tosses: 0.5 +- 0.05)."""
    rng = np.random.default_rng(2)
    place = rng.normal(size=(N_CONDITIONS, 2))
    x = place[CONDITION] + 1e-3 * rng.normal(size=(len(CONDITION), 2))
    success = (rng.random(N_CONDITIONS) < 0.5)[CONDITION]
    assert abs(separability(x, success, CONDITION, "forest").auc.value - 0.5) < 0.16
    leaking = separability(x, success, np.arange(len(CONDITION)), "forest")
    assert leaking.auc.value > 0.95


def test_auc_of_one_fold_is_that_of_scikit_learn_with_and_without_weights() -> None:
    rng = np.random.default_rng(3)
    y, score, weight = rng.random(60) < 0.4, np.round(rng.normal(size=60), 1), rng.integers(0, 4, 60).astype(float)
    good, bad = score[y][:, None], score[~y]
    fold = module._Wins(np.flatnonzero(y), np.flatnonzero(~y), (good > bad) + 0.5 * (good == bad))
    assert module._auc([fold], np.ones(60)) == pytest.approx(roc_auc_score(y, score))
    assert module._auc([fold], weight) == pytest.approx(roc_auc_score(y, score, sample_weight=weight))


def test_equal_input_gives_equal_output_and_units_do_not_matter() -> None:
    x = points()
    success = (x**2).sum(axis=1) < 2
    assert separability(x, success, CONDITION) == separability(x, success, CONDITION)
    scaled = separability(x * [1, 1000, 0.001], success, CONDITION)
    assert scaled.auc.value == pytest.approx(separability(x, success, CONDITION).auc.value, abs=1e-6)


def test_many_points_are_thinned_by_whole_conditions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "N_POINTS_MAX", 203)
    x = points()
    result = separability(x, (x**2).sum(axis=1) < 2, CONDITION)
    assert (result.n_points, result.auc.n) == (200, 40)


def test_one_kind_of_outcome_has_no_auc() -> None:
    x = points()
    result = separability(x, np.ones(len(x), dtype=bool), CONDITION)
    assert np.isnan(result.auc.value)
    only_one = CONDITION == 3
    assert np.isnan(separability(x, only_one, CONDITION).auc.value)


def test_bad_input_is_refused() -> None:
    x, y = points(), np.ones(len(CONDITION), dtype=bool)
    with pytest.raises(ValueError, match="shapes"):
        separability(x[:-1], y, CONDITION)
    with pytest.raises(ValueError, match="no model"):
        separability(x, y, CONDITION, "oracle")
    x[0, 0] = np.nan
    with pytest.raises(ValueError, match="finite"):
        separability(x, y, CONDITION)


def test_every_model_is_tested() -> None:
    assert set(MODELS) == {"svm", "forest", "linear"}
