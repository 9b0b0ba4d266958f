"""Vertices from edges, edges from planes, and the paper's features from the fewest points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

import tanteo.fitting as ft
from tanteo.errors import DegenerateError, InputError
from tanteo.features import Feature, SharedError, SharedTerm
from tanteo.features.kinds import EDGE, PLANE, VERTEX
from tanteo.geometry import SE3, SO3

N = 4000


def edge(u, point, P, label="", shared=()):
    return Feature(EDGE, SE3.from_parts(SO3.frame_from_axis(np.asarray(u, float), 0), point), P, label, shared)


def inside(nees, dof):
    low, high = special.chdtri(dof * len(nees), [0.975, 0.025]) / len(nees)
    assert low < nees.mean() < high


@pytest.mark.parametrize("k", [2, 3, 5])
def test_common_point_of_lines_follows_its_covariance(k):
    rng = np.random.default_rng(k)
    X, u = rng.normal(size=3), rng.normal(size=(k, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    T = SE3.from_parts(SO3.frame_from_axis(u, 0), X - 0.05 * u)
    L = np.diag([1e-4, 1e-4, 1e-3, 1e-3]) @ (np.eye(4) + 0.2 * rng.normal(size=(k, 4, 4)))
    hats = T @ SE3.exp((L @ rng.normal(size=(N, k, 4, 1)))[..., 0] @ EDGE.B)
    found = ft.intersect_lines(hats, L @ np.swapaxes(L, 1, 2))
    e = found.X - X
    inside(np.einsum("ni,nij,nj->n", e, np.linalg.inv(found.P), e), 3)
    inside(found.chi2, 2 * k - 3)


def test_vertex_of_edges_and_its_report():
    P = np.diag([1e-8, 1e-8, 1e-6, 1e-6])
    edges = [edge(u, 0.05 * np.array(u), P, str(u)) for u in np.eye(3).tolist()]
    off = edge([0, 0, 1.0], np.array([2e-3, 0, 0.05]), P, "off")
    vertex, report = ft.intersect_edges(edges, label="corner")
    assert vertex.kind is VERTEX
    assert vertex.label == "corner"
    np.testing.assert_allclose(vertex.T_world_feature[:3, 3], 0, atol=1e-12)
    assert report.dof == 3
    assert report.chi2 == pytest.approx(0, abs=1e-12)
    assert ft.intersect_edges([*edges[:2], off])[1].worst == "off"
    with pytest.raises(InputError, match="two or more edges"):
        ft.intersect_edges(edges[:1])
    with pytest.raises(DegenerateError, match="parallel"):
        ft.intersect_edges([edges[0], edge([1.0, 1e-3, 0], np.array([0, 0.01, 0]), P)])
    with pytest.raises(DegenerateError, match="parallel"):
        ft.intersect_lines(np.stack([e.T_world_feature for e in [edges[0]] * 2]), np.stack([P, P]))


def test_derived_features_inherit_a_rigid_base_exactly():
    rng = np.random.default_rng(4)
    base = SharedError("base", 1e-6 * np.eye(6))

    def on_base(kind, T, P):
        return Feature(kind, T, P, shared=(SharedTerm(base, kind.B @ SE3.adjoint_inverse(T)),))

    planes = [on_base(PLANE, SE3.exp(rng.normal(size=6)), np.diag([1e-8, 1e-6, 1e-6])) for _ in range(2)]
    edges = [on_base(EDGE, SE3.exp(rng.normal(size=6)), np.diag([1e-8, 1e-8, 1e-6, 1e-6])) for _ in range(3)]
    for kind, found in ((EDGE, ft.edge_from_planes(*planes)), (VERTEX, ft.intersect_edges(edges)[0])):
        exact = kind.B @ SE3.adjoint_inverse(found.T_world_feature)
        np.testing.assert_allclose(found.shared[0].jacobian, exact, atol=1e-9)
    one_only = ft.edge_from_planes(planes[0], Feature(PLANE, planes[1].T_world_feature, planes[1].P))
    _, K1, _ = ft.intersect_planes(*(p.T_world_feature for p in planes), one_only.T_world_feature[:3, 3])
    np.testing.assert_allclose(one_only.shared[0].jacobian, K1 @ planes[0].shared[0].jacobian, atol=1e-9)


def test_edge_of_two_planes_follows_its_covariance():
    rng = np.random.default_rng(5)
    T1, T2 = SE3.exp(rng.normal(size=(2, 6)))
    near = np.array([0.05, 0.02, 0.1])
    line, _, _ = ft.intersect_planes(T1, T2, near)
    sd = np.array([1e-4, 5e-4, 5e-4])
    for T in (T1, T2):  # both contain the line
        np.testing.assert_allclose(T[:3, 2] @ line[:3, 0], 0, atol=1e-12)
        np.testing.assert_allclose(T[:3, 2] @ (line[:3, 3] - T[:3, 3]), 0, atol=1e-12)
    np.testing.assert_allclose(line[:3, 0] @ (near - line[:3, 3]), 0, atol=1e-12)
    hats = [T @ SE3.exp((rng.normal(size=(N, 3)) * sd) @ PLANE.B) for T in (T1, T2)]
    found, K1, K2 = ft.intersect_planes(*hats, near)
    P = (K1 * sd**2) @ np.swapaxes(K1, 1, 2) + (K2 * sd**2) @ np.swapaxes(K2, 1, 2)
    gap = SE3.inverse(found) @ line
    slope = gap[:, 1:3, 0] / gap[:, :1, 0]
    lateral = gap[:, 1:3, 3] - gap[:, :1, 3] * slope
    p = np.concatenate([lateral, -slope[:, 1:], slope[:, :1]], axis=1)
    inside(np.einsum("ni,nij,nj->n", p, np.linalg.inv(P), p), 4)


@pytest.mark.parametrize("turn", [0.0, np.pi, 1e-3])
def test_planes_that_do_not_meet_have_no_edge(turn):
    P = np.diag([1e-8, 1e-6, 1e-6])
    a, b = (
        Feature(PLANE, np.eye(4), P, "a"),
        Feature(PLANE, SE3.from_parts(SO3.axis_rotation(0, turn), np.ones(3)), P, "b"),
    )
    with pytest.raises(DegenerateError, match="parallel"):
        ft.edge_from_planes(a, b)
    with pytest.raises(InputError, match="two planes"):
        ft.edge_from_planes(a, edge([1, 0, 0], np.zeros(3), np.eye(4)))


def test_the_papers_plane_and_edge_have_their_closed_forms():
    sd, L1, L2 = 3e-4, 0.04, 0.02
    q = np.array([[0, 0, 0], [L1, 0, 0], [0, 0, 0], [0, L2, 0]])
    corner = np.eye(12)
    corner[0:3, 6:9] = corner[6:9, 0:3] = np.eye(3)  # q3 is q1
    plane = ft.plane_from_two_directions(*q, sd**2 * corner, outward=[0, 0, 1])
    T = plane.T_world_feature
    normal = ft.spread.plane_normal_covariance(T, plane.P)
    np.testing.assert_allclose(T[:3, 2], [0, 0, 1])
    np.testing.assert_allclose(np.diag(normal)[:3], [2 * sd**2 / L1**2, 2 * sd**2 / L2**2, 0], atol=1e-18)
    np.testing.assert_allclose(normal[0, 1], sd**2 / (L1 * L2))
    np.testing.assert_allclose(normal[3], [sd**2 / L1, sd**2 / L2, 0, sd**2], atol=1e-18)
    edge = ft.edge_from_two_points(q[0], q[1], sd**2 * np.eye(6))
    np.testing.assert_allclose(np.diag(edge.P), [sd**2, sd**2, 2 * sd**2 / L1**2, 2 * sd**2 / L1**2])
    np.testing.assert_allclose(edge.P[0, 3], -(sd**2) / L1)
    with pytest.raises(DegenerateError, match="parallel"):
        ft.plane_from_two_directions(q[0], q[1], q[0], 2 * q[1], np.eye(12), outward=[0, 0, 1])
    with pytest.raises(DegenerateError, match="same point"):
        ft.edge_from_two_points(q[1], q[1], np.eye(6))
    with pytest.raises(InputError, match="expected shape"):
        ft.edge_from_two_points(q[0], q[1], np.eye(5))


def test_two_points_agree_with_the_general_fit():
    rng = np.random.default_rng(6)
    q, C = rng.normal(size=(2, 3)), 1e-8 * np.eye(6)
    two = ft.edge_from_two_points(*q, C)
    fit, report = ft.fit_edge(q, np.stack([C[:3, :3]] * 2))
    np.testing.assert_allclose(fit.T_world_feature[:3, 0], two.T_world_feature[:3, 0], atol=1e-12)
    slid = SE3.inverse(fit.T_world_feature) @ two.T_world_feature
    A = EDGE.B @ SE3.adjoint_inverse(slid) @ EDGE.B.T
    np.testing.assert_allclose(A @ fit.P @ A.T, two.P, rtol=1e-9, atol=1e-16)
    assert (report.dof, report.p_value) == (0, 1.0)


def test_the_general_fit_beats_the_papers_plane():
    """Two scan lines of 20 points: the largest corner sd of the patch, end points only against all points."""
    m, sd = 20, 3e-4
    t = np.linspace(0, 0.04, m)
    scan = np.r_[np.c_[t, 0 * t, 0 * t], np.c_[0 * t[1:], t[1:], 0 * t[1:]]]
    full, _ = ft.fit_plane(scan, np.broadcast_to(sd**2 * np.eye(3), (len(scan), 3, 3)), outward=[0, 0, 1])
    q = np.array([[0, 0, 0], [0.04, 0, 0], [0, 0, 0], [0, 0.04, 0]])
    C = np.eye(12)
    C[0:3, 6:9] = C[6:9, 0:3] = np.eye(3)
    ends = ft.plane_from_two_directions(*q, sd**2 * C, outward=[0, 0, 1])
    corners = np.array([[0, 0, 0], [0.04, 0, 0], [0, 0.04, 0], [0.04, 0.04, 0]])
    worst = [
        np.sqrt(np.diag(ft.spread.plane_displacement_covariance(f.T_world_feature, f.P, corners)).max())
        for f in (ends, full)
    ]
    assert worst[0] / worst[1] > 2
