"""TOML documents: units of keys become SI, and what is wrong is named with table, key, value and line."""

import numpy as np
import pytest

from tanteo.errors import InputError, UnitError
from tanteo.io import read_rig
from tanteo.io.documents import rig_text

GOOD = '# a rig\n\n[sensors.eye]\npreset = "vl53l0x"\nposition_mm = [1, 2, 30]\ndirection = [0, 3, 4]\n'


def read(tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_text(text)
    return read_rig(path)


def test_units_of_keys_become_si(tmp_path):
    rig = read(tmp_path, GOOD + "sd_um = 5\nmax_in = 10\nbeam_half_angle_deg = 9\n")
    (eye,) = rig.sensors
    np.testing.assert_allclose(eye.T_hand_sensor[:3, 3], [1e-3, 2e-3, 3e-2])
    np.testing.assert_allclose(eye.T_hand_sensor[:3, 2], [0, 0.6, 0.8])
    assert (eye.sd, eye.max_range, eye.beam_half_angle) == pytest.approx((5e-6, 0.254, np.radians(9)))
    (again,) = read(tmp_path, rig_text(rig)).sensors
    for name in ("sd", "max_range", "beam_half_angle"):
        assert getattr(again, name) == pytest.approx(getattr(eye, name))
    np.testing.assert_allclose(again.T_hand_sensor, eye.T_hand_sensor, atol=1e-9)


@pytest.mark.parametrize(
    ("line", "error", "message"),
    [
        ("sd_mm = 0", InputError, "sensor 'eye', sd_mm: expected one positive number, got 0. Correct it. See line 7."),
        ("sd_mm = true", InputError, "sd_mm: expected finite numbers, got True. Correct it. See line 7."),
        (f"sd_mm = {10**400}", InputError, "sd_mm: expected finite numbers, got 1000"),
        ("sd_mm = [1]", InputError, "sd_mm: expected one positive number, got [1]. Correct it. See line 7."),
        ("sd_cm = 1", UnitError, "expected one of sd_mm, sd_m, sd_um, sd_in, got 'sd_cm'"),
        ("sd_mm = 1\nsd_m = 1", UnitError, "sd_m: expected 'sd' once, got it in two units"),
        ("bais_mm = 1", InputError, "got 'bais_mm'. Did you mean 'bias_mm'? See line 7."),
        ("unit = 1", InputError, "unit: expected a text, got 1. Write it in quotes. See line 7."),
        ("zones = [1, 0]", InputError, "zones: expected [rows, columns], got [1, 0]"),
        ("axis = [0, 0, 0]", InputError, "axis: expected a direction that is not zero, got [0, 0, 0]"),
        ("axis = [1, 2]", InputError, "axis: expected 3 numbers, got 2. Correct it. See line 7."),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, line, error, message):
    with pytest.raises(InputError) as caught:
        read(tmp_path, GOOD + line)
    assert type(caught.value) is error
    assert str(caught.value).startswith(f"{tmp_path / 'rig.toml'}, sensor 'eye'")
    assert message in str(caught.value)


def test_what_is_missing_is_named(tmp_path):
    with pytest.raises(
        InputError, match=r"rig.toml, sensor 'eye': expected 'position_mm' \(3 numbers\), got nothing. Add it."
    ):
        read(tmp_path, "[sensors.eye]\n")
