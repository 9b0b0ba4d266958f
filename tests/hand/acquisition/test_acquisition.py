"""From a rough idea to a feature: statuses that are true, covariances that hold, records that replay."""

import numpy as np
import pytest
from scipy.stats import chi2

from felt_scenes import PARTS, facing, gripper, make_task, nees
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.hand import Workspace
from tanteo.hand.acquisition import (
    EdgeGuess,
    FaceGuess,
    VertexGuess,
    exact_poses,
    features_of,
    plane_as_published,
    sense_edge,
    sense_plane,
    sense_vertex,
)
from tanteo.hand.acquisition.patch import find_patches, stands
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.scan import scan
from tanteo.hand.acquisition.seen import clearance, cloud_of, over
from tanteo.hand.motion import Rules, spiral_scan
from tanteo.hand.simulator import Cell, Scene, SimulatedHand, box, clearances
from tanteo.io import read_readings, write_readings

SENSE = {"plane": sense_plane, "edge": sense_edge, "vertex": sense_vertex}
BLOCK = Scene.of([box("table", [-0.3, -0.3, -0.05], [0.3, 0.3, 0.0]), box("block", [0, 0, 0], [0.12, 0.08, 0.05])])
RULES = Rules(clearance=0.012, workspace=Workspace.above(0.0))
FACE = FaceGuess([0.06, 0.04, 0.055], [0.1, 0, 1])
EDGE = EdgeGuess([0.06, -0.005, 0.055], [1, 0.1, 0], [0, 0.1, 1])
CORNER = VertexGuess([0.115, 0.005, 0.05], [1, 0, 0], [0, 1, 0], [0, 0, 1])
IDEAS = {"plane": FACE, "edge": EDGE, "vertex": CORNER}


def start(x=0.05, y=0.04, height=0.12, tilt=(0.0, 0.1, 0.2)):
    R = np.diag([1.0, -1.0, -1.0]) @ SO3.exp(np.array(tilt))
    return SE3.from_parts(R, np.array([x, y, height]) - R @ gripper().front)


def robot_on(scene=BLOCK, T=None, seed=0):
    return SimulatedHand(scene, gripper(), start() if T is None else T, rng=np.random.default_rng(seed))


@pytest.fixture(scope="module")
def felt():
    """One acquisition of each kind on the block, and the robot that did it."""
    robots = {kind: robot_on(seed=3) for kind in SENSE}
    return {
        kind: (SENSE[kind](robots[kind], IDEAS[kind], standoff=0.02, rules=RULES, label="it"), robots[kind])
        for kind in SENSE
    }


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(SENSE))
def test_a_block_is_felt_where_it_is(felt, kind):
    got, robot = felt[kind]
    assert got.acquired, got.message
    assert got.feature.kind.name == got.kind == kind
    assert got.feature.label == "it"
    value, solid, _ = nees(BLOCK, got.feature)
    assert value < chi2.ppf(0.9999, got.feature.kind.size)
    assert solid == "block"
    assert clearances(BLOCK, gripper().body, np.array(robot.truth)).min() > 0.010
    assert got.seconds == pytest.approx(robot.sensed.time)
    assert len(got.others) == {"plane": 0, "edge": 1, "vertex": 3}[kind]


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(SENSE))
def test_the_record_gives_the_same_features_to_the_last_bit(tmp_path, felt, kind):
    got, _ = felt[kind]
    write_readings(got.readings, tmp_path / "record.csv", unit="m")
    kept, _ = features_of(got.readings, gripper().rig)
    replayed, _ = features_of(read_readings(tmp_path / "record.csv"), gripper().rig)
    sensed = {f.label: f for f in (*got.others, got.feature) if f.kind.name != "vertex"}
    assert set(kept) == set(replayed) == set(sensed)
    for label, feature in sensed.items():
        for other in (kept[label], replayed[label]):
            np.testing.assert_array_equal(feature.T_world_feature, other.T_world_feature)
            np.testing.assert_array_equal(feature.P, other.P)
            for a, b in zip(feature.shared, other.shared, strict=True):
                np.testing.assert_array_equal(a.jacobian, b.jacobian)


