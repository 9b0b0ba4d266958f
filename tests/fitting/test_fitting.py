"""Features from points: optimality, covariance, shared errors, orientation, degenerate sets."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

import tanteo.fitting as ft
from tanteo.errors import DegenerateError, InputError
from tanteo.features import SharedError, relate, relate_all
from tanteo.features.kinds import EDGE, PLANE, VERTEX
from tanteo.geometry import SE3, SO3

N = 4000


def random_frame(rng):
    return SE3.exp(np.r_[0.2 * rng.normal(size=3), rng.normal(size=3)])


def noise(n, rng, sd=3e-4):
    """Covariances of n points: a different ellipsoid each, and their square roots."""
    L = sd * (np.eye(3) + 0.5 * rng.normal(size=(n, 3, 3)))
    return L @ np.swapaxes(L, -1, -2), L


def on_plane(n, rng):
    return np.c_[rng.uniform(-0.03, 0.03, (n, 2)), np.zeros(n)]


def on_line(n, rng):
    return np.c_[np.linspace(-0.03, 0.03, n) + 0.001 * rng.normal(size=n), np.zeros((n, 2))]


def rigid(points):
    """Jacobian of a rigid left error of the world."""
    return np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), -SO3.hat(points)], axis=-1)


CASES = {
    "plane": (ft.plane_ml, PLANE, lambda rng: on_plane(9, rng), 3),
    "edge": (ft.edge_ml, EDGE, lambda rng: on_line(7, rng), 2),
    "vertex": (ft.vertex_ml, VERTEX, lambda rng: np.zeros((4, 3)), 1),
}


def perturbation(kind, T_hat, T):
    """``p`` of ``T_true = T_hat exp(B' p)`` modulo the unobserved directions of the kind."""
    gap = SE3.inverse(T_hat) @ T
    z = gap[..., :3, 3]
    if kind is VERTEX:
        return z
    if kind is PLANE:
        n = gap[..., :3, 2]
        height = np.sum(n * z, axis=-1) / n[..., 2]
        tilt = n[..., :2] / n[..., 2:]
        return np.stack([height, -tilt[..., 1], tilt[..., 0]], axis=-1)
    u = gap[..., :3, 0]
    slope = u[..., 1:] / u[..., :1]
    lateral = z[..., 1:] - z[..., :1] * slope
    return np.concatenate([lateral, -slope[..., 1:], slope[..., :1]], axis=-1)


@pytest.mark.parametrize("name", CASES)
def test_fits_follow_their_covariance(name):
    fit, kind, make, _ = CASES[name]
    rng = np.random.default_rng(1)
    truth, T = make(rng), random_frame(rng)
    covs, L = noise(len(truth), rng)
    world = SE3.apply(T, truth)
    sensed = world + (L @ rng.normal(size=(N, len(truth), 3, 1)))[..., 0]
    found = fit(sensed, covs)
    T_true = T
    if kind is PLANE:  # the side of the normal is arbitrary
        flip = np.sign(found.T[:, :3, 2] @ T[:3, 2])
        T_true = T @ np.where(flip[:, None, None] > 0, np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0]))
    if kind is EDGE:
        assert np.all(found.T[:, :3, 0] @ T[:3, 0] > 0)  # from the first point towards the last
    p = perturbation(kind, found.T, T_true)
    nees = np.einsum("ni,nij,nj->n", p, np.linalg.inv(found.P), p)
    low, high = special.chdtri(kind.size * N, [0.975, 0.025]) / N
    assert low < nees.mean() < high
    low, high = special.chdtri(found.dof * N, [0.975, 0.025]) / N
    assert low < found.chi2.mean() < high
    assert 0.04 < np.mean(found.chi2 > special.chdtri(found.dof, 0.05)) < 0.06


