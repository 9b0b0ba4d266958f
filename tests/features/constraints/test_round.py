"""Constraints of axes, centres, sizes and patterns: simulation, differences, shared errors, what is absent and why."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

import tanteo.features as cs
import tanteo.fitting as ft
from round_scenes import constraint_nees, related_scene, spread_of
from tanteo.errors import InputError
from tanteo.features import Feature, Round, SharedError, SharedTerm
from tanteo.features.kinds import CIRCLE, CONE, CYLINDER, KINDS, PLANE, SPHERE
from tanteo.features.reframing import reframe_feature
from tanteo.geometry import SE3, SO3

TRIALS = 400


@pytest.fixture(scope="module")
def simulated():
    return constraint_nees(TRIALS, 5)


@pytest.mark.slow
def test_round_constraints_follow_their_covariance(simulated):
    found, dof = simulated
    assert {kind for kind, _ in found} >= {
        "axis_angle", "axis_distance", "axis_gap", "axis_parallelism", "axis_perpendicularity", "axis_plane_angle",
        "axis_plane_distance", "centre_axis_distance", "centre_distance", "centre_edge_distance", "centre_on_axis",
        "centre_plane_height", "centre_vertex_distance", "coaxiality", "concentricity", "edge_axis_distance",
        "vertex_axis_distance",
    }  # fmt: skip
    for key, values in found.items():
        low, high = special.chdtri(dof[key] * TRIALS, [0.99995, 0.00005]) / TRIALS
        assert low < values.mean() < high, key


@pytest.mark.slow
def test_gates_of_round_constraints_have_the_size_they_claim(simulated):
    found, dof = simulated
    rejected = [np.mean(values > special.chdtri(dof[key], 0.05)) for key, values in found.items()]
    assert 0.045 < np.mean(rejected) < 0.055


def features(scale=1e-5):
    rng = np.random.default_rng(2)
    out = []
    for name, (kind, T) in related_scene().items():
        L = spread_of(kind, rng, scale)
        out.append(Feature(KINDS[kind], T, L @ L.T, label=name))
    return out


def test_covariances_match_differences():
    """Values of features moved a little, against the first-order covariance that the table states."""
    alone = features()
    table = {(c.kind.name, c.labels): c for c in cs.relate_all(alone)}
    total = {key: np.zeros_like(c.covariance) for key, c in table.items()}
    h = 1e-6
    for k, feature in enumerate(alone):
        L, slopes = np.linalg.cholesky(feature.P), []
        for row in feature.kind.B:
            at = [
                {(c.kind.name, c.labels): c.value for c in cs.relate_all([
                    Feature(f.kind, f.T_world_feature @ SE3.exp(s * h * row) if i == k else f.T_world_feature, f.P,
                            label=f.label) for i, f in enumerate(alone)
                ])} for s in (1, -1)
            ]  # fmt: skip
            slopes.append({key: (at[0][key] - at[1][key]) / (2 * h) for key in table if key in at[0] and key in at[1]})
        for key in table:
            if all(key in slope for slope in slopes):
                J = np.stack([slope[key] for slope in slopes], axis=-1) @ L
                total[key] += J @ J.T
    names = {"axis_angle", "axis_distance", "axis_gap", "axis_perpendicularity", "axis_plane_angle", "coaxiality"}
    names |= {"centre_axis_distance", "centre_distance", "centre_edge_distance", "centre_plane_height", "concentricity"}
    compared = 0
    for key, found in table.items():
        holds = not found.kind.null or np.abs(found.value).max() < 1e-9
        if key[0] in names and holds and not found.caution:
            np.testing.assert_allclose(total[key], found.covariance, rtol=2e-3, atol=1e-16, err_msg=str(key))
            compared += 1
    assert compared > 50


@pytest.mark.parametrize(
    ("kinds", "tilt"),
    [
        ({"axis_angle"}, 1.0),
        ({"axis_distance", "centre_distance", "centre_axis_distance", "centre_edge_distance"}, 1e-3),
    ],
    ids=["angles", "distances"],
)
def test_biases_match_second_differences(kinds, tilt):
    """The mean error of a value is half the sum of its second differences along the principal errors of each feature.

    Distances state that of displacements, so there tilts are small. One axis is reversed: its angles are obtuse.
    """
    alone = []
    for f in features():
        size = np.where(np.array(f.kind.rows) < 3, 1.0, tilt)
        T = f.T_world_feature @ SE3.exp([0, 0, 0, np.pi, 0, 0]) if f.label == "slanted bore" else f.T_world_feature
        alone.append(Feature(f.kind, T, np.outer(size, size) * f.P, label=f.label))
    table = {(c.kind.name, c.labels): c for c in cs.relate_all(alone) if c.kind.name in kinds and not c.caution}
    total = dict.fromkeys(table, 0.0)
    for k, feature in enumerate(alone):
        for error in np.linalg.cholesky(feature.P).T:
            for step in (10.0, -10.0):
                T = feature.T_world_feature @ SE3.exp(step * error @ feature.kind.B)
                moved = [*alone[:k], Feature(feature.kind, T, feature.P, label=feature.label), *alone[k + 1 :]]
                for c in cs.relate_all(moved):
                    key = (c.kind.name, c.labels)
                    if key in total:
                        total[key] += float((c.value - table[key].value)[0]) / (2 * step**2)
    for key, found in table.items():
        np.testing.assert_allclose(found.bias[0], total[key], rtol=0.02, atol=1e-12, err_msg=str(key))
    assert {name for name, _ in table} == kinds


def test_an_error_of_the_base_cancels_between_round_features():
    base = SharedError("base", np.diag([1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-4]))
    alone = features()
    together = [
        Feature(f.kind, f.T_world_feature, f.P, f.label,
                (SharedTerm(base, f.kind.B @ SE3.adjoint_inverse(f.T_world_feature)),)) for f in alone
    ]  # fmt: skip
    pairs = zip(cs.relate_all(alone), cs.relate_all(together), strict=True)
    names = ("axis_angle", "centre_distance", "axis_distance", "centre_plane_height", "coaxiality", "concentricity")
    compared = [(one, other) for one, other in pairs if one.kind.name in names and one.kind.name[:1] != "_"]
    for one, other in compared:
        if one.kind.null and one.distance2() > 100:
            continue  # such a pair does not hold, and its tilts depend on where frames are
        np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-5, atol=1e-12, err_msg=one.kind.name)
    assert len(compared) > 15


def test_origin_and_direction_of_an_axis_do_not_matter():
    alone = features()
    rng, moved = np.random.default_rng(3), []
    for f in alone:
        xi = np.zeros(6)
        if f.kind is CYLINDER:
            xi[2] = 0.01 * rng.normal()
        turned = reframe_feature(f, SE3.exp(xi))
        if f.kind in (CYLINDER, CIRCLE):
            turned = reframe_feature(turned, f.kind.symmetries[1])
        moved.append(turned)
    one, other = cs.relate_all(alone), cs.relate_all(moved)
    for name in ("axis_angle", "axis_gap", "axis_distance", "centre_axis_distance", "axis_plane_angle"):
        a, b = one.column(name), other.column(name)
        assert np.array_equal(a.present, b.present)
        np.testing.assert_allclose(a.value[a.present], b.value[a.present], atol=1e-9, err_msg=name)
        np.testing.assert_allclose(a.covariance[a.present], b.covariance[a.present], rtol=1e-5, err_msg=name)


def test_a_feature_has_no_constraint_with_itself():
    table = cs.relate_all([Feature(CIRCLE, np.eye(4), 1e-10 * np.eye(5), "a")])
    assert len(table) == 0
    two = cs.relate_all([Feature(k, np.eye(4), 1e-10 * np.eye(5), k.name) for k in (CIRCLE, CONE)])
    assert all(len(set(c.labels)) == 2 for c in two)
    assert "concentricity" in {c.kind.name for c in two}
    absent = {a.kind.name: a.reason for a in two.absent()}
    assert "parallel within 5 sigma" in absent["axis_angle"]
    assert "see coaxiality" in absent["axis_distance"]


def test_sizes_are_constraints_with_all_their_errors():
    tip = SharedError("tip", np.array([[1e-10]]))
    size = Round(5e-3, 4e-10, shared=(np.array([[2.0]]),), convex=False)
    hole = Feature(CIRCLE, np.eye(4), 1e-10 * np.eye(5), "a", (SharedTerm(tip, np.zeros((5, 1))),), size=size)
    found = cs.relate_size(hole)
    assert (found.kind.name, found.dof, found.caution) == ("radius", 1, "")
    np.testing.assert_allclose(found.covariance, [[8e-10]])
    cone = ft.given_round(CONE, [0, 0, 0], 1e-5, axis=[0, 0, 1], axis_sd=1e-3, size=0.4, size_sd=1e-3)
    assert cs.relate_size(cone).kind.name == "half_angle"
    assert "boss or a bore" in cs.relate_size(cone).caution
    with pytest.raises(InputError, match="got a plane without"):
        cs.relate_size(Feature(PLANE, np.eye(4), np.eye(3)))
    assert cs.constraints.CONSTRAINT_KINDS["radius"].units == ("m",)


def pattern(rng, holes, sd, base):
    """Sensed centres of a pattern somewhere, with errors of their own and one of the base."""
    T, left = SE3.exp(rng.normal(size=6)), SE3.exp(-base)
    error = SharedError("base", np.diag([1e-6] * 3 + [1e-6] * 3))
    out = []
    for hole in holes:
        at = SE3.apply(left, SE3.apply(T, hole)) + sd * rng.normal(size=3)
        frame = SE3.from_parts(SO3.exp(rng.normal(size=3)), at)
        term = SharedTerm(error, SPHERE.B @ SE3.adjoint_inverse(frame))
        out.append(Feature(SPHERE, frame, sd**2 * np.eye(3), "h", (term,)))
    return out


PATTERNS = {
    "two": (np.array([[0, 0, 0], [0.05, 0, 0]]), 1),
    "a row": (np.array([[0, 0, 0], [0.05, 0, 0], [0.09, 0, 0]]), 4),
    "flange": (0.03 * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1.1, 0]]), 6),
    "solid": (0.03 * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0], [1, 1, 0.5]]), 9),
}


@pytest.mark.parametrize("name", PATTERNS)
def test_a_pattern_of_centres_is_chi_square_wherever_it_lies(name):
    holes, dof = PATTERNS[name]
    rng, values = np.random.default_rng(4), []
    for _ in range(100):
        sensed = pattern(rng, holes, 1e-5, 1e-3 * rng.normal(size=6))
        test = cs.relate_pattern(sensed, holes + 0.3)
        assert test.dof == dof
        values.append(test.D2)
    low, high = special.chdtri(dof * 100, [0.9995, 0.0005]) / 100
    assert low < np.mean(values) < high


def test_another_pattern_and_a_mirror_image_are_rejected():
    holes, _ = PATTERNS["solid"]
    sensed = pattern(np.random.default_rng(5), holes, 1e-5, np.zeros(6))
    assert cs.relate_pattern(sensed, holes).p_value > 1e-3
    assert cs.relate_pattern(sensed, holes * [1, 1, -1]).p_value < 1e-6
    assert cs.relate_pattern(sensed, holes * 1.01).p_value < 1e-6
    with pytest.raises(InputError, match="as many finite points"):
        cs.relate_pattern(sensed, holes[:3])
    with pytest.raises(InputError, match="got a cylinder"):
        cs.relate_pattern([*sensed[:4], Feature(CYLINDER, np.eye(4), np.eye(4))], holes)
