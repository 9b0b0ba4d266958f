"""Readings to measurements: surface points, covariances, and what the readings share, against Monte Carlo."""

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.errors import InputError, ReadingsError
from tanteo.geometry import SE3
from tanteo.sensors import Readings, Rig, RigSensor, measure
from tanteo.sensors.presets import robot_preset, sensor_preset

N = 6


def hands(rng, n=N):
    return SE3.exp(rng.normal(size=(n, 6)) * [0.3, 0.3, 0.3, 1, 1, 1])


def touches(rng, **extra):
    return Readings.from_columns(rng.normal(size=(N, 3)), directions=rng.normal(size=(N, 3)), **extra)


def rig_sensor(name="eye", **changes):
    values = {
        "name": name, "T_hand_sensor": SE3.exp(np.array([0.01, 0.02, 0.05, 0.1, -0.2, 0.3])), "preset": None,
        "sd": 1e-3, "beam_half_angle": 0.05, "max_range": 1.0, "bias_sd": 0.0, "cov_mount": np.zeros((6, 6)),
    }  # fmt: skip
    return RigSensor(**(values | changes))


def test_plain_touches_are_balls_of_their_sd():
    r = Readings.from_columns(np.zeros((2, 3)), sds=[1e-3, np.nan])
    m = measure(r, sd=2e-3)
    np.testing.assert_allclose(m.covs, np.array([1e-6, 4e-6])[:, None, None] * np.eye(3), rtol=1e-12)
    assert m.shared == ()
    assert m.stacked()[0].shape == (2, 3, 0)
    assert m.ids == ("1", "2")


def test_column_beats_sd_beats_preset():
    r = Readings.from_columns(np.zeros((2, 3)), sds=[1e-3, np.nan])
    assert measure(r, sensor="touch_probe_hobby", sd=5e-3).covs[1, 0, 0] > 24e-6
    preset = measure(r, sensor="touch_probe_hobby").covs[:, 0, 0] - 0.00002**2
    np.testing.assert_allclose(preset, [1e-6, (8e-6) ** 2], rtol=1e-9)


def test_ball_moves_to_the_surface_only_where_normal_is_known():
    normal = [[0.0, 0, 2.0], [np.nan] * 3]
    r = Readings.from_columns(
        np.full((2, 3), 0.1), normals=normal, radii=[0.002, 0.002], sds=[1e-4, 1e-4], normal_sds=[0.1, np.nan]
    )
    m = measure(r)
    np.testing.assert_allclose(m.points, [[0.1, 0.1, 0.098], [0.1, 0.1, 0.1]])
    np.testing.assert_allclose(m.radii, [0, 0.002])
    np.testing.assert_allclose(np.diag(m.covs[0]), [1e-8 + (2e-4) ** 2] * 2 + [1e-8])
    np.testing.assert_allclose(np.diag(m.covs[1]), 1e-8)


def test_range_reading_is_narrow_along_and_wide_across_by_cone():
    beam = np.array([[0.0, 0, -1.0]])
    r = Readings.from_columns(np.zeros((1, 3)), directions=beam, ranges=[0.2])
    m = measure(r, sensor="hc_sr04")
    across = 0.5 * 0.2 * np.deg2rad(20)
    np.testing.assert_allclose(np.diag(m.covs[0]), [across**2, across**2, 0.003**2 + 0.0006**2], rtol=1e-9)
    assert [e.name for e in m.shared] == ["bias of hc_sr04", "scale of hc_sr04"]
    np.testing.assert_allclose(m.jacobians[0][0, :, 0], beam[0])
    np.testing.assert_allclose(m.jacobians[1][0, :, 0], 0.2 * beam[0])


def test_covariances_are_positive_definite_for_narrowest_beam():
    r = Readings.from_columns(np.zeros((1, 3)), directions=[[1.0, 1, 0]], ranges=[0.03])
    preset = sensor_preset("keyence_il030")
    values = np.linalg.eigvalsh(measure(r, sensor=preset).covs[0])
    assert values.min() > 0
    assert values.max() / values.min() < 1e5


