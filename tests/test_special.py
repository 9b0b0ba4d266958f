"""Special functions that stand for SciPy's where importing it takes longer than the answer."""

import numpy as np
import pytest
from scipy import special as scipy_special

from tanteo.geometry.special import (
    binomial_cdf,
    chi2_quantile,
    chi2_survival,
    entropy,
    jacobi_nodes,
    laguerre_nodes,
    legendre_nodes,
    log_even,
    log_sum,
    softmax,
    zeta_from_two,
)


@pytest.mark.parametrize("dof", [1, 2, 3, 6, 11, 50, 401])
def test_chi2_is_scipys(dof):
    for x in (0.0, 1e-8, 0.3, 2.0, 30.0, 400.0, 1e5):
        np.testing.assert_allclose(chi2_survival(x, dof), scipy_special.chdtrc(dof, x), rtol=1e-11, atol=1e-300)
    assert chi2_survival(np.inf, dof) == 0.0
    assert np.isnan(chi2_survival(np.nan, dof))


@pytest.mark.parametrize("dof", [1, 2, 6, 50])
def test_quantiles_of_chi2_are_scipys(dof):
    for level in (0.01, 0.5, 0.95, 0.999):
        np.testing.assert_allclose(chi2_quantile(level, dof), scipy_special.chdtri(dof, 1 - level), rtol=1e-9)


def test_log_even_is_the_log_of_the_mean_with_one():
    np.testing.assert_allclose(log_even(np.log([1.0, 3.0])), np.log([1.0, 2.0]), rtol=1e-12, atol=1e-15)
    assert log_even(-np.inf) == -np.log(2)


def test_binomial_is_scipys():
    p = np.array([0.0, 1e-6, 0.1, 0.7, 1.0])
    for k, n in ((0, 3), (2, 3), (3, 3), (5, 40), (39, 40)):
        np.testing.assert_allclose(binomial_cdf(k, n, p), scipy_special.bdtr(k, n, p), rtol=1e-10, atol=1e-12)


def test_log_sum_is_scipys():
    rng = np.random.default_rng(3)
    log = rng.normal(0, 300, size=(4, 5, 6))
    log[1], log[2, 3] = -np.inf, -np.inf
    for axis in (None, 0, 1, 2, (0, 2)):
        np.testing.assert_allclose(log_sum(log, axis), scipy_special.logsumexp(log, axis), rtol=1e-14)
    assert log_sum([]) == -np.inf


def test_weights_and_entropies_are_scipys():
    rng = np.random.default_rng(4)
    log = rng.normal(0, 300, size=9)
    log[3] = -np.inf
    np.testing.assert_allclose(softmax(log), scipy_special.softmax(log), rtol=1e-14)
    p = np.array([0.0, 1e-300, 0.3, 1.0, 1.5])
    np.testing.assert_allclose(entropy(p), scipy_special.entr(p), rtol=1e-14)


@pytest.mark.parametrize("count", [1, 2, 5, 12, 30])
@pytest.mark.parametrize("mean", [1e-3, 0.05, 0.5, 0.9])
def test_jacobi_nodes_are_scipys(count, mean):
    a, b = 0.5 / mean - 1.5, -0.5
    x, w = scipy_special.roots_jacobi(count, a, b)
    nodes, weights = jacobi_nodes(count, a, b)
    np.testing.assert_allclose(nodes, x, atol=1e-13)
    np.testing.assert_allclose(weights, w / w.sum(), atol=1e-11)


def test_laguerre_and_legendre_nodes_are_scipys():
    x, w = scipy_special.roots_genlaguerre(9, -0.5)
    np.testing.assert_allclose(laguerre_nodes(9, -0.5), (x, w / w.sum()), atol=1e-12)
    np.testing.assert_allclose(
        legendre_nodes(12), (scipy_special.roots_legendre(12)[0], scipy_special.roots_legendre(12)[1] / 2), atol=1e-13
    )


def test_zeta_without_its_first_term_is_that_of_scipy():
    s = np.array([2.0, 3.0, 4.5, 13.0, 40.0])
    np.testing.assert_allclose(zeta_from_two(s), scipy_special.zeta(s, 2.0), rtol=1e-9)
