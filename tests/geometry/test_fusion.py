"""Fusing estimates of one frame: optimality, consistency, chi-square, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from tanteo.errors import CovarianceError, InputError
from tanteo.geometry import SE3, UncertainFrame, fuse

TRIALS, N = 3000, 4


def noisy_estimates(rng, sigma=5e-3):
    """``TRIALS`` times ``N`` estimates of a true frame, with covariances of their own."""
    A = sigma * rng.normal(size=(N, 6, 6))
    C = A @ np.swapaxes(A, -1, -2)
    truth = SE3.exp(rng.normal(size=6))
    e = np.einsum("nij,tnj->tni", A, rng.normal(size=(TRIALS, N, 6)))
    return truth, UncertainFrame(truth @ SE3.inverse(SE3.exp(e)), np.broadcast_to(C, (TRIALS, N, 6, 6)))


def test_consistent():
    truth, estimates = noisy_estimates(np.random.default_rng(100))
    fused = fuse(estimates)
    assert np.all(fused.converged)
    assert fused.dof == 6 * (N - 1)
    errors = SE3.log(SE3.inverse(fused.frame.T) @ truth)
    nees = np.einsum("ti,tij,tj->", errors, np.linalg.inv(fused.frame.C), errors)
    low, high = chi2.ppf([0.025, 0.975], 6 * TRIALS)
    assert low <= nees <= high
    low, high = chi2.ppf([0.025, 0.975], fused.dof * TRIALS)
    assert low <= fused.chi2.sum() <= high
    assert kstest(fused.chi2, chi2(fused.dof).cdf).pvalue > 0.01


def test_understated_covariances_show_in_chi_square():
    _, estimates = noisy_estimates(np.random.default_rng(2))
    fused = fuse(UncertainFrame(estimates.T, estimates.C / 2))
    assert np.mean(chi2.sf(fused.chi2, fused.dof) < 0.01) > 0.3


def test_is_the_minimum():
    rng = np.random.default_rng(3)
    T = SE3.exp(rng.normal(size=6)) @ SE3.exp(0.2 * rng.normal(size=(N, 6)))
    A = 0.1 * rng.normal(size=(N, 6, 6))
    C = A @ np.swapaxes(A, -1, -2) + 1e-4 * np.eye(6)
    fused = fuse(UncertainFrame(T, C))
    assert fused.converged

    def cost(at):
        r = SE3.log(SE3.inverse(T) @ at)
        return np.einsum("ni,nij,nj->", r, np.linalg.inv(C), r)

    best = cost(fused.frame.T)
    np.testing.assert_allclose(fused.chi2, best, rtol=1e-10)
    root = np.linalg.cholesky(fused.frame.C)
    for direction in np.concatenate([root.T, -root.T]):  # one s.d. away, in every direction
        assert cost(fused.frame.T @ SE3.exp(0.1 * direction)) > best


def test_equals_the_linear_answer_for_pure_translations():
    rng = np.random.default_rng(4)
    p, S = rng.normal(size=(5, 3)), rng.uniform(0.1, 1, size=(5, 3))
    C = np.zeros((5, 6, 6))
    C[:, range(3), range(3)], C[:, range(3, 6), range(3, 6)] = S, 1e-6
    fused = fuse(UncertainFrame(SE3.from_parts(np.eye(3), p), C))
    W = (1 / S).sum(axis=0)
    np.testing.assert_allclose(fused.frame.T[:3, 3], (p / S).sum(axis=0) / W, atol=1e-6)
    np.testing.assert_allclose(np.diag(fused.frame.C)[:3], 1 / W, rtol=1e-3)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_coincident_estimates(n):
    rng = np.random.default_rng(5)
    T, C = SE3.exp(rng.normal(size=6)), np.diag(rng.uniform(1e-10, 1e-2, size=6))
    fused = fuse(UncertainFrame(np.broadcast_to(T, (n, 4, 4)), C))
    np.testing.assert_allclose(fused.frame.T, T, atol=1e-14)
    np.testing.assert_allclose(fused.frame.C, C / n, rtol=1e-9, atol=1e-15 * C.max())
    assert fused.converged
    assert abs(fused.chi2) < 1e-12
    assert fused.dof == 6 * (n - 1)


def test_batches_are_independent_of_each_other():
    _, estimates = noisy_estimates(np.random.default_rng(6))
    grid = UncertainFrame(estimates.T[:6].reshape(2, 3, N, 4, 4), estimates.C[:6].reshape(2, 3, N, 6, 6))
    together = fuse(grid)
    assert together.frame.batch == (2, 3)
    for i in range(2):
        for j in range(3):
            alone = fuse(UncertainFrame(grid.T[i, j], grid.C[i, j]))
            np.testing.assert_allclose(together.frame.T[i, j], alone.frame.T, atol=1e-8)
            np.testing.assert_allclose(together.chi2[i, j], alone.chi2, rtol=1e-6)


def test_an_empty_batch():
    fused = fuse(UncertainFrame(np.zeros((0, 3, 4, 4)), np.eye(6)))
    assert fused.frame.batch == (0,)
    assert fused.chi2.shape == fused.converged.shape == (0,)


def test_contradictions_are_not_averaged_in_silence():
    # half a turn about three axes: no frame is near all of them
    turns = SE3.exp(np.pi * 0.999 * np.eye(6)[3:])
    fused = fuse(UncertainFrame(np.concatenate([np.eye(4)[None], turns]), 1e-4 * np.eye(6)))
    assert not fused.converged or chi2.sf(fused.chi2, fused.dof) < 1e-6


def test_order_of_the_estimates_does_not_matter():
    _, estimates = noisy_estimates(np.random.default_rng(7), sigma=0.05)
    a, b = fuse(estimates), fuse(UncertainFrame(estimates.T[:, ::-1], estimates.C[:, ::-1]))
    scale = np.sqrt(np.diagonal(a.frame.C, axis1=-2, axis2=-1))
    apart = SE3.log(SE3.inverse(a.frame.T) @ b.frame.T)
    assert np.all(np.abs(apart[a.converged & b.converged]) < 1e-5 * scale[a.converged & b.converged])
    assert np.mean(a.converged) > 0.99


def test_refusals():
    with pytest.raises(InputError, match="estimates: expected at least one"):
        fuse(UncertainFrame(np.eye(4), np.eye(6)))
    with pytest.raises(InputError, match="estimates: expected at least one"):
        fuse(UncertainFrame(np.zeros((0, 4, 4)), np.zeros((0, 6, 6))))
    edge = np.diag([0, 1e-6, 1e-6, 0, 1e-4, 1e-4])
    with pytest.raises(CovarianceError, match="positive definite"):
        fuse(UncertainFrame(np.eye(4)[None], edge))
    v = np.ones(6)
    with pytest.raises(CovarianceError, match="positive definite"):
        fuse(UncertainFrame(np.eye(4)[None], np.outer(v, v)))
