"""Rig files: poses, presets and mounting errors in; everything else named and refused."""

import numpy as np
import pytest

from tanteo.errors import InputError, UnitError
from tanteo.geometry import SE3
from tanteo.io import read_rig, write_rig
from tanteo.io.documents import rig_text
from tanteo.sensors import Rig, RigSensor
from tanteo.sensors.presets import sensor_preset

RIG = """
[sensors.left]
preset = "vl53l0x"
position_mm = [0, 12.5, 48]
direction = [0, 0, 2]
mount_sd_mm = 1
mount_turn_sd_deg = [0.5, 0.5, 0]

[sensors.zone]
preset = "vl53l5cx_zone8x8"
position_m = [0, 0, 0.05]
quaternion_wxyz = [0.7071068, 0.7071068, 0, 0]
axis = [0, -1, 1]
sd_mm = 4
beam_half_angle_deg = 2
max_m = 1.5
bias_sd_um = 500
"""


def rig_file(tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_text(text)
    return path


def test_reading(tmp_path):
    rig = read_rig(rig_file(tmp_path, RIG))
    left, zone = rig.sensors
    assert (left.name, zone.name) == ("left", "zone")
    np.testing.assert_allclose(left.T_hand_sensor[:3, 2], [0, 0, 1])
    np.testing.assert_allclose(left.T_hand_sensor[:3, 3], [0, 0.0125, 0.048])
    np.testing.assert_allclose(np.sqrt(np.diag(left.cov_mount)), [*[1e-3] * 3, *np.deg2rad([0.5, 0.5, 0])])
    assert (left.max_range, left.bias_sd, left.axis_cosine) == (1.2, 0.005, 1.0)
    assert np.isnan(left.sd)
    np.testing.assert_allclose(zone.T_hand_sensor[:3, 2], [0, -1, 0], atol=1e-7)
    assert zone.axis_cosine == pytest.approx(np.sqrt(0.5))
    assert (zone.sd, zone.max_range) == (4e-3, 1.5)
    assert zone.bias_sd == pytest.approx(5e-4)
    assert zone.beam_half_angle == pytest.approx(np.deg2rad(2))


GOOD = '[sensors.a]\npreset = "vl53l0x"\nposition_mm = [0, 0, 0]\ndirection = [0, 0, 1]\n'


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("", InputError, "expected tables [sensors.NAME]"),
        ("sensors = 3", InputError, "expected tables [sensors.NAME]"),
        ("[sensors]\na = 3", InputError, "expected a table [sensors.a], got 3"),
        ("[sensors", InputError, "expected TOML, got"),
        ("[sensor.a]", InputError, "got 'sensor'. Did you mean 'sensors'"),
        (GOOD + "postion_mm = 3", InputError, "Did you mean 'position_mm'"),
        (GOOD.replace("position_mm", "position"), UnitError, "position_mm, position_m"),
        (GOOD.replace("position_mm", "position_cm"), UnitError, "got 'position_cm'"),
        (GOOD + "position_m = [0, 0, 0]", UnitError, "got it in two units"),
        (GOOD + "max_mm = -1", InputError, "max_mm: expected one positive number, got -1"),
        (GOOD + "sd_mm = nan", InputError, "sd_mm: expected finite numbers, got nan"),
        (GOOD + "sd_mm = true", InputError, "got True"),
        (GOOD + "mount_sd_mm = [1, 2]", InputError, "expected one or three numbers"),
        (GOOD + "quaternion_wxyz = [1, 0, 0, 0]", InputError, "got both or neither"),
        (GOOD.replace("direction = [0, 0, 1]", "quaternion_wxyz = [1, 1, 0, 0]"), InputError, "expected unit length"),
        (GOOD.replace("[0, 0, 1]", "[0, 0, 0]"), InputError, "expected a direction that is not zero"),
        (GOOD.replace("[0, 0, 1]", "[0, 1]"), InputError, "direction: expected 3 numbers, got 2"),
        (GOOD.replace("[0, 0, 1]", '"z"'), InputError, "expected finite numbers, got 'z'"),
        (GOOD.replace("position_mm = [0, 0, 0]\n", ""), InputError, "expected 'position_mm' (3 numbers)"),
        (GOOD.replace("vl53l0x", "vl53"), InputError, "sensor: expected one of"),
        (GOOD.replace("vl53l0x", "touch_probe_hobby"), InputError, "which touches"),
        (GOOD.replace('"vl53l0x"', "7"), InputError, "expected a name, got 7"),
        (GOOD.replace('preset = "vl53l0x"\n', ""), InputError, "expected a preset, or sd_mm"),
        (GOOD + "axis = [0, 0, -1]", InputError, "within 90 degrees of the beam"),
        (GOOD.replace("[0, 0, 0]", "[0, 0, 2500]"), UnitError, "expected within 2 m of the hand's origin, got 2.5 m"),
        (GOOD + "beam_half_angle_rad = 2", UnitError, "expected 60 degrees or less, got 114.592"),
        (GOOD.replace("[0, 0, 0]", "[0, 1, 80]").replace("[0, 0, 1]", "[0, 0, -1]"), InputError, "within 1 mm. Turn"),
        (GOOD + GOOD.replace("sensors.a", "sensors.b"), InputError, "got 'a' and 'b' with the same"),
        (GOOD + "sd_per_range = -1", InputError, "sd_per_range: expected one number of zero or more"),
        (GOOD + "sd_per_range = 0.01", InputError, "expected sd beside it"),
        (GOOD + "scale = -1", InputError, "scale: expected one number above -1"),
        (GOOD + "bias_mm = [1, 2]", InputError, "bias_mm: expected one number, got [1, 2]"),
        (GOOD + "mount_covariance_m_rad = [1, 2]", InputError, "expected 6 x 6 numbers"),
        (GOOD + f"mount_covariance_m_rad = {(-np.eye(6)).tolist()}", InputError, "got a negative variance"),
        (GOOD + f"mount_sd_mm = 1\nmount_covariance_m_rad = {np.eye(6).tolist()}", InputError, "got both. Keep one"),
        (GOOD + "scale_covariance_m_rad = [1, 0, 0, 0, 0, 0]\nscale_sd = 0", InputError, "expected scale_sd beside it"),
    ],
)
def test_refusals(tmp_path, text, error, message):
    with pytest.raises(InputError) as caught:
        read_rig(rig_file(tmp_path, text))
    assert type(caught.value) is error
    assert message in str(caught.value)


