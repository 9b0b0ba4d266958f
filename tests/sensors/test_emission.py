"""What simulated devices say against the model that measure assumes: chi-square for every preset, NEES for a rig."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.sensors import Readings, Rig, RigSensor, error_model, measure
from tanteo.sensors.emission import Status, draw_base, draw_touch_bias, draw_units, emit, emit_touches, reported_poses
from tanteo.sensors.noise import draw_aims
from tanteo.sensors.presets import robot_preset, robot_presets, sensor_preset, sensor_presets

RANGING = [p for p in sensor_presets().values() if not p.is_contact]
TOUCHING = [p for p in sensor_presets().values() if p.is_contact]
name = lambda p: p.name  # noqa: E731


def inside(total, dof):
    low, high = chi2.ppf([0.0005, 0.9995], dof)
    return low < total < high


def by_share(preset, share):
    return preset.min_range + share * (preset.max_range - preset.min_range)


@pytest.mark.parametrize("preset", RANGING, ids=name)
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_variance_of_readings_is_the_model_s(preset, share):
    """Noise from reading to reading, and the spread of unit means, each in its chi-square interval."""
    rng, n_units, n = np.random.default_rng(1), 400, 50
    model = error_model(preset)
    # limits out of the way: this is about the spread
    open_model = type(model)(**{f: getattr(model, f) for f in model.__slots__} | {"min_range": [-9], "max_range": [99]})
    d = by_share(preset, share)
    units = draw_units(rng, open_model, (n_units,))
    r, status = emit(rng, open_model, units, np.full((n, n_units, 1), d))
    assert (status == Status.OK).all()
    sigma2 = preset.law.sigma(d) ** 2
    means = r.mean(axis=0)
    assert inside(np.sum((r - means) ** 2) / sigma2, (n - 1) * n_units)
    shared = preset.bias_std**2 + (preset.bias_prop_std * d) ** 2
    assert inside(np.sum((means - d) ** 2) / (shared + sigma2 / n), n_units)


@pytest.mark.parametrize("preset", TOUCHING, ids=name)
def test_variance_of_touches_is_the_model_s(preset):
    rng, n_units, n = np.random.default_rng(2), 400, 50
    bias = draw_touch_bias(rng, preset, (n_units,))
    q, direction = np.array([0.1, 0.2, 0.3]), SO3.exp(np.array([0.3, 0.1, 0.2]))[:, 0]
    p, status = emit_touches(rng, preset, bias, np.broadcast_to(q, (n, n_units, 3)), direction)
    assert (status == Status.OK).all()
    along = (p - q) @ direction
    assert inside(np.sum((p - p.mean(axis=0)) ** 2) / preset.sigma_const**2, 3 * (n - 1) * n_units)
    spread = preset.bias_std**2 + preset.sigma_const**2 / n
    assert inside(np.sum(along.mean(axis=0) ** 2) / spread, n_units)
    slipped, status = emit_touches(rng, preset, bias[0], q, direction, np.array(preset.max_incidence + 0.01))
    assert status == Status.OBLIQUE
    assert np.isnan(slipped).all()


@pytest.mark.parametrize("robot", robot_presets().values(), ids=name)
def test_reported_poses_have_the_robot_s_errors(robot):
    rng, runs, n = np.random.default_rng(3), 300, 5
    Ts = SE3.exp(rng.normal(size=(n, 6)))
    base = draw_base(rng, robot, (runs, 1))
    reported = reported_poses(rng, robot, base, Ts)
    assert reported.shape == (runs, n, 4, 4)
    repeat = SE3.log(SE3.inverse(reported) @ SE3.inverse(SE3.exp(base)) @ Ts)
    sds = np.repeat([robot.pos_repeat_std, robot.rot_repeat_std], 3)
    assert inside(np.sum((repeat / sds) ** 2), 6 * n * runs)
    assert inside(np.sum((base / np.repeat([robot.pos_abs_std, robot.rot_abs_std], 3)) ** 2), 6 * runs)


def skewed_rig():
    mount = SE3.adjoint(SE3.exp(np.array([0.1, 0, 0.2, 0.3, 0.4, 0])))
    mount = mount @ np.diag(np.repeat([5e-4, 5e-3], 3) ** 2) @ mount.T
    common = {"beam_half_angle": 0.03, "max_range": 5.0, "bias_sd": 1e-3, "cov_mount": mount, "scale_sd": 0.004}
    T = SE3.exp(np.array([[0.01, 0.02, 0.05, 0.1, -0.2, 0.3], [0, -0.03, 0.04, 0.2, 0, 0]]))
    zones = {"unit": "b", "T_hand_unit": T[1], "preset": sensor_preset("vl53l5cx_zone8x8"), "sd": np.nan}
    return Rig(
        (
            RigSensor("a", T[0], None, sd=1e-3, sd_prop=0.004, bias=0.02, scale=0.05, **common),
            RigSensor("b1", T[1] @ SE3.exp(np.array([0, 0, 0, 0.1, 0, 0])), axis_cosine=0.9, **zones, **common),
            RigSensor("b2", T[1] @ SE3.exp(np.array([0, 0.01, 0, 0, -0.2, 0])), axis_cosine=0.95, **zones, **common),
        )
    )


@pytest.mark.parametrize(("runs", "off"), [(300, 0.055), pytest.param(1000, 0.03, marks=pytest.mark.slow)])
def test_measure_assumes_what_emit_draws(runs, off):
    """Everything at once, on an oblique plane: the NEES of all the points together is chi-square."""
    rng, n = np.random.default_rng(4), 3
    rig, robot = skewed_rig(), robot_preset("xarm")
    model = error_model(rig)
    units = draw_units(rng, model, (runs, 1))
    base = draw_base(rng, robot, (runs, 1))
    reported = SE3.exp(np.random.default_rng(8).normal(size=(n, 6)) * [0.1, 0.1, 0.1, 0.15, 0.15, 0.15])
    repeat = SE3.exp(np.repeat([robot.pos_repeat_std, robot.rot_repeat_std], 3) * rng.normal(size=(runs, n, 6)))
    Ts = (SE3.exp(base) @ reported @ repeat)[:, :, None] @ units.T_hand_sensors
    aims = SE3.apply(Ts[..., :3, :3], draw_aims(rng, model.beam_half_angle, (runs, n)))
    normal, offset = SO3.exp(np.array([0.2, 0.1, 0]))[:, 2], 0.6
    d = (offset - Ts[..., :3, 3] @ normal) / (aims @ normal)
    hits = Ts[..., :3, 3] + d[..., None] * aims
    r, status = emit(rng, model, units, d, np.arccos(aims @ normal))
    assert (status == Status.OK).all()

    def measured(ranges):
        columns = {"ranges": ranges.ravel(), "sensors": list(model.names) * n}
        return measure(
            Readings.from_columns(**columns, Ts_world_hand=np.repeat(reported, len(model), axis=0)),
            rig=rig,
            robot=robot,
        )

    nees = []
    for i in range(runs):
        m = measured(r[i])
        e = (hits[i].reshape(-1, 3) - m.points).ravel()
        nees.append(e @ np.linalg.solve(m.joint_cov(), e))
    # across the beam the errors are a disc, not a normal: the mean is what a covariance promises
    assert np.mean(nees) == pytest.approx(9 * n, rel=off)


@pytest.mark.parametrize("preset", RANGING, ids=name)
def test_a_cone_on_a_flat_surface_has_the_spread_of_the_model(preset):
    """Straight on not at all, however wide; at 10 degrees by half the half angle times the tangent."""
    rng, n = np.random.default_rng(10), 20_000
    model = error_model(preset)
    d, units = 0.5 * (preset.min_range + preset.max_range), draw_units(rng, model)
    calm = type(units)(0 * units.bias, 0 * units.scale, units.T_hand_sensors)
    aims = draw_aims(rng, model.beam_half_angle, (n,))
    sigma = float(preset.law.sigma(d))
    r, _ = emit(rng, model, calm, d / aims[..., 2], 0.0, aims)
    assert inside(np.nansum((r - d) ** 2) / sigma**2, np.isfinite(r).sum())
    beta = np.deg2rad(10)
    slanted = d * np.cos(beta) / (aims @ [np.sin(beta), 0, np.cos(beta)])
    r, _ = emit(rng, model, calm, slanted, beta, aims)
    expected = np.hypot(sigma, 0.5 * d * preset.beam_half_angle * np.tan(beta))
    # second order: half the square of the half angle times the tangent
    assert np.nanstd(r) / expected == pytest.approx(1, abs=0.02 + preset.beam_half_angle**2 / 2)


def test_zones_of_one_device_share_bias_scale_and_mounting():
    rng = np.random.default_rng(11)
    rig = skewed_rig()
    model = error_model(rig)
    units = draw_units(rng, model, (50,))
    np.testing.assert_allclose(units.bias[:, 1], units.bias[:, 2])
    np.testing.assert_allclose(units.scale[:, 1], units.scale[:, 2])
    assert np.abs(units.bias[:, 0] - 0.02 - units.bias[:, 1]).min() > 0
    one, two = (SE3.inverse(s.T_hand_sensor) @ s.T_hand_unit for s in rig.sensors[1:])
    np.testing.assert_allclose(units.T_hand_sensors[:, 1] @ one, units.T_hand_sensors[:, 2] @ two, atol=1e-14)
    m = measure(
        Readings.from_columns(ranges=[0.5] * 3, sensors=["a", "b1", "b2"], Ts_world_hand=np.stack([np.eye(4)] * 3)),
        rig=rig,
    )
    assert [e.name for e in m.shared] == [
        f"{what} of {unit}" for unit in "ab" for what in ("bias", "scale", "mounting")
    ]
    for error, J in zip(m.shared, m.jacobians, strict=True):
        touched = np.abs(J).max(axis=(1, 2)) > 0
        assert touched.tolist() == ([True, False, False] if error.name.endswith("a") else [False, True, True])


def test_beams_of_one_device_agree_on_it():
    one = skewed_rig().sensors[1]
    other = replace(one, name="c", bias_sd=9.0)
    with pytest.raises(InputError, match="unit 'b': expected one pose, mounting error"):
        Rig((one, other))


def test_reported_poses_undo_to_the_measured_model():
    """T_true = exp(base) T_reported exp(repeat), to the last digit, when the repeatability is nothing."""
    rng = np.random.default_rng(5)
    still = type(robot_preset("xarm"))("still", 0.0, 1e-3, 0.0, 2e-3, "A", "test")
    Ts, base = SE3.exp(rng.normal(size=(4, 6))), draw_base(rng, still)
    np.testing.assert_allclose(SE3.exp(base) @ reported_poses(rng, still, base, Ts), Ts, atol=1e-14)


def test_statuses():
    preset = sensor_preset("sharp_gp2y0a41sk0f")
    model = error_model(preset)
    rng = np.random.default_rng(6)
    still = type(draw_units(rng, model))(np.zeros(1), np.zeros(1), np.eye(4)[None])
    d = np.array([[0.2], [0.02], [0.9], [np.inf], [np.nan], [0.2], [0.02]])
    beta = np.array([[0.0], [0], [0], [0], [0], [0.9], [0.9]])
    r, status = emit(rng, model, still, d, beta)
    expected = [Status.OK, Status.NEAR, Status.NONE, Status.NONE, Status.NONE, Status.OBLIQUE, Status.NEAR]
    assert status[:, 0].tolist() == expected
    assert np.isfinite(r[:, 0]).tolist() == [True] + [False] * 6
    assert preset.min_range <= r[0, 0] <= preset.max_range


def test_what_is_reported_is_never_outside_the_limits():
    """Or measure would refuse it."""
    rng, preset = np.random.default_rng(7), sensor_preset("vl53l5cx_zone8x8")
    model = error_model(preset)
    d = np.concatenate([np.linspace(0.015, 0.03, 500), np.linspace(3.9, 4.1, 500)])
    r, status = emit(rng, model, draw_units(rng, model), d[:, None])
    good = r[status == Status.OK]
    assert ((good >= preset.min_range) & (good <= preset.max_range)).all()
    assert {Status.OK, Status.NEAR, Status.NONE} <= set(status.ravel())


def test_a_seed_repeats_and_statuses_do_not_shift_draws():
    model = error_model([sensor_preset("vl53l4cd"), sensor_preset("hc_sr04")])
    runs = []
    for first in (0.3, np.inf):
        rng = np.random.default_rng(8)
        units = draw_units(rng, model)
        emit(rng, model, units, np.array([first, 0.5]))
        runs.append(emit(rng, model, units, np.array([0.3, 0.5]))[0])
    np.testing.assert_array_equal(*runs)


def test_aims_fill_the_disc_evenly():
    rng, gamma = np.random.default_rng(9), 0.2
    a = draw_aims(rng, gamma, (20_000,))
    np.testing.assert_allclose(np.linalg.norm(a, axis=-1), 1)
    u, v = a[:, 0] / a[:, 2], a[:, 1] / a[:, 2]
    assert kstest((u * u + v * v) / np.tan(gamma) ** 2, "uniform").pvalue > 0.001
    assert kstest(np.arctan2(v, u) / (2 * np.pi) + 0.5, "uniform").pvalue > 0.001


def test_contact_and_range_are_not_mixed_up():
    with pytest.raises(InputError, match="which touches"):
        error_model(TOUCHING[0])
    with pytest.raises(InputError, match="got none"):
        error_model([])
    with pytest.raises(InputError, match="which gives ranges"):
        emit_touches(np.random.default_rng(), RANGING[0], 0.0, np.zeros(3), np.eye(3)[0])