@pytest.mark.parametrize("name", ["plane", "edge"])
def test_fits_are_stationary_points_of_the_exact_likelihood(name):
    fit, kind, make, _ = CASES[name]
    rng = np.random.default_rng(2)
    truth, T = make(rng), random_frame(rng)
    covs, L = noise(len(truth), rng, sd=2e-3 if name == "plane" else 1e-3)
    sensed = SE3.apply(T, truth) + (L @ rng.normal(size=(len(truth), 3, 1)))[..., 0]
    found = fit(sensed, covs)

    def chi2(frame):
        across = frame[:3, 2:3] if kind is PLANE else frame[:3, 1:3]
        r = (sensed - frame[:3, 3]) @ across
        return np.einsum("ni,nij,nj->", r, np.linalg.inv(across.T @ covs @ across), r)

    np.testing.assert_allclose(chi2(found.T), found.chi2, rtol=1e-12)
    h = 1e-4 * np.sqrt(np.diag(found.P))
    for k, row in enumerate(kind.B):
        ahead, back = (chi2(found.T @ SE3.exp(s * h[k] * row)) for s in (1, -1))
        slope = (ahead - back) / 2e-4  # per standard deviation
        assert abs(slope) < 1e-5


@pytest.mark.parametrize("name", CASES)
def test_batches_equal_single_fits(name):
    fit, _, make, _ = CASES[name]
    rng = np.random.default_rng(3)
    truth = make(rng)
    covs, L = noise(len(truth), rng)
    sensed = truth + (L @ rng.normal(size=(2, 3, len(truth), 3, 1)))[..., 0]
    together = fit(sensed, covs)
    for k in np.ndindex(2, 3):
        one = fit(sensed[k], covs)
        np.testing.assert_allclose(together.T[k], one.T, atol=1e-9)
        np.testing.assert_allclose(together.P[k], one.P, rtol=1e-6, atol=1e-15)
        np.testing.assert_allclose(together.chi2[k], one.chi2, rtol=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_gains_are_the_derivative_of_fit_up_to_size_of_residuals(name):
    fit, kind, make, _ = CASES[name]
    rng = np.random.default_rng(4)
    truth = make(rng)
    covs, _ = noise(len(truth), rng)
    found = fit(truth, covs)
    dq = 1e-7 * rng.normal(size=truth.shape)
    # the true points are dq from the measured ones
    p = perturbation(kind, found.T, fit(truth + dq, covs).T)
    np.testing.assert_allclose(p, np.einsum("nij,nj->i", found.shared_jacobian, dq), atol=1e-10)


def sensed_feature(kind, rng, shared):
    make = {PLANE: on_plane, EDGE: on_line, VERTEX: lambda n, rng: np.zeros((n, 3))}[kind]
    T = random_frame(rng)
    truth = SE3.apply(T, make(6, rng))
    covs, L = noise(6, rng)
    points = truth + (L @ rng.normal(size=(6, 3, 1)))[..., 0]
    if kind is PLANE:
        return ft.fit_plane(points, covs, outward=T[:3, 2], shared=shared(points))
    return {EDGE: ft.fit_edge, VERTEX: ft.fit_vertex}[kind](points, covs, shared=shared(points))


@pytest.mark.parametrize("kind", [PLANE, EDGE, VERTEX], ids=lambda k: k.name)
def test_an_error_of_the_robot_base_moves_the_feature_rigidly(kind):
    rng = np.random.default_rng(5)
    base = SharedError("base", np.diag([1e-3] * 3 + [2e-3] * 3) ** 2)
    hand = SE3.exp(rng.normal(size=6))
    mount = SharedError("mount", 1e-6 * np.eye(6))
    found, _ = sensed_feature(kind, rng, lambda q: [(base, rigid(q)), (mount, rigid(q) @ SE3.adjoint(hand))])
    exact = kind.B @ SE3.adjoint_inverse(found.T_world_feature)
    np.testing.assert_allclose(found.shared[0].jacobian, exact, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.shared[1].jacobian, exact @ SE3.adjoint(hand), rtol=1e-9, atol=1e-12)


def test_constraints_of_fitted_features_do_not_feel_robot_base():
    base = SharedError("base", np.diag([1.0] * 3 + [1e-4] * 3))
    with_base, without = (
        [
            sensed_feature(k, np.random.default_rng(6 + i), s)[0]
            for i, k in enumerate((PLANE, EDGE, PLANE, EDGE, VERTEX))
        ]
        for s in (lambda q: [(base, rigid(q))], lambda q: [])
    )
    corner = [ft.edge_from_planes(fs[0], fs[2]) for fs in (with_base, without)]
    for one, other in zip(relate_all([*with_base, corner[0]]), relate_all([*without, corner[1]]), strict=True):
        if not one.kind.null or one.kind.name == "edge_gap":
            np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-5, err_msg=one.kind.name)