ZONES = """
[sensors.tof]
preset = "vl53l5cx_zone8x8"
position_mm = [0, 30, 50]
quaternion_wxyz = [0.9238795, 0.3826834, 0, 0]
zones = [4, 8]
field_deg = [30, 45]
mount_sd_mm = 1
"""


def test_zones_are_beams_of_one_device(tmp_path):
    rig = read_rig(rig_file(tmp_path, ZONES))
    assert len(rig.sensors) == 32
    assert [s.name for s in rig.sensors][:2] == ["tof.1.1", "tof.1.2"]
    assert {s.device for s in rig.sensors} == {"tof"}
    device = rig.sensors[0].T_hand_unit
    for s in rig.sensors:
        np.testing.assert_array_equal(s.T_hand_unit, device)
        np.testing.assert_allclose(s.T_hand_sensor[:3, 3], [0, 0.03, 0.05])
        assert s.axis_cosine == pytest.approx(s.T_hand_sensor[:3, 2] @ device[:3, 2])
    local = np.array([device[:3, :3].T @ s.T_hand_sensor[:3, 2] for s in rig.sensors]).reshape(4, 8, 3)
    angles = np.degrees(np.arctan2(local[..., :2], local[..., 2:]))
    np.testing.assert_allclose(angles[0, :, 0], 45 * ((np.arange(8) + 0.5) / 8 - 0.5))
    np.testing.assert_allclose(angles[:, 0, 1], 30 * ((np.arange(4) + 0.5) / 4 - 0.5))
    path = tmp_path / "again.toml"
    write_rig(rig, path)
    back = read_rig(path)
    assert [(s.name, s.device) for s in back.sensors] == [(s.name, s.device) for s in rig.sensors]
    np.testing.assert_allclose(back.sensors[9].T_hand_unit, device, atol=1e-9)
    assert back.sensors[9].axis_cosine == pytest.approx(rig.sensors[9].axis_cosine)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[4, 8]", "[4]", "zones: expected [rows, columns], got [4]"),
        ("[4, 8]", '"many"', "zones: expected [rows, columns], got 'many'"),
        ("[4, 8]", "[0, 8]", "zones: expected [rows, columns]"),
        ("[4, 8]", "[1000, 1000]", "zones: expected [rows, columns]"),
        ("[30, 45]", "[30, 200]", "field_deg: expected field_deg = [height, width] below 180"),
        ("field_deg = [30, 45]\n", "", "field: expected field_deg"),
        ("zones = [4, 8]\n", "", "zones: expected [rows, columns], got None"),
        ("mount_sd_mm = 1", "axis = [0, 0, 1]", "axis nor unit"),
        ("quaternion_wxyz = [0.9238795, 0.3826834, 0, 0]", "direction = [0, 0, 1]", "Write quaternion_wxyz = "),
        ("zones = [4, 8]\nfield_deg = [30, 45]", 'unit = "a"', "unit_position_mm and unit_quaternion_wxyz together"),
    ],
)
def test_refused_zones(tmp_path, old, new, message):
    with pytest.raises(InputError) as caught:
        read_rig(rig_file(tmp_path, ZONES.replace(old, new)))
    assert message in str(caught.value)


