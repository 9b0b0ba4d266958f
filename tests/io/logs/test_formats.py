"""Each format, from a small sample of our own: the same four points from every program."""

from __future__ import annotations

import numpy as np
import pytest

from log_cases import CASES, MM, PCD_HEAD, PLY_HEAD, POSES, UP, P, R, console, fanuc, krl, rows, save
from tanteo.errors import InputError, ReadingsError, UnitError
from tanteo.io import read_readings
from tanteo.io.logs import FORMATS, Contents, recognise


@pytest.mark.parametrize("case", CASES)
def test_the_same_points_whoever_wrote_them(tmp_path, case):
    name, content, stated = CASES[case]
    path = save(tmp_path, content)
    found = recognise(Contents(path.read_bytes()))
    assert (found.name if found else "csv") == name
    readings = read_readings(path, **stated)
    np.testing.assert_allclose(readings.points, P / 1000, atol=2e-7)
    assert len(set(readings.ids)) == 4
    again = read_readings(path, format=name, **stated)
    np.testing.assert_array_equal(again.points, readings.points)


@pytest.mark.parametrize(
    "case",
    ["fusion", "xyzijk", "xyzijk with names", "dmis", "qif", "pcdmis", "words with vectors", "csv of XYZIJK"],
)
def test_vectors_out_of_the_material_are_approached_against(tmp_path, case):
    _, content, stated = CASES[case]
    path = save(tmp_path, content)
    readings = read_readings(path, **stated)
    np.testing.assert_allclose(readings.directions, -UP, atol=1e-6)
    assert any("--direction ijk" in note for note in readings.notes)
    turned = read_readings(path, direction="ijk", **stated)
    np.testing.assert_allclose(turned.directions, UP, atol=1e-6)
    down = read_readings(path, direction="down", **stated)
    np.testing.assert_allclose(down.directions, [[0, 0, -1]] * 4, atol=1e-6)


def test_inward_vectors_raise_a_question(tmp_path):
    away = P - P.mean(axis=0)
    inwards = -away / np.linalg.norm(away, axis=1, keepdims=True)
    path = save(tmp_path, rows(np.c_[P, inwards]))
    with pytest.raises(ReadingsError, match="--direction ijk; otherwise"):
        read_readings(path, unit="mm")
    np.testing.assert_allclose(read_readings(path, unit="mm", direction="-ijk").directions, -inwards, atol=1e-5)


@pytest.mark.parametrize("case", ["fanuc", "kuka", "abb", "ur"])
def test_positions_of_robots_are_poses_with_a_tool(tmp_path, case):
    _, content, stated = CASES[case]
    path = save(tmp_path, content)
    readings = read_readings(path, **stated)
    np.testing.assert_allclose(readings.Ts_world_hand, POSES, atol=2e-6)
    assert any("--tool" in note for note in readings.notes)
    tipped = read_readings(path, tool="0,0,100mm", direction="tool", **stated)
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
        ("asc with colours and normals", ["3 of 9 columns were excluded", "--normal-sd"]),
        ("bcnc xyz", ["taken as points of the surface"]),
        ("tinyg", ["1 probe made no contact", "1 report equal to the one before"]),
        ("klipper", ["add the probe's x_offset"]),
        ("pcdmis", ["1 feature of other kinds"]),
        ("characteristics", ["1 characteristic of other kinds"]),
        ("csv with remarks and a mean", ["1 line without numbers", "Rows excluded as statistics of others: Mean."]),
        ("xyzijk with names and tolerances", ["3 of 9 columns were excluded", "The words after the numbers"]),
        ("csv with titles", ["2 title lines above the header", "Columns excluded: Bemerkung."]),
        ("csv of a spreadsheet", ["decimal commas"]),
    ],
)
def test_excluded_rows_are_reported(tmp_path, case, notes):
    _, content, stated = CASES[case]
    got = read_readings(save(tmp_path, content), **stated).notes
    for note in notes:
        assert any(note in one for one in got), got