def test_an_error_that_is_not_rigid_goes_through_the_estimator():
    rng = np.random.default_rng(7)
    points, covs = on_plane(8, rng), noise(8, rng)[0]
    bias = SharedError("bias", np.array([[1e-6]]))
    up = np.broadcast_to(np.array([0, 0, 1.0])[:, None], (8, 3, 1))
    found, _ = ft.fit_plane(points, covs, outward=[0, 0, 1], shared=[(bias, up)])
    np.testing.assert_allclose(found.shared[0].jacobian[:, 0], [1, 0, 0], atol=1e-9)
    one_side = up * (points[:, 0] > 0)[:, None, None]
    tilted, _ = ft.fit_plane(points, covs, outward=[0, 0, 1], shared=[(bias, one_side)])
    moved, _ = ft.fit_plane(points + 1e-8 * one_side[..., 0], covs, outward=[0, 0, 1])
    p = perturbation(PLANE, tilted.T_world_feature, moved.T_world_feature)
    np.testing.assert_allclose(p, 1e-8 * tilted.shared[0].jacobian[:, 0], atol=1e-13)
    with pytest.raises(InputError, match="Jacobian of shape"):
        ft.fit_plane(points, covs, outward=[0, 0, 1], shared=[(bias, up[:3])])


def test_thickness_feels_range_bias_twice_with_the_hand_turned():
    rng = np.random.default_rng(8)
    bias = SharedError("bias", np.array([[1e-8]]))
    covs = 1e-12 * np.broadcast_to(np.eye(3), (6, 3, 3))
    faces = []
    for sign in (1.0, -1.0):
        points = np.add(on_plane(6, rng), [0, 0, 0.01 * sign])
        beam = np.broadcast_to(np.array([0, 0, -sign])[:, None], (6, 3, 1))
        faces.append(ft.fit_plane(points, covs, outward=[0, 0, sign], shared=[(bias, beam)])[0])
    (thickness,) = (c for c in relate(*faces) if c.kind.name == "plane_offset")
    assert thickness.value[0] == pytest.approx(-0.02, abs=1e-5)
    assert thickness.covariance[0, 0] == pytest.approx(4e-8, rel=1e-2)


def test_any_of_three_columns_gives_the_outward_side():
    rng = np.random.default_rng(9)
    points, covs = on_plane(5, rng), noise(5, rng, 1e-5)[0]
    down = np.tile([0.1, 0.0, -1.0], (5, 1))
    for given in ({"outward": [0, 0, 2.0]}, {"directions": down}, {"normals": -down}):
        assert ft.fit_plane(points, covs, **given)[0].T_world_feature[2, 2] > 0.99
        mirrored = {key: -np.asarray(value) for key, value in given.items()}
        assert ft.fit_plane(points, covs, **mirrored)[0].T_world_feature[2, 2] < -0.99
    with pytest.raises(InputError, match="which side is outside"):
        ft.fit_plane(points, covs)
    mixed = down.copy()
    mixed[0] *= -1
    with pytest.raises(InputError, match="agree on which side"):
        ft.fit_plane(points, covs, directions=mixed)
    with pytest.raises(InputError, match=r"agree on which side .* lie in the surface\. Check for swapped columns"):
        ft.fit_plane(points, covs, outward=[1.0, 0, 0])


def test_the_other_side_has_the_same_covariance_and_gains():
    rng = np.random.default_rng(10)
    points = on_plane(6, rng) + 1e-4 * rng.normal(size=(6, 3))
    covs = noise(6, rng)[0]
    base = SharedError("base", np.eye(6))
    up, down = (ft.fit_plane(points, covs, outward=[0, 0, s], shared=[(base, rigid(points))])[0] for s in (1, -1))
    for a, b in ((up, down),):
        S = np.diag([1.0, -1, -1, 1])
        Ad = SE3.adjoint_inverse(S)
        np.testing.assert_allclose(b.T_world_feature, a.T_world_feature @ S, atol=1e-15)
        np.testing.assert_allclose(b.P, PLANE.B @ Ad @ PLANE.B.T @ a.P @ (PLANE.B @ Ad @ PLANE.B.T).T, atol=1e-18)