def test_robot_base_is_a_rigid_left_error_of_the_world():
    rng = np.random.default_rng(0)
    r = touches(rng, sds=np.full(N, 1e-4))
    robot = robot_preset("xarm")
    m = measure(r, robot=robot)
    assert [e.name for e in m.shared] == ["robot base"]
    np.testing.assert_allclose(np.sqrt(np.diag(m.shared[0].covariance)), [1e-3] * 3 + [3e-3] * 3)
    h = 1e-6
    for k in range(6):
        moved = SE3.apply(SE3.exp(h * np.eye(6)[k]), r.points) - SE3.apply(SE3.exp(-h * np.eye(6)[k]), r.points)
        np.testing.assert_allclose(m.jacobians[0][:, :, k], moved / (2 * h), atol=1e-9)
    np.testing.assert_allclose(m.covs, (1e-8 + 0.00005**2) * np.tile(np.eye(3), (N, 1, 1)))


def test_robot_turn_acts_on_the_arm_from_hand_to_point():
    r = Readings.from_columns([[0.0, 0, 0.5]], sds=[1e-9], Ts_world_hand=np.eye(4)[None])
    np.testing.assert_allclose(
        np.diag(measure(r, robot="xarm").covs[0]), 0.00005**2 + np.array([1e-4, 1e-4, 0]) ** 2, rtol=1e-6
    )


def test_tip_offset_turns_with_the_hand():
    rng = np.random.default_rng(1)
    Ts = hands(rng)
    r = touches(rng, sds=np.full(N, 1e-4), Ts_world_hand=Ts)
    m = measure(r, tip_sd=[1.5e-3, 1.5e-3, 0.3e-3])
    np.testing.assert_allclose(m.jacobians[0], Ts[:, :3, :3])
    np.testing.assert_allclose(np.diag(m.shared[0].covariance), np.array([1.5e-3, 1.5e-3, 0.3e-3]) ** 2)


def test_bias_of_a_touch_without_direction_widens_it_instead():
    m = measure(Readings.from_columns(np.zeros((1, 3))), sensor="guarded_move_motor_current")
    assert m.shared == ()
    np.testing.assert_allclose(m.covs[0], (0.0005**2 + 0.002**2) * np.eye(3))


def test_bias_of_touch_acts_against_normal_when_that_is_known():
    m = measure(Readings.from_columns(np.zeros((1, 3)), normals=[[0, 0, 3.0]]), sensor="ball_tip_on_cobot")
    np.testing.assert_allclose(m.jacobians[0][0, :, 0], [0, 0, -1])


def test_joint_covariance_against_monte_carlo():
    """Everything at once: noise, repeatability, base, tip, bias: the NEES of all points together is chi-square."""
    rng = np.random.default_rng(4)
    Ts = hands(rng)
    r = touches(rng, Ts_world_hand=Ts)
    robot, probe = robot_preset("xarm"), sensor_preset("ball_tip_on_cobot")
    tip = np.array([1.5e-3, 1.5e-3, 0.3e-3])
    m = measure(r, sensor=probe, robot=robot, tip_sd=tip)
    runs = 4000
    local = SE3.apply(SE3.inverse(Ts), r.points)
    local = local + (tip * rng.normal(size=(runs, 1, 3)))
    repeat = np.repeat([robot.pos_repeat_std, robot.rot_repeat_std], 3)
    p = SE3.apply(Ts @ SE3.exp(repeat * rng.normal(size=(runs, N, 6))), local)
    p = p + probe.sigma_const * rng.normal(size=p.shape) + probe.bias_std * rng.normal(size=(runs, 1, 1)) * r.directions
    base = np.repeat([robot.pos_abs_std, robot.rot_abs_std], 3)
    p = SE3.apply(SE3.exp(base * rng.normal(size=(runs, 1, 6))), p)
    e = (p - m.points).reshape(runs, -1)
    nees = np.einsum("ri,ij,rj->r", e, np.linalg.inv(m.joint_cov()), e)
    low, high = chi2.ppf([0.0005, 0.9995], 3 * N * runs)
    assert low < nees.sum() < high
    alone = np.einsum("rni,nij,rnj->rn", e.reshape(p.shape), np.linalg.inv(m.total_covs()), e.reshape(p.shape))
    assert 2.7 < alone.mean() < 3.3
    J, C = m.stacked()
    np.testing.assert_allclose(m.total_covs() - m.covs, J @ C @ np.swapaxes(J, 1, 2), rtol=1e-9, atol=1e-18)