@pytest.mark.parametrize(
    ("case", "stated", "message"),
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
        ("qif", {"unit": "in"}, "expected lengths in mm, as the file states, got --units in"),
        ("fusion", {"unit": "mm", "radius": 0.001}, "got 1.5 mm in the file and --radius"),
        ("pcd", {"unit": "mm", "direction": "ijk"}, "expected vectors I J K"),
        ("bcnc", {"unit": "mm", "direction": "up"}, "got it in the file and --direction"),
        ("asc with names", {"unit": "mm", "normal_sd": 2.0}, "expected from"),
        ("ur", {"radius": 0.0, "hand": np.eye(4)}, "got its own columns and --hand"),
        ("dmis", {"tool": [0, 0, 0.1]}, "expected --tool with poses of the hand"),
    ],
)
def test_what_is_lacking_or_too_much_is_named(tmp_path, case, stated, message):
    _, content, _ = CASES[case]
    with pytest.raises(InputError) as caught:
        read_readings(save(tmp_path, content), **stated)
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
        read_readings(path, unit="mm" if "p[" not in content else None, radius=0.001)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value) or "expected a header" in str(caught.value)


def test_millimetres_that_were_called_metres_are_refused(tmp_path):
    with pytest.raises(UnitError, match="got one at 600 m: are these millimetres"):
        read_readings(save(tmp_path, rows(10 * P)), unit="m")


def test_poses_of_urscript_in_millimetres_have_a_way_out(tmp_path):
    text = "p[570.0, -120.0, 300.0, 0.0, 3.1, 0.0]\np[0.5, 20.0, 300.0, 0.0, 3.1, 0.0]\n"
    path = save(tmp_path, text)
    with pytest.raises(UnitError, match=r"are these millimetres\? Say --units mm"):
        read_readings(path, radius=0.0)
    readings = read_readings(path, radius=0.0, unit="mm")
    np.testing.assert_allclose(readings.points, [[0.57, -0.12, 0.3], [0.0005, 0.02, 0.3]])


def test_inches_of_the_console(tmp_path):
    path = save(tmp_path, "$13=1\n[PRB:1.000,2.000,3.000:1]\n")
    np.testing.assert_allclose(read_readings(path, radius=0.001).points, [[0.0254, 0.0508, 0.0762]])
    silent = save(tmp_path, "[PRB:1.000,2.000,3.000:1]\n")
    assert "taken as millimetres" in read_readings(silent, radius=0.001).notes[0]
    inches = read_readings(silent, radius=0.001, unit="in")
    np.testing.assert_allclose(inches.points[:, 0], [0.0254])
    assert "millimetres" not in " ".join(inches.notes)


def test_a_dense_cloud_is_drawn_from(tmp_path):
    cloud = np.random.default_rng(0).uniform(-50, 50, (5000, 3))
    path = save(tmp_path, rows(cloud))
    some = read_readings(path, unit="mm", max_points=300)
    assert len(some) == 300
    assert "300 of 5,000 readings are used" in some.notes[-1]
    np.testing.assert_array_equal(some.points, read_readings(path, unit="mm", max_points=300).points)
    assert len(read_readings(path, unit="mm")) == 5000


def test_a_viewpoint_gives_the_direction(tmp_path):
    path = save(tmp_path, rows(P))
    readings = read_readings(path, unit="mm", direction="from:0,0,500mm")
    beams = P - [0, 0, 500]
    np.testing.assert_allclose(readings.directions, beams / np.linalg.norm(beams, axis=1, keepdims=True), atol=1e-9)


def test_normals_count_when_their_spread_is_stated(tmp_path):
    path = save(tmp_path, CASES["ply binary"][1])
    readings = read_readings(path, unit="mm", normal_sd=0.1)
    np.testing.assert_allclose(readings.normals, UP, atol=1e-6)
    np.testing.assert_allclose(readings.normal_sds, 0.1)
    assert not read_readings(path, unit="mm").normal_sds.given.any()


def test_an_unknown_format_lists_all(tmp_path):
    with pytest.raises(InputError, match=r"expected one of csv, ply, .*Did you mean 'grbl'"):
        read_readings(save(tmp_path, console()), format="gbrl")


def test_the_table_of_formats_describes_each():
    assert all(row.name == name and row.words for name, row in FORMATS.builtin.items())
    assert issubclass(UnitError, InputError)


ENDS = {"fusion": "END", "dmis": "ENDFIL", "fanuc": "/END", "kuka": "ENDDAT", "abb": "ENDMODULE", "ur": "end"}


