import numpy as np
import pytest

from ivl.analysis.intervals import (
    Estimate,
    difference,
    share_of,
    share_of_clusters,
    stratified_mean,
    student95,
    wilson,
)


@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    [
        # Newcombe, Statistics in Medicine 17 (1998), table I, method 3
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0000, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_gives_published_values(k: int, n: int, low: float, high: float) -> None:
    assert np.array(wilson(k / n, n)) == pytest.approx([low, high], abs=5e-5)


def test_wilson_solves_its_defining_equation() -> None:
    share, n, z = 0.3, 17, 1.7
    for end in wilson(share, n, z):
        assert abs(share - end) == pytest.approx(z * np.sqrt(end * (1 - end) / n))


def test_wilson_mirrors_and_has_width_at_the_ends_and_says_nothing_without_data() -> None:
    low, high = wilson([0.0, 1.0, 0.5], [5, 5, 0])
    assert low[0] == 0.0
    assert high[1] == 1.0
    assert high[0] == pytest.approx(1 - low[1])
    assert 0.4 < high[0] < 0.5
    assert (low[2], high[2]) == (0.0, 1.0)


@pytest.mark.parametrize("share", [-0.1, 1.1])
def test_wilson_refuses_what_is_no_share(share: float) -> None:
    with pytest.raises(ValueError, match="outside"):
        wilson(share, 5)


def test_interval_of_a_mean_of_trials_covers_when_the_rollouts_of_a_trial_are_alike() -> None:
    """Trials that always or never land are the worst case; the interval over the rollouts would cover half as often."""
    rng = np.random.default_rng(0)
    mean = rng.binomial(5, 0.7, size=4000) / 5
    low, high = wilson(mean, 5)
    assert ((low <= 0.7) & (high >= 0.7)).mean() > 0.9
    low, high = wilson(mean, 5 * 24)
    assert ((low <= 0.7) & (high >= 0.7)).mean() < 0.6


def test_share_of_nothing_is_unknown() -> None:
    nothing = share_of([])
    assert np.isnan(nothing.value)
    assert (nothing.low, nothing.high, nothing.n) == (0.0, 1.0, 0)
    assert share_of([True, True, False, False]).value == 0.5


def crossed(rng: np.random.Generator, n_vehicles: int, n_approaches: int, bad: float) -> np.ndarray:
    """Landings of vehicles on the same approaches; both differ in how easy they are, and a share of vehicles is bad."""
    vehicle = rng.normal(0.0, 1.2, (n_vehicles, 1)) - 4.0 * (rng.random((n_vehicles, 1)) < bad)
    approach = rng.normal(0.0, 1.2, (1, n_approaches))
    return np.asarray(rng.random((n_vehicles, n_approaches)) < 1 / (1 + np.exp(-1.0 - vehicle - approach)))


@pytest.mark.parametrize("shape", [(6, 200), (20, 40), (20, 400), (8, 8)])
@pytest.mark.parametrize("bad", [0.0, 0.2])
def test_a_share_of_crossed_clusters_covers_where_that_of_flights_does_not(shape: tuple[int, int], bad: float) -> None:
    rng = np.random.default_rng(1)
    truth = crossed(rng, 4000, 500, bad).mean()
    vehicle, approach = np.indices(shape)
    inside = {"clusters": 0, "flights": 0}
    n = 400
    for _ in range(n):
        landed = crossed(rng, *shape, bad)
        found = {
            "clusters": share_of_clusters(landed, np.ones(shape), vehicle, approach),
            "flights": share_of(landed),
        }
        for name, of in found.items():
            inside[name] += of.low <= truth <= of.high
    assert inside["clusters"] / n > 0.92
    assert inside["flights"] / n < 0.75


def test_a_share_of_some_flights_of_clusters_covers() -> None:
    """As the strikes that are avoided: a share of flights whose number differs from vehicle to vehicle."""
    rng = np.random.default_rng(2)

    def drawn(n_vehicles: int) -> tuple[np.ndarray, np.ndarray]:
        rate, share = rng.beta(1.0, 2.0, (2, n_vehicles, 1))
        counted = rng.random((n_vehicles, 100)) < rate
        return counted & (rng.random((n_vehicles, 100)) < 1 - 0.5 * share), counted

    happened, counted = drawn(40_000)
    truth = happened.sum() / counted.sum()
    vehicle, approach = np.indices((12, 100))
    inside = 0
    for _ in range(400):
        found = share_of_clusters(*drawn(12), vehicle, approach)
        inside += found.low <= truth <= found.high
    assert inside / 400 > 0.92


def test_answers_that_have_a_cluster_each_are_independent() -> None:
    landed = np.arange(50) % 3 == 0
    assert share_of_clusters(landed, np.ones(50), np.arange(50)) == share_of(landed)
    doubled = share_of_clusters(np.tile(landed, 2), np.ones(100), np.tile(np.arange(50), 2))
    alone = share_of(landed)
    # the same answers once more tell nothing new
    assert (doubled.low, doubled.high) == pytest.approx((alone.low, alone.high), abs=0.01)
    assert doubled.n == 100


def test_clusters_that_are_few_or_all_the_same_count_as_one_answer_each() -> None:
    vehicle, approach = np.indices((3, 100))
    few = share_of_clusters(approach % 2 == 0, np.ones((3, 100)), vehicle)
    assert (few.low, few.high) == tuple(float(end) for end in wilson(0.5, 3))
    vehicle, _ = np.indices((20, 100))
    perfect = share_of_clusters(np.ones((20, 100)), np.ones((20, 100)), vehicle)
    assert perfect.low == pytest.approx(float(wilson(1.0, 20)[0]))
    nothing = share_of_clusters(np.ones(5), np.zeros(5), np.arange(5))
    assert np.isnan(nothing.value)
    assert (nothing.low, nothing.high, nothing.n) == (0.0, 1.0, 0)


@pytest.mark.parametrize(("freedom", "wanted"), [(3, 3.182), (5, 2.571), (11, 2.201), (19, 2.093), (1000, 1.962)])
def test_quantiles_of_students_t_are_the_published_ones(freedom: int, wanted: float) -> None:
    assert student95(freedom) == pytest.approx(wanted, rel=0.01)


def test_stratified_mean_weighs_cells_equally_and_knows_its_error() -> None:
    values, cell = [1.0, 1.0, 1.0, 0.0, 0.0], [0, 0, 0, 1, 1]
    assert stratified_mean(values, cell) == Estimate(0.5, 0.5, 0.5, 2)
    # two cells, variances 1/3 (of 3) and 1/2 (of 2): standard error sqrt(1/9 + 1/4) / 2
    mean = stratified_mean([1.0, 1.0, 0.0, 0.0, 1.0], cell)
    assert mean.value == pytest.approx((2 / 3 + 1 / 2) / 2)
    assert mean.high - mean.value == pytest.approx(1.959964 * np.sqrt(1 / 9 + 1 / 4) / 2, rel=1e-6)


def test_stratified_interval_covers_the_truth_of_a_fixed_grid() -> None:
    rng, truth = np.random.default_rng(1), np.linspace(0.05, 0.95, 40)
    cell, hits = np.repeat(np.arange(40), 5), 0
    for _ in range(1500):
        mean = stratified_mean(rng.random(200) < truth[cell], cell)
        hits += mean.low <= truth.mean() <= mean.high
    assert 0.93 < hits / 1500 < 0.97


def test_stratified_mean_of_single_trials_has_no_interval() -> None:
    mean = stratified_mean([0.0, 1.0], [0, 1])
    assert mean.value == 0.5
    assert np.isnan(mean.low)
    assert np.isnan(stratified_mean([], []).value)


def test_stratified_mean_refuses_shapes_that_differ() -> None:
    with pytest.raises(ValueError, match="shapes"):
        stratified_mean([0.0, 1.0], [0])


def test_difference_adds_variances() -> None:
    result = difference(Estimate(0.8, 0.77, 0.83, 9), Estimate(0.5, 0.46, 0.54, 4))
    assert (result.value, result.low, result.high) == pytest.approx((0.3, 0.25, 0.35))
    assert result.n == 4


def test_difference_is_not_fooled_by_an_interval_cut_off_at_one() -> None:
    assert difference(Estimate(0.99, 0.95, 1.0, 9), Estimate(0.5, 0.5, 0.5, 9)).high == pytest.approx(0.53)
