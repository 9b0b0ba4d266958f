"""Zones of one device share offset, scale and pose: their number does not average these errors away."""

import numpy as np
import pytest
from scipy.stats import chi2

import tanteo
from plane_scenes import ZONES, zones_log
from tanteo.geometry import SE3
from tanteo.io import read_rig, write_rig
from tanteo.sensors import Readings, calibrate
from tanteo.sensors.calibration import calibrated_rig


@pytest.fixture
def rig_file(tmp_path):
    def of(n):
        path = tmp_path / f"rig{n}.toml"
        path.write_text(ZONES.format(n=n))
        return path

    return of


@pytest.mark.slow
@pytest.mark.parametrize(("n", "seeds"), [(1, 3), *(pytest.param(n, 8, marks=pytest.mark.slow) for n in (1, 3, 5))])
def test_the_plane_s_height_keeps_the_device_s_offset(rig_file, n, seeds):
    rig, errors = read_rig(rig_file(n)), []
    for seed in range(seeds):
        found = calibrate(zones_log(np.random.default_rng(seed), rig), rig=rig)
        plane = found.planes[0]
        at = np.array([0.4, 0.1, 0.0])
        height = float(plane.T_world_plane[:3, 2] @ (at - plane.T_world_plane[:3, 3]))
        errors.append(height**2 / plane.cov[2, 2])
        assert np.sqrt(plane.cov[2, 2]) > 7e-3
    assert np.sum(errors) < chi2.ppf(0.999, seeds)


def test_a_device_is_one_table_and_reads_back(rig_file, tmp_path):
    rig = read_rig(rig_file(3))
    found = calibrate(zones_log(np.random.default_rng(1), rig), rig=rig)
    write_rig(calibrated_rig(found, rig=rig), tmp_path / "out.toml")
    text = (tmp_path / "out.toml").read_text()
    assert text.count("[sensors.") == 1
    again, made = read_rig(tmp_path / "out.toml"), calibrated_rig(found, rig=rig)
    for one, other in zip(again.sensors, made.sensors, strict=True):
        # a written field of view widens evenly in angle, a fitted one about the axis: equal to second order
        np.testing.assert_allclose(one.T_hand_sensor, other.T_hand_sensor, atol=2e-3)
        np.testing.assert_allclose([one.bias, one.scale, one.sd], [other.bias, other.scale, other.sd], atol=1e-6)
        np.testing.assert_allclose(one.cov_mount, other.cov_mount, rtol=1e-6)
    write_rig(again, tmp_path / "twice.toml")
    assert (tmp_path / "twice.toml").read_text() == text


def test_an_approach_along_one_line_is_insufficient(rig_file):
    rng, rig = np.random.default_rng(2), read_rig(rig_file(1))
    heights = np.linspace(0.06, 0.38, 30)
    hands = np.array([SE3.exp(np.r_[0, 0, h, 0, 0, 0]) @ SE3.exp(np.r_[0, 0, 0, np.pi, 0, 0]) for h in heights])
    log = Readings.from_columns(
        ranges=heights + 1e-3 * rng.normal(size=30), sensors=[rig.sensors[0].name] * 30, Ts_world_hand=hands,
    )  # fmt: skip
    found = calibrate(log, rig=rig)
    assert found.status == "insufficient"
    assert found.incidences.max() < rig.sensors[0].preset.max_incidence
    assert found.devices[0].advice.startswith("turn it")
    assert tanteo.calibrate is calibrate