def test_rig_ranges_against_monte_carlo_and_geometry():
    rng = np.random.default_rng(5)
    Ts, ranges = hands(rng), rng.uniform(0.2, 0.6, N)
    mount = np.diag(np.repeat([1e-3, 0.01], 3) ** 2)
    eye = rig_sensor(bias_sd=2e-3, cov_mount=mount)
    r = Readings.from_columns(ranges=ranges, sensors=["eye"] * N, Ts_world_hand=Ts)
    m = measure(r, rig=Rig((eye,)))
    T = Ts @ eye.T_hand_sensor
    np.testing.assert_allclose(m.points, T[:, :3, 3] + ranges[:, None] * T[:, :3, 2], atol=1e-15)
    assert [e.name for e in m.shared] == ["bias of eye", "mounting of eye"]
    runs = 4000
    wobble = SE3.exp(np.sqrt(np.diag(mount)) * rng.normal(size=(runs, 1, 6)))
    d = ranges + 1e-3 * rng.normal(size=(runs, N)) + 2e-3 * rng.normal(size=(runs, 1))
    turn, off = rng.uniform(0, 2 * np.pi, (runs, N)), 0.05 * np.sqrt(rng.uniform(size=(runs, N)))
    ray = np.stack([d * off * np.cos(turn), d * off * np.sin(turn), d], axis=-1)
    e = (SE3.apply(T @ wobble, ray) - m.points).reshape(runs, -1)
    nees = np.einsum("ri,ij,rj->r", e, np.linalg.inv(m.joint_cov()), e).mean()
    assert 0.97 < nees / (3 * N) < 1.03


def test_distance_along_the_axis_becomes_range_along_the_beam():
    eye = rig_sensor(axis_cosine=0.8, T_hand_sensor=np.eye(4))
    r = Readings.from_columns(ranges=[0.4], sensors=["eye"], Ts_world_hand=np.eye(4)[None])
    np.testing.assert_allclose(measure(r, rig=Rig((eye,))).points, [[0, 0, 0.5]])


def test_free_beams_are_carried_not_turned_into_points():
    r = Readings.from_columns(
        [[0.0, 0, 0], [0, 0, 1], [np.nan] * 3], directions=[[1.0, 0, 0], [0, 0, -3], [np.nan] * 3],
        is_free=[False, True, True], max_ranges=[np.nan, 0.7, np.nan], sds=[1e-3, np.nan, np.nan],
        sensors=["", "", "eye"], Ts_world_hand=np.stack([np.eye(4)] * 3),
    )  # fmt: skip
    m = measure(r, rig=Rig((rig_sensor(T_hand_sensor=np.eye(4)),)))
    assert (m.ids, m.free.ids) == (("1",), ("2", "3"))
    np.testing.assert_allclose(m.free.origins, [[0, 0, 1], [0, 0, 0]])
    np.testing.assert_allclose(m.free.directions, [[0, 0, -1], [0, 0, 1]])
    np.testing.assert_allclose(m.free.lengths, [0.7, 1.0])
    np.testing.assert_allclose(m.free.half_angles, [0, 0.05])
    assert r.kinds == ("point", "free", "free")


ORIGIN = np.zeros((1, 3))