@pytest.mark.parametrize("case", ENDS)
def test_a_log_that_breaks_off_is_noted_or_refused(tmp_path, case):
    _, content, options = CASES[case]
    whole = content if ENDS[case] in content.split() else f"{content}{ENDS[case]}\n"
    notes = read_readings(save(tmp_path, whole), **options).notes
    assert not any("cut off" in note for note in notes)
    cut = whole[: whole.rindex(ENDS[case])]
    notes = read_readings(save(tmp_path, cut), **options).notes
    assert any(note.startswith(f"{ENDS[case]} is missing at the end") for note in notes)
    if case != "fanuc":  # a position that is cut has no closing bracket, and is no position
        last = cut.rstrip()
        while not last[-1].isdigit():
            last = last[:-1]
        with pytest.raises(ReadingsError, match=r"breaks off in|expected"):
            read_readings(save(tmp_path, last), **options)


def test_an_excerpt_without_a_start_needs_no_end(tmp_path):
    poses = "\n".join(line for line in CASES["ur"][1].splitlines() if "p[" in line)
    assert not any("cut off" in note for note in read_readings(save(tmp_path, poses), radius=0.0).notes)


def test_an_interrupted_height_map_keeps_its_grid(tmp_path):
    grid = "0 20 3\n0 10 2\n-5 5 100\n"
    points = [(x, y, -1.5) for y in (0, 10) for x in (0, 10, 20)]
    for count in (6, 4):
        readings = read_readings(save(tmp_path, grid + rows(points[:count])), unit="mm", radius=1.0)
        assert len(readings) == count
        assert any(f"{6 - count} points of the grid of 3 x 2 missing" in note for note in readings.notes) == (count < 6)
    with pytest.raises(ReadingsError, match="3 x 2 points, got 7"):
        read_readings(save(tmp_path, grid + rows([*points, (30, 10, -1)])), unit="mm", radius=1.0)


@pytest.mark.parametrize("step", [11, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", CASES)
def test_a_file_cut_anywhere_gives_only_rows_of_the_whole(tmp_path, case, step):
    """Cut a sample: it is refused, or its points are the first ones of the sample.

    The last of three points is not compared, because they do not show how many decimals a program writes; nor are the
    nominal points of DMIS, which stand above the actual ones and are used, with a note, where these are missing.
    """
    _, content, options = CASES[case]
    data = content if isinstance(content, bytes) else content.encode()
    path = tmp_path / "log"
    for end in range(0, len(data), step):
        path.write_bytes(data[:end])
        try:
            readings = read_readings(path, **options)
        except InputError:
            continue
        if len(readings) >= 3 and not any("nominal" in note for note in readings.notes):
            sure = len(readings) - (len(readings) == 3)
            assert len(readings) <= 4
            np.testing.assert_allclose(
                readings.points[:sure], P[:sure] / 1000, atol=2e-7, err_msg=str(data[:end][-40:])
            )


def test_a_height_map_of_reprapfirmware_is_a_grid(tmp_path):
    text = (
        "RepRapFirmware height map file v2 generated at 2026-01-01 12:00, min error -0.100, max error 0.200\n"
        "axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1\n"
        "X,Y,5.00,25.00,10.00,20.00,-1.00,10.00,10.00,3,2\n"
        "  0.000,  0.100,  0.200\n"
        " -0.100,      0,  0.050\n"
    )
    readings = read_readings(save(tmp_path, text))
    expected = [[5, 10, 0], [15, 10, 0.1], [25, 10, 0.2], [5, 20, -0.1], [25, 20, 0.05]]
    np.testing.assert_allclose(readings.points, np.array(expected) / 1000, atol=1e-12)
    np.testing.assert_array_equal(readings.directions, [[0, 0, -1]] * 5)
    assert any("1 point of the grid not probed" in note for note in readings.notes)
    old = text.replace("axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1",
                       "xmin,xmax,ymin,ymax,radius,xspacing,yspacing,xnum,ynum")  # fmt: skip
    old = old.replace("X,Y,5.00", "5.00")
    np.testing.assert_array_equal(read_readings(save(tmp_path, old)).points, readings.points)
    for cut in (text[:-27], text[:-3], text[: text.index("  0.000")]):
        with pytest.raises(ReadingsError, match=r"height|last line"):
            read_readings(save(tmp_path, cut))


def test_circles_of_a_listing_are_centres(tmp_path):
    text = (
        "CIR1 =FEAT/CONTACT/CIRCLE/DEFAULT,CARTESIAN,IN,LEAST_SQR\nTHEO/<10,20,5>,<0,0,1>,8\n"
        "ACTL/<10.01,20.02,5>,<0,0,1>,8.02\nCIR2 =FEAT/CIRCLE,POLAR,IN\nACTL/<1,2,3>,<0,0,1>,4\n"
    )
    readings = read_readings(save(tmp_path, text), unit="mm")
    assert (readings.kinds, readings.material_sides) == (("centre",), ("hole",))
    np.testing.assert_allclose(readings.hole_radii, [4.01e-3])
    assert any("1 feature of other kinds, in polar coordinates" in note for note in readings.notes)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("%\nO1234\nG90 G54\nG1 X10 Y20 Z3 F100\nX12 Y3 Z4\n", "a G-code program. Give the log"),
        ("0 BEGIN PGM A MM\n1 L X+10 Y+20\n", "a Heidenhain program. Give the file that FN 16"),
        ("ISO-10303-21;\nHEADER;\n", "a CAD file (STEP). Give it with --part"),
        ("%PDF-1.7\n", "a PDF report"),
        ("  0\nSECTION\n  2\nENTITIES\n", "a CAD file (IGES, DXF or VDA)"),
        (f"{'A part':72}S      1\n", "a CAD file (IGES, DXF or VDA)"),
        ("<table><tr><td>1</td></tr></table>", "a web page"),
        ("N10 CYCLE977(1,,1)\n", "a Siemens program or log"),
        ("Bilinear Leveling Grid:\n      0      1\n 0 +0.1 +0.2\n", "heights of a bed without places"),
        ("Stopped at height 1.234 mm\n", "heightmap.csv"),
        ("planid\tidsymbol\tactual\tfeatureid\np\tdiameter\t3.0\tC1\n", "Add xValue, yValue and zValue"),
    ],
)
def test_other_files_are_named_with_what_to_export(tmp_path, content, message):
    with pytest.raises(ReadingsError) as caught:
        read_readings(save(tmp_path, content), unit="mm")
    assert message in str(caught.value)


