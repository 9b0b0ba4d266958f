"""Calibration against simulation: NEES of beams, planes and angles, noise laws, and what a rig of it promises."""

import numpy as np
import pytest
from scipy.stats import chi2

from plane_scenes import PLACE, REPEAT, joined, random_hands, ranges_to, simulated_log
from tanteo.geometry import SE3, SO3
from tanteo.sensors import Readings, calibrate, measure
from tanteo.sensors.calibration import calibrated_rig, plane_angle
from tanteo.sensors.presets import robot_preset

RUNS, STATIONS, FRESH = 24, 25, 8


def mean_in_interval(values, dof, slack=1.0):
    """Check that the mean of chi-square values is in its 99.9 % interval; ``slack`` widens it."""
    low, high = chi2.ppf([0.0005, 0.9995], dof * len(values)) / len(values)
    return low < np.mean(values) / slack < high


def errors_of(beam, T_true, scale, slant):
    """Return the errors in the fitted beam's frame, without the rotation about the beam."""
    R = beam.T_hand_beam[:3, :3]
    origin = R.T @ (T_true[:3, 3] - beam.T_hand_beam[:3, 3])
    aim = R.T @ T_true[:3, 2]
    # the origin may slide along the beam: both are compared at the true beam's own offset
    return np.r_[origin, -aim[1], aim[0], scale - beam.scale, slant - beam.slant]


@pytest.fixture(scope="module")
def runs():
    """Two planes at right angles, one sensor, nothing known before; and fresh readings measured by the rig."""
    out = {
        "beam": [],
        "plane": [],
        "angle": [],
        "repeat": [],
        "variance": [],
        "fresh": [],
        "outliers": 0,
        "status": set(),
    }
    for k in range(RUNS):
        rng = np.random.default_rng(100 + k)
        floor = SE3.exp(rng.normal(size=6) * [0.3, 0.3, 0.3, 2, 2, 2])
        wall = floor @ SE3.from_parts(SO3.exp(np.array([np.pi / 2, 0, 0])), np.array([0.0, 0.3, 0]))
        T = SE3.exp(np.r_[0.05 * rng.normal(size=3), rng.normal(size=3) * [0.3, 0.3, 1]])
        scale, slant = 0.01 * rng.normal(), 0.01 * rng.normal()
        hands = [random_hands(rng, STATIONS, plane, T) for plane in (floor, wall)]
        log = joined(
            simulated_log(rng, T, floor, hands[0], scale=scale, slant=slant, label="floor"),
            simulated_log(rng, T, wall, hands[1], scale=scale, slant=slant, label="wall"),
        )
        found = calibrate(log)
        beam = found.beams[0]
        e = errors_of(beam, T, scale, slant)
        out["beam"].append(e @ np.linalg.solve(beam.cov, e))
        for fit, plane in zip(found.planes, (floor, wall), strict=True):
            n = fit.T_world_plane[:3, :3].T @ plane[:3, 2]
            assert n[2] > 0.9  # towards the sensors
            q = np.array([-n[1], n[0], (plane[:3, 3] - fit.T_world_plane[:3, 3]) @ plane[:3, 2]])
            out["plane"].append(q @ np.linalg.solve(fit.cov, q))
        angle, sd = plane_angle(found, "floor", found, "wall")
        out["angle"].append(((angle - np.pi / 2) / sd) ** 2)
        e = np.array([float(beam.repeats.law.const), float(beam.repeats.law.prop)]) ** 2 - np.square(REPEAT)
        out["repeat"].append(e @ np.linalg.solve(beam.repeats.cov, e))
        d, tan2 = found.ranges, np.tan(found.incidences) ** 2
        true = PLACE[0] ** 2 + (PLACE[1] * d) ** 2 * 1 + (PLACE[2] * d) ** 2 * tan2
        out["variance"].append(np.mean((found.sds**2 - (REPEAT[0] ** 2 + (REPEAT[1] * d) ** 2) / 4) / true))
        out["fresh"].append(fresh_nees(rng, found, T, scale, slant, floor))
        out["outliers"] += len(found.outliers)
        out["status"].add(found.status)
    return out


def fresh_nees(rng, found, T, scale, slant, plane):
    """Distances of fresh points from the true plane, against the covariance that the calibrated rig promises."""
    hands = random_hands(rng, FRESH, plane, T)
    log = simulated_log(rng, T, plane, hands, scale=scale, slant=slant, repeats=1)
    m = measure(log, rig=calibrated_rig(found))
    e = (m.points - plane[:3, 3]) @ plane[:3, 2]
    N = np.kron(np.eye(FRESH), plane[:3, 2])
    return e @ np.linalg.solve(N @ m.joint_cov() @ N.T, e)


# the noise is estimated from some 37 degrees of freedom, so that chi-squares are F times their number
F = 37 / 35


@pytest.mark.slow
def test_beams_follow_their_covariance(runs):
    assert runs["status"] == {"calibrated"}
    assert mean_in_interval(runs["beam"], 7, F)


@pytest.mark.slow
def test_planes_and_their_angle_follow_their_covariance(runs):
    assert mean_in_interval(runs["plane"], 3, F)
    assert mean_in_interval(runs["angle"], 1, F)


