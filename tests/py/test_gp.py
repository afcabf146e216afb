import numpy as np
import pytest

from ivl.learners.gp import GaussianProcess, Hyper, fit, log_likelihood

HYPER = Hyper(np.array([0.2, 0.3]), 0.01)


def data(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.uniform(size=(n, 2))
    y = np.sin(5 * x[:, 0]) + x[:, 1] ** 2 + 0.05 * rng.standard_normal(n)
    return x, (y - y.mean()) / y.std()


def dense(x: np.ndarray, y: np.ndarray, at: np.ndarray, hyper: Hyper) -> tuple[np.ndarray, np.ndarray, float]:
    """The textbook formulas with explicit inverses."""

    def k(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.exp(-0.5 * (((a[:, None] - b[None]) / hyper.lengths) ** 2).sum(-1))

    inverse = np.linalg.inv(k(x, x) + (hyper.noise + 1e-8) * np.eye(len(x)))
    variance = y @ inverse @ y / len(x)
    mean = k(at, x) @ inverse @ y
    covariance = variance * (k(at, at) - k(at, x) @ inverse @ k(x, at))
    sign, log_det = np.linalg.slogdet(inverse)
    return mean, covariance, -0.5 * len(x) * np.log(variance) + 0.5 * sign * log_det


def test_prediction_and_likelihood_equal_the_textbook_formulas() -> None:
    x, y = data(30)
    at = np.random.default_rng(1).uniform(size=(7, 2))
    gp = GaussianProcess(x, y, HYPER)
    mean, covariance, likelihood = dense(x, y, at, HYPER)
    assert gp.predict(at)[0] == pytest.approx(mean, abs=1e-8)
    assert gp.predict(at)[1] == pytest.approx(np.sqrt(np.diag(covariance)), abs=1e-6)
    assert log_likelihood(x, y, HYPER) == pytest.approx(likelihood, abs=1e-6)


def test_joint_draws_have_the_posterior_s_mean_and_covariance() -> None:
    x, y = data(12)
    at = np.random.default_rng(1).uniform(size=(4, 2))
    rng = np.random.default_rng(2)
    gp = GaussianProcess(x, y, HYPER)
    draws = np.vstack([gp.sample(at, 40, rng) for _ in range(1000)])
    mean, covariance, _ = dense(x, y, at, HYPER)
    scale = np.sqrt(covariance.max())
    assert draws.mean(axis=0) == pytest.approx(mean, abs=0.03 * scale)
    assert np.cov(draws.T) == pytest.approx(covariance, abs=0.05 * scale**2)


def test_fit_finds_hyper_parameters_better_than_where_it_began() -> None:
    x, y = data(60)
    prior = Hyper(np.array([0.05, 0.05]), 1.0)
    found = fit(x, y, prior, prior)
    gain = log_likelihood(x, y, found) - log_likelihood(x, y, prior)
    assert gain > 10


def test_fit_keeps_the_noise_ratio_above_its_floor() -> None:
    x, _ = data(40)
    y = np.sin(5 * x[:, 0]) + x[:, 1]
    free, floored = (fit(x, y, HYPER, HYPER, noise_min) for noise_min in (0.0, 0.008))
    assert free.noise < 0.008
    assert floored.noise == pytest.approx(0.008, rel=1e-12)


def test_fit_is_deterministic() -> None:
    x, y = data(40)
    first, second = (fit(x, y, HYPER, HYPER) for _ in range(2))
    assert (first.log() == second.log()).all()


@pytest.mark.parametrize("y", [np.zeros(6), np.ones(6)])
def test_repeated_points_and_constant_values_are_survived(y: np.ndarray) -> None:
    x = np.full((6, 2), 0.5)
    hyper = fit(x, y, HYPER, HYPER)
    mean, sd = GaussianProcess(x, y, hyper).predict(np.array([[0.5, 0.5], [0.0, 1.0]]))
    assert np.isfinite(mean).all()
    assert np.isfinite(sd).all()


def test_the_safest_point_is_that_of_exact_predictions() -> None:
    x, y = data(50)
    at = np.random.default_rng(1).uniform(size=(300, 2))
    for lengths in ([0.2, 0.3], [0.02, 0.03], [3.0, 2.0]):
        gp = GaussianProcess(x, y, Hyper(np.array(lengths), 0.05))
        mean, sd = gp.predict(at)
        value = mean - 0.5 * sd
        assert value[gp.safest(at, 0.5)] == pytest.approx(value.max(), abs=1e-4)


def test_fitted_values_are_the_mean_at_the_data() -> None:
    x, y = data(90)
    gp = GaussianProcess(x, y, HYPER)
    assert gp.fitted == pytest.approx(gp.predict(x)[0], abs=1e-9)


@pytest.mark.parametrize("length", [1e-3, 0.02, 100.0])
def test_very_short_and_very_long_lengths_equal_the_textbook_too(length: float) -> None:
    x, y = data(90)
    hyper = Hyper(np.array([length, length]), 0.05)
    at = np.random.default_rng(1).uniform(size=(7, 2))
    mean, covariance, likelihood = dense(x, y, at, hyper)
    gp = GaussianProcess(x, y, hyper)
    assert gp.predict(at)[0] == pytest.approx(mean, abs=1e-7)
    assert gp.predict(at)[1] ** 2 == pytest.approx(np.diag(covariance), abs=1e-6)
    assert log_likelihood(x, y, hyper) == pytest.approx(likelihood, rel=1e-6, abs=1e-9)


def test_a_fit_that_follows_is_no_worse_than_where_it_began_and_moves_by_its_step_at_most() -> None:
    x, y = data(60)
    start = Hyper(np.array([0.1, 0.1]), 0.05)
    found = fit(x, y, HYPER, start, follow=True)
    assert log_likelihood(x, y, found) > log_likelihood(x, y, start)
    assert np.abs(found.log() - start.log()).max() == pytest.approx(0.3)
