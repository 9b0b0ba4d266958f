"""Readings near edges: their density against the integral over the surface, its derivatives against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from bare_scenes import box_centred_pose, touches_of
from tanteo.lie import SE3
from tanteo.surface_search import prepare_target
from tanteo.surface_search.near_edges import _covered, near_edges

SD = 1e-3
NODES, WEIGHTS = np.polynomial.legendre.leggauss(120)


@pytest.fixture(scope="module")
def block(parts):
    return prepare_target(parts["block"])


def near_points(target, rng, n, corner):
    """Points within two standard deviations of edges, or of corners, in the part's frame."""
    borders = target.borders
    if corner:
        at = borders.vertices[rng.choice(np.flatnonzero(borders.corners >= 0), n)]
    else:
        ends = borders.vertices[borders.edges[rng.choice(len(borders.edges), n)]]
        at = ends.mean(axis=1)
    return at + SD * rng.uniform(-2, 2, (n, 3))


def at_edges(touches, target, R, p):
    return near_edges(touches, target, R, p, target.surface.closest(p).triangles)


def integral(target, x, C, weight):
    """``int weight(n) N(x; q, C) dq`` over the faces of a box."""
    total = 0.0
    low, high = target.part.box
    density = multivariate_normal(x, C)
    for axis in range(3):
        u, v = [k for k in range(3) if k != axis]
        for place, sign in ((low[axis], -1.0), (high[axis], 1.0)):
            n = sign * np.eye(3)[axis]
            if abs(x[axis] - place) > 7 * SD:
                continue

            a0, a1 = max(low[u], x[u] - 7 * SD), min(high[u], x[u] + 7 * SD)
            b0, b1 = max(low[v], x[v] - 7 * SD), min(high[v], x[v] + 7 * SD)
            if a1 <= a0 or b1 <= b0:
                continue
            q = np.full((len(NODES), len(NODES), 3), place)
            q[..., u] = 0.5 * (a0 + a1) + 0.5 * (a1 - a0) * NODES[:, None]
            q[..., v] = 0.5 * (b0 + b1) + 0.5 * (b1 - b0) * NODES
            mean = WEIGHTS @ density.pdf(q) @ WEIGHTS
            total += weight(n) * 0.25 * (a1 - a0) * (b1 - b0) * mean
    return total


@pytest.mark.parametrize("corner", [False, True])
def test_the_density_is_the_integral_over_the_surface(block, corner):
    rng = np.random.default_rng(3)
    p = near_points(block, rng, 6, corner)
    found = at_edges(touches_of(p, SD), block, np.eye(3)[None], p[None])
    assert len(found.log) == 6
    for k, x in enumerate(p):
        truth = integral(block, x, SD**2 * np.eye(3), lambda n: 1 / block.part.area)
        assert np.exp(found.log[k]) == pytest.approx(truth, rel=1e-4)


def test_a_slanted_covariance_is_cut_where_the_face_ends(block):
    """At an edge exact for any covariance: what the distance says of the place across is taken into account."""
    rng = np.random.default_rng(4)
    p = near_points(block, rng, 4, corner=False)
    A = rng.normal(size=(4, 3, 3))
    covs = 0.1 * SD**2 * (A @ np.swapaxes(A, 1, 2) + np.eye(3))
    touches = replace(touches_of(p, SD), covs=covs)
    found = at_edges(touches, block, np.eye(3)[None], p[None])
    for k, x in enumerate(p):
        truth = integral(block, x, covs[k], lambda n: 1 / block.part.area)
        assert np.exp(found.log[k]) == pytest.approx(truth, rel=1e-3)