def test_names_of_axes_in_a_table_are_no_words(tmp_path):
    rows = "".join(f"{axis}{k},{k},20.5,30.5\n" for k in range(1, 5) for axis in "xyz")
    readings = read_readings(save(tmp_path, "id,x_mm,y_mm,z_mm\n" + rows))
    assert readings.ids[:3] == ("x1", "y1", "z1")


def test_the_rest_of_a_row_with_names_is_no_number(tmp_path):
    rows = "".join(f"A,MEAS,p{k},{k}.5,20.25,30.5,2025-03-02 10:11:1{k}\n" for k in range(4))
    readings = read_readings(save(tmp_path, rows), unit="mm")
    assert readings.ids[0] == "A MEAS p0"
    np.testing.assert_allclose(readings.points[3], [3.5e-3, 20.25e-3, 30.5e-3])


def test_the_last_touch_of_a_search_counts(tmp_path):
    path = save(
        tmp_path,
        "$13=0\n[PRB:1.000,2.000,-3.120:1]\n[PRB:1.000,2.000,-3.050:1]\n[PRB:9.000,2.000,-3.051:1]\n"
        "[PRB:9.000,7.000,-3.100:1]\n[PRB:9.500,7.000,-3.100:1]\n",
    )
    readings = read_readings(path, radius=0.0)
    np.testing.assert_allclose(1e3 * readings.points.values[:, 2], [-3.05, -3.051, -3.1, -3.1])
    assert any("1 touch of searches in several steps" in note for note in readings.notes)


@pytest.mark.parametrize("form", ["[PRB:{}:1]", '{{"prb":{{"e":1,"x":{},"y":{},"z":{}}}}}', "{} {} {} 0 0 0 0 0 0"])
def test_many_touches_in_a_row_are_repeats_of_a_place(tmp_path, form):
    places = [(1.0, 2.0, -3.0 - 1e-3 * k) for k in range(5)] + [(9.0, 2.0, -3.5), (9.0, 2.0, -3.4), (9.0, 8.0, -3.4)]
    words = [[f"{x:.3f}" for x in place] for place in places]
    lines = [form.format(",".join(w)) if form.count("{}") == 1 else form.format(*w) for w in words]
    readings = read_readings(save(tmp_path, "\n".join(lines) + "\n"), unit="mm", radius=0.0)
    assert readings.ids == ("1", "2", "3", "4", "5", "7", "8")
    assert any("the last and slowest counts" in note for note in readings.notes)


