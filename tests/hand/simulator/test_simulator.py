"""The simulated hand: it moves as commanded, senses the truth with the stated errors, and uses no estimator."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import chi2

from felt_scenes import gripper
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.hand import FREE, HIT, LOST, NEAR
from tanteo.hand.simulator import Cell, Scene, SimulatedHand, Solid, box, clearances
from tanteo.hand.twists import translation_twist
from tanteo.sensors import Readings, error_model, measure
from tanteo.sensors.presets import robot_preset

DOWN = SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 0.15]))
"""The hand's front 50 mm over the table."""


@pytest.fixture(scope="module")
def table():
    return Scene.of([box("table", [-0.5, -0.5, -0.05], [0.5, 0.5, 0.0])])


def robot_on(scene, T=DOWN, seed=0, **cell):
    return SimulatedHand(scene, gripper(), T, rng=np.random.default_rng(seed), cell=Cell(**cell))


@pytest.mark.parametrize("latency", [0.0, 0.004, 0.01, 0.037])
def test_a_command_moves_the_hand_after_the_latency(table, latency):
    robot = robot_on(table, latency=latency)
    velocity = 0.05
    for k in range(1, 31):
        sensed = robot.step(translation_twist([velocity, 0, 0]))
        expected = velocity * max(k * 0.01 - latency, 0.0)
        assert sensed.T_world_hand[0, 3] == pytest.approx(expected, abs=1e-12)
        assert sensed.time == pytest.approx(0.01 * k)


def test_too_fast_commands_are_slowed_as_a_whole(table):
    robot = robot_on(table, latency=0.0, max_speed=0.1, max_turn=1.0)
    sensed = robot.step(np.array([0.3, 0.0, 0.0, 0.0, 0.0, 1.5]))
    assert sensed.T_world_hand[0, 3] == pytest.approx(0.1 * 0.01, rel=1e-4)
    turned = SO3.log(DOWN[:3, :3].T @ sensed.T_world_hand[:3, :3])
    np.testing.assert_allclose(turned, [0, 0, 0.5 * 0.01], atol=1e-12)


@pytest.mark.parametrize("twist", [np.full(6, np.nan), np.array([np.inf, 0, 0, 0, 0, 0])])
def test_commands_must_be_finite(table, twist):
    with pytest.raises(InputError, match="twist: expected six finite numbers"):
        robot_on(table).step(twist)


def test_one_seed_one_run(table):
    runs = [
        [robot.step(translation_twist([0.01, 0, 0])).ranges for _ in range(20)]
        for robot in (robot_on(table), robot_on(table))
    ]
    np.testing.assert_array_equal(runs[0], runs[1])
    other = robot_on(table, seed=1)
    assert (other.step(translation_twist([0.01, 0, 0])).ranges[:2] != runs[0][0][:2]).all()


def test_states(table):
    robot = robot_on(table)
    assert list(robot.sensed.states) == [HIT, HIT, FREE, FREE, FREE, FREE]
    low = robot_on(table, T=SE3.from_parts(DOWN[:3, :3], np.array([0, 0, 0.101])))
    assert list(low.sensed.states[:2]) == [NEAR, NEAR]
    tilted = SE3.from_parts(DOWN[:3, :3] @ SO3.exp([0, 1.32, 0]), np.array([0, 0, 0.06]))
    assert LOST in robot_on(table, T=tilted).sensed.states


def test_readings_vary_with_the_variance_of_the_model(table):
    """Over units: bias, scale and mounting; from reading to reading: noise and the place in the cone."""
    hand = gripper()
    T = SE3.from_parts(DOWN[:3, :3] @ SO3.exp([0.3, 0.2, 0]), np.array([0, 0, 0.15]))
    squares, n = 0.0, 400
    for seed in range(n):
        sensed = robot_on(table, T=T, seed=seed).sensed
        readings = Readings.from_columns(
            ranges=sensed.ranges[:2],
            sensors=[s.name for s in hand.rig.sensors[:2]],
            Ts_world_hand=np.repeat(sensed.T_world_hand[None], 2, axis=0),
        )
        measured = measure(readings, rig=hand.rig)
        z = measured.points[:, 2]
        S = measured.joint_cov()[2::3, 2::3]
        squares += z @ np.linalg.solve(S, z)
    low, high = chi2.ppf([0.0005, 0.9995], 2 * n)
    assert low < squares < high


