"""Roots of covariances that rounding has made a little indefinite: a nearly free direction beside a sharp one."""

import numpy as np

from tanteo.posterior.sampling.widths import roots


def test_a_covariance_that_is_indefinite_by_rounding_has_a_root():
    v = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0]) / np.sqrt(2)
    C = np.eye(6) - (1 + 1e-6) * np.outer(v, v)
    assert np.linalg.eigvalsh(C).min() < 0
    L = roots(np.stack([C, np.eye(6)]))
    np.testing.assert_allclose(L @ np.swapaxes(L, 1, 2), np.stack([C, np.eye(6)]), atol=1e-5)
    np.testing.assert_array_equal(L, np.tril(L))