@pytest.mark.parametrize(
    ("cells", "step"),
    [
        ("10.25,4.50,31.52", 1e-5),
        ("10,4.5,31.521", 1e-6),
        ("10,4,31", 0.0),
        ("10.123456789,4.5,31", 0.0),
    ],
)
def test_the_step_is_that_of_the_last_digit(tmp_path, cells, step):
    readings = read_readings(save(tmp_path, f"x_mm,y_mm,z_mm\n{cells}\n{cells}\n0,0,0\n"))
    assert readings.step == pytest.approx(step, rel=1e-9)
    assert readings.take([0, 2]).step == readings.step


def test_the_step_of_inches_is_in_metres(tmp_path):
    readings = read_readings(save(tmp_path, "$13=1\n[PRB:1.0001,2.0,-3.5:1]\n[PRB:4.0,2.5,-3.5:1]\n"), radius=0.0)
    assert readings.step == pytest.approx(2.54e-6)


PLACES = [(10.25, 20.5, 30.125), (60.75, 20.5, 30.125), (60.75, 80.25, 30.25), (10.25, 80.25, 12.5)]


def table(header, row, places=PLACES, comma=False):
    lines = [row.format(k, *(f"{v:.3f}".replace(".", "," if comma else ".") for v in p)) for k, p in enumerate(places)]
    return "\n".join([header, *lines]) + "\n"


@pytest.mark.parametrize(
    ("header", "row", "comma"),
    [
        ("Point;X mesuré;Y mesuré;Z mesuré;Ecart", "P{};{};{};{};0,01", True),
        ("Punto;X medido;Y medido;Z medido;Desviación", "P{};{};{};{};0,01", True),
        ("点号,X实测,Y实测,Z实测,备注", "P{},{},{},{},", False),
        ("点名,X座標,Y座標,Z座標", "P{},{},{},{}", False),
        ("Punkt;X;Y;Z;Ist X;Ist Y;Ist Z", "P{0};0,5;0,5;0,5;{1};{2};{3}", True),
        ("Messung;Achse X;Achse Y;Achse Z;Soll Achse X;Soll Achse Y;Soll Achse Z", "{0};{1};{2};{3};0;0;0", True),
        ("nr,probe x result,probe y result,probe z result", "{},{},{},{}", False),
        ("ID,XMM,YMM,ZMM", "{},{},{},{}", False),
        ("Feature,X,Y,Z,A,B,Pass/Fail", "P{},{},{},{},90,-90,PASS", False),
    ],
)
def test_names_of_columns_in_other_words(tmp_path, header, row, comma):
    readings = read_readings(save(tmp_path, table(header, row, comma=comma)), unit=None if "MM" in header else "mm")
    np.testing.assert_allclose(1e3 * readings.points.values, PLACES)


@pytest.mark.parametrize(
    ("header", "row", "comma"),
    [
        ("x;y;d", "{1};{2};8,010", True),
        ("Bohrung;X-Pos;Y-Pos;Durchmesser", "{};{};{};8,010", True),
        ("Hole,X (mm),Y (mm),Diameter (mm),remark", "H{},{},{},8.01,ok", False),
        ("# plug plate\nX Y D", "{1} {2} 8.01", False),
        ("X,Y,Dia\nmm,mm,mm", "{1},{2},8.01", False),
    ],
)
def test_a_table_without_heights_holds_centres(tmp_path, header, row, comma):
    stated = "mm" not in header
    readings = read_readings(save(tmp_path, table(header, row, comma=comma)), unit="mm" if stated else None)
    assert set(readings.kinds) == {"centre"}
    np.testing.assert_allclose(1e3 * readings.points.values[:, :2], [p[:2] for p in PLACES])
    np.testing.assert_allclose(readings.hole_radii.values, 4.005e-3)


def test_the_measured_value_of_a_renishaw_report_counts(tmp_path):
    rows = "".join(
        f"FEATURE NO {k}\n"
        + "".join(f"POSN {a} {v:.3f} ACTUAL {v + 0.01:.3f} TOL 0.1 DEV 0.01\n" for a, v in zip("XYZ", p, strict=True))
        for k, p in enumerate(PLACES)
    )
    readings = read_readings(save(tmp_path, rows), unit="mm")
    np.testing.assert_allclose(1e3 * readings.points.values, np.array(PLACES) + 0.01)


