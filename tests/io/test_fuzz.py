"""Any bytes give readings or a tanteo error that names the file, never another exception."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tanteo.errors import InputError, TanteoError
from tanteo.io import read_readings, read_rig
from tanteo.io.readings import parse_length

RELAXED = settings(
    max_examples=100, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)

TEXTS = ("id", "feature", "kind", "sensor", "status", "side")
LENGTHS = ("x", "y", "z", "radius", "sd", "across_sd", "range", "max", "hand_x", "hand_y", "hand_z", "hole_radius",
           "hole_diameter")  # fmt: skip
ANGLES = (
    "normal_sd",
    "half_angle",
    *(f"hand_{name}" for name in ("rx", "ry", "rz", "roll", "pitch", "yaw", *"wprabcote")),
)
PLAIN = ("dx", "dy", "dz", "nx", "ny", "nz", "i", "j", "k", *(f"hand_q{axis}" for axis in "wxyz1234"),
         *(f"hand_r{i}{j}" for i in "123" for j in "123"))  # fmt: skip
COLUMNS = [
    *TEXTS,
    *PLAIN,
    *(f"{name}_mm" for name in LENGTHS),
    *(f"{name}_rad" for name in ANGLES),
    "x_m",
    "x",
    "sd",
    "bogus",
    "",
]
CELLS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True).map(repr),
    st.integers(-200, 200).map(str),
    st.sampled_from(["", " ", "plane", "free", "none", "ok", "A", "1e-400", "0", "1", "1", "-0", '"', "#", "1;2"]),
    st.text(max_size=5),
)


@st.composite
def tables(draw):
    names = draw(st.lists(st.sampled_from(COLUMNS), min_size=1, max_size=8, unique=True))
    if draw(st.booleans()):
        names = ["x_mm", "y_mm", "z_mm", *(n for n in names if n not in ("x_mm", "y_mm", "z_mm"))]
    width = st.just(len(names)) if draw(st.booleans()) else st.integers(0, 9)
    rows = draw(st.lists(width.flatmap(lambda n: st.lists(CELLS, min_size=n, max_size=n)), max_size=6))
    return "\n".join([",".join(names), *(",".join(row) for row in rows)])


def check_file(path):
    """Read; what is read is whole, what is refused names the file."""
    readings, complaint = None, ""
    try:
        readings = read_readings(path)
    except InputError as error:
        complaint = str(error)
    if readings is None:
        assert complaint.startswith(str(path))
        return
    n = len(readings)
    assert n > 0
    assert len(set(readings.ids)) == n
    assert not np.isinf(readings.points.values).any()
    assert (readings.points.given | readings.Ts_world_hand.given).all()


@RELAXED
@given(tables())
def test_tables(tmp_path, text):
    path = tmp_path / "r.csv"
    path.write_text(text, encoding="utf-8", errors="surrogatepass", newline="")
    check_file(path)


@RELAXED
@given(st.binary(max_size=200))
def test_bytes(tmp_path, content):
    path = tmp_path / "r.csv"
    path.write_bytes(content)
    check_file(path)


@RELAXED
@given(st.text(max_size=12))
def test_quantities(text):
    metres, complaint = 0.0, ""
    try:
        metres = parse_length(text, "--sd")
    except TanteoError as error:
        complaint = str(error)
    assert np.isfinite(metres)
    assert not complaint or complaint.startswith("--sd: expected")


VALUES = st.one_of(
    st.integers(-3, 3).map(str),
    st.floats().map(repr),
    st.sampled_from(['"vl53l0x"', "[0, 0, 1]", "[]", "true", '"x"', "{}"]),
)
KEYS = ["preset", "position_mm", "direction", "quaternion_wxyz", "axis", "sd_mm", "max_m", "mount_sd_mm", "bias_sd_um",
        "beam_half_angle_deg", "mount_turn_sd_deg", "sd", "other"]  # fmt: skip


@RELAXED
@given(st.dictionaries(st.sampled_from(KEYS), VALUES))
def test_rigs(tmp_path, table):
    path = tmp_path / "rig.toml"
    good = {"preset": '"vl53l0x"', "position_mm": "[0, 0, 1]", "direction": "[0, 0, 1]"}
    path.write_text("[sensors.a]\n" + "\n".join(f"{k} = {v}" for k, v in (good | table).items()))
    try:
        (sensor,) = read_rig(path).sensors
    except InputError:
        return
    assert np.isfinite(sensor.T_hand_sensor).all()


def test_the_tables_are_not_all_refused(tmp_path):
    """The strategy reaches both sides: otherwise the tests above could not fail."""
    path = tmp_path / "r.csv"
    path.write_text("x_mm,y_mm,bogus\n1,2,4\n")
    with pytest.raises(InputError):
        read_readings(path)
    path.write_text("x_mm,y_mm,z_mm,id\n1,2,3,A\n")
    assert read_readings(path).ids == ("A",)
