"""Beams on parts at many poses: what the surface's own rays meet, and how ranges move with the pose."""

import numpy as np
import pytest

from tanteo import _core
from tanteo.geometry import SE3


@pytest.fixture(params=["bracket_left", "flange"])
def target(request, models):
    return models[request.param]


def scene(target, each, rng, spread=0.3, poses=9, count=60):
    """Poses, origins outside of the part, and directions of each beam towards it: one, or one at every pose."""
    origins = rng.normal(size=(count, 3))
    origins *= 0.5 / np.linalg.norm(origins, axis=1, keepdims=True)
    aims = target.samples[rng.integers(0, len(target.samples), (count, each))]
    directions = aims - origins[:, None]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return SE3.exp(spread * rng.normal(size=(poses, 6))), origins, directions


@pytest.mark.parametrize("each", [1, 9])
@pytest.mark.parametrize("spread", [0.3, 0.01, 1e-3])
def test_beams_meet_what_rays_on_the_surface_meet(target, each, spread):
    Ts, origins, directions = scene(target, each, np.random.default_rng(3), spread)
    ranges, cosines, faces, derivatives = _core.beams(target.shape, Ts, origins, directions)
    to_part = SE3.inverse(Ts)
    along = SE3.apply(to_part[:, :3, :3], np.broadcast_to(directions, (*ranges.shape, 3)))
    hits = target.surface.cast(SE3.apply(to_part, origins[:, None]), along)
    missed = hits.triangles < 0
    assert 0 < missed.sum() < missed.size
    np.testing.assert_allclose(ranges, hits.distances, rtol=1e-9)
    np.testing.assert_array_equal(faces, np.where(missed, -1, target.part.triangle_face[hits.triangles]))
    n = target.surface.normals[hits.triangles]
    np.testing.assert_allclose(cosines, np.where(missed, 0.0, np.abs(np.sum(n * along, axis=-1))), atol=1e-12)
    assert not derivatives[missed].any()


def test_derivatives_are_differences_of_ranges(models):
    target = models["bracket_left"]
    Ts, origins, directions = scene(target, 1, np.random.default_rng(4), 0.05)
    ranges, cosines, faces, derivatives = _core.beams(target.shape, Ts, origins, directions)
    step, differences, same = 1e-7, np.zeros(derivatives.shape), cosines > 0.2
    for k, e in enumerate(np.eye(6)):
        there = [_core.beams(target.shape, Ts @ SE3.exp(s * step * e), origins, directions) for s in (1, -1)]
        same &= (there[0][2] == faces) & (there[1][2] == faces)
        with np.errstate(invalid="ignore"):
            differences[..., k] = (there[0][0] - there[1][0]) / (2 * step)
    same &= np.isfinite(ranges)
    assert same.sum() > 20
    np.testing.assert_allclose(differences[same], derivatives[same], atol=1e-5)


def test_spreads_are_quadratic_forms():
    rng = np.random.default_rng(5)
    g, A = rng.normal(size=(7, 4, 6)), rng.normal(size=(3, 4, 6, 6))
    A = A @ np.swapaxes(A, -1, -2)
    g[2, 1] = 0.0
    np.testing.assert_allclose(_core.spreads(g, A), np.einsum("csi,ksij,csj->kcs", g, A, g), rtol=1e-12, atol=1e-12)


def test_no_beams_have_no_hits(target):
    none = _core.beams(target.shape, np.zeros((0, 4, 4)), np.zeros((3, 3)), np.ones((3, 1, 3)))
    assert [values.shape for values in none] == [(3, 0), (3, 0), (3, 0), (3, 0, 6)]
    with pytest.raises(ValueError, match="directions"):
        _core.beams(target.shape, np.eye(4)[None], np.zeros((3, 3)), np.ones((3, 2, 3)))
