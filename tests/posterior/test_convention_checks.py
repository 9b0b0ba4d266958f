"""A mistake of a file is named where undoing it explains the readings, and nowhere else."""

import time
from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import beams, box_centred_pose
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare
from tanteo.sensors import Rig, RigSensor
from tanteo.sensors.error_states import Stock
from tanteo.words.findings import Convention, DirectionsConvention, OffsetQuestion, ScaleQuestion

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD, RADIUS = 5e-5, 2e-3
SIZES = {"long": (0.09, 0.05, 0.03), "flat": (0.07, 0.06, 0.015), "high": (0.04, 0.035, 0.08)}


@pytest.fixture(scope="module")
def blocks():
    return [block(name, size) for name, size in SIZES.items()]


def block(name, size):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * np.asarray(size)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    triangles = [(a, b, c) for a, b, c, _ in sides] + [(a, c, d) for a, _, c, d in sides]
    return tanteo.part_from_mesh(corners, triangles, unit="m", name=name)


def touches(part, rng, radius=0.0, n=18):
    """Return centres of a ball that touches faces of a block away from their rims, and the outward normals."""
    half = 0.5 * (part.box[1] - part.box[0])
    axes, signs = rng.integers(3, size=n), rng.choice([-1.0, 1.0], n)
    p = rng.uniform(-0.8, 0.8, (n, 3)) * half
    p[np.arange(n), axes] = signs * half[axes]
    normals = np.zeros((n, 3))
    normals[np.arange(n), axes] = signs
    T = box_centred_pose(rng)
    middle = 0.5 * (part.box[0] + part.box[1])
    points = SE3.apply(T, p + middle + radius * normals) + SD * rng.normal(size=(n, 3))
    return points, normals @ T[:3, :3].T


def identified(parts, points, **columns):
    return tanteo.identify(tanteo.Readings.from_columns(points=points, sds=np.full(len(points), SD), **columns), parts)


@pytest.mark.quick_sets(1)
@pytest.mark.parametrize("aimed", [False, True])
@pytest.mark.parametrize(
    "name", [name if name == "flat" else pytest.param(name, marks=pytest.mark.slow) for name in SIZES]
)
def test_a_forgotten_radius_is_named_with_its_size(blocks, name, aimed):
    part = next(one for one in blocks if one.name == name)
    points, normals = touches(part, np.random.default_rng(3), RADIUS)
    answer = identified(blocks, points, **({"directions": -normals} if aimed else {}))
    (found,) = (one for one in answer.findings if isinstance(one, OffsetQuestion))
    assert answer.status == "unknown"
    assert found.part == name
    assert abs(abs(found.offset) - RADIUS) < 5 * SD


@pytest.mark.parametrize("seeds", [2, pytest.param(6, marks=pytest.mark.slow)])
def test_a_part_that_is_in_no_file_has_no_offset(blocks, seeds):
    for seed in range(seeds):
        points, _ = touches(blocks[0], np.random.default_rng(seed))
        answer = identified(blocks[1:], points)
        assert not [one for one in answer.findings if isinstance(one, OffsetQuestion)]


@pytest.mark.parametrize("factor", [1.01, 0.995])
def test_a_scaled_part_is_named_with_its_scale(blocks, factor):
    points, normals = touches(blocks[0], np.random.default_rng(3))
    answer = identified(blocks, factor * points, directions=-normals)
    (found,) = (one for one in answer.findings if one.role == "question")
    assert isinstance(found, ScaleQuestion)
    assert abs(found.scale - factor) < 4 * found.sd < 0.01


def test_wrong_directions_are_named(blocks):
    points, normals = touches(blocks[2], np.random.default_rng(4), n=24)
    answer = identified(blocks, points, directions=np.roll(normals, 1, axis=1))
    (found,) = (one for one in answer.findings if one.role == "question")
    assert isinstance(found, DirectionsConvention)
    assert found.mistake == "directions_wrong"


@pytest.mark.parametrize(("noise", "seeds"), [(4, 1), *(pytest.param(n, 4, marks=pytest.mark.slow) for n in (4, 8))])
def test_noise_is_no_offset_and_no_scale(blocks, noise, seeds):
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        points, normals = touches(blocks[seed % 3], rng, n=12)
        points, groups = points + noise * SD * rng.normal(size=points.shape), ["first", "second"] * 6
        answer = identified(blocks, points, directions=-normals, groups=groups)
        assert not [one for one in answer.findings if isinstance(one, (OffsetQuestion, ScaleQuestion))]


def test_groups_with_offsets_of_their_own_are_named(blocks):
    points, normals = touches(blocks[0], np.random.default_rng(8), n=20)
    fast = np.arange(20) % 2 == 0
    answer = identified(
        blocks, points + np.where(fast, 1e-3, 0.0)[:, None] * normals,
        directions=-normals, groups=np.where(fast, "fast", "slow").tolist(),
    )  # fmt: skip
    (found,) = (one for one in answer.findings if isinstance(one, OffsetQuestion))
    offsets = dict(zip(found.groups, found.offsets, strict=True))
    assert answer.status == "unknown"
    assert abs(abs(offsets["fast"] - offsets["slow"]) - 1e-3) < 5 * SD
    assert "group=" in found.message


