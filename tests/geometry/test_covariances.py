"""What is and what is not a covariance."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import CovarianceError
from tanteo.geometry import check_covariance, check_covariances, frozen_array


@pytest.mark.parametrize("size", [0, 1, 3, 6])
@pytest.mark.parametrize("batch", [(), (0,), (4,), (2, 3)])
def test_products_pass_at_every_rank(size, batch):
    rng = np.random.default_rng(size)
    for rank in range(size + 1):
        A = rng.normal(size=(*batch, size, rank)) * 10.0 ** rng.integers(-9, 3, size=(*batch, size, 1))
        C = A @ np.swapaxes(A, -1, -2)
        checked = check_covariances("C", C, size)
        np.testing.assert_allclose(checked, C, atol=1e-15 * np.abs(C).max(initial=0.0))
        assert not checked.flags.writeable


@pytest.mark.parametrize(
    ("C", "reason"),
    [
        (np.zeros(3), "matrices, got shape"),
        (np.zeros((2, 3)), "matrices, got shape"),
        (np.full((3, 3), np.nan), "finite"),
        (np.array([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]), "symmetric"),
        (np.diag([1, 1, -1e-6]), "semidefinite"),
        (np.array([[1, 1.001, 0], [1.001, 1, 0], [0, 0, 1]]), "semidefinite"),
        (np.array([[1e-12, 1.001e-12, 0], [1.001e-12, 1e-12, 0], [0, 0, 1e-3]]), "semidefinite"),
        (np.array([[0, 1e-3, 0], [1e-3, 1, 0], [0, 0, 1]]), "semidefinite"),
        (np.array([[1, 0.9, -0.9], [0.9, 1, 0.9], [-0.9, 0.9, 1]]), "semidefinite"),
    ],
)
def test_others_do_not(C, reason):
    with pytest.raises(CovarianceError, match=f"P: expected.*{reason}"):
        check_covariances("P", C, 3)
    with pytest.raises(CovarianceError, match="P: expected"):
        check_covariance("P", C, 3)


def test_a_batch_is_as_good_as_its_worst():
    C = np.stack([np.eye(3), np.diag([1, 1, -1e-6])])
    with pytest.raises(CovarianceError, match="semidefinite"):
        check_covariances("C", C, 3)
    with pytest.raises(CovarianceError, match=r"3 x 3 matrix, got shape \(1, 3, 3\)"):
        check_covariance("C", C[:1], 3)


def test_rounding_is_repaired():
    C = np.diag([1.0, -1e-15, 0.0])
    C[0, 1] = 1e-12
    checked = check_covariance("C", C, 3)
    np.testing.assert_array_equal(checked, checked.T)
    assert checked[1, 1] == 0.0


def test_frozen_copies():
    a = np.array([1, 2])
    b = frozen_array(a)
    a[0] = 5
    assert b.tolist() == [1.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        b[0] = 3.0