def test_the_published_plane_holds_what_it_states():
    """Four readings of the record instead of all: a greater covariance, and a calibrated one."""
    total, n = 0.0, 6
    for seed in range(n):
        session = SensingRun(robot_on(T=start(height=0.07, tilt=(0.0, 0.05, 0.2)), seed=seed), 0.02, RULES, None)
        _, _, plane = scan(session, "plane", 0.015)
        published = plane_as_published(session.readings[0], gripper().rig, "plane")
        total += nees(BLOCK, published)[0]
        assert len(published.readings) == 4
        assert np.linalg.det(published.P) > 8 * np.linalg.det(plane.P)
    low, high = chi2.ppf([0.001, 0.999], 3 * n)
    assert low < total < high
    with pytest.raises(InputError, match="expected four readings or more of two sensors"):
        plane_as_published(session.readings[0], gripper().rig, "no such label")


def test_poses_survive_a_quaternion():
    rng = np.random.default_rng(0)
    T = SE3.exp(rng.normal(size=(3000, 6)) * 3)
    exact = exact_poses(T)
    R = exact[:, :3, :3]
    np.testing.assert_array_equal(SO3.from_quaternion(SO3.as_quaternion(R)), R)
    np.testing.assert_allclose(exact, T, atol=1e-12)


@pytest.mark.slow
def test_one_seed_one_answer(felt):
    first, second = felt["plane"][0], sense_plane(robot_on(seed=3), FACE, standoff=0.02, rules=RULES)
    np.testing.assert_array_equal(first.feature.T_world_feature, second.feature.T_world_feature)


def test_nothing_is_there():
    there = FaceGuess(FACE.point + np.array([0, 0, 0.35]), FACE.normal)
    got = sense_plane(robot_on(T=start(height=0.4)), there, standoff=0.02, rules=RULES)
    assert (got.status, got.feature, got.readings) == ("nothing", None, None)


def test_a_face_that_is_too_narrow_is_not_felt():
    scene = Scene.of([box("pin", [-0.006, -0.006, 0], [0.006, 0.006, 0.05])])
    got = sense_plane(robot_on(scene, T=start(0, 0)), FaceGuess([0, 0, 0.05], [0, 0, 1]), standoff=0.02, rules=RULES)
    assert got.status in ("nothing", "lost", "unclear")
    assert got.feature is None


@pytest.mark.slow
def test_too_little_clearance_is_a_limit():
    walls = [([0.045, -0.1], [0.06, 0.1]), ([-0.06, -0.1], [-0.045, 0.1])]
    walls += [([-0.1, 0.035], [0.1, 0.05]), ([-0.1, -0.05], [0.1, -0.035])]
    solids = [box(f"wall {k}", [*low, 0.05], [*high, 0.1]) for k, (low, high) in enumerate(walls)]
    scene = Scene.of([box("floor", [-0.1, -0.1, 0], [0.1, 0.1, 0.05]), *solids])
    rules = Rules(clearance=0.02)
    robot = robot_on(scene, T=start(0, 0, 0.14, (0, 0, 0)))
    got = sense_plane(robot, FaceGuess([0, 0, 0.05], [0, 0, 1]), standoff=0.03, rules=rules)
    assert got.status in ("limit", "nothing")
    assert clearances(scene, gripper().body, np.array(robot.truth)).min() > 0.012


def test_an_edge_that_is_not_there_is_not_felt():
    """The middle of a wide face, far from all its edges."""
    scene = Scene.of([box("plate", [-0.4, -0.4, -0.02], [0.4, 0.4, 0.0])])
    guess = EdgeGuess([0, 0, 0], [1, 0, 0], [0, 0, 1])
    got = sense_edge(robot_on(scene, T=start(0, 0, 0.07)), guess, standoff=0.02, rules=Rules(clearance=0.012))
    assert got.status == "nothing"
    assert got.feature is None
    assert got.others[0].kind.name == "plane"


def test_ideas_must_make_sense():
    with pytest.raises(InputError, match="normal: expected a direction that is not zero"):
        FaceGuess([0, 0, 0], [0, 0, 0])
    with pytest.raises(InputError, match="point: expected three finite numbers"):
        FaceGuess([0, 0, np.nan], [0, 0, 1])
    with pytest.raises(InputError, match="direction: expected one across the normal"):
        EdgeGuess([0, 0, 0], [0, 0, 1], [0, 0, 1])
    with pytest.raises(InputError, match="leaving: expected an edge that meets"):
        VertexGuess([0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1])
    with pytest.raises(InputError, match="standoff: expected at least"):
        sense_plane(robot_on(), FACE, standoff=0.014, rules=RULES)
    inside = EdgeGuess([0, 0, 0], [1, 0, 0], [0, 0, 1]).face(0.02)
    np.testing.assert_allclose(inside.point, [0, 0.02, 0], atol=1e-15)