def test_two_nearly_equal_points_a_row_are_refused(tmp_path):
    rows = table("", "P{0} {1} {2} {3} {1}1 {2}1 {3}1 0.001").lstrip()
    with pytest.raises(ReadingsError, match="nominal and measured"):
        read_readings(save(tmp_path, rows), unit="mm")


def test_names_of_features_may_repeat_but_ids_may_not(tmp_path):
    rows = "a,1,2,3\na,4,5,6\n"
    assert read_readings(save(tmp_path, "Name,x_mm,y_mm,z_mm\n" + rows + ",7,8,9\n")).ids == ("a", "a.2", "3")
    with pytest.raises(ReadingsError, match="every reading"):
        read_readings(save(tmp_path, "id,x_mm,y_mm,z_mm\n" + rows))


def test_a_table_of_heidenhain_ends(tmp_path):
    rows = table("BEGIN POINTS.PNT MM\nNR X Y Z", "{} {} {} {}") + "[END]\n"
    np.testing.assert_allclose(1e3 * read_readings(save(tmp_path, rows), unit="mm").points.values, PLACES)


def test_system_variables_of_a_skip_signal_are_positions(tmp_path):
    rows = table("", "#5061={1} #5062={2} #5063={3}").lstrip()
    np.testing.assert_allclose(1e3 * read_readings(save(tmp_path, rows), unit="mm").points.values, PLACES)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("A lathe", "HIT/BASIC,NORMAL,<1.5,2.5,3.5>,<0,0,1>,<{1},{2},{3}>,USE THEO=YES"),
        ("$$ NO", "    HIT/VECTOR,1.5,2.5,3.5,0,0,1,{1},{2},{3}"),
        ("Grbl 0.9j ['$' for help]", "[PRB:{1},{2},{3}]\nok"),
        ("", "+X {1} {2} {3}"),
        ("", "probe -Z: {1}, {2}, {3}"),
        ("no,#5061,#5062,#5063", "{},{1},{2},{3}"),
        ("", "(LOG {} 5061={1} 5062={2} 5063={3})"),
        ("P = [", "  {1} {2} {3};"),
        ("points = [", "    ({1}, {2}, {3}),"),
        ("", "P{} = POINT / {1},{2},{3}"),
        ("", "171234560{}.123 {1} {2} {3}"),
        ("", "{1}D+00 {2}D+00 {3}D+00"),
    ],
)
def test_positions_of_other_programs_are_read(tmp_path, header, row):
    end = {"P = [": "];\n", "points = [": "]\n"}.get(header, "")
    readings = read_readings(save(tmp_path, table(header, row.replace("{}", "{0}")) + end), unit="mm", radius=0.0)
    np.testing.assert_allclose(1e3 * readings.points.values, PLACES, atol=1e-9)


def test_lists_of_points_on_one_line_are_read(tmp_path):
    rows = ["({}, {}, {})", "{} {} {}"]
    for text in (
        f"[{', '.join(rows[0].format(*p) for p in PLACES)}]",
        f"P = [{'; '.join(rows[1].format(*p) for p in PLACES)}];",
    ):
        readings = read_readings(save(tmp_path, text + "\n"), unit="mm")
        np.testing.assert_allclose(1e3 * readings.points.values, PLACES, atol=1e-9)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("x,y,z", '{1}",{2}",{3}"'),
        ("x,y,z", '"{1}""","{2}""","{3}"""'),
        ("", 'X {1}" Y {2}" Z {3}"'),
        ("", "Point {}: X {1} Y {2} Z {3} in"),
        ("", "{1}in {2}in {3}in"),
    ],
)
def test_marks_of_inches_state_the_unit(tmp_path, header, row):
    readings = read_readings(save(tmp_path, table(header, row.replace("{}", "{0}")).lstrip()))
    np.testing.assert_allclose(readings.points.values / 0.0254, PLACES, atol=1e-9)
    with pytest.raises(UnitError, match="units"):
        read_readings(save(tmp_path, table("", "X {1} Y {2} Z {3} in place").lstrip()))


@pytest.mark.parametrize("header", ["x_mm,y_mm,z_mm", ""])
def test_a_typographic_minus_is_one(tmp_path, header):
    rows = table(header, "{1},{2},\N{MINUS SIGN}{3}").lstrip()
    readings = read_readings(save(tmp_path, rows), unit=None if header else "mm")
    np.testing.assert_allclose(1e3 * readings.points.values, np.array(PLACES) * [1, 1, -1], atol=1e-9)
