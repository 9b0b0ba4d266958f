"""The outlier rate integrated out, against quadrature by brute force, differences and exact sums."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import betaln, expit
from scipy.stats import beta, betabinom

from tanteo.geometry.special import log_sum
from tanteo.posterior.near_variants import by_place, log_density_elsewhere
from tanteo.posterior.outliers import beta_binomial_tail, log_by_rate, outlier_rates


def log_density(log_hit, log_outlier, mean):
    """Return the log density of all readings at each pose, integrated over the outlier rate by the engine's nodes."""
    return log_sum(log_by_rate(log_hit, log_outlier, *outlier_rates(mean, log_hit.shape[1])), axis=0)


def inlier_probability(hit, outlier, mean):
    """Probability that the last reading is on the surface: the derivative of the log density by that there."""
    step = np.zeros(len(hit))
    step[-1] = 1e-5
    up, down = (log_density((hit + sign * step)[None], outlier[None], mean)[0] for sign in (1, -1))
    return (up - down) / 2e-5


@pytest.mark.parametrize("mean", [1e-6, 9e-4, 1.1e-3, 0.02, 0.3, 0.9])
def test_rates_have_the_mean_that_is_stated(mean):
    rates, weights = outlier_rates(mean, 20)
    assert np.all((rates > 0) & (rates < 1))
    assert weights.sum() == pytest.approx(1)
    assert weights @ rates == pytest.approx(mean)


@pytest.mark.parametrize(("n", "astray"), [(5, 0), (8, 1), (15, 3), (40, 6)])
def test_is_the_integral_over_all_rates(n, astray):
    """Readings that are half clear and half doubtful, with densities as different as a touch's."""
    rng = np.random.default_rng(n)
    hit, outlier = rng.normal(8, 2, n), rng.normal(0, 1, n)
    hit[:astray] -= 30
    hit[astray : astray + 2] -= 6  # doubtful
    density = beta(0.5, 0.5 / 0.02 - 0.5)
    top = np.maximum(hit, outlier)

    def of(rate):
        return np.prod((1 - rate) * np.exp(hit - top) + rate * np.exp(outlier - top)) * density.pdf(rate)

    expected = np.log(quad(of, 0, 1e-3)[0] + quad(of, 1e-3, 0.2)[0] + quad(of, 0.2, 1)[0]) + top.sum()
    assert log_density(hit[None], outlier[None], 0.02)[0] == pytest.approx(expected, abs=0.05)


def test_outliers_lower_the_inlier_probability_of_a_doubtful():
    clear, doubtful = np.array([12.0] * 10), np.array([0.0])
    gone = np.array([-40.0] * 3)
    alone = inlier_probability(np.concatenate([clear, doubtful]), np.zeros(11), 0.02)
    among = inlier_probability(np.concatenate([clear, gone, doubtful]), np.zeros(14), 0.02)
    stated = expit(np.log(0.98 / 0.02))
    assert among < 0.93 < stated < alone


@pytest.mark.parametrize(("outliers", "n"), [(1, 8), (3, 25), (6, 25), (12, 100)])
def test_counts_of_strays_are_beta_binomial(outliers, n):
    assert beta_binomial_tail(outliers, n, 0.02) == pytest.approx(betabinom(n, 0.5, 24.5).sf(outliers - 1), rel=0.1)


def test_no_outliers_are_never_many():
    assert beta_binomial_tail(0, 8, 0.02) == beta_binomial_tail(0, 8, 0.0) == 1
    assert beta_binomial_tail(1, 8, 0.0) == 0


@pytest.mark.parametrize(("elsewhere", "n"), [(0, 3), (1, 8), (4, 12), (10, 25), (2, 20)])
def test_any_share_of_a_near_variant_may_be_elsewhere(elsewhere, n):
    hit, outlier = np.full(n, 10.0), np.zeros(n)
    hit[:elsewhere] = -100
    expected = 10 * (n - elsewhere) + betaln(elsewhere + 1, n - elsewhere + 1)
    assert log_density_elsewhere(hit[None], outlier[None])[0] == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("n", [3, 8, 30, 100, 300, 1000])
@pytest.mark.parametrize("mean", [5e-4, 0.02, 0.1])
def test_counts_weigh_what_they_weigh_many_readings_there_are(n, mean):
    """Both densities against beta functions, from no outlier to a fifth of the readings."""
    counts = np.unique(np.linspace(0, n // 5, 12).astype(int))
    hit, outlier = np.full((len(counts), n), 10.0), np.zeros((len(counts), n))
    hit[np.arange(n) < counts[:, None]] = -100
    near_variant = 10 * (n - counts) + betaln(counts + 1, n - counts + 1)
    assert log_density_elsewhere(hit, outlier) == pytest.approx(near_variant, abs=0.1)
    b = 0.5 / mean - 0.5
    rate = 10 * (n - counts) + betaln(counts + 0.5, n - counts + b) - betaln(0.5, b)
    likely = counts < 10 * mean * n + 2
    assert log_density(hit, outlier, mean)[likely] == pytest.approx(rate[likely], abs=0.1)


def test_few_strays_are_the_sensor_s_and_many_are_another_part():
    """Odds at equal priors, over the number of 25 readings that are off the part."""
    hit, outlier = np.full((12, 25), 8.0), np.zeros((12, 25))
    hit[np.arange(25) < np.arange(12)[:, None]] = -100
    odds = log_density_elsewhere(hit, outlier) - log_density(hit, outlier, 0.02)
    assert np.all(np.diff(odds) > 0)
    assert odds[0] < -2.5
    assert odds[2] < 0 < odds[6]
    assert odds[10] > 5


def test_an_outlier_of_one_part_may_be_on_another():
    """Two readings of one place, one of them off: of an object like the part, too, the sensor erred."""
    off, on, outlier = -300.0, 4.0, 1.0
    hit, other = np.array([[on, on, off, on]]), np.full((1, 4), outlier)
    alone = log_density_elsewhere(hit[:, :3], other[:, :3])
    own = log_density_elsewhere(*by_place(hit, other, 0.02, np.arange(4)))
    np.testing.assert_allclose(own, log_density_elsewhere(hit, other))
    together = log_density_elsewhere(*by_place(hit, other, 0.02, np.array([0, 1, 2, 2])))
    share = np.linspace(0, 1, 200_001)
    place = (1 - share) * 0.02 * np.exp(outlier) * (0.98 * np.exp(on) + 0.02 * np.exp(outlier)) + share * np.exp(
        2 * outlier
    )
    each = (1 - share) * np.exp(on) + share * np.exp(outlier)
    assert together[0] == pytest.approx(np.log(np.trapezoid(each**2 * place, share)), abs=1e-6)
    assert together[0] - alone[0] < own[0] - alone[0]