def test_advised_stock_leaves_the_truth_inside(blocks):
    rng = np.random.default_rng(6)
    points, normals = touches(blocks[0], rng, n=20)
    upright = np.abs(normals @ normals[0]) > 0.9  # one pair of faces carries nothing, the others 2 mm
    stocked = points + np.where(upright, 0.0, RADIUS)[:, None] * normals
    advised = tanteo.locate(
        tanteo.Readings.from_columns(points=stocked, directions=-normals, sds=np.full(20, SD)), blocks[0],
        shared_errors=(Stock(RADIUS),),
    )  # fmt: skip
    exact = tanteo.locate(
        tanteo.Readings.from_columns(points=points, directions=-normals, sds=np.full(20, SD)), blocks[0]
    )
    gap = SE3.inverse(exact.pose) @ (advised.pose @ blocks[0].symmetry.Ts)
    assert advised.status == "recognized"
    assert np.linalg.norm(gap[:, :3, 3], axis=1).min() < 3 * advised.best.corner_sd


def test_right_readings_are_no_mistake(blocks):
    points, _ = touches(blocks[1], np.random.default_rng(5))
    answer = identified(blocks, points)
    assert answer.status == "recognized"
    assert not [one for one in answer.findings if isinstance(one, (OffsetQuestion, Convention))]


@pytest.mark.slow
def test_elapsed_time_has_the_checks_in_it(blocks):
    points, _ = touches(blocks[0], np.random.default_rng(3), RADIUS)
    start = time.perf_counter()
    answer = identified(blocks, points)
    whole = time.perf_counter() - start
    assert answer.elapsed["conventions"] > 0
    assert answer.elapsed["total"] == pytest.approx(whole, abs=0.05 * whole + 0.02)


def ranged(part, rng, T_hand_sensor, n=20):
    """Return ranges at a block from a sensor on the hand whose beam is along +z of its frame."""
    points, normals = touches(part, rng, n=n)
    distances = rng.uniform(0.05, 0.1, n)
    hands = []
    for point, normal, distance in zip(points, normals, distances, strict=True):
        R = SO3.frame_from_axis(-normal, 2) @ SO3.axis_rotation(2, rng.uniform(-3, 3))
        hands.append(SE3.from_parts(R, point + distance * normal) @ SE3.inverse(T_hand_sensor))
    return tanteo.Readings.from_columns(ranges=distances, sensors=["eye"] * n, Ts_world_hand=np.array(hands), n=n)


FORWARD = SE3.from_parts(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.zeros(3))
MOUNT = SE3.from_parts(SO3.exp(np.array([0.3, -0.5, 0.8])), np.array([0.03, -0.04, 0.09]))
STATED = {
    "beam_along_x": MOUNT @ SE3.inverse(FORWARD),
    "mount_inverted": SE3.inverse(MOUNT),
    "mount_inverted_along_x": SE3.inverse(MOUNT @ SE3.inverse(FORWARD)),
    "mount_quaternion_xyzw": SE3.from_parts(
        SO3.from_quaternion(np.roll(SO3.as_quaternion(MOUNT[:3, :3]), -1)), MOUNT[:3, 3]
    ),
}


@pytest.mark.parametrize("mistake", STATED)
def test_a_slip_in_the_pose_of_a_sensor_is_named(blocks, mistake):
    readings = ranged(blocks[0], np.random.default_rng(4), MOUNT)
    sensor = RigSensor("eye", STATED[mistake], None, SD, 0.0, np.nan, 0.0, np.zeros((6, 6)))
    answer = tanteo.identify(readings, blocks[:1], rig=Rig((sensor,)))
    assert answer.status == "unknown"
    (found,) = (one for one in answer.findings if isinstance(one, Convention))
    assert found.mistake == mistake


@pytest.mark.parametrize(
    ("kind", "lacks"), [("sphere_centre", "no ball and no hollow"), ("centre", "no hole and no boss")]
)
def test_centres_that_a_part_cannot_have_are_named(blocks, kind, lacks):
    points = np.random.default_rng(0).uniform(-0.05, 0.05, (12, 3))
    normals = np.tile([0.0, 0.0, 1.0], (12, 1)) if kind == "centre" else None
    answer = identified(blocks[:1], points, kinds=[kind] * 12, normals=normals)
    assert answer.status == "unknown"
    assert answer.message.startswith(f"long has {lacks}.")
    assert not [one for one in answer.findings if isinstance(one, OffsetQuestion)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "k"), [("step_12mm", 23), pytest.param("housing", 43, marks=pytest.mark.slow)])
def test_two_outliers_of_eight_touches_are_no_wrong_directions(name, k):
    rng = np.random.default_rng((991, 3, k))
    part = prepare(tanteo.read_part(PARTS / f"{name}.step"))
    n = int(rng.choice([8, 12, 20]))
    T = box_centred_pose(rng, 0.3)
    p, d = beams(part, n, rng, tilt=0.2)
    points, d = SE3.apply(T, p), d @ T[:3, :3].T
    points += 1e-4 * rng.normal(size=p.shape)
    rows = rng.permutation(n)[: max(2, n // 4)]
    points[rows] += rng.uniform(-0.02, 0.02, (len(rows), 1)) * d[rows]
    readings = tanteo.Readings.from_columns(points=points, sds=np.full(n, 1e-4), directions=d)
    assert not any(isinstance(one, DirectionsConvention) for one in tanteo.locate(readings, part).findings)