@pytest.mark.slow
def test_noise_of_repeats_is_found_with_its_covariance(runs):
    assert mean_in_interval(runs["repeat"], 2)


@pytest.mark.slow
def test_noise_of_places_is_neither_too_small_nor_too_large(runs):
    """By restricted likelihood: the parameters of the setup do not eat the variance."""
    spread = np.std(runs["variance"]) / np.sqrt(RUNS)
    assert abs(np.mean(runs["variance"]) - 1) < 3.3 * spread
    assert spread < 0.1


@pytest.mark.slow
def test_a_rig_of_it_promises_what_it_keeps(runs):
    """A slant is kept as noise, which is more than it is at most incidences: the promise may be too modest by a bit."""
    mean = np.mean(runs["fresh"]) / FRESH
    low, high = chi2.ppf([0.0005, 0.9995], FRESH * RUNS) / (FRESH * RUNS)
    assert 0.75 * low < mean < F * high


@pytest.mark.slow
def test_good_readings_are_hardly_ever_called_outliers(runs):
    assert runs["outliers"] <= RUNS * 2 * STATIONS // 200


def scene(seed, n=40, **options):
    rng = np.random.default_rng(seed)
    plane = SE3.exp(rng.normal(size=6) * [0.3, 0.3, 0.3, 2, 2, 2])
    T = SE3.exp(np.r_[0.05 * rng.normal(size=3), 0.2 * rng.normal(size=3)])
    return rng, plane, T, random_hands(rng, n, plane, T, **options)


def with_ranges(log, ranges):
    return Readings.from_columns(
        ranges=ranges, sensors=log.sensors, Ts_world_hand=log.Ts_world_hand, features=log.features, kinds=log.kinds,
        ids=log.ids,
    )  # fmt: skip


def test_saturated_readings_are_found_and_named():
    """A device that stops at 450 mm: the places beyond it are named, and the beam is as accurate as without them."""
    rng, plane, T, hands = scene(1, near=0.1, far=0.7)
    log = simulated_log(rng, T, plane, hands, place=(5e-4, 0, 0), repeat=(1e-3, 0))
    ceiling = 0.45
    clipped = with_ranges(log, np.minimum(log.ranges, ceiling))
    found = calibrate(clipped)
    truth = ranges_to(plane, hands @ T)[0] > ceiling + 0.01
    assert truth.sum() >= 8
    named = {s.ids[0].split(".")[0] for s in found.outliers if s.reason == "saturated"}
    assert {f"eye{i + 1}" for i in np.flatnonzero(truth)} <= named
    assert all(s.reason == "saturated" for s in found.outliers)
    assert np.linalg.norm(found.beams[0].T_hand_beam[:2, 3] - T[:2, 3]) < 4e-3
    assert found.planes[0].rms < 1e-3


def test_strays_among_repeats_are_found():
    rng, plane, T, hands = scene(2)
    log = simulated_log(rng, T, plane, hands, repeats=12)
    ranges = np.array(log.ranges)
    ranges[[3, 100, 200]] += [0.04, -0.03, 0.08]
    found = calibrate(with_ranges(log, ranges))
    single = {s.ids[0] for s in found.outliers if s.reason == "unlike its repeats"}
    assert {log.ids[i] for i in (3, 100, 200)} <= single
    assert len(found.outliers) <= 5


def test_two_sensors_share_the_plane():
    rng, plane, T, hands = scene(3, n=30)
    other = T @ SE3.exp(np.array([0.05, 0.02, 0, 0.1, -0.1, 0]))
    log = joined(
        simulated_log(rng, T, plane, hands, name="left"), simulated_log(rng, other, plane, hands, name="right")
    )
    found = calibrate(log)
    assert [b.name for b in found.beams] == ["left", "right"]
    for beam, true in zip(found.beams, (T, other), strict=True):
        e = errors_of(beam, true, 0.0, 0.0)
        assert e @ np.linalg.solve(beam.cov, e) < chi2.ppf(0.999, 7) * 1.2


@pytest.mark.slow
def test_the_robot_s_error_moves_planes_and_not_beams():
    rng, plane, T, hands = scene(4)
    log = simulated_log(rng, T, plane, hands)
    plain, with_robot = calibrate(log), calibrate(log, robot="ur_ros_nominal_dh")
    np.testing.assert_array_equal(plain.beams[0].cov, with_robot.beams[0].cov)
    more = with_robot.planes[0].cov - plain.planes[0].cov
    preset, T, h = robot_preset("ur_ros_nominal_dh"), plain.planes[0].T_world_plane, 1e-6
    # a body error of the world moves the plane: its tilts about x and y and its height, by differences
    local = SE3.log(SE3.inverse(T) @ SE3.exp(h * np.eye(6)) @ T) / h
    J, C = local[:, [3, 4, 2]].T, np.diag(np.repeat([preset.pos_abs_std, preset.rot_abs_std], 3) ** 2)
    np.testing.assert_allclose(more, J @ C @ J.T, rtol=1e-4, atol=1e-9)
    # planes of one run share the robot, planes of two do not
    assert plane_angle(with_robot, "plane", plain, "plane")[1] > 0.005
