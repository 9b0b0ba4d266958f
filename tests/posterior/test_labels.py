"""What labels and normals say of an object of which nothing else is known, against sums over random planes and axes."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.factors import FreeRays, surface_points
from tanteo.geometry import SO3
from tanteo.posterior import Priors, Problem
from tanteo.posterior.joint_surface_model import log_level, log_right_angled
from tanteo.posterior.labels import Facets

RADIUS, SD = 0.1, 5e-3


def labelled(points, sd=SD, kind="plane", **more):
    return surface_points(points, sd, labels=("a",) * len(points), kind=kind, **more)


def problem(points):
    return Problem(points, FreeRays.none(), Priors(radius=RADIUS))


def evidence(points):
    return problem(points).label_evidence


def odds(points):
    found = evidence(points)
    return found.log_odds[0], found.facets


def any_rotations(rng, n):
    q = rng.normal(size=(n, 4))
    return SO3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))


@pytest.mark.parametrize("tilted", [0.0, 0.7])
def test_points_of_a_plane_are_as_dense_as_the_mean_over_planes(tilted):
    rng = np.random.default_rng(1)
    R = SO3.exp(np.array([tilted, 0.2, 0.0]))
    p = np.column_stack([rng.uniform(-0.05, 0.05, (5, 2)), SD * rng.normal(size=5)]) @ R.T + 0.01
    toward = np.tile(-R[:, 2], (5, 1))
    got, _ = odds(labelled(p, directions=toward))
    u = rng.normal(size=(2_000_000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    h = rng.uniform(-RADIUS, RADIUS, len(u))
    log = -0.5 * np.sum(((p @ u.T - h) / SD) ** 2, axis=0) + 5 * np.log(2 * RADIUS / (SD * np.sqrt(2 * np.pi)))
    log += 5 * np.log(np.maximum(u @ R[:, 2], 1e-9))  # a beam meets a plane by the cosine of its incidence
    mean, error = np.exp(log).mean(), np.exp(log).std() / np.sqrt(len(log))
    assert error < 0.1 * mean
    assert np.exp(got) == pytest.approx(0.5 * mean + 0.5, rel=0.15 + 4 * error / mean)


def designs_without_surface(points, kind, normals):
    """Return the two log densities of places alone: beams along the normal have the same density of the surface, but
    for its side, which they know."""
    given = labelled(points, sd=1e-4, kind=kind), labelled(points, sd=1e-4, kind=kind, directions=-normals)
    bare, beams = (np.log(2 * np.exp(evidence(one).log_designs[:, 0]) - 1) for one in given)  # half are outliers
    return bare - beams - np.log(2)


@pytest.mark.parametrize("n", [3, 5])
def test_places_on_a_face_are_as_dense_as_over_rectangles(n):
    """The two densities of places: the mean over random rectangles, and even over the patch of the points."""
    rng = np.random.default_rng(n)
    flat = np.column_stack([rng.uniform(-0.03, 0.03, n), rng.uniform(-0.015, 0.015, n)])
    p = np.column_stack([flat, 1e-4 * rng.normal(size=n)])
    got = designs_without_surface(p, "plane", np.tile([0.0, 0, 1], (n, 1)))
    sides, middles = rng.uniform(0, 2 * RADIUS, (2, 400_000, 2))
    middles, angles = 2 * (middles - RADIUS), rng.uniform(0, np.pi, len(sides))
    axis = np.column_stack([np.cos(angles), np.sin(angles)])
    off = flat[:, None] - middles
    along = np.abs(np.stack([np.sum(off * axis, axis=2), off[..., 1] * axis[:, 0] - off[..., 0] * axis[:, 1]], axis=2))
    inside = np.all(along < sides / 2, axis=(0, 2))
    section, per_face = 2 / 3 * np.pi * RADIUS**2, inside / np.prod(sides, axis=1) ** n
    mean, error = per_face.mean(), per_face.std() / np.sqrt(len(sides))
    expected = (n - 1) * np.log(section) + np.log((4 * RADIUS) ** 2 * mean)
    assert got[0] == pytest.approx(expected, abs=4 * error / mean)
    patch = problem(labelled(p, sd=1e-4)).region.groups[0]
    assert got[1] == pytest.approx((n - 1) * np.log(section / patch), abs=1e-3)  # beams are not quite perpendicular


def test_points_in_no_plane_are_outliers():
    rng = np.random.default_rng(2)
    got, facets = odds(labelled(rng.uniform(-0.05, 0.05, (6, 3)), sd=1e-4))
    assert got == pytest.approx(np.log(0.5))
    assert len(facets) == 0


def test_an_edge_and_a_corner_inform_more_than_points_anywhere():
    rng = np.random.default_rng(3)
    line = np.outer(np.linspace(-0.04, 0.04, 4), [0.6, 0, 0.8]) + 1e-4 * rng.normal(size=(4, 3))
    along, facets = odds(labelled(line, sd=1e-4, kind="edge"))
    assert along > 10
    assert np.abs(facets.normals[0] @ [0.6, 0, 0.8]) == pytest.approx(1, abs=1e-4)
    assert odds(labelled(1e-4 * rng.normal(size=(2, 3)), sd=1e-4, kind="vertex"))[0] > 10


def test_a_shared_error_that_turns_with_hand_does_not_hide_plane():
    """Points off by a shared error of ten times their noise are on a plane still, if the error is known to be
    shared."""
    rng = np.random.default_rng(4)
    R = any_rotations(rng, 8)
    p = np.column_stack([rng.uniform(-0.03, 0.03, (8, 2)), 1e-4 * rng.normal(size=8)])
    off, shared_jacobian = np.array([6e-4, -9e-4, 5e-4]), 1e-3 * R
    seen = labelled(p - R @ off, sd=1e-4)
    labels_given = labelled(p - R @ off, sd=1e-4)
    object.__setattr__(labels_given, "shared_jacobian", shared_jacobian)
    assert odds(labels_given)[0] > odds(seen)[0] + 20


def test_a_label_of_very_many_points_is_no_burden():
    rng = np.random.default_rng(6)
    p = np.column_stack([rng.uniform(-0.05, 0.05, (20_000, 2)), 1e-4 * rng.normal(size=20_000)])
    got, facet = odds(labelled(p, sd=1e-4))  # as full matrices of all pairs it would take 3 GB
    assert np.isfinite(got)
    assert abs(facet.normals[0, 2]) == pytest.approx(1)


def facets(normals, tilt, points=None, sd=1e-4):
    k = len(normals)
    covariances = tilt**2 * (np.eye(3) - normals[:, :, None] * normals[:, None])
    return Facets(normals, covariances, np.zeros((k, 3)) if points is None else points, np.full(k, sd**2))


@pytest.mark.parametrize("case", ["right", "one askew", "askew", "parallel"])
def test_directions_are_as_dense_as_the_mean_over_axes(case):
    rng, tilt, share = np.random.default_rng(5), 0.08, 0.8
    R = any_rotations(rng, 1)[0]
    axes = {
        "right": [[1, 0, 0], [0, 1, 0], [0, 0, -1]],
        "one askew": [[1, 0, 0], [0, 1, 0], [0.5, 0.5, 0.7]],
        "askew": [[1, 0, 0], [0.5, 0.86, 0], [0.3, 0.4, 0.86]],
        "parallel": [[1, 0, 0], [-1, 0, 0], [1, 0, 0]],
    }[case]
    n = np.array(axes, dtype=float) @ R.T + 0.3 * tilt * rng.normal(size=(3, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    frames = any_rotations(rng, 400_000)
    cosines = np.abs(np.einsum("fia,ki->fka", frames, n))
    on = 4 * np.pi / 6 * np.exp(-0.5 * (1 - cosines**2) / tilt**2).sum(axis=2) / (2 * np.pi * tilt**2)
    mean = np.prod(1 - share + share * on, axis=1).mean()
    assert log_right_angled(facets(n, tilt), share) == pytest.approx(np.log(mean), abs=0.6)


def test_a_face_touched_again_is_no_coincidence():
    n = np.tile([0.0, 0, 1], (2, 1))
    level = facets(n, 1e-2, np.array([[0, 0, 0.02], [0.01, 0, 0.02]]))
    step = facets(n, 1e-2, np.array([[0, 0, 0.02], [0.01, 0, 0.03]]))
    across = facets(np.eye(3)[:2], 1e-2, np.array([[0, 0, 0.02], [0.01, 0, 0.02]]))
    assert log_level(level, RADIUS) > 3
    assert log_level(step, RADIUS) == pytest.approx(np.log(0.5))
    assert log_level(across, RADIUS) == 0