@pytest.mark.parametrize("height", [0.03, 0.1])
def test_a_ray_of_the_cone_counts_along_the_beam(table, height):
    """Else every range would be long by a quarter of the squared half angle: 0.2 mm at 100 mm."""
    robot, n = robot_on(table, T=SE3.from_parts(DOWN[:3, :3], np.array([0, 0, 0.1 + height]))), 6000
    ranges = np.array([robot.step(np.zeros(6)).ranges[:2] for _ in range(n)])
    beams = robot.truth[-1] @ robot._units.T_hand_sensors[:2]
    true = beams[:, 2, 3] / -beams[:, 2, 2]
    expected = true * (1 + robot._units.scale[:2]) + robot._units.bias[:2]
    assert (np.abs(ranges.mean(axis=0) - expected) < 3.3 * ranges.std(axis=0) / np.sqrt(n)).all()


def test_a_filled_cone_reads_the_middle_of_its_spot(table):
    robot = robot_on(table, cone=64)
    true = robot.truth[-1][2, 3] - 0.1
    errors = error_model(gripper().rig)
    tolerance = 5 * np.sqrt(
        errors.law.sigma(np.full(6, true)) ** 2 + errors.bias_sd**2 + errors.cov_unit[:, 6, 6] * true**2
    )
    assert (np.abs(robot.sensed.ranges[:2] - true) < tolerance[:2]).all()
    beside = SE3.from_parts(DOWN[:3, :3], np.array([0.53, 0, 0.15]))
    assert robot_on(table, T=beside, cone=64).sensed.states[0] == FREE


def test_the_robots_errors(table):
    preset = robot_preset("calibrated_small")
    robots = [robot_on(table, seed=s, robot=preset) for s in range(200)]
    off = np.array([SE3.log(SE3.inverse(r.sensed.T_world_hand) @ r.truth[-1]) for r in robots])
    expected = 3 * (preset.pos_abs_std**2 + preset.pos_repeat_std**2 + (0.15 * preset.rot_abs_std) ** 2 * 2 / 3)
    assert np.sum(off[:, :3] ** 2, axis=1).mean() == pytest.approx(expected, rel=0.35)
    assert SE3.log(SE3.inverse(DOWN) @ robots[0].truth[0])[:3] == pytest.approx(0, abs=6 * preset.pos_repeat_std)


def test_clearance_of_the_whole_hand(table):
    hand = gripper()
    turned = SE3.from_parts(DOWN[:3, :3] @ SO3.exp([0, np.pi / 2, 0]), np.array([0, 0, 0.05]))
    poses = np.stack([DOWN, turned])
    np.testing.assert_allclose(clearances(table, hand.body, poses), [0.05, 0.05 - hand.body.radii.max()], atol=1e-12)
    wall = Scene.of([box("table", [-0.5, -0.5, -0.05], [0.5, 0.5, 0]), box("wall", [0.04, -1, 0], [0.1, 1, 1])])
    assert clearances(wall, hand.body, DOWN) == pytest.approx(0.01)


def test_scenes():
    cube = box("cube", [0, 0, 0], [1, 1, 1])
    scene = Scene.of([cube, Solid.at("moved", cube.vertices, cube.triangles, SE3.from_parts(np.eye(3), [3, 0, 0]))])
    hits = scene.surface.cast(np.array([[-1, 0.5, 0.5], [2, 0.5, 0.5]]), np.array([1.0, 0, 0]))
    np.testing.assert_allclose(hits.distances, 1, atol=1e-12)
    assert list(scene.owner[hits.triangles]) == [0, 1]
    outward = scene.surface.normals
    middles = scene.surface.vertices[scene.surface.triangles].mean(axis=1) - [0.5, 0.5, 0.5]
    assert (np.sum(outward[:12] * middles[:12], axis=1) > 0).all()
    with pytest.raises(InputError, match="expected solids with unique names"):
        Scene.of([cube, cube])
    with pytest.raises(InputError, match="expected a low and a high corner"):
        box("flat", [0, 0, 0], [1, 1, 0])


@pytest.mark.parametrize("values", [{"period": 0.0}, {"max_speed": -1.0}, {"latency": -0.1}, {"cone": -1}])
def test_cells_that_are_none(values):
    with pytest.raises(InputError):
        Cell(**values)


def test_the_simulator_imports_no_estimator():
    code = (
        "import sys, tanteo.hand, tanteo.hand;"
        "print([m for m in sys.modules if m.split('.')[1:2] and m.split('.')[0] == 'tanteo' and m.split('.')[1] in "
        "('fitting', 'localization', 'answers', 'matching', 'active', 'constraints', 'acquisition', 'parts')])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"
