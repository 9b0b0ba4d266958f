"""Cones: rays that fill a spot, and the bias and spread of an edge event (math.md, section 7)."""

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.errors import InputError
from tanteo.sensors.noise import blend, cone_rays, draw_aims, edge_bias, edge_shift, edge_variance

D, GAMMA = 0.04, np.deg2rad(5)


def ranges_past_edge(rays, x):
    """Ranges to the half plane z = D, x <= 0, from sensors at (x, 0, 0) that look along +z."""
    d = D / rays[..., 2]
    return np.where(x[..., None] + d * rays[..., 0] <= 0, d, np.inf)


@pytest.mark.parametrize("threshold", [0.1, 0.3, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("side", [1, -1])
def test_edge_bias_of_a_cone_is_d_tan_gamma_g(threshold, side):
    """The event moves out where a small share is enough, by the same amount from either side of the part."""
    rays = cone_rays(GAMMA, 2000) * [side, 1, 1]
    x = np.linspace(-1.2, 1.2, 4801) * D * np.tan(GAMMA)
    _, share = blend(ranges_past_edge(rays, x), threshold=threshold)
    seen = share >= threshold
    event = x[seen].max()
    # half a ray's strip of the spot, and the grid
    assert event == pytest.approx(-edge_bias(D, GAMMA, threshold), abs=0.03 * D * np.tan(GAMMA))
    assert (np.diff(seen.astype(int)) <= 0).all()


def test_edge_shift_is_the_inverse_of_the_covered_share():
    rng = np.random.default_rng(0)
    aims = draw_aims(rng, GAMMA, (200_000,))
    u = aims[:, 0] / aims[:, 2] / np.tan(GAMMA)
    for threshold in (0.05, 0.25, 0.5, 0.8):
        covered = np.count_nonzero(u <= edge_shift(threshold))
        assert covered / len(u) == pytest.approx(threshold, abs=4 * np.sqrt(threshold * (1 - threshold) / len(u)))
    assert edge_shift(0.5) == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(edge_shift(np.array([0.2, 0.3])), -edge_shift(np.array([0.8, 0.7])), atol=1e-12)


def test_opposite_edges_and_both_ways_cancel_the_bias():
    """Width of a part is wrong by twice the bias, its middle by none."""
    bias = edge_bias(D, GAMMA, 0.2)
    left, right = -0.01 + bias, 0.01 - bias
    assert left + right == pytest.approx(0)
    assert right - left - 0.02 == pytest.approx(2 * D * np.tan(GAMMA) * 0.492, rel=0.01)


def test_edge_variance_of_drawn_rays():
    """A drawn ray meets the edge at a distance from the axis that spreads by kappa = 1/4; strides add 1/12."""
    rng, n, stride = np.random.default_rng(1), 20_000, 2e-3
    aims = draw_aims(rng, GAMMA, (n,))
    crossing = -D * aims[:, 0] / aims[:, 2] + stride * (rng.random(n) - 0.5)
    expected = edge_variance(D, GAMMA, stride)
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    # a disc and a uniform have lighter tails than a normal: the interval is wide enough for them
    assert low < np.mean(crossing**2) / expected < high


def test_blend_means_nearest_and_nothing():
    r = np.array([[1.0, 3.0, np.inf, np.inf], [np.inf] * 4, [np.nan, np.inf, np.inf, 2.0]])
    mean, share = blend(r, threshold=0.5)
    np.testing.assert_allclose(mean, [2, np.inf, np.inf])
    np.testing.assert_allclose(share, [0.5, 0, 0.25])
    np.testing.assert_allclose(blend(r, threshold=0.25, nearest=True)[0], [1, np.inf, 2])


def test_cone_rays_fill_the_spot_evenly():
    rays = cone_rays(np.array([0.1, 0.2]), 400)
    assert rays.shape == (2, 400, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1)
    off = np.linalg.norm(rays[..., :2], axis=-1) / rays[..., 2] / np.tan([[0.1], [0.2]])
    np.testing.assert_allclose(np.mean(off**2, axis=-1), 0.5, atol=1e-12)
    np.testing.assert_allclose((rays[..., :2] / rays[..., 2:]).mean(axis=1), 0, atol=1e-3)


def test_refusals():
    with pytest.raises(InputError, match="expected one ray or more"):
        cone_rays(0.1, 0)
    with pytest.raises(InputError, match="expected a share above 0"):
        blend(np.ones(3), threshold=0.0)