def test_a_beam_meets_only_faces_that_look_at_it(block):
    rng = np.random.default_rng(5)
    p = near_points(block, rng, 6, corner=False)
    d = rng.normal(size=(6, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    found = at_edges(touches_of(p, SD, directions=d), block, np.eye(3)[None], p[None])
    for k, x in enumerate(p):
        truth = integral(block, x, SD**2 * np.eye(3), lambda n, k=k: max(-n @ d[k], 0.0))
        assert np.exp(found.log[k]) == pytest.approx(truth, rel=0.05, abs=3e-3)


@pytest.mark.parametrize("corner", [False, True])
@pytest.mark.parametrize("name", ["block", "bracket_left", "clamp"])
def test_derivatives(parts, name, corner):
    target, rng = prepare_target(parts[name]), np.random.default_rng(6)
    T = box_centred_pose(rng)
    n = 8
    points = SE3.apply(T, near_points(target, rng, n, corner))
    A = rng.normal(size=(n, 3, 3))
    gains = 1e-3 * rng.normal(size=(n, 3, 2))
    touches = replace(touches_of(points, SD, gains=gains), covs=0.2 * SD**2 * (A @ np.swapaxes(A, 1, 2) + np.eye(3)))

    def at(xi):
        moved, shifted = T @ SE3.exp(xi[:6]), points + gains @ xi[6:]
        p = SE3.apply(SE3.inverse(moved), shifted)
        return at_edges(touches, target, moved[None, :3, :3], p[None])

    found, h = at(np.zeros(8)), 1e-7
    fixed = replace(touches, covs=np.tile(SD**2 * np.eye(3), (n, 1, 1)))
    touches = fixed  # with a round covariance nothing depends on the attitude but the place
    found = at(np.zeros(8))
    differences = np.stack([(at(h * e).log - at(-h * e).log) / (2 * h) for e in np.eye(8)], axis=1)
    scale = np.abs(differences).max()
    np.testing.assert_allclose(found.gradient, differences, atol=2e-4 * scale)
    assert np.linalg.eigvalsh(found.resistance).min() > -1e-9 * np.abs(found.resistance).max()


def test_far_from_every_edge_nothing_is_looked_at(block):
    middle = np.array([block.part.box.mean(axis=0)])
    assert at_edges(touches_of(middle, SD), block, np.eye(3)[None], middle[None]) is None


def test_balls_and_sensed_normals_are_not_concerned(block):
    p = near_points(block, np.random.default_rng(7), 3, corner=False)
    ball = touches_of(p, SD, radii=5e-3)
    oriented = touches_of(p, SD, normals=np.tile([0.0, 0.0, 1.0], (3, 1)), normal_sd=0.1)
    for touches in (ball, oriented):
        assert at_edges(touches, block, np.eye(3)[None], p[None]) is None


def test_a_strip_holds_what_is_between_both_its_sides():
    b, w, h = np.linspace(-3, 6, 19), 2.5, 1e-5

    def cover(b):
        beta, beyond = np.full((len(b), 1, 2), np.inf), np.full((len(b), 1, 2), -np.inf)
        beta[:, 0, 0], beyond[:, 0, 0] = b, b - w
        return [a.reshape(len(b), -1)[:, 0] for a in _covered(beta, beyond, np.zeros((len(b), 1), dtype=bool))]

    log, pull, hold = cover(b)
    np.testing.assert_allclose(np.exp(log), norm.cdf(b) - norm.cdf(b - w), rtol=1e-9)
    np.testing.assert_allclose(pull, (cover(b + h)[0] - cover(b - h)[0]) / (2 * h), rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(hold, -(cover(b + h)[1] - cover(b - h)[1]) / (2 * h), rtol=1e-4, atol=1e-6)


def test_the_far_side_of_a_face_cuts_its_share(block):
    """Noise a third of the block's thinnest side: a point near an edge of that side is cut by the next edge too."""
    low, high = block.part.box
    thin = int(np.argmin(high - low))
    sd = float((high - low)[thin]) / 3
    x = 0.5 * (low + high)
    x[thin], x[(thin + 1) % 3] = low[thin] + sd, high[(thin + 1) % 3] + 0.5 * sd
    near = at_edges(touches_of(x[None], sd), block, np.eye(3)[None], x[None, None])
    rows = block.borders.nearest(x[None], np.array([0.0]))[1]
    assert len(near.log) == 1
    assert np.isfinite(block.borders.junctions.take(rows).widths).all()
    side = norm.pdf(0.5 * sd, scale=sd) * (norm.cdf(1.0) - norm.cdf(1.0 - 3.0))
    bottom = norm.pdf(sd, scale=sd) * norm.cdf(-0.5)
    assert np.exp(near.log[0]) * block.part.area == pytest.approx(side + bottom, rel=0.003)
