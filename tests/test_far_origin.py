"""The origin of a CAD file may lie anywhere: in a car's or a ship's coordinates most parts are far from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from bare_scenes import box_centred_pose, surface_points
from tanteo import Readings, identify
from tanteo.geometry import SE3
from tanteo.parts import Part, Surface, read_part
from tanteo.planning import Probe, at_place, plan
from tanteo.posterior import Priors, prepare
from tanteo.sensors.presets import NoiseLaw
from tanteo.vision import prepare_vision, see_table
from vision_scenes import seen_alone

SD = 3e-4
OFFSETS = [10.0, 55.0]
"""Distances of a part of a tenth of a metre from the origin of its file [m]."""


def moved_file(part: Part, away: float, folder: Path) -> tuple[Part, np.ndarray]:
    """Return the same part from a file with another origin, and the old origin in its frame."""
    by, file = away * np.array([3.0, -2.0, 1.0]) / np.sqrt(14), folder / f"{part.name}.off"
    rows = [f"{x:.12f} {y:.12f} {z:.12f}" for x, y, z in part.vertices + by]
    rows += [f"3 {a} {b} {c}" for a, b, c in part.triangles]
    file.write_text("\n".join(["OFF", f"{len(part.vertices)} {len(part.triangles)} 0", *rows, ""]))
    return read_part(file, unit="m"), SE3.from_parts(np.eye(3), by)


def same(near, far, T_far_near):
    """Return whether two answers are equal, except for the frame of the part."""
    assert far.status == near.status
    kept = ([h for h in answer.hypotheses if h.probability > 1e-3] for answer in (near, far))
    for a, b in zip(*kept, strict=True):
        off = SE3.log(SE3.inverse(a.T_world_part) @ b.T_world_part @ T_far_near)
        to_near = SE3.adjoint_inverse(T_far_near)
        J = np.linalg.cholesky(np.linalg.inv(a.covariance)).T
        assert np.linalg.norm(J @ off) < 0.2  # standard deviations, of means of samples
        unit = J @ (to_near @ b.covariance @ to_near.T) @ J.T
        if not a.unobserved:
            np.testing.assert_allclose(unit, np.eye(6), atol=0.15)  # some hundred samples give it, to a twelfth
        assert b.corner_sd == pytest.approx(a.corner_sd, rel=0.1)
        assert b.probability == pytest.approx(a.probability, abs=0.05)
        assert [w.split(" through")[0] for w in b.unobserved] == [w.split(" through")[0] for w in a.unobserved]


@pytest.fixture(scope="module")
def bracket(tmp_path_factory):
    """A part without symmetry, from a mesh."""
    part = read_part(Path(__file__).parents[1] / "examples" / "parts" / "bracket_left.step")
    return moved_file(part, 0.0, tmp_path_factory.mktemp("near"))[0]


@pytest.mark.parametrize("away", OFFSETS)
def test_bare_readings_place_it_as_they_do_one_at_its_origin(bracket, away, tmp_path):
    far, T_far_near = moved_file(bracket, away, tmp_path)
    rng = np.random.default_rng(7)
    for _ in range(4):
        points, _ = surface_points(Surface(bracket.vertices, bracket.triangles), 20, rng)
        points = SE3.apply(box_centred_pose(rng), points) + SD * rng.normal(size=points.shape)
        readings = Readings.from_columns(points, sds=np.full(20, SD))
        same(identify(readings, [bracket]), identify(readings, [far]), T_far_near)


@pytest.mark.parametrize("away", OFFSETS)
@pytest.mark.parametrize("faces", [3, 5])
def test_readings_with_labels_do(bracket, away, faces, tmp_path):
    far, T_far_near = moved_file(bracket, away, tmp_path)
    rng = np.random.default_rng([faces, 9])
    planes = bracket.planes
    points, normals, labels = [], [], []
    for plane in rng.choice(np.flatnonzero(planes.areas > 2e-4), faces, replace=False):
        triangles = rng.choice(np.flatnonzero(bracket.triangle_face == planes.faces[plane]), 5)
        shares = rng.dirichlet(np.ones(3), 5)
        points.append(np.einsum("nk,nkj->nj", shares, bracket.vertices[bracket.triangles[triangles]]))
        normals.append(np.tile(planes.normals[plane], (5, 1)))
        labels += [f"face {plane}"] * 5
    T = box_centred_pose(rng)
    readings = Readings.from_columns(
        SE3.apply(T, np.concatenate(points)) + SD * rng.normal(size=(len(labels), 3)),
        sds=np.full(len(labels), SD), features=labels, directions=-np.concatenate(normals) @ T[:3, :3].T,
    )  # fmt: skip
    same(identify(readings, [bracket]), identify(readings, [far]), T_far_near)


def test_the_spin_of_a_round_part_stays_no_error(tmp_path):
    near, rng = tmp_path / "pin.stl", np.random.default_rng(3)
    trimesh.creation.cylinder(0.02, 0.05, sections=64).export(near)
    pin = read_part(near, unit="m")
    far, T_far_near = moved_file(pin, 55.0, tmp_path)
    T = box_centred_pose(rng)
    points, _ = surface_points(Surface(pin.vertices, pin.triangles), 20, rng)
    readings = Readings.from_columns(SE3.apply(T, points) + SD * rng.normal(size=(20, 3)), sds=np.full(20, SD))
    exactly = Priors(noise_factor=1.0)  # otherwise samples give the tails, to a tenth
    a, b = (identify(readings, [part], priors=exactly).hypotheses[0] for part in (pin, far))
    assert a.unobserved == b.unobserved == ()
    assert b.corner_sd == pytest.approx(a.corner_sd, rel=0.1)
    assert a.corner_sd < 5 * SD
    for h in (a, b):  # a uniform rotation, for any frame
        assert np.sqrt(np.trace(h.covariance[3:, 3:])) == pytest.approx(2 * np.pi / np.sqrt(12), rel=0.01)
    middle = SE3.apply(b.T_world_part @ T_far_near, pin.centroid)
    np.testing.assert_allclose(middle, SE3.apply(a.T_world_part, pin.centroid), atol=2 * SD)


@pytest.mark.slow
def test_a_plan_for_it_reaches_the_same(bracket, tmp_path):
    far, _ = moved_file(bracket, 55.0, tmp_path)
    probe = Probe("laser", NoiseLaw.of(SD), max_range=0.3, standoff=0.1)
    rough = np.diag(np.repeat((1e-3, 1e-2), 3)) ** 2
    plans = [plan(at_place((prepare(p),), np.eye(4), rough), probe, 1e-3) for p in (bracket, far)]
    assert plans[0].reached
    assert plans[1].reached
    assert abs(len(plans[0].readings) - len(plans[1].readings)) <= 1
    assert plans[1].before == pytest.approx(plans[0].before, rel=1e-6)


def test_an_image_of_it_is_read_as_well(bracket, tmp_path):
    pytest.importorskip("cv2")
    far, T_far_near = moved_file(bracket, 55.0, tmp_path)
    camera, image, _, _ = seen_alone(prepare_vision(bracket), 0.4)
    a, b = (see_table(image, camera, [part]).objects[0].answer for part in (bracket, far))
    same(a, b, T_far_near)