def test_the_patch_and_the_stands_of_a_block():
    robot = robot_on()
    cloud = cloud_of(gripper(), [spiral_scan(robot, 0.25, RULES)])
    patch = find_patches(cloud, FACE)[0]
    assert np.degrees(np.arccos(patch.normal[2])) < 3
    assert abs(patch.point[2] - 0.05) < 2e-3
    for width, place, along in stands(patch, 0.04, FACE.point)[:20]:
        feet = place + np.outer([-0.02, 0.02], along)
        assert width > 0
        assert ((feet[:, :2] > -2e-3) & (feet[:, :2] < [0.122, 0.082])).all()
    assert not over(cloud, patch.point, patch.normal).hit.any()
    poses = [facing(gripper(), patch.point, patch.normal, [1, 0, 0], h, start()) for h in (0.06, 0.005)]
    far_clearance, near_clearance = clearance(cloud, gripper().body, np.array(poses))
    assert far_clearance > 0.055 > near_clearance


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "n"), [("plane", 7), ("edge", 5), ("vertex", 4)])
def test_scenes_at_random(kind, n):
    """A small part of ``benchmarks/motions.py``: nothing is touched, and what is stated holds."""
    total, dof, acquired = 0.0, 0, 0
    for k in range(n):
        rng = np.random.default_rng((7, k))
        task = make_task(rng, kind, PARTS[k % len(PARTS)])
        robot = SimulatedHand(task.scene, gripper(), task.T_world_hand, rng=rng)
        rules = Rules(clearance=0.6 * task.standoff, workspace=task.workspace)
        got = SENSE[kind](robot, task.guess, standoff=task.standoff, rules=rules)
        assert clearances(task.scene, gripper().body, np.array(robot.truth)).min() > 0.5 * task.standoff
        acquired += got.acquired
        if got.acquired:
            total, dof = total + nees(task.scene, got.feature)[0], dof + got.feature.kind.size
    assert acquired >= 0.7 * n
    low, high = chi2.ppf([0.001, 0.999], dof)
    assert low < total < high


@pytest.mark.parametrize(
    ("seed", "k", "what"),
    [(20261201, 622, "a first look"), (20261204, 333, "a way down")],
)
@pytest.mark.slow
def test_what_is_beside_its_beams_is_not_run_into(seed, k, what):
    """Two scenes of ``benchmarks/motions.py`` in which it came nearer than half the stand-off, or touched."""
    rng = np.random.default_rng((seed, 1, k))
    task = make_task(rng, "edge", PARTS[k % len(PARTS)])
    cell = Cell(latency=rng.uniform(0, 0.06))
    robot = SimulatedHand(task.scene, gripper(), task.T_world_hand, rng=rng, cell=cell)
    rules = Rules(clearance=0.6 * task.standoff, workspace=task.workspace)
    got = sense_edge(robot, task.guess, standoff=task.standoff, rules=rules)
    assert got.acquired, got.message
    least = clearances(task.scene, gripper().body, np.array(robot.truth)).min()
    assert least > 0.5 * task.standoff, what


@pytest.mark.slow
def test_three_places_on_one_line_of_three_edges_are_no_edge():
    """A scene of ``benchmarks/motions.py`` in which they were stated as one, half a radian askew."""
    rng = np.random.default_rng((20261206, 1, 918))
    task = make_task(rng, "edge", PARTS[918 % len(PARTS)])
    cell = Cell(latency=rng.uniform(0, 0.06))
    robot = SimulatedHand(task.scene, gripper(), task.T_world_hand, rng=rng, cell=cell)
    got = sense_edge(
        robot, task.guess, standoff=task.standoff, rules=Rules(clearance=0.6 * task.standoff, workspace=task.workspace)
    )
    assert not got.acquired or nees(task.scene, got.feature)[0] < 20