def test_a_ball_tip_is_taken_off_against_the_normal():
    rng = np.random.default_rng(11)
    n = np.array([0.0, 0.6, 0.8])
    R = SO3.frame_from_axis(n, 2)
    surface = on_plane(7, rng) @ R.T
    covs = noise(7, rng, 1e-5)[0]
    found, report = ft.fit_plane(surface + 0.002 * n, covs, directions=np.tile(-n, (7, 1)), radius=0.002)
    np.testing.assert_allclose(found.T_world_feature[:3, 2], n, atol=1e-9)
    np.testing.assert_allclose(n @ found.T_world_feature[:3, 3], 0, atol=1e-12)
    np.testing.assert_allclose(found.support @ n, 0, atol=1e-12)
    assert report.rms < 1e-12


def test_plane_frames_sit_at_centroid_along_principal_directions():
    points = np.array([[x, y, 0.0] for x in (-3, -1, 1, 3) for y in (-1, 0, 1)]) * 0.01 + [1, 2, 3]
    covs = np.broadcast_to(1e-8 * np.eye(3), (12, 3, 3))
    found, report = ft.fit_plane(points, covs, outward=[0, 0, 1])
    np.testing.assert_allclose(found.T_world_feature[:3, 3], [1, 2, 3], atol=1e-12)
    assert abs(found.T_world_feature[0, 0]) == pytest.approx(1)
    sum_x2, sum_y2 = ((points - [1, 2, 3])[:, :2] ** 2).sum(axis=0)
    np.testing.assert_allclose(found.P, np.diag([1e-8 / 12, 1e-8 / sum_y2, 1e-8 / sum_x2]), rtol=1e-9, atol=1e-20)
    assert (report.dof, report.p_value) == (9, pytest.approx(1))


def test_the_report_names_the_worst_reading():
    rng = np.random.default_rng(12)
    points, covs = on_plane(9, rng), np.broadcast_to(1e-8 * np.eye(3), (9, 3, 3))
    points[4, 2] += 2e-3
    ids = tuple("abcdefghi")
    _, report = ft.fit_plane(points, covs, outward=[0, 0, 1], readings=ids)
    assert report.worst == "e"
    assert report.p_value < 1e-6
    assert report.worst_sds > 10
    _, report = ft.fit_edge(np.c_[np.linspace(0, 0.05, 5), [0, 0, 1e-3, 0, 0], np.zeros(5)], covs[:5])
    assert report.worst == "3"


def isotropic(n, sd=1e-4):
    return np.broadcast_to(sd**2 * np.eye(3), (n, 3, 3))


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((2, 3)), "at least 3 points, got 2"),
        (np.zeros((4, 3)), "coincident"),
        (np.outer(np.arange(5.0), [1, 2, 3]), "not on one line"),
        (np.c_[np.arange(6.0) * 0.01, 1e-4 * np.array([1, -1, 1, -1, 1, 1]), np.zeros(6)], "spread over 4 standard"),
    ],
)
def test_planes_refuse_degenerate_points(points, message):
    with pytest.raises((DegenerateError, InputError), match=message):
        ft.fit_plane(points, isotropic(len(points)), outward=[0, 0, 1.0])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((1, 3)), "at least 2 points, got 1"),
        (np.ones((3, 3)), "coincident"),
        (1e-4 * np.array([[0.0, 0, 0], [1, 0, 0], [2, 1, 0]]), "direction is free|does not converge"),
    ],
)
def test_edges_refuse_degenerate_points(points, message):
    with pytest.raises((DegenerateError, InputError), match=message):
        ft.fit_edge(points, isotropic(len(points)))


def test_shapes_and_numbers_are_checked():
    good = on_plane(4, np.random.default_rng(13))
    for points, covs, message in (
        (good[:, :2], isotropic(4), "shape"),
        (good, np.eye(2), "shape"),
        (good * np.nan, isotropic(4), "finite"),
        (good, 0 * isotropic(4), "positive variance"),
    ):
        with pytest.raises(InputError, match=message):
            ft.fit_plane(points, covs, outward=[0, 0, 1])
    with pytest.raises(InputError, match="singular"):
        ft.fit_edge(on_line(4, np.random.default_rng(0)), np.broadcast_to(np.diag([1, 1e-8, 0]), (4, 3, 3)))
    with pytest.raises(InputError, match="positive definite"):
        ft.fit_vertex(good, np.zeros((4, 3, 3)))
    with pytest.raises(InputError, match="edge_ml"):
        ft.fit_edge(good[None], isotropic(4)[None])
