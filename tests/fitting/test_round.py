"""Round features from points: covariances by simulation, another solver, sides and balls, refusals, degenerate sets."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special
from scipy.optimize import least_squares

import tanteo.fitting as ft
from round_scenes import RADIUS, error_of, nees, random_frame, round_points, size_of
from tanteo.errors import DegenerateError, InputError, SideError
from tanteo.features import Feature, SharedError
from tanteo.features.kinds import CIRCLE, CONE, CYLINDER, KINDS, PLANE, SPHERE
from tanteo.geometry import SE3, SO3

N, SD = 600, 1e-5
ROUND = ("circle", "cylinder", "cone", "sphere")


def noise(n, rng, sd=SD):
    L = sd * (np.eye(3) + 0.3 * rng.normal(size=(n, 3, 3)))
    return L @ np.swapaxes(L, -1, -2), L


def sensed(kind, arc, n, rng, sd=SD):
    """Return a frame, points on the feature in the world with noise, covariances, and vectors away from the axis."""
    T = random_frame(rng)
    q, N = round_points(kind, arc, n)
    covs, L = noise(n, rng, sd)
    return T, SE3.apply(T, q) + (L @ rng.normal(size=(n, 3, 1)))[..., 0], covs, N @ T[:3, :3].T


def inside(values, dof):
    low, high = special.chdtri(dof * len(values), [0.9995, 0.0005]) / len(values)
    assert low < np.mean(values) < high, f"{np.mean(values):.4f} outside {low:.4f}..{high:.4f}"


@pytest.mark.parametrize("arc", [360, 180, 90])
@pytest.mark.parametrize("kind", ROUND)
def test_round_fits_follow_their_covariance(kind, arc):
    rng = np.random.default_rng(arc)
    T, (q, out) = random_frame(rng), round_points(kind, arc, 12)
    covs, L = noise(12, rng)
    points = SE3.apply(T, q) + (L @ rng.normal(size=(N, 12, 3, 1)))[..., 0]
    outward = np.broadcast_to(out @ T[:3, :3].T, points.shape)
    found = ft.round_ml(KINDS[kind], points, covs, outward=outward)
    ok = ft.observable(KINDS[kind], found, points)
    assert ok.mean() > 0.99
    error = error_of(kind, found.fit.T, T, found.size, size_of(kind))
    inside(nees(error, found.fit.P)[ok], error.shape[-1])
    inside(found.fit.chi2[ok], found.fit.dof)


@pytest.mark.parametrize("kind", ROUND)
def test_another_solver_finds_the_same(kind):
    rng = np.random.default_rng(3)
    T, points, _, _ = sensed(kind, 200, 14, rng)
    covs = np.tile(SD**2 * np.eye(3), (14, 1, 1))
    found = ft.round_ml(KINDS[kind], points, covs)
    rows = list(KINDS[kind].rows)
    bias = {"circle": 0.5, "cylinder": 0.5, "sphere": 1.0, "cone": 0.5}[kind]

    def residuals(x):
        xi = np.zeros(6)
        xi[rows] = x[:-1] * np.where(np.array(rows) < 3, 1e-3, 1e-1)
        p = SE3.apply(SE3.inverse(T @ SE3.exp(xi)), points)
        s, rho = size_of(kind) * (1 + x[-1]), np.hypot(p[:, 0], p[:, 1])
        if kind == "circle":
            return np.r_[p[:, 2], rho - s - bias * SD**2 / rho] / SD
        if kind == "sphere":
            d = np.linalg.norm(p, axis=1)
            return (d - s - bias * SD**2 / d * 1.0) / SD
        if kind == "cone":
            return (rho * np.cos(s) - p[:, 2] * np.sin(s) - bias * np.cos(s) * SD**2 / rho) / SD
        return (rho - s - bias * SD**2 / rho) / SD

    other = least_squares(residuals, np.zeros(len(rows) + 1), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert 2 * other.cost == pytest.approx(float(found.fit.chi2), rel=1e-6)
    assert size_of(kind) * (1 + other.x[-1]) == pytest.approx(float(found.size), rel=1e-6)


@pytest.mark.parametrize("kind", ROUND)
def test_far_from_the_origin_and_in_another_unit_it_is_the_same(kind):
    rng = np.random.default_rng(14)
    _, points, covs, _ = sensed(kind, 300, 12, rng)
    near = ft.round_ml(KINDS[kind], points, covs)
    far = ft.round_ml(KINDS[kind], points + np.array([2e3, -1e3, 5e2]), covs)
    large = ft.round_ml(KINDS[kind], 1e3 * points, 1e6 * covs)
    assert near.converged
    assert far.converged
    assert large.converged
    assert far.size == pytest.approx(near.size, rel=1e-7)
    assert large.size == pytest.approx(near.size * (1 if kind == "cone" else 1e3), rel=1e-9)
    np.testing.assert_allclose(far.fit.T[:3, 3] - [2e3, -1e3, 5e2], near.fit.T[:3, 3], atol=1e-8)


@pytest.mark.parametrize("kind", ROUND)
def test_batches_of_round_fits_equal_single_ones(kind):
    rng = np.random.default_rng(4)
    _, points, covs, _ = sensed(kind, 270, 12, rng)
    many = points + SD * rng.normal(size=(3, 12, 3))
    together = ft.round_ml(KINDS[kind], many, covs)
    for k in range(3):
        one = ft.round_ml(KINDS[kind], many[k], covs)
        np.testing.assert_allclose(together.size[k], one.size, rtol=1e-9)
        np.testing.assert_allclose(together.fit.P[k], one.fit.P, rtol=1e-5, atol=1e-9 * np.abs(one.fit.P).max())


@pytest.mark.parametrize("kind", ROUND)
def test_gains_of_points_are_the_derivative_of_the_fit(kind):
    rng = np.random.default_rng(5)
    q, _ = round_points(kind, 250, 12)
    points, covs = SE3.apply(random_frame(rng), q), np.tile(SD**2 * np.eye(3), (12, 1, 1))
    found = ft.round_ml(KINDS[kind], points, covs)
    dq = 1e-8 * rng.normal(size=points.shape)
    moved = ft.round_ml(KINDS[kind], points + dq, covs)
    p = error_of(kind, found.fit.T, moved.fit.T, found.size, moved.size)
    np.testing.assert_allclose(p, np.einsum("nij,nj->i", found.fit.shared_jacobian, dq), rtol=2e-3, atol=2e-10)


@pytest.mark.parametrize("bore", [False, True])
@pytest.mark.parametrize("kind", ["cylinder", "cone", "sphere"])
def test_a_ball_inside_a_bore_or_outside_a_boss(kind, bore):
    rng, tip = np.random.default_rng(6), 1.5e-3
    T, points, covs, away = sensed(kind, 280, 15, rng, 1e-6)
    side = -1.0 if bore else 1.0
    feature, _ = ft.fit_round(
        KINDS[kind], points + side * tip * away, covs, directions=-side * away, tip_radius=tip, label="a"
    )
    assert feature.convex is not bore
    error = error_of(kind, feature.T_world_feature, T, feature.size.value, size_of(kind))
    assert nees(error, feature.full_covariance) < special.chdtri(len(error), 1e-4)
    apart = np.linalg.norm(feature.support - points, axis=1)
    assert apart.max() < 2e-5  # the support is on the surface
    known, _ = ft.fit_round(
        KINDS[kind], points + side * tip * away, covs, directions=-side * away, tip_radius=tip, size=size_of(kind)
    )
    assert known.size.value == pytest.approx(size_of(kind), rel=1e-12)
    assert known.size.variance == 0


def test_sensed_normals_make_a_short_arc_observable():
    rng, sd = np.random.default_rng(7), np.radians(0.2)
    errors = []
    for _ in range(80):
        T, points, covs, away = sensed("cylinder", 25, 12, rng)
        normals = away + sd * np.cross(away, rng.normal(size=away.shape))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        feature, _ = ft.fit_round(CYLINDER, points, covs, normals=-normals, normal_sds=np.full(12, sd))
        assert feature.convex is False
        error = error_of("cylinder", feature.T_world_feature, T, feature.radius, RADIUS)
        errors.append(nees(error, feature.full_covariance))
    inside(errors, 5)


REFUSED = {
    "a short arc": ("circle", 20, 12, "covers 1. degrees"),
    "a ring of a cylinder": ("ring", 360, 12, "one plane"),
    "nearly a ring": ("thin", 360, 12, "reach .*direction of the axis is not observable"),
    "a small cap": ("sphere", 8, 12, "the cap covers .* degrees: the radius is not observable.*give it"),
    "a line": ("line", 0, 6, "on one line"),
    "one point": ("point", 0, 6, "coincident"),
    "five points": ("cylinder", 360, 5, "another fits as well"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_observable_is_refused_with_the_reason(case):
    name, arc, n, words = REFUSED[case]
    rng = np.random.default_rng(8)
    kind = KINDS.get(name, CYLINDER)
    q = {
        "line": np.c_[np.linspace(0, 1, n), np.zeros((n, 2))],
        "point": np.zeros((n, 3)),
    }.get(name)
    if q is None:
        q, _ = round_points(name if name in KINDS else "cylinder", arc, n)
    if name in ("ring", "thin"):
        q[:, 2] *= 0 if name == "ring" else 2e-3
    noise_sd = 0 if name in ("ring", "line", "point") else SD
    points = q + noise_sd * rng.normal(size=q.shape)
    with pytest.raises(DegenerateError, match=words):
        ft.fit_round(kind, points, np.tile(SD**2 * np.eye(3), (n, 1, 1)), label="a")


def test_touches_from_known_sides_leave_one_cylinder():
    """Two short arcs opposite each other fit a second cylinder, across: directions rule it out."""
    rng, n = np.random.default_rng(1), 12
    turn = np.radians(np.linspace(-18, 18, n))
    q = np.c_[RADIUS * np.cos(turn), RADIUS * np.sin(turn), RADIUS * (2 * (np.arange(n) % 2) - 1)]
    points, covs = q + SD * rng.normal(size=q.shape), np.tile(SD**2 * np.eye(3), (n, 1, 1))
    with pytest.raises(DegenerateError, match="Give the direction of each touch"):
        ft.fit_round(CYLINDER, points, covs)
    away = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    feature, _ = ft.fit_round(CYLINDER, points, covs, directions=away)
    assert feature.convex is False
    assert abs(feature.T_world_feature[2, 2]) > 0.99


def test_six_touches_square_to_the_wall_are_enough():
    """Three touches in each of two rings lie on several cylinders; only of one are they square to the wall."""
    turn = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    away = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    points = 9e-3 * away - np.c_[0 * turn, 0 * turn, 4e-3 * (np.arange(6) % 2)]
    covs = np.tile(SD**2 * np.eye(3), (6, 1, 1))
    with pytest.raises(DegenerateError, match="another fits as well"):
        ft.fit_round(CYLINDER, points, covs)
    bore, _ = ft.fit_round(CYLINDER, points, covs, directions=away, tip_radius=1e-3)
    assert bore.radius == pytest.approx(10e-3, abs=1e-5)
    assert bore.convex is False


def test_a_known_radius_settles_a_short_arc():
    rng = np.random.default_rng(10)
    _, points, covs, away = sensed("cylinder", 35, 24, rng)
    out = {"directions": -away}
    free, _ = ft.fit_round(CYLINDER, points, covs, **out)
    fixed, _ = ft.fit_round(CYLINDER, points, covs, size=RADIUS, **out)
    loose, _ = ft.fit_round(CYLINDER, points, covs, size=RADIUS, size_sd=1e-7, **out)
    after, distance = ft.with_known_size(free, RADIUS)
    sds = [np.sqrt(f.P[:2, :2].trace()) for f in (free, fixed, loose, after)]
    assert sds[1] < 0.4 * sds[0]
    assert sds[1:] == pytest.approx([sds[1]] * 3, rel=0.03)
    assert distance < 10
    np.testing.assert_allclose(after.T_world_feature[:3, 2], fixed.T_world_feature[:3, 2], atol=5e-4)
    with pytest.raises(InputError, match="fitted size"):
        ft.with_known_size(fixed, RADIUS)


def test_sides_that_contradict_each_other_are_refused():
    rng = np.random.default_rng(11)
    _, points, covs, away = sensed("cylinder", 360, 12, rng)
    mixed = away * np.where(np.arange(12) % 2, 1, -1)[:, None]
    with pytest.raises(SideError, match="agree on which side"):
        ft.fit_round(CYLINDER, points, covs, directions=mixed)
    with pytest.raises(SideError, match="expected a bore, got directions or normals of a boss"):
        ft.fit_round(CYLINDER, points, covs, directions=-away, convex=False)
    with pytest.raises(SideError, match="outside or a bore from inside"):
        ft.fit_round(CYLINDER, points, covs, tip_radius=1e-3)
    with pytest.raises(InputError, match="points of its rim"):
        ft.fit_round(CIRCLE, points, covs, tip_radius=1e-3)
    with pytest.raises(InputError, match="positive definite"):
        ft.fit_round(CYLINDER, points, 0 * covs)
    with pytest.raises(InputError, match="at least 5 points"):
        ft.fit_round(CYLINDER, points[:4], covs[:4])
    with pytest.raises(InputError, match="smaller than it"):
        ft.fit_round(SPHERE, round_points("sphere", 200, 12)[0], covs, tip_radius=0.02, convex=True)


@pytest.mark.parametrize("kind", ROUND)
def test_an_error_of_the_base_moves_a_round_feature_rigidly(kind):
    rng = np.random.default_rng(12)
    _, points, covs, _ = sensed(kind, 360, 12, rng)
    base = SharedError("base", np.diag([1e-3] * 3 + [2e-3] * 3) ** 2)
    rigid = np.concatenate([np.broadcast_to(np.eye(3), (12, 3, 3)), -SO3.hat(points)], axis=-1)
    bias = SharedError("bias", np.array([[1e-8]]))
    feature, _ = ft.fit_round(KINDS[kind], points, covs, shared=[(base, rigid), (bias, rng.normal(size=(12, 3, 1)))])
    exact = feature.kind.B @ SE3.adjoint_inverse(feature.T_world_feature)
    np.testing.assert_allclose(feature.shared[0].jacobian, exact, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(feature.size.shared[0], 0, atol=1e-12)
    assert feature.size.shared[1].shape == (1, 1)


def plane_at(T, P, label="top"):
    return Feature(PLANE, T, P, label=label)


@pytest.mark.parametrize(("n", "known"), [(3, None), (4, None), (2, RADIUS)])
def test_three_touches_of_a_bore_and_its_face_give_the_rim(n, known):
    rng, tip, values = np.random.default_rng(13), 1e-3, []
    L = np.diag([5e-6, 3e-4, 2e-4])
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False) if n > 2 else np.array([0.2, 1.9])
    away = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    for _ in range(200):
        T = random_frame(rng)
        at = T @ SE3.from_parts(np.eye(3), np.array([0.03, 0.02, 0.0]))
        q = (RADIUS - tip) * away - np.array([0, 0, 5e-3])
        points = SE3.apply(at, q) + SD * rng.normal(size=(n, 3))
        plane = plane_at(T @ SE3.exp(-PLANE.B.T @ L @ rng.normal(size=3)), L @ L)
        rim, report = ft.circle_on_plane(
            points, np.tile(SD**2 * np.eye(3), (n, 1, 1)), plane, size=known, tip_radius=tip,
            directions=away @ T[:3, :3].T, convex=False,
        )  # fmt: skip
        error = error_of("circle", rim.T_world_feature, at, rim.radius, RADIUS)
        error, C = (error, rim.full_covariance) if known is None else (error[:-1], rim.P)
        values.append(nees(error, C))
    inside(values, len(error))
    assert report.dof == n - (3 if known is None else 2)


def test_holes_and_their_face_count_the_face_once():
    top = ft.with_named_errors(plane_at(np.eye(4), np.diag([1e-10, 1e-8, 1e-8])))
    turn = np.linspace(0, 2 * np.pi, 4, endpoint=False)
    ring = RADIUS * np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    covs = np.tile(SD**2 * np.eye(3), (4, 1, 1))
    a, b = (
        ft.circle_on_plane(ring + np.array([x, 0, -0.005]), covs, top, convex=False, label="h")[0] for x in (0.0, 0.1)
    )
    names = [term.error.name for term in (*a.shared, *b.shared)]
    assert names == ["plane 'top'"] * 2
    heights = np.array([a.shared[0].jacobian[2], b.shared[0].jacobian[2]])
    np.testing.assert_allclose(heights, [[1, 0, 0], [1, 0, -0.1]], atol=1e-4)
    with pytest.raises(InputError, match="expected a label"):
        ft.with_named_errors(plane_at(np.eye(4), np.eye(3), ""))
    with pytest.raises(InputError, match="expected a plane, got a circle"):
        ft.circle_on_plane(ring, covs, a)


def test_finished_features_and_their_required_columns():
    hole = ft.given_round(CIRCLE, [0.1, 0, 0], [1e-5, 1e-5, 1e-4], axis=[0, 0, 2], axis_sd=1e-3, size=3e-3)
    np.testing.assert_allclose(np.sqrt(np.diag(hole.P)), [1e-5, 1e-5, 1e-4, 1e-3, 1e-3])
    assert (hole.radius, hole.half_angle, hole.convex) == (3e-3, None, None)
    centre = ft.given_round(CIRCLE, [0.1, 0, 0], 1e-5)
    assert np.sqrt(centre.P[4, 4]) == pytest.approx(np.pi)
    cone = ft.given_round(CONE, [0, 0, 0], 1e-5, axis=[1, 0, 0], axis_sd=1e-3, size=0.4)
    assert cone.half_angle == 0.4
    with pytest.raises(InputError, match="expected its axis"):
        ft.given_round(CYLINDER, [0, 0, 0], 1e-5)
    with pytest.raises(InputError, match="How well is the axis known"):
        ft.given_round(CIRCLE, [0, 0, 0], 1e-5, axis=[0, 0, 1])
    with pytest.raises(InputError, match="Is it in degrees"):
        ft.given_round(CONE, [0, 0, 0], 1e-5, axis=[1, 0, 0], axis_sd=1e-3, size=20.0)
    with pytest.raises(InputError, match="got a plane"):
        ft.given_round(PLANE, [0, 0, 0], 1e-5)
