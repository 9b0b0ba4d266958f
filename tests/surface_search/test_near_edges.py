"""Readings near edges: their density against the integral over the surface, its derivatives against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal, norm

from bare_scenes import beams, box_centred_pose, nees, no_paths, surface_points, touches_of
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.surface_search import prepare_target
from tanteo.surface_search.cover import covered
from tanteo.surface_search.likelihood import explain
from tanteo.surface_search.modes import weigh
from tanteo.surface_search.near_edges import near_edges
from tanteo.surface_search.polish import polish

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
@pytest.mark.parametrize("normal_sd", [0.0, 0.3])
def test_derivatives(parts, name, corner, normal_sd):
    target, rng = prepare_target(parts[name]), np.random.default_rng(6)
    T = box_centred_pose(rng)
    n = 8
    points = SE3.apply(T, near_points(target, rng, n, corner))
    A = rng.normal(size=(n, 3, 3))
    gains = 1e-3 * rng.normal(size=(n, 3, 2))
    sensed = {} if not normal_sd else {"normals": _mostly_known(rng, n), "normal_sd": normal_sd}
    touches = replace(
        touches_of(points, SD, gains=gains, **sensed), covs=0.2 * SD**2 * (A @ np.swapaxes(A, 1, 2) + np.eye(3))
    )

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


@pytest.mark.parametrize("normal_sd", [0.0, 0.3])
def test_poses_are_summed_as_their_readings_one_by_one(block, normal_sd):
    """Each with its share; poses with more readings near edges than others, and one with none."""
    rng, n = np.random.default_rng(12), 8
    T = box_centred_pose(rng)
    points = SE3.apply(T, near_points(block, rng, n, corner=False))
    sensed = {} if not normal_sd else {"normals": _mostly_known(rng, n), "normal_sd": normal_sd}
    touches = touches_of(points, SD, gains=1e-3 * rng.normal(size=(n, 3, 2)), **sensed)
    Ts = T @ SE3.exp(np.array([0, 3, 1e3, 6])[:, None] * SD * rng.normal(size=(4, 6)) * [1, 1, 1, 1e-2, 1e-2, 1e-2])
    p = SE3.apply(SE3.inverse(Ts)[:, None], points)
    found = at_edges(touches, block, Ts[:, :3, :3], p)
    counts = np.bincount(found.poses, minlength=4)
    assert counts[2] == 0
    assert len(set(counts[[0, 1, 3]])) > 1
    share = rng.uniform(0.1, 1, size=len(found.poses))
    A, b = np.zeros((4, 8, 8)), np.zeros((4, 8))
    found.add_to(A, b, share)
    for k in range(4):
        mine = found.poses == k
        gradient = np.sum(share[mine, None] * found.gradient[mine], axis=0)
        resistance = np.sum(share[mine, None, None] * found.resistance[mine], axis=0)
        np.testing.assert_allclose(b[k], gradient, rtol=1e-9, atol=1e-9 * np.abs(found.gradient).max())
        np.testing.assert_allclose(A[k], resistance, rtol=1e-9, atol=1e-9 * np.abs(found.resistance).max())


def _mostly_known(rng, n):
    """Normals of any direction; the first reading has none."""
    m = rng.normal(size=(n, 3))
    m /= np.linalg.norm(m, axis=1, keepdims=True)
    m[0] = 0.0
    return m


def test_far_from_every_edge_nothing_is_looked_at(block):
    middle = np.array([block.part.box.mean(axis=0)])
    assert at_edges(touches_of(middle, SD), block, np.eye(3)[None], middle[None]) is None


def test_balls_are_not_concerned(block):
    p = near_points(block, np.random.default_rng(7), 3, corner=False)
    assert at_edges(touches_of(p, SD, radii=5e-3), block, np.eye(3)[None], p[None]) is None


def test_where_one_face_explains_all_the_resistance_is_the_curvature(block):
    """On a face, most of the noise inside its edge, normals as they are: that the face is not known takes nothing."""
    rng, (low, high) = np.random.default_rng(10), block.part.box
    T, gains = box_centred_pose(rng), 1e-3 * rng.normal(size=(3, 3, 2))
    q, m = np.tile(0.5 * (low + high), (3, 1)), np.eye(3)
    for k, across in enumerate((1, 2, 0)):
        q[k, k], q[k, across] = high[k], high[across] - 3.5 * SD
    m[0] = 0.0  # the first reading has no normal
    points = SE3.apply(T, q)
    touches = touches_of(points, SD, normals=m @ T[:3, :3].T, normal_sd=0.01, gains=gains)

    def at(xi):
        moved = T @ SE3.exp(xi[:6])
        p = SE3.apply(SE3.inverse(moved), points + gains @ xi[6:])
        return at_edges(touches, block, moved[None, :3, :3], p[None])

    found, h = at(np.zeros(8)), 1e-7
    curvature = -np.stack([(at(h * e).gradient - at(-h * e).gradient) / (2 * h) for e in np.eye(8)], axis=2)
    unit = np.sqrt(np.einsum("kii->ki", curvature[1:]).max(axis=0))
    gaps = (found.resistance - curvature)[1:] / np.outer(unit, unit)
    np.testing.assert_allclose(gaps, 0.0, atol=0.01)
    tilts = 1e4 * (np.eye(3) - m[1:, :, None] * m[1:, None, :])
    plain = at_edges(replace(touches, normals=np.zeros((3, 3))), block, T[None, :3, :3], q[None])
    np.testing.assert_allclose((found.resistance - plain.resistance)[1:, 3:6, 3:6], tilts, atol=100.0)
    np.testing.assert_allclose(found.resistance[0], plain.resistance[0])


@pytest.mark.parametrize("sd", [0.05, 0.5])
def test_a_sensed_normal_tells_the_faces_apart(block, sd):
    """Each face's share of the integral counts as the tilt of the normal against the face's is likely."""
    rng = np.random.default_rng(8)
    p, m = near_points(block, rng, 6, corner=False), rng.normal(size=(6, 3))
    faces = np.eye(3)[np.argmax(np.abs(m), axis=1)] * np.sign(m)
    m = (faces + sd * m) / np.linalg.norm(faces + sd * m, axis=1, keepdims=True)
    found = at_edges(touches_of(p, SD, normals=m, normal_sd=sd), block, np.eye(3)[None], p[None])
    for k, x in enumerate(p):

        def weight(n, k=k):
            tilt = norm.pdf(np.linalg.norm(np.cross(n, m[k])), scale=sd) / np.sqrt(2 * np.pi) / sd
            return tilt / block.part.area * (1.0 if n @ m[k] > 0 else np.exp(-50))

        truth = integral(block, x, SD**2 * np.eye(3), weight)
        assert found.log[k] == pytest.approx(np.log(max(truth, 1e-300)), abs=1e-3)


def test_normals_near_edges_place_the_part_as_well_as_they_say(parts):
    """Twelve readings within two deviations of edges, every other with a normal: NEES of the pose that they give."""
    target, rng, values = prepare_target(parts["bracket_left"]), np.random.default_rng(9), []
    for _ in range(30):
        T = box_centred_pose(rng)
        q, n = surface_points(target, 3000, rng)
        near = np.flatnonzero(target.borders.nearest(q, np.zeros(len(q)))[0] < 2 * SD)[:12]
        m = n[near] + 0.1 * rng.normal(size=(12, 3))
        m = (m / np.linalg.norm(m, axis=1, keepdims=True)) @ T[:3, :3].T
        points = SE3.apply(T, q[near]) + SD * rng.normal(size=(12, 3))
        m[::2] = 0.0
        touches = touches_of(points, SD, normals=m, normal_sd=0.1)
        found = polish(touches, no_paths(), T[None], target, Priors(radius=target.part.radius))
        mode = weigh(touches, no_paths(), [(target, found)], -np.inf, 1, Priors(radius=target.part.radius))[0][0]
        values.append(nees(target.part, found.Ts[0], mode.covariance, T)[0] / 6)
    low, high = chi2.ppf([0.001, 0.999], 6 * 30) / (6 * 30)
    assert low < np.mean(values) < high


def test_a_strip_holds_what_is_between_both_its_sides():
    b, w, h = np.linspace(-3, 6, 19), 2.5, 1e-5

    def cover(b):
        beta, beyond = np.full((len(b), 1, 2), np.inf), np.full((len(b), 1, 2), -np.inf)
        beta[:, 0, 0], beyond[:, 0, 0] = b, b - w
        return [a.reshape(len(b), -1)[:, 0] for a in covered(beta, beyond, np.zeros((len(b), 1), dtype=bool))]

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


def test_a_sensed_normal_finds_the_other_side_of_a_wall(block):
    """A wall three deviations thick: noise put the point next to one side, the normal is that of the other.

    That one is not cut where it ends: another edge would have to be looked at for it.
    """
    low, high = block.part.box
    thin = int(np.argmin(high - low))
    sd, across = float((high - low)[thin]) / 3, (thin + 1) % 3
    x = 0.5 * (low + high)
    x[thin], x[across] = low[thin] + sd, high[across] - 0.5 * sd
    touches = touches_of(x[None], sd, normals=np.eye(3)[thin][None], normal_sd=0.1)
    near = at_edges(touches, block, np.eye(3)[None], x[None, None])
    other = norm.logpdf(2 * sd, scale=sd) - np.log(2 * np.pi * 0.1**2)
    assert near.log[0] + np.log(block.part.area) == pytest.approx(other, abs=1e-3)


def test_a_face_that_is_nearest_and_told_by_the_normal_counts_once(parts):
    """A normal as it is weighs its face by the peak of the tilt's density and others by less, so none gains more."""
    target, rng, sd = prepare_target(parts["housing"]), np.random.default_rng(1), 2e-3
    q, n = surface_points(target, 1500, rng)
    p = q + sd * rng.normal(size=q.shape)
    nearest, told = (target.surface.closest(x).triangles for x in (p, p + 2 * sd * n))
    v, m = target.surface.vertices[target.surface.triangles[:, 0]], target.surface.normals
    level = np.abs(np.sum(m[nearest] * (v[nearest] - v[told]), axis=1)) < 1e-9
    one = level & (np.sum(m[nearest] * m[told], axis=1) > 1 - 1e-9)  # both are one face: the same faces are looked at
    p, n = p[one], n[one]
    plain, sensed = (
        at_edges(touches, target, np.eye(3)[None], p[None])
        for touches in (touches_of(p, sd), touches_of(p, sd, normals=n, normal_sd=0.1))
    )
    assert len(plain.log) > 500
    assert (sensed.log - plain.log).max() == pytest.approx(-np.log(2 * np.pi * 0.1**2), abs=1e-3)