def test_a_missing_rig(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_rig(tmp_path / "none.toml")


def test_the_paper_s_gripper_is_there_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig = read_rig("paper-gripper")
    beams = {s.name: s.T_hand_sensor[:3, 2].round(9).tolist() for s in rig.sensors}
    assert beams == {
        "front_left": [0, 0, 1], "front_right": [0, 0, 1], "side_left": [-1, 0, 0], "side_right": [1, 0, 0],
        "side_front": [0, 1, 0], "side_back": [0, -1, 0],
    }  # fmt: skip
    (tmp_path / "paper-gripper").write_text(GOOD)
    assert [s.name for s in read_rig("paper-gripper").sensors] == ["a"]
    with pytest.raises(InputError, match="one of paper-gripper"):
        read_rig("paper-griper")


def test_beams_across_the_hand_are_no_mistake(tmp_path):
    """Fingers that face each other, and sensors beside each other."""
    across = GOOD.replace("[0, 0, 0]", "[30, 0, 100]").replace("[0, 0, 1]", "[-1, 0, 0]")
    beside = GOOD.replace("sensors.a", "sensors.b").replace("[0, 0, 0]", "[0, 5, 0]")
    assert len(read_rig(rig_file(tmp_path, across + beside)).sensors) == 2


def test_what_is_written_is_read_back(tmp_path):
    rng = np.random.default_rng(0)
    A = 1e-3 * rng.normal(size=(7, 7))
    C = A @ A.T
    rich = RigSensor(
        name="left eye", T_hand_sensor=SE3.exp(rng.normal(size=6) * [0.1, 0.1, 0.1, 0.5, 0.5, 0.5]), preset=None,
        sd=1e-3, beam_half_angle=0.03, max_range=0.8, bias_sd=0.0, cov_mount=C[:6, :6], axis_cosine=0.9, sd_prop=0.004,
        bias=1e-3, scale=-0.02, scale_sd=float(np.sqrt(C[6, 6])), cov_scale=C[:6, 6],
    )  # fmt: skip
    preset = sensor_preset("vl53l4cd")
    plain = RigSensor("b", SE3.exp(np.r_[0.1, np.zeros(5)]), preset, np.nan, 0.1, 1.2, 0.003, np.zeros((6, 6)))
    path = tmp_path / "rig.toml"
    write_rig(Rig((rich, plain)), path, comment="two lines\nof comment")
    assert path.read_text().startswith("# two lines\n# of comment\n\n[sensors.")
    back = read_rig(path)
    for old, new in zip((rich, plain), back.sensors, strict=True):
        assert (old.name, old.preset) == (new.name, new.preset)
        for name in ("T_hand_sensor", "cov_mount", "cov_scale"):
            np.testing.assert_allclose(getattr(new, name), getattr(old, name), atol=1e-11)
        for name in ("sd", "sd_prop", "beam_half_angle", "max_range", "bias", "bias_sd", "scale", "scale_sd"):
            np.testing.assert_allclose(getattr(new, name), getattr(old, name), rtol=1e-5)
        assert new.axis_cosine == pytest.approx(old.axis_cosine)
    assert rig_text(back).count("[sensors.") == 2


def test_dots_in_comments_separate_no_names(tmp_path):
    path = tmp_path / "rig.toml"
    dots = "a." * 200
    path.write_text(f"# {dots}\n{RIG.replace('mount_sd_mm = 1', f'mount_sd_mm = 1  # {dots}')}")
    assert len(read_rig(path).sensors) == 2
    path.write_text(f"{dots}a = 1\n{RIG}")
    with pytest.raises(InputError, match="a name in fifty others"):
        read_rig(path)
    path.write_text(f"x = {'9' * 5000}\n{RIG}")
    with pytest.raises(InputError, match=r"rig.toml: expected TOML, got: Exceeds the limit"):
        read_rig(path)
