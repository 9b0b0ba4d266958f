"""Headers as people write them, and hands as robots write them."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io import BRANDS, pose_as_brand, read_readings

T = SE3.from_parts(
    SO3.exp(np.array([[0.3, -0.2, 1.0], [0.1, 0.4, -0.7], [2.0, 0.3, 0.2]])),
    np.array([[0.4, 0.2, 0.3], [0.1, -0.2, 0.5], [0.3, 0.3, 0.1]]),
)


def save(tmp_path, names, values):
    path = tmp_path / "r.csv"
    path.write_text(",".join(names) + "\n" + "".join(",".join(f"{x:.9g}" for x in row) + "\n" for row in values))
    return path


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("X_mm", "x_mm"), ("X (mm)", "x_mm"), ("X [mm]", "x_mm"), ("x mm", "x_mm"), (" Y_MM ", "y_mm"),
        ("Z/mm", "z_mm"), ("Radius (µm)", "radius_um"), ("normal sd [°]", "normal_sd_deg"), ("Feature", "feature"),
        ("X (inch)", "x_in"), ("hand_Rx (rad)", "hand_rx_rad"), ("pose.position.x", "hand_x"), ("DX (-)", "dx"),
        ("pose.orientation.w", "hand_qw"), ("normal_x", "nx"), ("Direction Z", "dz"),
        ("Richtung Z", "dz"), ("Antastrichtung X", "dx"), ("Dirección Y", "dy"), ("Normale X", "nx"),
    ],
)  # fmt: skip
def test_names_in_any_spelling(tmp_path, written, name):
    """Read a table twice: once as the documented names have it, once with one name in another spelling."""
    unit = name.rpartition("_")[2] if name[0] in "xyz" else "mm"
    point = [f"{axis}_{unit}" for axis in "xyz"]
    hand = ["hand_x", "hand_y", "hand_z"] if name == "hand_x" else ["hand_x_mm", "hand_y_mm", "hand_z_mm"]
    turn = (
        ["hand_rx_rad", "hand_ry_rad", "hand_rz_rad"] if "rx" in name else ["hand_qw", "hand_qx", "hand_qy", "hand_qz"]
    )
    names = [*point, "radius_um", "nx", "ny", "nz", "normal_sd_deg", "dx", "dy", "dz", "feature", *hand, *turn]
    assert names.count(name) == 1
    row = [1, 2, 3, 500, 0, 0, 1, 2, 0, 0, -1, 7, 4, 5, 6, *([0.1, 0.2, 0.3] if "rx" in name else [1, 0, 0, 0])]
    units = {"unit": "mm"} if name == "hand_x" else {}
    plain = read_readings(save(tmp_path, names, [row]), **units)
    other = read_readings(save(tmp_path, [written if n == name else n for n in names], [row]), **units)
    assert other.notes == plain.notes
    assert other.features == plain.features == ("7",)
    for field in ("points", "radii", "normals", "normal_sds", "directions", "Ts_world_hand"):
        np.testing.assert_array_equal(getattr(other, field), getattr(plain, field))


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("diameter_mm", "name the column radius_mm and halve the values"),
        ("Ball Diameter (mm)", "name the column radius_mm"),
    ],
)
def test_a_diameter_decides_what_the_points_are(tmp_path, name, advice):
    path = save(tmp_path, ["x_mm", "y_mm", "z_mm", name], [[1, 2, 3, 4]])
    with pytest.raises(InputError) as caught:
        read_readings(path)
    assert advice in str(caught.value)
    assert "Did you mean" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("sigma_mm", "name the column sd_mm"),
        ("Standardabweichung", "name the column sd_mm"),
        ("vx", "nx, ny, nz if they point out of the material, dx, dy, dz if into it"),
        ("distance_mm", "name the column range_mm"),
    ],
)
def test_advice_goes_by_meaning(tmp_path, name, advice):
    readings = read_readings(save(tmp_path, ["x_mm", "y_mm", "z_mm", name], [[1, 2, 3, 4]]))
    assert any(f"Column '{name}' was excluded." in note and advice in note for note in readings.notes)
    with pytest.raises(InputError) as caught:
        read_readings(save(tmp_path, ["x_mm", "y_mm", name], [[1, 2, 4]]))
    assert advice in str(caught.value)
    assert "Did you mean" not in str(caught.value)


def test_a_standard_deviation_in_french_is_no_deviation(tmp_path):
    readings = read_readings(save(tmp_path, ["x mm", "y mm", "z mm", "écart-type mm"], [[1, 2, 3, 4]]))
    assert "name the column sd_mm" in readings.notes[0]


@pytest.mark.parametrize("name", ["Temp 1", "dX [mm]", "Bemerkung", "A", "Kommentar", "bogus", "X Soll", ""])
def test_other_columns_are_left_out_of_clear_coordinates(tmp_path, name):
    readings = read_readings(save(tmp_path, ["X Ist (mm)", "Y Ist (mm)", "Z Ist (mm)", name], [[1, 2, 3, 4]]))
    np.testing.assert_allclose(readings.points, [[1e-3, 2e-3, 3e-3]])
    assert readings.notes == (f"Columns excluded: {name or '(no name)'}.",)
    assert not readings.directions.given.any()


def test_a_collection_is_a_group_of_readings(tmp_path):
    readings = read_readings(save(tmp_path, ["x_mm", "y_mm", "z_mm", "Collection"], [[1, 2, 3, 4], [5, 6, 7, 8]]))
    assert readings.groups == ("4", "8")
    assert not readings.notes


def test_the_tools_of_a_log_are_groups_of_readings(tmp_path):
    readings = read_readings(save(tmp_path, ["x_mm", "y_mm", "z_mm", "Tool"], [[1, 2, 3, 1], [5, 6, 7, 2]]))
    assert readings.groups == ("1", "2")
    assert not readings.notes


def test_directions_of_many_lengths_are_deviations(tmp_path):
    names = ["x_mm", "y_mm", "z_mm", "dX", "dY", "dZ"]
    rows = np.c_[np.arange(12).reshape(4, 3), np.diag([0.01, 0.2, 0.03, 0.1])[:, :3] + 0.001]
    readings = read_readings(save(tmp_path, names, rows))
    assert not readings.directions.given.any()
    assert any("dX, dY, dZ" in note and "deviations" in note for note in readings.notes)
    assert read_readings(save(tmp_path, names, np.c_[rows[:, :3], [[0, 0, -5.0]] * 4])).directions.given.all()


@pytest.mark.parametrize("mark", [";", "\t", ","])
@pytest.mark.parametrize("titles", ["Messprotokoll vom 3. Mai\n", "Part{0}bracket\nDate{0}2026-01-02\n\n"])
def test_title_lines_above_the_header_are_skipped(tmp_path, mark, titles):
    path = tmp_path / "r.csv"
    text = titles.format(mark) + mark.join(["Punkt", "X", "Y", "Z"]) + "\n"
    text += "".join(mark.join([f"P{k}", "1.5", f"{k}", "3"]) + "\n" for k in range(3))
    path.write_text(text)
    readings = read_readings(path, unit="mm")
    assert readings.ids == ("P0", "P1", "P2")
    np.testing.assert_allclose(readings.points[1], [1.5e-3, 1e-3, 3e-3])
    assert "title line" in readings.notes[0]
    path.write_text(text.replace(mark.join(["P2", "1.5"]), mark.join(["P2", "far"])))
    with pytest.raises(InputError, match=f"line {text.count(chr(10))}, column 'X'"):
        read_readings(path, unit="mm")


@pytest.mark.parametrize("brand", ["fanuc", "kuka", "yaskawa", "mitsubishi", "kawasaki", "abb", "ur", "denso", "comau"])
def test_hands_in_the_columns_of_a_brand(tmp_path, brand):
    names = [f"hand_{field.lower()}" for field in BRANDS[brand].fields]
    path = save(tmp_path, ["x_mm", "y_mm", "z_mm", *names], np.c_[np.ones((3, 3)), pose_as_brand(brand, T)])
    np.testing.assert_allclose(read_readings(path, brand=brand).Ts_world_hand, T, atol=1e-7)


def test_a_pose_without_hand_is_where_the_tip_is(tmp_path):
    path = save(tmp_path, ["X (mm)", "Y (mm)", "Z (mm)", "W", "P", "R"], pose_as_brand("fanuc", T))
    readings = read_readings(path)
    np.testing.assert_allclose(readings.points, T[:, :3, 3], atol=1e-9)
    assert any("--tool" in note for note in readings.notes)
    tipped = read_readings(path, tool=[0, 0, 0.15])
    np.testing.assert_allclose(tipped.points, T[:, :3, 3] + 0.15 * T[:, :3, 2], atol=1e-9)


def test_matrices_and_ros(tmp_path):
    names = [f"m{i}{j}" + ("_m" if j == 4 else "") for i in (1, 2, 3) for j in (1, 2, 3, 4)]
    readings = read_readings(save(tmp_path, names, T[:, :3].reshape(3, 12)))
    np.testing.assert_allclose(readings.Ts_world_hand, T, atol=1e-7)
    q = SO3.as_quaternion(T[:, :3, :3])
    names = [*(f"pose.position.{a}" for a in "xyz"), *(f"pose.orientation.{a}" for a in "xyzw")]
    path = save(tmp_path, names, np.c_[T[:, :3, 3], q[:, 1:], q[:, :1]])
    np.testing.assert_allclose(read_readings(path, unit="m").Ts_world_hand, T, atol=1e-7)
    skew = T.copy()
    skew[1, :3, :3] *= 1.1
    names = [f"m{i}{j}" + ("_m" if j == 4 else "") for i in (1, 2, 3) for j in (1, 2, 3, 4)]
    with pytest.raises(InputError, match="line 3: expected a rotation matrix"):
        read_readings(save(tmp_path, names, skew[:, :3].reshape(3, 12)))


@pytest.mark.parametrize(
    ("names", "row", "message"),
    [
        ("hand_a_deg hand_b_deg hand_c_deg", [1, 2, 3], "(kuka, mitsubishi, doosan), got none. Use --brand kuka."),
        ("hand_w_deg hand_p_deg hand_r_deg", [3.14159, 0, 1.5708], "are these radians? Name the column hand_w_rad"),
        ("hand_rx_rad hand_ry_rad hand_rz_rad", [4, 4, 4], "expected a rotation vector of at most a full turn"),
        ("hand_rx_rad hand_ry_rad hand_rz_rad", [180, 0, 0], "are these degrees? Name the column hand_rx_deg"),
        ("hand_w_deg hand_p_deg hand_c_deg", [1, 2, 3], "expected the hand's rotation in one way"),
        ("hand_q1 hand_q2 hand_q3 hand_q4", [1, 1, 0, 0], "a unit quaternion hand_q1 .. hand_q4"),
    ],
)
def test_turns_that_cannot_be_meant_are_refused(tmp_path, names, row, message):
    head = ["x_mm", "y_mm", "z_mm", "hand_x_mm", "hand_y_mm", "hand_z_mm", *names.split()]
    with pytest.raises(InputError) as caught:
        read_readings(save(tmp_path, head, [[1, 2, 3, 4, 5, 6, *row]]))
    assert message in str(caught.value)


def test_a_place_of_400_m_is_millimetres(tmp_path):
    head = ["x_m", "y_m", "z_m"]
    with pytest.raises(InputError, match=r"within 100 m .* Millimetres are x_mm"):
        read_readings(save(tmp_path, head, [[400, 200, 0]]))


def test_three_two_one_is_usable(tmp_path):
    path = tmp_path / "r.csv"
    labels = ["top"] * 3 + ["front"] * 2 + ["left"]
    path.write_text(
        "x_mm,y_mm,z_mm,feature,kind\n" + "".join(f"{k},{k * k},0,{f},plane\n" for k, f in enumerate(labels))
    )
    readings = read_readings(path)
    assert readings.features == ("top",) * 3 + ("",) * 3
    assert readings.kinds == ("plane",) * 3 + ("point",) * 3
    (note,) = readings.notes
    assert "those of 'front' (2), 'left' (1) are used as unlabelled points" in note


def test_other_columns_of_a_report_are_named(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("Point;Actual X [mm];Actual Y [mm];Actual Z [mm];Nominal X;Dev X;Time\nP1;1,5;2;3;1;0,5;12:01\n")
    readings = read_readings(path)
    assert readings.ids == ("P1",)
    np.testing.assert_allclose(readings.points, [[1.5e-3, 2e-3, 3e-3]])
    assert "Columns excluded: Nominal X, Dev X, Time." in readings.notes
