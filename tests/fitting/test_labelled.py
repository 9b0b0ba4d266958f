"""From measurements with labels to features: wrong readings, unknown sides, single points with normals."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.features import feature_covariance
from tanteo.fitting import fit_labelled
from tanteo.geometry import SE3, SO3
from tanteo.io import read_rig
from tanteo.sensors import Readings, measure

SD = 1e-4


def plane_points(n, rng, T=None, sd=SD, span=0.05):
    local = np.column_stack([rng.uniform(-span, span, (n, 2)), sd * rng.normal(size=n)])
    return SE3.apply(np.eye(4) if T is None else T, local)


def fit(points, labels=None, tolerance=0.0, sd=SD, robot=None, **columns):
    labels = ("top",) * len(points) if labels is None else labels
    readings = Readings.from_columns(points, features=labels, **columns)
    return fit_labelled(measure(readings, sd=sd, robot=robot), tolerance)


def down(n):
    return np.tile([0.0, 0.0, -1.0], (n, 1))


def test_each_label_becomes_one_feature_with_its_readings():
    rng = np.random.default_rng(1)
    points = np.concatenate([plane_points(5, rng), plane_points(4, rng) + np.array([0, 0, 0.03])])
    found = fit(points, ("a",) * 5 + ("b",) * 4, directions=down(9))
    assert [f.label for f in found.features] == ["a", "b"]
    assert found.features[1].readings == ("6", "7", "8", "9")
    assert not len(found.unlabelled)
    assert found.notes == ()
    assert found.features[0].T_world_feature[2, 2] > 0.99  # outward: against the direction of approach


def test_a_wrong_reading_is_dropped_and_named_with_its_distance():
    rng = np.random.default_rng(2)
    points = plane_points(8, rng)
    points[3, 2] += 2e-3
    found = fit(points, directions=down(8))
    assert found.rejected == ("4",)
    assert found.rejected_by[0] == pytest.approx(2e-3, rel=0.2)
    assert "4" not in found.features[0].readings


def of_another_face(n):
    """Return ``n`` readings of a face from above, the last one of the opposite face, and their beams."""
    rng = np.random.default_rng(5)
    points, beams = plane_points(n, rng, span=0.02), down(n)
    points[-1], beams[-1] = (0.01, 0.0, -0.05), (0.0, 0.0, 1.0)
    return points, beams


@pytest.mark.parametrize("column", ["directions", "normals"])
def test_a_reading_of_another_side_is_excluded_by_name(column):
    points, beams = of_another_face(4)
    extra = {"normal_sds": np.full(4, 0.05)} if column == "normals" else {}
    found = fit(points, **{column: -beams if column == "normals" else beams}, **extra)
    assert found.rejected == ("4",)
    assert found.rejected_by[0] == pytest.approx(0.05, rel=0.1)
    assert found.features[0].readings == ("1", "2", "3")


def test_a_label_of_unlike_sides_is_left_out_beside_others():
    points, beams = of_another_face(3)
    others = plane_points(5, np.random.default_rng(6)) + np.array([0, 0, 0.03])
    found = fit(np.concatenate([points, others]), ("a",) * 3 + ("b",) * 5, directions=np.concatenate([beams, down(5)]))
    assert [f.label for f in found.features] == ["b"]
    assert "'a' was excluded" in found.notes[0]
    with pytest.raises(InputError, match="which side is outside"):
        fit(points, ("a",) * 3, directions=beams)


def test_a_clean_group_loses_no_reading():
    lost = sum(bool(fit(plane_points(8, np.random.default_rng(s)), directions=down(8)).rejected) for s in range(200))
    assert lost <= 3  # one in a thousand each


def test_general_scatter_widens_covariance_and_is_reported():
    rng = np.random.default_rng(3)
    wide = fit(plane_points(12, rng, sd=5 * SD), directions=down(12))
    fair = fit(plane_points(12, np.random.default_rng(3), sd=5 * SD), directions=down(12), sd=5 * SD)
    assert wide.rejected == ()
    assert "scatter" in wide.notes[0]
    ratio = np.sqrt(wide.features[0].P[0, 0] / fair.features[0].P[0, 0])
    assert 0.5 < ratio < 2.0


def test_scatter_names_the_reading_that_is_farthest_off():
    points = plane_points(12, np.random.default_rng(3), sd=5 * SD)
    note = fit(points, directions=down(12)).notes[0]
    centred = points - points.mean(axis=0)
    off = np.abs(centred @ np.linalg.svd(centred)[2][2])
    assert f"check reading {np.argmax(off) + 1}, " in note


def test_tolerance_adds_the_form_of_the_surface_to_every_point():
    points = plane_points(10, np.random.default_rng(4))
    plain, made = (fit(points, directions=down(10), tolerance=t).features[0].P[0, 0] for t in (0.0, 3 * SD))
    assert made == pytest.approx(10 * plain, rel=1e-6)


def test_an_unknown_side_gives_both_with_the_ball_on_either():
    rng = np.random.default_rng(5)
    found = fit(plane_points(6, rng), radii=np.full(6, 2e-3))
    one, other = found.features[0]
    assert one.T_world_feature[:3, 2] @ other.T_world_feature[:3, 2] == pytest.approx(-1.0)
    assert abs(one.T_world_feature[2, 3] - other.T_world_feature[2, 3]) == pytest.approx(4e-3, rel=0.05)
    assert one.tip_radius == other.tip_radius == 2e-3


def test_a_point_with_its_normal_is_a_small_plane():
    found = fit(np.zeros((1, 3)), ("",), normals=np.array([[0, 0, 1.0]]), normal_sds=np.array([0.05]))
    (plane,) = found.features
    np.testing.assert_allclose(np.sqrt(np.diag(plane.P)), [SD, 0.05, 0.05])
    with pytest.raises(InputError, match="normal_sd_deg"):
        fit(np.zeros((1, 3)), ("",), normals=np.array([[0, 0, 1.0]]))


@pytest.mark.parametrize("single", [False, True])
def test_the_robots_error_moves_a_plane_as_a_rigid_world_would(single):
    """Covariance of the plane under a base error alone is B Ad(T^-1) C Ad(T^-1)' B'."""
    rng = np.random.default_rng(6)
    if single:
        columns = {"normals": np.array([[0, 0, 1.0]]), "normal_sds": np.array([0.05])}
        found = fit(np.array([[0.3, 0.1, 0.2]]), ("",), robot="generic_6axis_uncalibrated", **columns)
    else:
        found = fit(
            plane_points(8, rng) + np.array([0.3, 0.1, 0.2]), directions=down(8), robot="generic_6axis_uncalibrated"
        )
    (plane,) = found.features
    (term,) = [t for t in plane.shared if len(t.error.covariance) == 6]
    jacobian = plane.kind.B @ SE3.adjoint_inverse(plane.T_world_feature)
    np.testing.assert_allclose(term.jacobian, jacobian, atol=1e-9)
    assert feature_covariance(plane)[2, 2] > plane.P[0, 0]


def test_points_without_label_or_normal_are_bare():
    rng = np.random.default_rng(7)
    found = fit(plane_points(7, rng), ("a",) * 4 + ("",) * 3, directions=down(7))
    assert found.unlabelled.tolist() == [4, 5, 6]
    assert len(found.features) == 1


def test_points_in_a_row_are_left_out_with_what_to_add():
    points = np.column_stack([np.linspace(0, 0.1, 5), np.zeros(5), np.zeros(5)])
    found = fit(points, directions=down(5))
    assert found.features == ()
    assert "Add a point" in found.notes[0]


def test_a_ball_on_an_edge_and_mixed_tips_are_refused():
    line = np.column_stack([np.linspace(0, 0.1, 4), np.zeros(4), np.zeros(4)])
    with pytest.raises(InputError, match="contact on an edge is unknown"):
        fit(line, kinds=("edge",) * 4, radii=np.full(4, 1e-3))
    rng = np.random.default_rng(8)
    with pytest.raises(InputError, match="one tip radius"):
        fit(plane_points(4, rng), directions=down(4), radii=np.array([1, 1, 2, 2]) * 1e-3)


def test_edges_and_vertices_by_their_kind():
    line = np.column_stack([np.linspace(0, 0.1, 4), np.zeros(4), np.zeros(4)])
    found = fit(line, kinds=("edge",) * 4)
    assert found.features[0].kind.name == "edge"
    found = fit(line[:1], ("tip",), kinds=("vertex",))
    assert found.features[0].kind.name == "vertex"


def test_a_tip_error_with_turning_hand_is_not_taken_for_scatter():
    """A tip off its stated place and a hand that rotates between touches are part of the stated errors: no
    rejection."""
    tip_sd, wrong = np.array([1.5e-3, 1.5e-3, 0.3e-3]), 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        R = SO3.exp(np.array([np.pi, 0, 0])) @ SO3.exp(rng.normal(size=(5, 3)) * [0.1, 0.1, 1.0])
        believed = plane_points(5, rng, span=0.03) - R @ (tip_sd * rng.normal(size=3))
        hands = SE3.from_parts(R, believed)
        readings = Readings.from_columns(believed, directions=down(5), features=("a",) * 5, Ts_world_hand=hands)
        found = fit_labelled(measure(readings, sd=SD, tip_sd=tip_sd))
        wrong += bool(found.notes or found.rejected)
    assert wrong <= 3


def test_a_feature_shares_no_error_with_other_sensors():
    """Alone or in a record with another sensor's readings, an edge has the same shared errors."""
    rig = read_rig("paper-gripper")
    x = np.arange(8) * 0.01
    T = np.tile(SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.zeros(3)), (8, 1, 1))
    T[:, 0, 3] = np.where(x < 0.04, x, -x)
    both = Readings.from_columns(
        ids=[str(k) for k in range(8)],
        ranges=np.full(8, 0.02),
        sensors=["front_left"] * 4 + ["front_right"] * 4,
        Ts_world_hand=T,
        features=["left"] * 4 + ["right"] * 4,
        kinds=["edge"] * 8,
        source="test",
    )
    alone = fit_labelled(measure(both.take(np.arange(4)), rig=rig)).features[0]
    joint = fit_labelled(measure(both, rig=rig)).features[0]
    assert [t.error.name for t in joint.shared] == [t.error.name for t in alone.shared]
    assert alone.shared
