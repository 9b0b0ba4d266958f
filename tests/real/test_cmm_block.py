"""A real block touched by a hand-held measuring machine, its faces labelled: which part, where, and how sure.

Twenty dimples, four a face, five to fourteen touches each, in two placements. The drawing and the made block differ by
0.1-0.2 mm, and ``tool_cloud.csv``, the truth for the order of the dimples, has a frame of its own.
"""

from __future__ import annotations

import csv
from collections import defaultdict

import numpy as np
import pytest

from tanteo.catalogue import read_parts
from tanteo.features import Feature
from tanteo.features.kinds import PLANE, VERTEX
from tanteo.fitting.localization import ModelFeature, Pairing, estimate_pose
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare
from tanteo.recognition import identify
from tanteo.sensors import Readings
from tanteo.sensors.error_states import Drift, Form, Scale

BALL, SD, TOLERANCE = 1.5e-3, 0.05e-3, 0.15e-3
CHI2_95_OF_3 = 7.815
FACES = 5


@pytest.fixture(scope="module")
def data(request):
    folder = request.config.rootpath.parent / "shared" / "data"
    if not (folder / "cmm_block").is_dir():
        pytest.skip(f"the real measurements are not here: {folder / 'cmm_block'} is missing")
    return folder


@pytest.fixture(scope="module")
def parts(data, tmp_path_factory):
    block = data / "cmm_block" / "calibration_block_from_drawing.stl"
    others = sorted((data / "step_parts").glob("*.st*p"))[::3]
    return read_parts([block, *others], unit="mm").parts


@pytest.fixture(scope="module")
def block(parts):
    return next(part for part in parts if part.name.startswith("calibration_block"))


def table(path):
    """Coordinates [m] by element number."""
    rows = defaultdict(list)
    with path.open() as file:
        for row in csv.reader(file):
            number = row[0].removeprefix("Point")
            if number.isdigit():
                rows[int(number)].append([1e-3 * float(v) for v in row[3:6]])
    return {number: np.array(points) for number, points in rows.items()}


@pytest.fixture(scope="module")
def dimples(data):
    cloud = table(data / "cmm_block" / "tool_cloud.csv")
    return np.array([cloud[i][0] for i in sorted(cloud)])


def touches(data, placement):
    rows = table(data / "cmm_block" / "rob1_self_transform_092024.csv")
    return [rows[i] for i in range(20 * placement + 1, 20 * placement + 21)]


def readings(groups):
    points = np.concatenate(groups)
    labels = [f"face {i // 4}" for i, group in enumerate(groups) for _ in group]
    return Readings.from_columns(points, features=labels, radii=np.full(len(points), BALL))


def rigid(a, b):
    R = SO3.align(a - a.mean(axis=0), b - b.mean(axis=0))
    return SE3.from_parts(R, b.mean(axis=0) - R @ a.mean(axis=0))


def frame_of_the_cloud(block, dimples):
    """Pose of the drawing in the frame of the cloud: its dimples on the faces that they are nearest to."""
    lifted = block.planes.centroids + BALL * block.planes.normals
    pairings = []
    for point in dimples:
        inside = np.abs(np.sum((point - lifted) * block.planes.normals, axis=1))
        beside = np.linalg.norm(point - lifted, axis=1) > 0.03
        face = int(np.argmin(np.where(beside, np.inf, inside)))
        T = np.eye(4)
        T[:3, 3] = point - BALL * block.planes.normals[face]
        sensed = Feature(VERTEX, T, TOLERANCE**2 * np.eye(3))
        pairings.append(Pairing(sensed, ModelFeature(PLANE, block.planes.Ts_part_feature[face])))
    return estimate_pose(pairings, start=np.eye(4), length=block.diagonal).T_world_part


