"""Constraints of features: what the table holds equals the cores; shared errors; degenerate sets; model features."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tanteo.features as cs
from tanteo.errors import InputError
from tanteo.features import Feature, SharedError, SharedTerm, cross_covariance, feature_covariance
from tanteo.features.kinds import CIRCLE, EDGE, PLANE, VERTEX
from tanteo.features.reframing import flip_edge, reframe_feature
from tanteo.geometry import SE3, SO3

KINDS = (PLANE, EDGE, VERTEX, EDGE, PLANE, VERTEX)


def features(rng, kinds=KINDS, shared=True, scale=1e-4):
    base = SharedError("base", np.diag([1e-3] * 3 + [2e-3] * 3) ** 2)
    tip = SharedError("tip", 1e-6 * np.eye(3))
    out = []
    for k, kind in enumerate(kinds):
        T = SE3.exp(np.r_[0.1 * rng.normal(size=3), rng.normal(size=3)])
        A = scale * rng.normal(size=(kind.size, kind.size + 2))
        terms = (SharedTerm(base, kind.B @ SE3.adjoint_inverse(T)), SharedTerm(tip, rng.normal(size=(kind.size, 3))))
        out.append(Feature(kind, T, A @ A.T, label=f"f{k}", shared=terms[: 2 * shared]))
    return out


CORES = {
    "plane_angle": cs.angle_planes,
    "edge_gap": cs.gap_edges,
    "point_plane_height": cs.constraints.point.point_plane_distance,
    "point_edge_distance": cs.constraints.point.point_edge_distance,
    "edge_plane_coplanarity": cs.coplanarity,
}


@pytest.mark.parametrize("shared", [False, True])
def test_the_table_has_the_values_of_the_cores(shared):
    fs = features(np.random.default_rng(1), shared=shared)
    named = {f.label: f for f in fs}
    table = cs.relate_all(fs)
    seen = set()
    for found in table:
        first, second = (named[label] for label in found.labels)
        pair = (first.T_world_feature, feature_covariance(first), second.T_world_feature, feature_covariance(second))
        cross = cross_covariance(first, second)
        name = found.kind.name
        if name in CORES:
            core = CORES[name](*pair, cross)
            np.testing.assert_allclose(found.value, np.atleast_1d(core.value), rtol=1e-9, atol=1e-14)
            if name == "plane_angle":
                pair_frames = cs.relative(pair[0], pair[2])
                bias = cs.constraints.angle.angle_bias(pair_frames, 2, (pair[1], pair[3], cross))
                np.testing.assert_allclose(found.bias, [bias], rtol=1e-7)
            variance = core.covariance if hasattr(core, "covariance") else core.variance
            np.testing.assert_allclose(found.covariance, np.reshape(variance, (found.dof, -1)), rtol=1e-7)
        elif name == "edge_angle":
            core = cs.angle_edges(*pair, cross)
            assert min(abs(found.value[0] - core.value), abs(np.pi - found.value[0] - core.value)) < 1e-12
            np.testing.assert_allclose(found.covariance[0, 0], core.variance, rtol=1e-8)
            bias = cs.constraints.angle.angle_bias(cs.relative(pair[0], pair[2]), 0, (pair[1], pair[3], cross))
            np.testing.assert_allclose(abs(found.bias[0]), abs(bias), rtol=1e-7)
            assert np.sign(found.bias[0]) == np.sign(bias) * (1 if abs(found.value[0] - core.value) < 1e-12 else -1)
        elif name == "point_distance":
            S = pair[1][:3, :3], pair[3][:3, :3], cross[:3, :3]
            R1, R2 = pair[0][:3, :3], pair[2][:3, :3]
            X = R1 @ S[2] @ R2.T
            core = cs.constraints.point.point_distance(
                pair[0][:3, 3], pair[2][:3, 3], R1 @ S[0] @ R1.T + R2 @ S[1] @ R2.T - X - X.T
            )
            np.testing.assert_allclose([found.value[0], found.bias[0]], [core.value, core.bias], rtol=1e-7)
            np.testing.assert_allclose(found.covariance[0, 0], core.variance, rtol=1e-7)
        seen.add(name)
    assert seen >= {*CORES, "edge_angle", "point_distance", "edge_plane_angle", "edge_parallelism"}


def on_a_base(alone):
    """Return the same features, moved together by a common error of a metre and ten milliradians."""
    base = SharedError("base", np.diag([1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-4]))
    return [replace(f, shared=(SharedTerm(base, f.kind.B @ SE3.adjoint_inverse(f.T_world_feature)),)) for f in alone]


def test_a_rigid_error_of_robot_base_cancels_in_every_constraint():
    alone = features(np.random.default_rng(2), shared=False)
    compared = 0
    for one, other in zip(cs.relate_all(alone), cs.relate_all(on_a_base(alone)), strict=True):
        if not one.kind.null or one.kind.name == "edge_gap":
            np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-6, err_msg=one.kind.name)
            compared += 1
    assert compared > 10


def test_base_error_cancels_in_conditions_that_hold():
    """Tilts and heights depend on where frames are if the pair is neither parallel nor coplanar, so only here."""
    flat = Feature(EDGE, SE3.from_parts(SO3.axis_rotation(2, 0.3), np.array([0.1, 0.2, 0.0])), 1e-8 * np.eye(4), "e")
    pairs = [parallel_pair(k, [0.1, 0.03, 0.04]) for k in (PLANE, EDGE)]
    for alone in (*pairs, parallel_pair(EDGE, [0.1, 0, 0]), (parallel_pair(PLANE, [0, 0, 0])[0], flat)):
        for one, other in zip(cs.relate_all(alone), cs.relate_all(on_a_base(alone)), strict=True):
            np.testing.assert_allclose(other.covariance, one.covariance, atol=1e-12, rtol=1e-6, err_msg=one.kind.name)


def test_order_of_features_and_placement_of_frames_do_not_matter():
    rng = np.random.default_rng(3)
    fs = features(rng)
    slid = []
    for f in fs:
        xi = np.zeros(6)
        free = [i for i in f.kind.free if i < 3]
        xi[free] = 0.02 * rng.normal(size=len(free))
        slid.append(reframe_feature(f, SE3.exp(xi)))
    for kind in ("plane_angle", "edge_gap", "point_plane_height", "edge_plane_angle"):
        a, b = cs.relate_all(fs).column(kind), cs.relate_all(slid[::-1]).column(kind)
        np.testing.assert_allclose(np.sort(np.abs(a.value), axis=0), np.sort(np.abs(b.value), axis=0), rtol=1e-8)
        np.testing.assert_allclose(
            np.sort(a.covariance[:, 0, 0]), np.sort(b.covariance[:, 0, 0]), rtol=1e-6, err_msg=kind
        )


def parallel_pair(kind, offset, turn=0.0, sd=1e-4):
    P = np.diag([sd**2] * (2 if kind is EDGE else 1) + [(10 * sd) ** 2] * 2)
    R = SO3.axis_rotation(2 if kind is EDGE else 0, turn)
    return (
        Feature(kind, np.eye(4), P, "a"),
        Feature(kind, SE3.from_parts(R, np.asarray(offset)), P, "b"),
    )


def names(found):
    return {c.kind.name for c in found}


@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_parallel_pairs_have_a_distance_and_no_angle(turn):
    planes = cs.relate_all(parallel_pair(PLANE, [0.01, 0.0, 0.05], turn))
    assert names(planes) == {"plane_parallelism", "plane_offset"}
    np.testing.assert_allclose(planes.column("plane_offset").value, 0.05, rtol=1e-9)
    assert any("parallel" in a.reason for a in planes.absent())
    edges = cs.relate_all(parallel_pair(EDGE, [0.3, 0.03, 0.04], turn))
    assert names(edges) == {"edge_parallelism", "edge_distance"}
    np.testing.assert_allclose(edges.column("edge_distance").value, 0.05, rtol=1e-9)


def test_coincident_edges_have_a_joint_test_instead_of_distance():
    found = cs.relate_all(parallel_pair(EDGE, [0.02, 1e-5, 0.0]))
    assert names(found) == {"edge_parallelism", "edge_collinearity"}
    (one,) = (c for c in found if c.kind.name == "edge_collinearity")
    assert one.dof == 4
    assert one.p_value() > 0.9
    assert names(cs.relate_all(parallel_pair(PLANE, [0.02, 1e-2, 0.0]))) == {"plane_parallelism", "plane_offset"}


def test_coincident_vertices_have_no_distance():
    P = 1e-8 * np.eye(3)
    assert len(cs.relate_all([Feature(VERTEX, np.eye(4), P), Feature(VERTEX, np.eye(4), P)])) == 0


def test_exactly_known_model_features_of_a_box():
    zero = np.zeros((3, 3))
    faces = []
    for k in range(3):
        for sign in (1.0, -1.0):
            n = sign * np.eye(3)[k]
            faces.append(Feature(PLANE, SE3.from_parts(SO3.frame_from_axis(n, 2), 0.02 * (k + 1) * n), zero))
    table = cs.relate_all(faces)
    offset, angle = table.column("plane_offset"), table.column("plane_angle")
    np.testing.assert_allclose(np.sort(offset.value[offset.present, 0]), [-0.12, -0.08, -0.04], atol=1e-15)
    np.testing.assert_allclose(angle.value[angle.present], np.pi / 2)
    assert offset.present.sum() == 3
    assert angle.present.sum() == 12


def test_edge_directions_point_away_from_the_vertex():
    rng = np.random.default_rng(4)
    corner, u1, u2 = np.array([0.1, 0.2, 0.3]), np.array([1.0, 0, 0]), np.array([np.cos(2.0), np.sin(2.0), 0])
    P = np.diag([1e-8, 1e-8, 1e-6, 1e-6])
    T = [SE3.from_parts(SO3.frame_from_axis(u, 0), corner + 0.05 * u) for u in (u1, u2)]
    for flips in np.ndindex(2, 2):
        edges = [
            Feature(
                EDGE, flip_edge(t) if flip else t, P, support=corner + np.linspace(0.02, 0.08, 4)[:, None] * t[:3, 0]
            )
            for t, flip in zip(T, flips, strict=True)
        ]
        slid = [reframe_feature(e, SE3.exp(np.r_[0.3 * rng.normal(), np.zeros(5)])) for e in edges]
        for both in (edges, slid):
            column = cs.relate_all(both).column("edge_angle")
            np.testing.assert_allclose(column.value, 2.0)
            assert not column.caution.any()
    crossing = [Feature(EDGE, t, P, support=corner + np.linspace(-0.05, 0.06, 4)[:, None] * t[:3, 0]) for t in T]
    (angle,) = (c for c in cs.relate_all(crossing) if c.kind.name == "edge_angle")
    assert "supplement" in angle.caution


def test_length_between_corners_counts_shared_errors_once():
    P = np.diag([1e-8, 1e-8, 1e-6, 1e-6])
    base = SharedError("base", 1e-2 * np.eye(6))

    def edge(u, c, label, shared):
        T = SE3.from_parts(SO3.frame_from_axis(np.array(u), 0), np.array(c))
        terms = (SharedTerm(base, EDGE.B @ SE3.adjoint_inverse(T)),) if shared else ()
        return Feature(EDGE, T, P, label, terms)

    found = []
    for shared in (False, True):
        e = edge([1.0, 0, 0], [0.05, 0, 0], "e", shared)
        a, b = edge([0, 1.0, 0], [0, 0.05, 0], "a", shared), edge([0.5, 1.0, 0], [0.125, 0.05, 0], "b", shared)
        found.append(cs.relate_length(e, a, b))
    np.testing.assert_allclose([f.value[0] for f in found], 0.1)
    np.testing.assert_allclose(found[1].covariance, found[0].covariance, rtol=1e-6)
    T_A, T_E, T_B = a.T_world_feature, e.T_world_feature, b.T_world_feature
    C = np.kron(np.eye(3), EDGE.B.T @ P @ EDGE.B)
    np.testing.assert_allclose(found[0].covariance[0, 0], cs.edge_length(T_A, T_E, T_B, C).variance, rtol=1e-9)
    assert found[0].caution == ""
    assert "parallel" in cs.relate_length(e, a, edge([1.0, 1e-3, 0], [0.1, 0, 0], "c", False)).caution
    with pytest.raises(InputError, match="three edges"):
        cs.relate_length(e, a, Feature(PLANE, np.eye(4), np.eye(3)))


@pytest.mark.parametrize("kinds", [(), (PLANE,), (CIRCLE,)])
def test_too_few_features_have_no_constraints(kinds):
    fs = [Feature(kind, np.eye(4), 1e-8 * np.eye(kind.size)) for kind in kinds]
    table = cs.relate_all(fs)
    assert len(table) == 0
    assert list(table) == []
    with pytest.raises(InputError, match="none"):
        table.column("plane_angle")


def test_relate_is_the_table_of_two():
    fs = features(np.random.default_rng(5))[:2]
    one, all_of_them = cs.relate(*fs), tuple(cs.relate_all(fs))
    assert [c.kind.name for c in one] == [c.kind.name for c in all_of_them]
    assert one[0].labels == ("f0", "f1")
    assert cs.relate(*fs[::-1])[0].labels == ("f0", "f1")  # a plane is named before an edge


def test_a_relation_has_ordered_shapes_and_new_names():
    (relation,) = cs.constraints.PAIR_RELATIONS["plane", "point"]
    with pytest.raises(InputError, match="got point, plane"):
        cs.constraints.register_relation(replace(relation, shapes=("point", "plane")))
    with pytest.raises(InputError, match="'point_plane_height', which is taken"):
        cs.constraints.register_relation(relation)
    assert cs.constraints.PAIR_RELATIONS["plane", "point"] == [relation]


@pytest.mark.parametrize(("meaning", "title"), [("mounting [m, rad] and scale [1]", "mounting and scale"), ("", "tip")])
def test_an_error_is_named_in_answers_without_units(meaning, title):
    assert SharedError("tip", np.eye(7), meaning).title == title
