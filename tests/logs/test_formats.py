"""Each format, from a small sample of our own: the same four points, whoever wrote them."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from tanteo.errors import InputError, ReadingsError, UnitError
from tanteo.io import pose_as_brand, read_readings
from tanteo.lie import SE3, SO3
from tanteo.logs import FORMATS, Contents, recognise

P = np.array([[10.0, 20.0, 30.0], [40.5, 20.0, 30.0], [10.0, 50.25, 5.0], [12.5, 60.0, -7.25]])
"""Millimetres."""

UP = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.6, -0.8]])
R = SO3.exp(np.array([[np.pi - 0.1, 0, 0.2], [0, 0, 1.0], [0.3, 0.2, 0.1], [0, 0, 0]]))
POSES = SE3.from_parts(R, P / 1000)


def rows(values, sep=" ", end="\n", form="{:.6f}"):
    return end.join(sep.join(form.format(x) for x in row) for row in np.atleast_2d(values)) + end


def fields(brand):
    return pose_as_brand(brand, POSES)


def console():
    met = "".join(f"[PRB:{x:.3f},{y:.3f},{z:.3f}:1]\nok\n" for x, y, z in P)
    return "Grbl 1.1f ['$' for help]\n$13=0\n" + met + "ALARM:5\n[PRB:300.000,100.000,-60.000:0]\n"


def results():
    lines = ["START", "TOOLPATH Surf", "G331 N1 A0. B0. C0. X0. Y0. Z0."]
    for k, (p, n) in enumerate(zip(P, UP, strict=True), start=1):
        lines.append(f"G800 N{k} X0. Y0. Z0. I{n[0]:.5f} J{n[1]:.5f} K{n[2]:.5f} O0. U0.1 L0.1")
        lines.append(f"G801 N{k} X{p[0]:.3f} Y {p[1]:.3f} Z{p[2]:.3f} R1.5")
    return "\n".join([*lines, "G800 N9 X0. Y0. Z0. I0. J0. K1.", "END", ""])


def dmis():
    head = "DMISMN/'PART',5.3\nUNITS/MM,ANGDEC\n$$ a comment\nF(P1)=FEAT/POINT,CART,0,0,0,0,0,1\n"
    points = [f"FA(P{k})=FEAT/POINT,CART,$\n {','.join(map(str, p))},{','.join(map(str, n))}"
              for k, (p, n) in enumerate(zip(P.tolist(), UP.tolist(), strict=True), start=1)]  # fmt: skip
    return head + "\n".join(points) + "\nFA(PL)=FEAT/PLANE,CART,0,0,0,0,0,1\nENDFIL\n"


def qif():
    points = "".join(
        f'<PointFeatureMeasurement id="{k}"><Location>{rows(p, form="{}").strip()}</Location>'
        f"<Normal>{rows(n, form='{}').strip()}</Normal></PointFeatureMeasurement>"
        for k, (p, n) in enumerate(zip(P, UP, strict=True), start=1)
    )
    return (
        '\ufeff<?xml version="1.0" encoding="UTF-8"?>\n<QIFDocument xmlns="http://qifstandards.org/xsd/qif3">'
        "<FileUnits><PrimaryUnits><LinearUnit><SIUnitName>meter</SIUnitName><UnitName>mm</UnitName>"
        "<UnitConversion><Factor>0.001</Factor></UnitConversion></LinearUnit></PrimaryUnits></FileUnits>"
        f"<MeasurementsResults>{points}<PlaneFeatureMeasurement/></MeasurementsResults></QIFDocument>"
    )


def fanuc():
    blocks = "".join(
        f"P[{k}:\"T{k}\"]{{\n   GP1:\n\tUF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n"
        f"\tX = {x:.4f}  mm,\tY = {y:.4f}  mm,\tZ = {z:.4f}  mm,\n"
        f"\tW = {w:.5f} deg,\tP = {p:.5f} deg,\tR = {r:.5f} deg\n}};\n"
        for k, (x, y, z, w, p, r) in enumerate(fields("fanuc"), start=1)
    )
    joints = "P[9]{\n   GP1:\n\tUF : 1, UT : 1,\n\tJ1= 0.000 deg,\tJ2= 0.000 deg\n};\n"
    return f"/PROG  TOUCH\n/ATTR\n/MN\n   1:L P[1] 100mm/sec FINE    ;\n/POS\n{blocks}{joints}/END\n"


def krl():
    lines = "".join(
        f"DECL E6POS XT{k}={{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.5f},B {b:.5f},C {c:.5f},S 2,T 34,E1 0.0}}\n"
        f'DECL FDAT FT{k}={{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " "}}\n'
        for k, (x, y, z, a, b, c) in enumerate(fields("kuka"), start=1)
    )
    return f"&ACCESS RVP\nDEFDAT TOUCH\nDECL E6POS XHOME={{X 1,Y 2,Z 3,A 0,B 0,C 0}}\n{lines}ENDDAT\n"


def rapid():
    def brackets(numbers):
        return "[" + ",".join(f"{x:.7f}" for x in numbers) + "]"

    return "MODULE Touch\n" + "".join(
        f"CONST robtarget t{k}:=[{brackets(v[:3])},{brackets(v[3:])},[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
        for k, v in enumerate(fields("abb"), start=1)
    )


def urscript():
    return "def touch():\n" + "".join(
        f"  t{k}=p[{', '.join(f'{x:.7f}' for x in v)}]\n" for k, v in enumerate(fields("ur"), start=1)
    )


PLY_HEAD = "ply\nformat {} 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty float z\n"
NORMALS = "property float nx\nproperty float ny\nproperty float nz\n"
PCD_HEAD = (
    "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 8 8 8 4\nTYPE F F F F\n"
    "COUNT 1 1 1 1\nWIDTH 4\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA {}\n"
)
GRID = "0 40 2\n0 50 2\n-5 5 100\n\n\n"
MM, TIP = {"units": "mm"}, {"units": "mm", "radius": 0.0015}

CASES = {
    "linuxcnc": ("linuxcnc", rows(np.c_[P, np.zeros((4, 6))]), TIP),
    "linuxcnc of six axes": ("linuxcnc", rows(np.c_[P, np.zeros((4, 3))]), TIP),
    "linuxcnc with a rotary axis": ("linuxcnc", rows(np.c_[P, np.tile([90.0, 0, 0, 0, 0, 0], (4, 1))]), TIP),
    "grbl": ("grbl", console(), {"radius": 0.0015}),
    "bcnc": ("bcnc", GRID + rows(P), MM),
    "bcnc xyz": ("asc", rows(P), MM),
    "fusion": ("fusion", results(), MM),
    "xyzijk": ("xyzijk", rows(np.c_[P, UP], "\t"), MM),
    "xyzijk with commas": ("xyzijk", rows(np.c_[P, UP], ", "), MM),
    "decimal commas": ("asc", rows(P, ";").replace(".", ","), MM),
    "asc with colours and normals": ("asc", "4\n" + rows(np.c_[P, [[255, 0, 7]] * 4, UP]), MM),
    "asc with names": ("asc", "//X Y Z Nx Ny Nz\n" + rows(np.c_[P, UP]), MM),
    "dmis": ("dmis", dmis(), {}),
    "qif": ("qif", qif(), {}),
    "fanuc": ("fanuc", fanuc(), {"radius": 0.0}),
    "kuka": ("kuka", krl(), {"radius": 0.0}),
    "abb": ("abb", rapid(), {"radius": 0.0}),
    "ur": ("ur", urscript(), {"radius": 0.0}),
    "ply": ("ply", PLY_HEAD.format("ascii") + "end_header\n" + rows(P), MM),
    "ply binary": (
        "ply",
        (PLY_HEAD.format("binary_little_endian") + NORMALS + "end_header\n").encode()
        + b"".join(struct.pack("<ddffff", *p, *n) for p, n in zip(P, UP, strict=True)),
        MM,
    ),
    "ply big endian": (
        "ply",
        (PLY_HEAD.format("binary_big_endian") + "end_header\n").encode()
        + b"".join(struct.pack(">ddf", *p) for p in P),
        MM,
    ),
    "pcd": ("pcd", PCD_HEAD.format("ascii") + rows(np.c_[P, np.zeros(4)]), MM),
    "pcd binary": (
        "pcd",
        PCD_HEAD.format("binary").encode() + b"".join(struct.pack("<dddf", *p, 0) for p in P),
        MM,
    ),
    "csv of a spreadsheet": (
        "csv", "\ufeffX (mm);Y [mm];Z_MM\n" + rows(P, ";", "\r\n").replace(".", ","), {}
    ),
    "csv in UTF-16": ("csv", ("X\tY\tZ\nmm\tmm\tmm\n" + rows(P, "\t")).encode("utf-16"), {}),
    "csv with sep": ("csv", "sep=;\nx;y;z\n" + rows(P, ";"), MM),
    "csv without units": ("csv", "x,y,z\n" + rows(P, ","), MM),
    "csv of XYZIJK": ("csv", "X,Y,Z,I,J,K\n" + rows(np.c_[P, UP], ","), MM),
}  # fmt: skip


def save(tmp_path, content, name="log"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("case", CASES)
def test_the_same_points_whoever_wrote_them(tmp_path, case):
    name, content, said = CASES[case]
    path = save(tmp_path, content)
    found = recognise(Contents(path.read_bytes()))
    assert (found.name if found else "csv") == name
    readings = read_readings(path, **said)
    np.testing.assert_allclose(readings.points, P / 1000, atol=2e-7)
    assert len(set(readings.ids)) == 4
    again = read_readings(path, format=name, **said)
    np.testing.assert_array_equal(again.points, readings.points)


@pytest.mark.parametrize("case", ["fusion", "xyzijk", "dmis", "qif", "csv of XYZIJK"])
def test_vectors_out_of_the_material_are_approached_against(tmp_path, case):
    _, content, said = CASES[case]
    path = save(tmp_path, content)
    readings = read_readings(path, **said)
    np.testing.assert_allclose(readings.directions, -UP, atol=1e-6)
    assert any("--direction ijk" in note for note in readings.notes)
    turned = read_readings(path, direction="ijk", **said)
    np.testing.assert_allclose(turned.directions, UP, atol=1e-6)
    down = read_readings(path, direction="down", **said)
    np.testing.assert_allclose(down.directions, [[0, 0, -1]] * 4, atol=1e-6)


def test_vectors_that_point_inwards_are_asked_about(tmp_path):
    away = P - P.mean(axis=0)
    inwards = -away / np.linalg.norm(away, axis=1, keepdims=True)
    path = save(tmp_path, rows(np.c_[P, inwards]))
    with pytest.raises(ReadingsError, match="--direction ijk; otherwise"):
        read_readings(path, units="mm")
    np.testing.assert_allclose(read_readings(path, units="mm", direction="-ijk").directions, -inwards, atol=1e-5)


@pytest.mark.parametrize("case", ["fanuc", "kuka", "abb", "ur"])
def test_positions_of_robots_are_poses_with_a_tool(tmp_path, case):
    _, content, said = CASES[case]
    path = save(tmp_path, content)
    readings = read_readings(path, **said)
    np.testing.assert_allclose(readings.Ts_world_hand, POSES, atol=2e-6)
    assert any("--tool" in note for note in readings.notes)
    tipped = read_readings(path, tool="0,0,100mm", direction="tool", **said)
    np.testing.assert_allclose(tipped.points, P / 1000 + 0.1 * R[:, :, 2], atol=2e-6)
    np.testing.assert_allclose(tipped.directions, R[:, :, 2], atol=2e-6)


@pytest.mark.parametrize(
    ("case", "notes"),
    [
        ("grbl", ["1 probe made no contact"]),
        ("linuxcnc with a rotary axis", ["Axis A was at 90"]),
        ("fusion", ["1 nominal point without"]),
        ("dmis", ["1 feature of other kinds"]),
        ("qif", ["1 feature of other kinds"]),
        ("fanuc", ["1 position in joints"]),
        ("kuka", ["1 position in axes, relative or of home"]),
        ("asc with colours and normals", ["3 of 9 columns were left out", "--normal-sd"]),
        ("bcnc xyz", ["taken as points of the surface"]),
        ("csv of a spreadsheet", ["decimal commas"]),
    ],
)
def test_what_was_left_out_is_said(tmp_path, case, notes):
    _, content, said = CASES[case]
    got = read_readings(save(tmp_path, content), **said).notes
    for note in notes:
        assert any(note in one for one in got), got


@pytest.mark.parametrize(
    ("case", "said", "message"),
    [
        (
            "linuxcnc",
            {},
            "expected --units and --radius with a LinuxCNC probe log (PROBEOPEN), got none. Use",
        ),
        ("linuxcnc", MM, "expected --radius with a LinuxCNC"),
        ("grbl", {}, "Use --radius 1.5mm (of the tip's ball; 0mm of a sharp tip)"),
        ("ply", {}, "expected --units with a PLY point cloud, got none. Use --units mm."),
        ("csv without units", {}, "Add it, or use --units mm."),
        ("qif", {"units": "in"}, "expected lengths in mm, as the file says, got --units in"),
        ("fusion", {"units": "mm", "radius": 0.001}, "got 1.5 mm in the file and --radius"),
        ("pcd", {"units": "mm", "direction": "ijk"}, "expected vectors I J K"),
        ("bcnc", {"units": "mm", "direction": "up"}, "got it in the file and --direction"),
        ("asc with names", {"units": "mm", "normal_sd": 2.0}, "expected from"),
        ("ur", {"radius": 0.0, "hand": np.eye(4)}, "got its own columns and --hand"),
        ("dmis", {"tool": [0, 0, 0.1]}, "expected --tool with poses of the hand"),
    ],
)
def test_what_is_lacking_or_too_much_is_named(tmp_path, case, said, message):
    _, content, _ = CASES[case]
    with pytest.raises(InputError) as caught:
        read_readings(save(tmp_path, content), **said)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (rows(np.c_[P, np.arange(24).reshape(4, 6)]), "expected axis A to stand still"),
        ("[PRB:1,2,3:0]\n", "expected at least one probe move with contact"),
        ("[PRB:1,2,x:1]\n", "line 1: expected finite numbers of a probe report, got 'x'"),
        ("G800 N1 X0. Y0. Z0. I0. J0. K1.\n", "Export the results of the measurement, not the program"),
        ("UNITS/MM\nFILNAM/'A'\nFA(C)=FEAT/CIRCLE,CART,0,0,0,0,0,1,5\n", "got 1 feature of other kinds"),
        ('<QIFDocument xmlns="q"></QIFDocument>', "expected measured points"),
        ("<QIFDocument><a></QIFDocument>", "expected well-formed XML"),
        ("<!DOCTYPE x><QIFDocument/>", "without DTD"),
        ("/PROG A\n/POS\nP[1]{\n GP1:\n UF : 0,\n J1= 0 deg\n};\n", "expected Cartesian positions"),
        (fanuc().replace("UF : 1", "UF : 0", 1), "expected positions in one user frame, got UF 0, 1"),
        (krl().replace("BASE_NO 2", "BASE_NO 3", 1), "expected positions in one base"),
        ("DEFDAT A\nDECL E6AXIS X={A1 0,A2 0}\n", "expected Cartesian positions"),
        ("p[92.3, 0, 0, 0, 0, 90]\n", "are these degrees"),
        ("p[0.1, 0, 0, 4, 4, 4]\n", "expected a rotation vector of at most a full turn"),
        ("p[0.1, 0, 0]\np[1,2,3,4,5,6]", "line 2: expected 3 numbers"),
        ("ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\n", "expected a header that ends"),
        (PLY_HEAD.format("ascii") + "end_header\n1 2 3\n", "expected 4 points, got 1 lines"),
        (PLY_HEAD.format("ascii").replace("double y", "double q") + "end_header\n1 2 3\n", "expected properties"),
        (PCD_HEAD.format("binary_compressed"), "pcl_convert_pcd_ascii_binary"),
        (PCD_HEAD.format("ascii").replace("COUNT 1", "COUNT 99999999999999"), "expected a COUNT of up to"),
        (PCD_HEAD.format("ascii").replace("POINTS 4", "POINTS 999999999999999999"), "points, got 0 bytes"),
        (PCD_HEAD.format("binary").replace("POINTS 4", "POINTS 99999999999"), "expected 99999999999 points"),
        ("1 2 3\n4 5\n", "got '1 2 3'"),
    ],
)  # fmt: skip
def test_malformed_logs_are_refused(tmp_path, content, message):
    path = save(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read_readings(path, units="mm" if "p[" not in content else None, radius=0.001)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value) or "expected a header" in str(caught.value)


def test_millimetres_that_were_called_metres_are_refused(tmp_path):
    with pytest.raises(UnitError, match="got one at 600 m: are these millimetres"):
        read_readings(save(tmp_path, rows(10 * P)), units="m")


def test_inches_of_the_console(tmp_path):
    path = save(tmp_path, "$13=1\n[PRB:1.000,2.000,3.000:1]\n")
    np.testing.assert_allclose(read_readings(path, radius=0.001).points, [[0.0254, 0.0508, 0.0762]])
    silent = save(tmp_path, "[PRB:1.000,2.000,3.000:1]\n")
    assert "taken as millimetres" in read_readings(silent, radius=0.001).notes[0]
    np.testing.assert_allclose(read_readings(silent, radius=0.001, units="in").points[:, 0], [0.0254])


def test_a_dense_cloud_is_drawn_from(tmp_path):
    cloud = np.random.default_rng(0).uniform(-50, 50, (5000, 3))
    path = save(tmp_path, rows(cloud))
    some = read_readings(path, units="mm", max_points=300)
    assert len(some) == 300
    assert "300 of 5,000 readings are used" in some.notes[-1]
    np.testing.assert_array_equal(some.points, read_readings(path, units="mm", max_points=300).points)
    assert len(read_readings(path, units="mm")) == 5000


def test_a_viewpoint_gives_the_direction(tmp_path):
    path = save(tmp_path, rows(P))
    readings = read_readings(path, units="mm", direction="from:0,0,500mm")
    looked = P - [0, 0, 500]
    np.testing.assert_allclose(readings.directions, looked / np.linalg.norm(looked, axis=1, keepdims=True), atol=1e-9)


def test_normals_count_when_their_spread_is_stated(tmp_path):
    path = save(tmp_path, CASES["ply binary"][1])
    readings = read_readings(path, units="mm", normal_sd=0.1)
    np.testing.assert_allclose(readings.normals, UP, atol=1e-6)
    np.testing.assert_allclose(readings.normal_sds, 0.1)
    assert np.isnan(read_readings(path, units="mm").normal_sds).all()


def test_an_unknown_format_lists_all(tmp_path):
    with pytest.raises(InputError, match=r"expected one of csv, ply, .*Did you mean 'grbl'"):
        read_readings(save(tmp_path, console()), format="gbrl")


def test_the_table_of_formats_says_what_each_is():
    assert all(row.name == name and row.words for name, row in FORMATS.builtin.items())
    assert issubclass(UnitError, InputError)