@pytest.fixture(scope="module", params=[0, 1])
def located(request, data, parts, dimples):
    """Of one placement: the answer, its pose, the one that the dimples' order gives, the gaps of the dimples."""
    groups = touches(data, request.param)
    answer = identify(readings(groups), parts, sd=SD, tolerance=TOLERANCE)
    best = answer.hypotheses[0]
    known = rigid(dimples, np.array([group.mean(axis=0) for group in groups]))
    poses = [best.T_world_part, *best.symmetry_poses]
    gaps = [SE3.apply(T, dimples) - SE3.apply(known, dimples) for T in poses]
    k = int(np.argmin([np.abs(gap).max() for gap in gaps]))
    return answer, poses[k], known, gaps[k]


@pytest.mark.quick_sets(1)
def test_the_block_is_named_and_located(located, block, dimples):
    answer, T, known, gaps = located
    best = answer.hypotheses[0]
    assert (answer.status, best.part) == ("recognized", block.name)
    assert best.probability > 0.99
    assert best.symmetry_order == 2
    # The rest of the gap is the frame of the cloud: it is rotated against the drawing, for any fit of the drawing.
    own = SE3.apply(T, dimples) - SE3.apply(known @ frame_of_the_cloud(block, dimples), dimples)
    print(f"dimples off by {1e3 * np.linalg.norm(gaps, axis=1).max():.2f} mm", end=", ")
    print(
        f"{1e3 * np.linalg.norm(own, axis=1).max():.2f} mm without the frame of the cloud; P = {best.probability:.6f}"
    )
    assert np.linalg.norm(gaps, axis=1).max() < 0.5e-3
    assert np.linalg.norm(own, axis=1).max() < 0.3e-3


@pytest.mark.xfail(reason="the frame of the cloud is off by more than the covariance of the drawing's own faces")
@pytest.mark.quick_sets(1)
def test_every_dimple_is_in_its_ellipsoid_of_95_percent(located, dimples):
    answer, T, _, gaps = located
    J = np.concatenate([np.broadcast_to(np.eye(3), (20, 3, 3)), -SO3.hat(dimples)], axis=-1)
    C = J @ answer.hypotheses[0].covariance @ np.swapaxes(J, 1, 2)
    local = gaps @ T[:3, :3]
    assert np.einsum("ni,nij,nj->n", local, np.linalg.inv(C), local).max() < CHI2_95_OF_3


def test_the_frame_of_the_cloud_is_turned_against_the_drawing(data, block, dimples):
    """No pose that fits the drawing is within 0.3 mm of the known order at every dimple: the truth itself is not."""
    T = frame_of_the_cloud(block, dimples)
    turn = np.linalg.norm(SO3.log(T[:3, :3]))
    moved = np.linalg.norm(SE3.apply(T, dimples) - dimples, axis=1)
    print(f"turned by {1e3 * turn:.1f} mrad, dimples move by {1e3 * moved.max():.2f} mm at most")
    assert 0.010 < turn < 0.020
    assert moved.max() > 0.3e-3


def test_without_the_tolerance_the_scatter_is_reported(data, parts, block):
    """The made block is off its drawing by more than the touches' noise: that is found, and the covariance widened."""
    exact = Scale(1e-9), Drift(1e-9), Form(1e-9)  # the machine is a good one
    noise, made = (
        identify(readings(touches(data, 0)), [block], sd=SD, tolerance=t, shared_errors=exact) for t in (0.0, TOLERANCE)
    )
    assert noise.best.part == made.best.part == block.name
    assert "times as much as stated" in noise.message
    assert made.best.noise_scale[0] < 1 < noise.best.noise_scale[1]
    # the offset of a face is one draw, not many: only the tolerance models it
    assert noise.best.corner_sd < made.best.corner_sd


def test_preparing_parts_once_gives_the_same_answer(data, block):
    given = readings(touches(data, 1))
    plain = identify(given, [block], sd=SD, tolerance=TOLERANCE)
    prepared = identify(given, [prepare(block)], sd=SD, tolerance=TOLERANCE)  # type: ignore[list-item]
    np.testing.assert_allclose(prepared.hypotheses[0].T_world_part, plain.hypotheses[0].T_world_part, atol=1e-12)