def test_a_face_that_a_normal_tells_costs_how_far_past_its_border_the_reading_is(block):
    """Beside a wall three deviations thick, nearer its other side: of the face that the normal tells, 0.8 past it."""
    low, high = block.part.box
    thin = int(np.argmin(high - low))
    sd, across = float((high - low)[thin]) / 3, (thin + 1) % 3
    x, m = 0.5 * (low + high), np.zeros(3)
    x[thin], x[across] = low[thin] + 1.4 * sd, high[across] + 0.8 * sd
    m[thin], m[across] = 1.0, -0.8
    m /= np.linalg.norm(m)
    found = at_edges(touches_of(x[None], sd, normals=m[None], normal_sd=0.5), block, np.eye(3)[None], x[None, None])
    tilt = -0.5 * (m[across] / 0.5) ** 2 - np.log(2 * np.pi * 0.5**2)
    other = norm.logpdf(1.6 * sd, scale=sd) + tilt - 0.5 * 0.8**2
    assert found.log[0] + np.log(block.part.area) == pytest.approx(other, abs=1e-3)


def test_a_reading_is_as_far_off_as_its_likelihood_makes_it(parts):
    """Noise 3 mm beside the beam and 0.3 mm along it: the face that a point is nearest to may be the wrong one."""
    target, rng = prepare_target(parts["bracket_left"]), np.random.default_rng(5)
    p, d = beams(target, 3000, rng)
    near = target.borders.near(p, np.full(len(p), 3e-3))
    p, d = p[near], d[near]
    covs = 9e-6 * (np.eye(3) - d[:, :, None] * d[:, None]) + 9e-8 * d[:, :, None] * d[:, None]
    points = p + np.einsum("nij,nj->ni", np.linalg.cholesky(covs), rng.normal(size=p.shape))
    touches = replace(touches_of(points, 3e-3, directions=d), covs=covs)
    T, z, priors = np.eye(4)[None], np.zeros((1, 0)), Priors(radius=target.part.radius)
    found, nearest = polish(touches, no_paths(), T, target, priors, 0), explain(touches, T, z, target, priors).r[0]
    on, gate = found.belongs[0] > 0.5, chi2.ppf(0.99, 1)
    assert on.mean() > 0.95
    assert np.all(np.abs(found.residuals[0]) <= np.abs(nearest) + 1e-12)
    assert np.mean(found.residuals[0, on] ** 2 > gate) < 0.02
    assert np.abs(nearest[on]).max() > 5 > 4 > np.abs(found.residuals[0, on]).max()
