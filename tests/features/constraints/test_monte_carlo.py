"""Every covariance against simulation: NEES inside its chi-square interval, gates of the size they claim."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

import tanteo.features as cs
from tanteo.features.kinds import EDGE, PLANE, VERTEX
from tanteo.geometry import SE3, SO3

N = 20_000
FREE_PAIRS = {
    "angle_edges": (cs.angle_edges, EDGE, EDGE),
    "angle_planes": (cs.angle_planes, PLANE, PLANE),
    "angle_edge_plane": (cs.constraints.angle.angle_edge_plane, PLANE, EDGE),
    "intersect": (cs.intersect, EDGE, EDGE),
    "gap_edges": (cs.gap_edges, EDGE, EDGE),
    "point_plane_distance": (cs.constraints.point.point_plane_distance, PLANE, VERTEX),
    "point_edge_distance": (cs.constraints.point.point_edge_distance, EDGE, VERTEX),
}


def spread(kind, rng, scale):
    A = rng.normal(size=(kind.size, kind.size + 3)) * np.where(np.array(kind.rows) < 3, 0.1, 1.0)[:, None]
    return scale * A


def draw(T, factor, kind, noise):
    """Estimates whose true frame is ``T``: ``T = T_hat exp(B' p)``."""
    return T @ SE3.exp(-(noise @ factor.T) @ kind.B)


def inside(nees, dof):
    """Check that the mean of N values of chi-square with ``dof`` degrees of freedom is in its 99.9 % interval."""
    low, high = special.chdtri(dof * N, [0.9995, 0.0005]) / N
    assert low < np.mean(nees) < high, f"{np.mean(nees):.4f} outside {low:.4f}..{high:.4f}"


@pytest.mark.parametrize("correlated", [False, True])
@pytest.mark.parametrize("name", FREE_PAIRS)
def test_scalar_constraints_follow_their_variance(name, correlated):
    function, first, second = FREE_PAIRS[name]
    rng = np.random.default_rng(sum(map(ord, name)) + correlated)
    T = SE3.exp(np.c_[0.05 * rng.normal(size=(2, 3)), rng.normal(size=(2, 3))])
    L1, L2 = spread(first, rng, 2e-4), spread(second, rng, 2e-4)
    z1 = rng.normal(size=(N, L1.shape[1]))
    z2 = rng.normal(size=(N, L2.shape[1]))
    shared = min(L1.shape[1], L2.shape[1]) if correlated else 0
    z2[:, :shared] = z1[:, :shared]
    C12 = first.B.T @ L1[:, :shared] @ L2[:, :shared].T @ second.B if correlated else None
    C1, C2 = (k.B.T @ L @ L.T @ k.B for k, L in ((first, L1), (second, L2)))
    truth = function(T[0], C1, T[1], C2).value
    found = function(draw(T[0], L1, first, z1), C1, draw(T[1], L2, second, z2), C2, C12)
    inside((found.value - truth) ** 2 / found.variance, 1)


def on_plane(rng):
    T = SE3.exp(rng.normal(size=6) * 0.3)
    spun = SE3.exp(np.array([0.02, 0, 0, 0, 0, 0])) @ SE3.exp(np.array([0, 0, 0, 0, 0, 0.7]))
    return T, T @ spun @ SE3.exp(np.array([0, 0, 0, 0.9, 0, 0]))


def parallel(rng, offset):
    T = SE3.exp(rng.normal(size=6) * 0.3)
    return T, T @ SE3.from_parts(SO3.axis_rotation(0, 0.0), np.asarray(offset))


CONDITIONS = {
    "coplanarity": (cs.coplanarity, PLANE, EDGE, on_plane, 2),
    "collinearity": (cs.collinearity, EDGE, EDGE, lambda rng: parallel(rng, [0.05, 0, 0]), 4),
    "parallel_edges": (
        lambda *a: tilt(cs.parallel_edges(*a)), EDGE, EDGE, lambda rng: parallel(rng, [0.01, 0.03, 0.04]), 2,
    ),
    "parallel_planes": (
        lambda *a: tilt(cs.parallel_planes(*a)), PLANE, PLANE, lambda rng: parallel(rng, [0.01, 0.0, 0.04]), 2,
    ),
}  # fmt: skip


def tilt(found):
    return cs.constraints.VectorEstimate(found.tilt, found.tilt_covariance, found.joint.g1, found.joint.g2)


@pytest.mark.parametrize("correlated", [False, True])
@pytest.mark.parametrize("name", CONDITIONS)
def test_joint_conditions_are_chi_square_and_their_gate_has_size(name, correlated):
    function, first, second, truth, dof = CONDITIONS[name]
    rng = np.random.default_rng(sum(map(ord, name)) + correlated)
    T1, T2 = truth(rng)
    L1, L2 = spread(first, rng, 1e-3), spread(second, rng, 1e-3)
    z1, z2 = rng.normal(size=(N, L1.shape[1])), rng.normal(size=(N, L2.shape[1]))
    shared = 3 if correlated else 0
    z2[:, :shared] = z1[:, :shared]
    C12 = first.B.T @ L1[:, :shared] @ L2[:, :shared].T @ second.B
    C1, C2 = (k.B.T @ L @ L.T @ k.B for k, L in ((first, L1), (second, L2)))
    found = function(draw(T1, L1, first, z1), C1, draw(T2, L2, second, z2), C2, C12)
    D2 = cs.chi2_statistic(found.value, found.covariance)
    inside(D2, dof)
    assert 0.045 < np.mean(cs.chi2_limit(0.05, dof) < D2) < 0.055


def test_conditioned_distances_have_true_spread_at_any_origin():
    rng = np.random.default_rng(3)
    for kind, function, offset in (
        (EDGE, cs.parallel_edges, [0, 0.03, 0.04]),
        (PLANE, cs.parallel_planes, [0, 0, 0.05]),
    ):
        sds = []
        for slide in (0.0, 0.06):
            T1, T2 = parallel(rng, np.add(offset, [slide, 0, 0]))
            sd = np.array([3e-4] * (kind.size - 2) + [2e-3] * 2)
            L = np.diag(sd)
            C = kind.B.T @ L @ L @ kind.B
            # both origins to the common abscissa, as relate does (section 13)
            z1, z2 = rng.normal(size=(2, N, kind.size))
            found = function(draw(T1, L, kind, z1), C, draw(T2, L, kind, z2), C)
            inside((found.distance - 0.05) ** 2 / found.variance, 1)
            sds.append(np.sqrt(found.variance.mean()))
            joint = found.joint.value - [0, 0, 0.05]
            inside(cs.chi2_statistic(joint, found.joint.covariance), 3)
        assert sds[1] == pytest.approx(sds[0], rel=0.15)


def test_lengths_with_shared_edges_and_a_shared_robot():
    rng = np.random.default_rng(4)
    directions = [[0.5, 0.9, 0], [1, 0, 0], [-0.5, 0.9, 0]]
    origins = [[0.01, 0.018, 0], [0.03, 0, 0], [0.05, 0.018, 0]]
    T = np.stack([
        SE3.from_parts(SO3.frame_from_axis(np.array(u), 0), np.array(c))
        for u, c in zip(directions, origins, strict=True)
    ])  # fmt: skip
    truth = cs.edge_length(*T, np.zeros((18, 18))).value
    own = np.diag([3e-5, 3e-5, 5e-4, 5e-4])
    base = np.diag([5e-4] * 3 + [2e-3] * 3)
    A = np.concatenate([EDGE.B.T @ EDGE.B @ SE3.adjoint_inverse(t) for t in T]) @ base
    C = np.kron(np.eye(3), EDGE.B.T @ own @ own @ EDGE.B) + A @ A.T
    c = rng.normal(size=(N, 6)) @ base
    hats = [SE3.exp(-c) @ draw(t, own, EDGE, rng.normal(size=(N, 4))) for t in T]
    found = cs.edge_length(*hats, C)
    inside((found.value - truth) ** 2 / found.variance, 1)
    # as independent edges, the same errors would be taken for four times the variance and more
    alone = C * np.kron(np.eye(3), np.ones((6, 6)))
    assert np.mean((found.value - truth) ** 2 / cs.edge_length(*hats, alone).variance) < 0.25


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.15, np.pi - 0.2])
def test_second_order_biases(turn):
    rng = np.random.default_rng(5)
    T1, T2 = np.eye(4), SE3.from_parts(SO3.axis_rotation(2, turn), np.zeros(3))
    sd = np.diag([0, 0, 0.03, 0.03])
    C = EDGE.B.T @ sd @ sd @ EDGE.B
    n = 200_000
    z1, z2 = rng.normal(size=(2, n, 4))
    value = cs.angle_edges(draw(T1, sd, EDGE, z1), C, draw(T2, sd, EDGE, z2), C).value
    predicted = cs.constraints.angle.angle_bias(cs.relative(T1, T2), 0, (C, C, None))
    assert np.mean(value) - turn == pytest.approx(predicted, rel=0.1)
    # errors that both edges have in common, as of one robot: those of the second are 0.8 of the first's, and its own
    C12 = 0.8 * C
    common = 0.8 * z1 + 0.6 * z2
    value = cs.angle_edges(draw(T1, sd, EDGE, z1), C, draw(T2, sd, EDGE, common), C, C12).value
    predicted = cs.constraints.angle.angle_bias(cs.relative(T1, T2), 0, (C, C, C12))
    assert np.mean(value) - turn == pytest.approx(predicted, rel=0.1)
    p = rng.normal(size=(n, 3)) * 0.1 + [1.0, 0, 0]
    found = cs.constraints.point.point_distance(np.zeros(3), np.array([1.0, 0, 0]), 0.01 * np.eye(3))
    assert np.mean(np.linalg.norm(p, axis=1)) - 1 == pytest.approx(found.bias, rel=0.1)


def test_gates_of_one_number_have_the_size_they_claim():
    value = np.random.default_rng(6).normal(size=N)
    assert 0.045 < np.mean(~cs.gate(value, 1.0, 0.0, 0.05).accept) < 0.055