@pytest.mark.parametrize(
    ("columns", "options", "message"),
    [
        ({"points": ORIGIN}, {}, "sd of reading '1': expected one standard deviation"),
        ({"points": ORIGIN}, {"sensor": "hc_sr04"}, "depends on the range and there is none"),
        ({"points": ORIGIN}, {}, "in Python sd=0.3e-3 or sds, in a session Sensing(sd=0.3e-3)"),
        ({"points": ORIGIN}, {"sd": -1.0}, "sd: expected one standard deviation from 1e-09 to 1e+06 m, got -1"),
        ({"points": ORIGIN}, {"sd": np.nan}, "sd: expected one standard deviation from 1e-09 to 1e+06 m, got nan"),
        ({"points": ORIGIN}, {"sd": 1e-3, "tip_sd": [1e-3] * 3}, "hand_x_mm"),
        ({"points": ORIGIN}, {"sd": 1e-3, "tip_sd": [1e-3, -1, 0]}, "expected three lengths of zero or more"),
        ({"points": ORIGIN}, {"sd": 1e-3, "tip_sd": [0, 0]}, "expected three lengths"),
        ({"points": ORIGIN}, {"sensor": "vl53l0"}, "Did you mean 'vl53l0x'"),
        ({"points": ORIGIN}, {"sd": 1e-3, "robot": "xam"}, "Did you mean 'xarm'"),
        ({"points": ORIGIN, "ranges": [5.0]}, {"sensor": "vl53l0x"}, "expected 0.03 to 1.2 m from 'vl53l0x', got 5 m"),
        (
            {"points": ORIGIN, "ranges": [0.01]},
            {"sensor": "vl53l0x"},
            "got 0.01 m. Remove the row",
        ),
        (
            {"ranges": [0.5], "sensors": ["eye"], "Ts_world_hand": np.eye(4)[None]},
            {"sd": 1e-3},
            "sits on the hand, got no rig",
        ),
        (
            {"ranges": [0.5], "sensors": ["eey"], "Ts_world_hand": np.eye(4)[None]},
            {"rig": Rig((rig_sensor(),))},
            "Did you mean 'eye'",
        ),
    ],
)
def test_refusals(columns, options, message):
    with pytest.raises(InputError) as caught:
        measure(Readings.from_columns(**columns), **options)
    assert message in str(caught.value)


def test_an_exact_tip_adds_no_state_and_needs_no_hand():
    readings = Readings.from_columns(points=ORIGIN)
    exact, plain = measure(readings, sd=1e-3, tip_sd=[0, 0, 0]), measure(readings, sd=1e-3)
    assert exact.shared == ()
    np.testing.assert_array_equal(exact.covs, plain.covs)


def test_a_sensor_name_may_be_a_preset_without_a_rig():
    r = Readings.from_columns(ORIGIN, sensors=["touch_probe_hobby"])
    assert measure(r).covs[0, 0, 0] == pytest.approx(8e-6**2 + 2e-5**2)


def test_inputs_are_not_changed_and_outputs_are_read_only():
    points = np.ones((2, 3))
    r = Readings.from_columns(points, sds=[1e-3, 1e-3])
    points[:] = 7
    assert (r.points[:] == 1).all()
    m = measure(r, robot="xarm")
    for array in (
        r.points.values,
        r.points.given,
        r.sds[:],
        m.points,
        m.covs,
        m.jacobians[0],
        m.shared[0].covariance,
        m.rows,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_a_spread_across_the_beam_replaces_that_of_the_cone():
    rng = np.random.default_rng(3)
    rig = Rig((rig_sensor(),))
    columns = {"ranges": np.full(2, 0.04), "sensors": ["eye"] * 2, "Ts_world_hand": hands(rng, 2)}
    m = measure(Readings.from_columns(across_sds=[3e-4, np.nan], **columns), rig=rig)
    for cov, beam, across in zip(m.covs, m.directions, (3e-4, 0.5 * 0.04 * 0.05), strict=True):
        expected = across**2 * (np.eye(3) - np.outer(beam, beam)) + 1e-6 * np.outer(beam, beam)
        np.testing.assert_allclose(cov, expected, rtol=1e-9, atol=1e-16)


def test_a_spread_across_needs_to_be_positive():
    with pytest.raises(ReadingsError, match="across_sds of reading '1'"):
        Readings.from_columns(np.zeros((1, 3)), sds=[1e-3], across_sds=[-1e-3])
