"""What a box leaves of a pose, against draws of which those outside are left out."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.lie import SE3, SO3
from tanteo.matching.box import left_by
from tanteo.parts import read_part


@pytest.fixture(scope="module")
def part(request):
    return read_part(request.config.rootpath / "examples" / "parts" / "wedge.step")


@pytest.mark.parametrize("off", [(0, 0, 0), (1.5, 0, 0), (1, -1, 1), (0, 3, 0)])
def test_share_and_moments_are_those_of_the_draws_inside(part, off):
    rng = np.random.default_rng(1)
    A = rng.normal(size=(6, 6)) * np.r_[np.full(3, 2e-3), np.full(3, 0.02)][:, None]
    C, mean, T = A @ A.T, 1e-3 * rng.normal(size=6), SE3.exp(rng.normal(size=6))
    G = T[:3, :3] @ np.concatenate([np.eye(3), -SO3.hat(part.centroid)], axis=1)
    sd = np.sqrt(np.diag(G @ C @ G.T))
    middle = SE3.apply(T, part.centroid) + G @ mean + np.array(off) * sd
    box = np.stack([middle - 0.8 * sd, middle + 1.2 * sd])
    x = mean + rng.normal(size=(400_000, 6)) @ np.linalg.cholesky(C).T
    centre = SE3.apply(T, part.centroid) + x @ G.T
    kept = x[np.all((centre >= box[0]) & (centre <= box[1]), axis=1)]
    left = left_by(box, part, T[None], C[None], mean[None])
    assert np.exp(left.log_share[0]) == pytest.approx(len(kept) / len(x), rel=0.1)
    white = np.linalg.inv(np.linalg.cholesky(C))
    np.testing.assert_allclose(white @ left.means[0], white @ kept.mean(axis=0), atol=0.1)
    np.testing.assert_allclose(white @ left.covariances[0] @ white.T, white @ np.cov(kept.T) @ white.T, atol=0.12)


def test_far_outside_shares_stay_numbers_and_means_inside(part):
    T, C = np.eye(4), np.diag(np.repeat([1e-3, 1e-5], 3)) ** 2
    box = part.centroid + np.array([[0.1, -0.01, -0.01], [0.12, 0.01, 0.01]])
    left = left_by(box, part, T[None], C[None])
    assert -6000 < left.log_share[0] < -1000
    assert (SE3.apply(T @ SE3.exp(left.means[0]), part.centroid) > box[0] - 2e-3).all()
    assert (np.linalg.eigvalsh(left.covariances[0]) >= -1e-15).all()
