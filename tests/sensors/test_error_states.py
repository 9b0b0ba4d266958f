"""Errors that readings share as states: derivatives, priors, and the covariance of the pose under them."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

import tanteo
from bare_scenes import beams, box_centred_pose, inside, nees
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare
from tanteo.sensors import Rig, RigSensor, measure
from tanteo.sensors.error_states import (
    ERROR_STATES,
    Backlash,
    Drift,
    FaceOffset,
    Fan,
    Form,
    Lobes,
    Offset,
    OffsetByAxes,
    OffsetByGroup,
    Scale,
    Stock,
    TriggerDrift,
    one_sided,
    stepped_amounts,
)

SD = 1e-4
ALL = (
    Offset(3e-4, common=True), OffsetByAxes(3e-4, "xy"), Backlash(3e-4), Lobes(2e-4), OffsetByGroup(3e-4), Scale(1e-3),
    Drift(3e-4), TriggerDrift(3e-4), Form(3e-4), Stock(3e-3), FaceOffset(3e-4),
)  # fmt: skip


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture(scope="module")
def block():
    size = np.array([0.09, 0.07, 0.05])
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * size
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    triangles = [(a, b, c) for a, b, c, _ in sides] + [(a, c, d) for a, _, c, d in sides]
    return prepare(tanteo.part_from_mesh(corners, triangles, unit="m", name="block"))


def readings_of(rng, n=12):
    directions = rng.normal(size=(n, 3))
    return tanteo.Readings.from_columns(
        points=0.3 * rng.normal(size=(n, 3)), directions=directions, groups=[f"line {k % 3}" for k in range(n)],
        sds=np.full(n, SD),
    )  # fmt: skip


@pytest.mark.parametrize("error", ALL, ids=lambda one: one.name)
def test_points_move_by_the_mean_of_an_error(rng, error):
    readings = readings_of(rng)
    measured = measure(readings, shared_errors=(error,))
    (J,) = measured.jacobians
    mean = np.full(J.shape[2], error.center * error.sd)
    np.testing.assert_allclose(measured.points, readings.points.values + J @ mean, atol=1e-12)
    np.testing.assert_allclose(np.diag(measured.shared[0].covariance), (error.spread * error.sd) ** 2)


def test_every_error_has_a_name_of_its_own():
    assert all(cls.name == name for name, cls in ERROR_STATES.items())
    assert {type(one).name for one in ALL} | {"fan"} == set(ERROR_STATES)


def test_an_offset_acts_along_each_approach(rng):
    readings = readings_of(rng)
    (J,) = measure(readings, bias_sd=1e-4).jacobians
    np.testing.assert_allclose(J[..., 0], readings.directions.values * (1, 1, 0))
    np.testing.assert_allclose(J[..., 1], readings.directions.values * (0, 0, 1))
    (J,) = measure(readings, shared_errors=(Offset(1e-4, common=True),)).jacobians
    np.testing.assert_allclose(J[..., 0], readings.directions.values)


def test_offsets_of_all_axes_are_one_offset(rng):
    readings = readings_of(rng)
    (whole,) = measure(readings, shared_errors=(Offset(1e-4, common=True),)).jacobians
    xy, z = measure(readings, shared_errors=(OffsetByAxes(1e-4, "xy"), OffsetByAxes(1e-4, "z"))).jacobians
    np.testing.assert_allclose(xy + z, whole)


def test_a_scale_moves_points_from_the_origin(rng):
    readings = readings_of(rng)
    (J,) = measure(readings, shared_errors=(Scale(1e-4),)).jacobians
    np.testing.assert_allclose(J[..., 0], readings.points.values)


def test_a_form_error_has_its_sd_at_every_point(rng):
    readings = readings_of(rng, n=40)
    plain, measured = measure(readings), measure(readings, shared_errors=(Form(3e-4, length=0.2),))
    J = measured.jacobians[0]
    variance = 9e-8 * np.sum(J**2, axis=2) + np.diagonal(measured.covs - plain.covs, axis1=1, axis2=2)
    np.testing.assert_allclose(variance, 9e-8, rtol=1e-6)


def test_a_fan_turns_points_about_its_sensor(rng):
    T = SE3.from_parts(SO3.exp(rng.normal(size=3)), rng.normal(size=3))
    rig = Rig((RigSensor("eye", np.eye(4), None, 1e-3, 0.01, 1.0, 0.0, np.zeros((6, 6))),))
    readings = tanteo.Readings.from_columns(n=1, Ts_world_hand=T[None], ranges=np.array([0.5]), sensors=["eye"])
    measured = measure(readings, rig=rig, shared_errors=(Fan(0.005),))
    turned = SE3.apply(T @ SE3.from_parts(SO3.exp(np.array([1e-6, 0, 0])), np.zeros(3)), np.array([0, 0, 0.5]))
    np.testing.assert_allclose(measured.jacobians[0][0, :, 0], (turned - measured.points[0]) / 1e-6, atol=1e-6)


def test_amounts_are_on_one_side(rng):
    z = rng.normal(size=100_000)
    amounts, own = Stock(3e-3).amounts(z), Stock(3e-3)
    assert amounts.min() >= 0
    assert np.mean(amounts > 3e-3) == pytest.approx(0.049, abs=0.003)
    assert amounts.mean() == pytest.approx(own.center * own.sd, rel=0.01)
    assert amounts.std() == pytest.approx(own.spread * own.sd, rel=0.01)
    assert np.mean(amounts < 5e-4) == pytest.approx(1 / 6, abs=0.005)


def test_steps_of_amounts_are_linear_in_them(rng):
    z, x = rng.uniform(-2.5, 2.5, 200), 1e-5
    rate = (one_sided(z + x) - one_sided(z - x)) / (2 * x)
    step = rng.uniform(-0.5, 2.0, 200) / rate
    there = one_sided(z) + rate * step
    inside = there > one_sided(np.array(-4.0))
    np.testing.assert_allclose(one_sided(stepped_amounts(z, step))[inside], there[inside], atol=1e-9)
    np.testing.assert_allclose(stepped_amounts(z, step)[~inside], (z + step)[~inside], atol=2.0)


def test_stock_is_by_face():
    directions = np.array([[0, 0, -1], [0, 0.05, -1], [0, 0, 1], [1, 0, 0], [1, 0.1, 0]])
    readings = tanteo.Readings.from_columns(points=np.zeros((5, 3)), directions=directions, sds=np.full(5, SD))
    by_face, uniform = (measure(readings, shared_errors=(Stock(3e-3, u),)) for u in (False, True))
    assert by_face.jacobians[0].shape[2] == 3
    assert uniform.jacobians[0].shape[2] == 1


def test_readings_without_approach_have_an_offset_as_noise():
    readings = tanteo.Readings.from_columns(points=np.zeros((1, 3)), sds=np.full(1, SD))
    measured = measure(readings, shared_errors=(OffsetByAxes(3e-4, "z"),))
    np.testing.assert_allclose(measured.covs[0], (SD**2 + 9e-8) * np.eye(3))


@pytest.mark.parametrize(
    ("error", "words"),
    [(OffsetByGroup(1e-4), "expected a column group"), (Fan(0.01), "expected ranges of a sensor")],
    ids=("group", "fan"),
)
def test_an_error_without_its_readings_is_refused(error, words):
    readings = tanteo.Readings.from_columns(points=np.zeros((1, 3)), sds=np.full(1, SD))
    with pytest.raises(InputError, match=words):
        measure(readings, shared_errors=(error,))


def test_more_groups_than_states_are_refused(rng):
    readings = tanteo.Readings.from_columns(
        points=rng.normal(size=(600, 3)), directions=rng.normal(size=(600, 3)), groups=list(map(str, range(600))),
        sds=np.full(600, SD),
    )  # fmt: skip
    with pytest.raises(InputError, match="at most 504 states, got 600 of offset by group"):
        measure(readings, shared_errors=(OffsetByGroup(1e-4),))


@pytest.mark.parametrize("sd", [0.0, -1e-4, math.nan, math.inf])
def test_an_error_without_a_size_is_refused(sd):
    with pytest.raises(InputError, match="scale: expected a standard deviation above 0"):
        Scale(sd)


@pytest.mark.quick_sets(2)
@pytest.mark.parametrize(("scenes", "outside"), [(6, 2), pytest.param(16, 3, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "error", [OffsetByAxes(3e-4, "xy"), Backlash(3e-4), Scale(1e-3), Drift(3e-4), Form(3e-4)], ids=lambda one: one.name
)
def test_the_truth_is_inside_the_region_under_an_error(block, error, scenes, outside):
    target, covered, total = block, 0, 0.0
    for k in range(scenes):
        rng = np.random.default_rng((7, k))
        T = box_centred_pose(rng, 0.3)
        p, d = beams(target, 16, rng, tilt=0.05)
        points, directions = SE3.apply(T, p), d @ T[:3, :3].T
        sds = np.full(len(p), SD)
        exact = tanteo.Readings.from_columns(points=points, directions=directions, sds=sds)
        (J,) = measure(exact, shared_errors=(error,)).jacobians
        moved = points - J @ (error.sd * rng.normal(size=J.shape[2])) + SD * rng.normal(size=p.shape)
        readings = tanteo.Readings.from_columns(points=moved, directions=directions, sds=sds)
        best = tanteo.locate(readings, target, shared_errors=(error,), conventions=False).hypotheses[0]
        value, dof = nees(target.part, best.T_world_part, best.covariance, T)
        covered, total = covered + inside(value, dof), total + value
    assert covered >= scenes - outside  # more than 3 of 16, or 2 of 6, are outside with a probability below 1 %
    assert total < chi2.ppf(0.999, 6 * scenes)


def outside_with_stock_on_the_sides(target, **words):
    """Return how many of six regions miss the truth if the sides carry 2 mm of stock and the top none."""
    outside = 0
    for k in range(6):
        rng = np.random.default_rng((8, k))
        p, d = beams(target, 16, rng, tilt=0.0)
        keep = np.abs(d[:, 2]) < 0.5
        keep |= d[:, 2] < -0.5  # four sides and the top
        moved = p[keep] - d[keep] * (2e-3, 2e-3, 0) + 1e-5 * rng.normal(size=(int(keep.sum()), 3))
        readings = tanteo.Readings.from_columns(points=moved, directions=d[keep], sds=np.full(len(moved), 1e-5))
        best = tanteo.locate(readings, target, conventions=False, **words).hypotheses[0]
        value, dof = nees(target.part, best.T_world_part, best.covariance, np.eye(4))
        outside += not inside(value, dof)
    return outside


def test_an_offset_of_the_sides_does_not_move_the_top(block):
    assert outside_with_stock_on_the_sides(block, bias_sd=2e-3) <= 1
    assert outside_with_stock_on_the_sides(block, shared_errors=(Offset(2e-3, common=True),)) >= 4


def face_columns(points, directions, faces=(), **columns):
    readings = tanteo.Readings.from_columns(points, directions=directions, sds=np.full(len(points), 5e-5), **columns)
    (J,) = measure(readings, shared_errors=(FaceOffset(2e-4, faces),)).jacobians
    return J


def test_faces_of_one_plane_have_separate_offsets(rng):
    """Two bosses in one plane: the readings alone do not distinguish them, their faces do; a label does not divide."""
    points = np.c_[rng.uniform(-0.01, 0.01, (12, 2)), np.zeros(12)]
    faces = np.arange(12) % 2
    points[:, 0] += 0.05 * faces
    down = np.tile([0.0, 0.0, -1.0], (12, 1))
    assert face_columns(points, down).shape[2] == 1
    J = face_columns(points, down, tuple(map(int, faces)))
    assert J.shape[2] == 2
    np.testing.assert_allclose(J[:, 2], -np.eye(2)[faces])
    assert face_columns(points, down, tuple(map(int, faces)), features=["top"] * 12).shape[2] == 1


def test_touches_of_a_plane_share_one_offset(rng):
    """Approaches slant from the normal by some degrees, and the face by 5 degrees from the axis."""
    R = SO3.exp(np.radians(5) * np.array([0.6, -0.8, 0.0]))
    points = np.c_[rng.uniform(-0.05, 0.05, (12, 2)), 5e-5 * rng.normal(size=12)] @ R.T
    slant = np.tan(np.radians(4)) * rng.normal(size=(12, 2))
    directions = np.c_[slant, -np.ones(12)]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(face_columns(points, directions)[..., 0], directions)


def test_parallel_faces_have_separate_offsets(rng):
    """Two levels of a step, and a side: three offsets."""
    points = np.r_[rng.uniform(-0.05, 0.05, (18, 3))]
    face = np.arange(18) % 3
    points[face == 0, 2], points[face == 1, 2], points[face == 2, 0] = 0.0, -0.02, 0.05
    directions = np.where((face == 2)[:, None], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0])
    J = face_columns(points, directions)
    assert J.shape[2] == 3
    assert all(len(np.unique(np.argmax(np.abs(J[face == f]).sum(axis=1), axis=1))) == 1 for f in range(3))


def test_one_label_is_one_face_and_centres_have_no_face():
    points, down = np.array([[0, 0, 0], [0.05, 0, 0.03], [0, 0.05, 0]]), np.tile([0.0, 0.0, -1.0], (3, 1))
    assert face_columns(points, down, features=["a", "a", "b"]).shape[2] == 2
    centres = tanteo.Readings.from_columns(points, directions=down, kinds=["centre"] * 3, sds=np.full(3, 5e-5))
    exact, made = (measure(centres, shared_errors=errors) for errors in ((), (FaceOffset(2e-4),)))
    np.testing.assert_allclose(made.covs - exact.covs, np.broadcast_to(4e-8 * np.eye(3), (3, 3, 3)))


@pytest.mark.slow
@pytest.mark.quick_sets(1)
@pytest.mark.parametrize("aimed", [True, False])
def test_many_touches_do_not_average_the_offset_of_a_face(block, aimed):
    """40 touches of 0.05 mm on faces that are off by 0.2 mm each: the region holds the truth, and keeps its size."""
    contained, scenes, form_sd = 0, 24, 2e-4
    for seed in range(scenes):
        rng = np.random.default_rng((53, seed))
        T = SE3.exp(np.r_[0.1 * rng.normal(size=3), 0.3 * rng.normal(size=3)])
        offsets = form_sd * rng.normal(size=len(block.part.faces))
        rows = rng.choice(len(block.samples), 40, replace=False)
        p = block.samples[rows] + offsets[block.sample_faces[rows]][:, None] * block.normals[rows]
        known = {"directions": -block.normals[rows] @ T[:3, :3].T} if aimed else {}
        points = SE3.apply(T, p + 5e-5 * rng.normal(size=p.shape))
        best = tanteo.locate(
            tanteo.Readings.from_columns(points, sds=np.full(40, 5e-5), **known), block.part, tolerance=form_sd
        ).best
        assert best.corner_sd > 0.5 * form_sd
        off = [SE3.log(SE3.inverse(best.T_world_part) @ T @ S) for S in block.part.symmetry.Ts]
        contained += min(x @ np.linalg.solve(best.covariance, x) for x in off) <= chi2.ppf(0.95, 6)
    assert contained >= scenes - 4  # 5 of 24 have a probability of 0.006
