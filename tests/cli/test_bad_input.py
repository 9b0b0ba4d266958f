"""Errors of users: each case has its exit code and a message, no traceback, and no answer on stdout."""

from __future__ import annotations

import json
import struct
from typing import NamedTuple

import numpy as np
import pytest

FAILED, MISUSED = 1, 2

GOOD = "id,x_mm,y_mm,z_mm\na,0,0,10\nb,10,0,20\nc,20,0,5\n"
HAND = "hand_x_mm,hand_y_mm,hand_z_mm,hand_qw,hand_qx,hand_qy,hand_qz"
RANGED = f"id,range_mm,sensor,{HAND}\na,100,eye,0,0,0,1,0,0,0\n"
RIG = '[sensors.eye]\npreset = "vl53l0x"\nposition_mm = [0, 0, 50]\ndirection = [0, 0, 1]\n'


class Case(NamedTuple):
    """Readings, further arguments, exit code, part of the message; ``rig`` and ``parts`` replace the good ones."""

    name: str
    readings: str | bytes
    args: str
    code: int
    message: str
    rig: str | None = None


def readings(name, content, message, code=FAILED):
    return Case(name, content, "--sd 0.3mm", code, message)


def options(name, args, message, code=MISUSED, content=GOOD, rig=None):
    return Case(name, content, args, code, message, rig)


def with_row(row):
    return GOOD + row + "\n"


def with_column(column, *cells):
    head, *rows = GOOD.splitlines()
    cells = cells or ("",) * len(rows)
    return "\n".join([f"{head},{column}", *(f"{row},{cell}" for row, cell in zip(rows, cells, strict=True)), ""])


READINGS = [
    readings("empty file", "", "got an empty file"),
    readings("only comments", "# nothing\n#\n", "got an empty file"),
    readings("only blank lines", "\n\n  \n", "got an empty file"),
    readings("header only", "id,x_mm,y_mm,z_mm\n", "expected at least one reading below the header"),
    readings("binary", bytes(range(256)), "got a binary one"),
    readings("zip", b"PK\x03\x04\x14\0\0\0", "Save the sheet as CSV"),
    readings("executable", b"\x7fELF\2\0\0\0\3", "got a binary one"),
    readings("no header", "a,2,3\n4,5,6\n", "expected a header that names the columns"),
    readings("slashes", GOOD.replace(",", "/"), "got 'id/x_mm/y_mm/z_mm'"),
    readings("json", '{"x": 1}', "expected points with x, y and z, got a JSON document"),
    readings("unknown unit", GOOD.replace("_mm", "_cm"), "expected one of the units x_mm, x_m, x_um, x_in, got 'x_cm'"),
    readings("two units", with_column("x_m", "0", "1", "2"), "got it also as 'x_mm'"),
    readings("column twice", with_column("x_mm", "0", "1", "2"), "expected 'x' once"),
    readings(
        "wrong unit", GOOD.replace("_mm", "_m").replace("10,0", "381,0"), "is the unit in the column's name right"
    ),
    readings("metres for millimetres", GOOD.replace("_mm", "_m"), "Check the units in the names of the columns"),
    readings("misspelt column", with_column("featrue"), "Did you mean 'feature'"),
    readings("diameter", with_column("diameter_mm", "3", "3", "3"), "name the column radius_mm and halve"),
    readings("missing z", "x_mm,y_mm\n1,2\n", "got only x_mm, y_mm. Add z"),
    readings("half a direction", with_column("dx", "1", "1", "1"), "Add dy, dz"),
    readings("half a hand", with_column("hand_qw", "1", "1", "1"), "Add hand_x, hand_y"),
    readings("no place at all", "id,sd_mm\na,1\n", "Add where the points are"),
    readings("text in a number", with_row("d,1,2,abc"), "line 5, column 'z_mm': expected a finite number, got 'abc'"),
    readings("unit in a number", with_row("d,1kg,2,3"), "line 5, column 'x_mm': expected a finite number, got '1kg'"),
    readings("another unit", with_row("d,1in,2,3"), "line 5, column 'x_mm': expected a finite number, got '1in'"),
    readings("unit against name", "x_mm,y_mm,z_mm\n1 mm,2 in,3 mm\n4,5,6\n", "expected a finite number, got '2 in'"),
    readings("nan", with_row("d,nan,2,3"), "line 5, column 'x_mm': expected a finite number, got 'nan'"),
    readings("infinity", with_row("d,1,-inf,3"), "column 'y_mm': expected a finite number, got '-inf'"),
    readings("overflow", with_row("d,1,2,1e999"), "got '1e999'"),
    readings("underscore", with_row("d,1_0,2,3"), "got '1_0'"),
    readings("hexadecimal", with_row("d,0x1F,2,3"), "got '0x1F'"),
    readings("spreadsheet error", with_row("d,#REF!,2,3"), "got '#REF!'"),
    readings("escape sequence", with_row("d,\x1b[2J,2,3"), "got '\\x1b[2J'"),
    readings("decimal comma", with_row("d,1,5,2,5,3,5"), "Mind decimal commas"),
    readings("ragged row", with_row("d,1,2"), "line 5: expected 4 cells as in the header, got 3"),
    readings("row of commas", with_row("d,,,"), "expected a point"),
    readings("hole in a point", with_row("d,1,,3"), "line 5, column 'y_mm': expected all of x, y, z or none"),
    readings("duplicate id", with_row("a,1,2,3"), "line 5, column 'id': expected every reading to have"),
    readings("empty id", with_row(",1,2,3"), "line 5, column 'id': expected a name"),
    readings(
        "open quote",
        with_row('d,1,2,"3'),
        "line 5: expected comma-separated cells, got a quotation mark that is never closed",
    ),
    readings(
        "free but met", with_column("dx,dy,dz,max_mm,kind,status", *["0,0,1,50,free,ok"] * 3), "expected status none"
    ),
    readings("giant cell", with_row("d,1,2," + "1" * 200_000), "field larger than field limit"),
    readings("negative sd", with_column("sd_mm", "1", "-1", "1"), "line 3, column 'sd_mm': expected a positive number"),
    readings("zero sd", with_column("sd_mm", "1", "1", "0"), "column 'sd_mm': expected a positive number, got '0'"),
    readings("infinite sd", with_column("sd_mm", "1", "inf", "1"), "'sd_mm': expected a finite number, got 'inf'"),
    readings("negative radius", with_column("radius_mm", "1", "-1", "1"), "column 'radius_mm': expected zero or more"),
    readings("zero direction", with_column("dx,dy,dz", *["0,0,0"] * 3), "expected a direction that is not zero"),
    readings("zero normal", with_column("nx,ny,nz", *["0,0,0"] * 3), "column 'nx': expected a direction"),
    readings("normal sd alone", with_column("normal_sd_deg", "1", "1", "1"), "expected a normal beside it"),
    readings("quaternion not unit", with_column(HAND, *["0,0,0,1,1,0,0"] * 3), "expected a unit quaternion"),
    readings("quaternion zero", with_column(HAND, *["0,0,0,0,0,0,0"] * 3), "got 'length 0'"),
    readings("hole in a hand", with_column(HAND, *["0,0,0,1,0,0,"] * 3), "expected all of hand_x"),
    readings(
        "degrees as radians",
        with_column(HAND.partition(",hand_q")[0] + ",hand_rx_rad,hand_ry_rad,hand_rz_rad", *["0,0,0,92.3,0,0"] * 3),
        "of reading 'a': 92.3 rad is more than a full turn: are these degrees? Name the column hand_rx_deg.",
    ),
    readings(
        "two rotations of a hand", with_column(f"{HAND},hand_yaw_deg", *["0,0,0,1,0,0,0,9"] * 3), "rotation in one way"
    ),
    readings("unknown kind", with_column("kind", "point", "corner", ""), "column 'kind': expected one of plane, edge"),
    readings("kind without label", with_column("kind", "plane", "", ""), "expected a label for kind 'plane'"),
    readings("mixed kinds", with_column("feature,kind", "A,plane", "A,edge", "A,plane"), "Give one label one kind"),
    readings("edge of one", with_column("feature,kind", "A,edge", ",", ","), "at least 2 readings of kind edge, got 1"),
    readings(
        "ball on an edge",
        with_column("radius_mm,feature,kind", "1,A,edge", "1,A,edge", "1,A,edge"),
        "whose contact on an edge is unknown",
    ),
    readings("unknown status", with_column("status", "ok", "lost", "ok"), "column 'status': expected one of ok, none"),
    readings("free without beam", with_column("status", "ok", "none", "ok"), "expected where the beam was"),
    readings("zero range", RANGED.replace("100", "0"), "column 'range_mm': expected a dis"),
]

OPTIONS = [
    options("sd without unit", "--sd 0.3", "--sd: expected a unit (mm, m, um, in) as in 0.3mm, got '0.3'"),
    options("sd in an unknown unit", "--sd 0.3cm", "--sd: expected a unit of mm, m, um, in, got 'cm'"),
    options("sd without number", "--sd mm", "--sd: expected a number and its unit"),
    options("negative sd option", "--sd -0.3mm", "--sd: expected a positive length, got '-0.3mm'"),
    options("zero sd option", "--sd 0mm", "--sd: expected a positive length"),
    options("infinite sd option", "--sd infmm", "--sd: expected a number and its unit"),
    options("overflowing sd option", "--sd 1e999mm", "--sd: expected a finite number"),
    options("two sds", "--sd 1,2mm", "--sd: expected one length"),
    options("unknown sensor", "--sensor vl53l0", "Did you mean 'vl53l0x'"),
    options("sensor needs the range", "--sensor hc_sr04", "the noise of 'hc_sr04' depends on the range"),
    options("unknown robot", "--sd 1mm --robot xam", "Did you mean 'xarm'"),
    options("alpha zero", "--sd 1mm --significance 0", "--significance: expected a number between 0 and 1, got 0"),
    options("alpha one", "--sd 1mm --significance 1", "--significance: expected a number between 0 and 1, got 1"),
    options("alpha nan", "--sd 1mm --significance nan", "--significance: expected a number between 0 and 1, got nan"),
    options("alpha text", "--sd 1mm --significance small", "--significance"),
    options("top zero", "--sd 1mm --top 0", "--top: expected 1 or more, got 0"),
    options("top fraction", "--sd 1mm --top 1.5", "--top"),
    options("negative seed", "--sd 1mm --seed -1", "--seed: expected 0 or more"),
    options("negative tolerance", "--sd 1mm --form-sd -1mm", "--form-sd: expected a length of zero or more"),
    options("tolerance without unit", "--sd 1mm --form-sd 0.1", "--form-sd: expected a unit"),
    options("tip sd of two", "--sd 1mm --tip-sd 1,1mm", "--tip-sd: expected three lengths"),
    options("negative tip sd", "--sd 1mm --tip-sd 1,-1,1mm", "--tip-sd: expected three lengths"),
    options("tip sd without unit", "--sd 1mm --tip-sd 1,1,1", "--tip-sd: expected a unit"),
    options("sd of a light year", "--sd 1e16m", "--sd: expected a length from 1e-09 up to 1e+06 m, got '1e16m'"),
    options("sd of nothing", "--sd 1e-20mm", "--sd: expected a length from 1e-09 up to 1e+06 m, got '1e-20mm'"),
    options("tolerance of a light year", "--sd 1mm --form-sd 1e16m", "--form-sd: expected a length up to 1e+06 m"),
    options("tip sd of a light year", "--sd 1mm --tip-sd 0,1e16,0m", "--tip-sd: expected lengths up to 1e+06 m"),
    options("table of a light year", "--sd 1mm --table 0+-1e16m", "--table: expected a length from 1e-09 to 1e+06 m"),
    options("box of a light year", "--sd 1mm --box 0,0,0,1e16,1,1m", "--box: expected coordinates up to 1e+06 m"),
    options("as published without labels", "--sd 1mm --as-published", "--as-published: expected every reading to have"),
    options("tip sd without hand", "--sd 1mm --tip-sd 1,1,1mm", "Add the columns hand_x_mm"),
    options("unknown part unit", "--sd 1mm --units furlong", "unit: expected one of"),
    options("unknown option", "--sd 1mm --tolerence 1mm", "--tolerence"),
    options("option without value", "--sd", "--sd"),
    options("two readings files", "--sd 1mm more.csv", "more.csv"),
    options("range without rig", "--sd 1mm", "Give one (--rig rig.toml)", content=RANGED),
    options("range too far", "", "got 5 m", FAILED, RANGED.replace("100", "5000"), RIG),
    options(
        "range in mm, read as m",
        "",
        "It would be in range in mm: correct the unit",
        FAILED,
        RANGED.replace("range_mm", "range_m").replace("100", "90"),
        RIG,
    ),
    options(
        "range in m, read as mm", "", "It would be in range in m: correct", FAILED, RANGED.replace("100", "0.1"), RIG
    ),
    options(
        "sensor not on the rig",
        "",
        "sensor of a reading: expected one of the rig's (eye), got 'eey'",
        content=RANGED.replace("eye", "eey"),
        rig=RIG,
    ),
    options("rig is not toml", "", "expected TOML", FAILED, RANGED, "[sensors"),
    options("rig misspelt", "", "Did you mean 'position_mm'", FAILED, RANGED, RIG.replace("position", "postion")),
    options("rig without unit", "", "the unit in the name", FAILED, RANGED, RIG.replace("position_mm", "position")),
    options("empty rig", "", "expected tables [sensors.NAME]", FAILED, RANGED, ""),
]


def refused(result, code, message, *, as_json=False):
    assert "Traceback" not in result.err
    assert message in result.err.replace("\n", " ")
    assert result.code == code
    assert bool(result.out) == (as_json and "Error: " not in result.err)  # the parser of options prints text only
    if result.out:
        document = json.loads(result.out)
        assert (document["schema"], document["exit_code"]) == ("tanteo.error/1", code)
        assert message in document["message"].replace("\x1b", "\\x1b").replace("\n", " ")


@pytest.mark.parametrize("as_json", [[], ["--json"]], ids=["plain", "json"])
@pytest.mark.parametrize("case", READINGS + OPTIONS, ids=lambda c: c.name)
def test_refused(run, tmp_path, parts, case, as_json):
    path = tmp_path / "r.csv"
    path.write_bytes(case.readings if isinstance(case.readings, bytes) else case.readings.encode())
    args = ["--units", "mm", "--parts", parts]
    if case.rig is not None:
        (tmp_path / "rig.toml").write_text(case.rig)
        args += ["--rig", tmp_path / "rig.toml"]
    # what is typed last wins, so the case may replace --units
    refused(run("identify", path, *args, *as_json, *case.args.split()), case.code, case.message, as_json=bool(as_json))


def binary_stl(triangles, claimed=None):
    out = b"\0" * 80 + struct.pack("<I", len(triangles) if claimed is None else claimed)
    return out + b"".join(struct.pack("<12fH", 0, 0, 0, *map(float, t.ravel()), 0) for t in triangles)


def nan_corner(triangles):
    out = np.array(triangles)
    out[0, 0, 0] = np.nan
    return out


PARTS = [
    ("missing part", "none.stl", None, "none.stl"),
    ("empty part", "p.stl", lambda t: b"", "p.stl: expected a CAD file, got an empty one"),
    ("text as a part", "p.stl", lambda t: b"hello", "p.stl: expected"),
    ("readings as a part", "p.csv", lambda t: GOOD.encode(), "Export it as STEP"),
    ("picture as a part", "p.png", lambda t: b"\x89PNG\r\n", "Export it as STEP"),
    ("no suffix", "p", lambda t: b"x", "Export it as STEP"),
    ("broken step", "p.step", lambda t: b"ISO-10303-21;\nHEADER;\n", "p.step"),
    ("stl called step", "p.step", binary_stl, "p.step"),
    ("truncated stl", "p.stl", lambda t: binary_stl(t)[:-70], "p.stl"),
    ("stl that promises more", "p.stl", lambda t: binary_stl(t, 10_000_000), "p.stl"),
    ("stl without triangles", "p.stl", lambda t: binary_stl(t[:0]), "p.stl"),
    ("nan corner", "p.stl", lambda t: binary_stl(nan_corner(t)), "p.stl"),
    ("zero-area faces only", "p.stl", lambda t: binary_stl(np.repeat(t[:, :1], 3, axis=1)), "p.stl"),
    ("part of kilometres", "p.stl", lambda t: binary_stl(t * 1e5), "too large"),
    (
        "part in metres",
        "p.stl",
        lambda t: binary_stl(t * 1e-3),
        "Did you mean --units m or --units ft?",
    ),
    ("part of nanometres", "p.stl", lambda t: binary_stl(t * 1e-4), "too small"),
    ("empty off", "p.off", lambda t: b"OFF\n", "p.off"),
    ("obj of nothing", "p.obj", lambda t: b"# nothing\n", "p.obj"),
]


COMMANDS = [("identify", PARTS, ()), *((c, PARTS[1:2], ()) for c in ("locate", "show"))]
COMMANDS += [(c, PARTS[:1] + PARTS[2:], pytest.mark.slow) for c in ("locate", "show")]
"""Commands, parts that they refuse, and marks: two more commands with one part are quick, with all are slow."""


@pytest.mark.parametrize(
    ("name", "content", "message", "command"),
    [
        pytest.param(*case, command, id=f"{title}-{command}", marks=marks)
        for command, cases, marks in COMMANDS
        for title, *case in cases
    ],
)
def test_parts_refused(run, tmp_path, wedge, name, content, message, command):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content(wedge))
    (tmp_path / "r.csv").write_text(GOOD)
    before = {
        "identify": ["identify", tmp_path / "r.csv", "--sd", "1mm", "--parts"],
        "locate": ["locate", tmp_path / "r.csv", "--sd", "1mm", "--part"],
        "show": ["part", "show"],
    }[command]
    refused(run(*before, path, "--units", "mm"), FAILED, message)


@pytest.mark.parametrize(
    "command", [["part", "show"], ["identify", "r.csv", "--sd", "1mm", "--parts"]], ids=["show", "identify"]
)
def test_stl_needs_units(run, tmp_path, parts, command, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "r.csv").write_text(GOOD)
    refused(run(*command, parts / "wedge.stl"), MISUSED, "Pass --units mm (or um")


CALLS = [
    ("readings missing", ["identify", "none.csv", "--parts", "parts"], FAILED, "none.csv: expected a readings file"),
    ("readings a folder", ["identify", "parts", "--parts", "parts"], FAILED, "Is a directory"),
    ("readings a part", ["identify", "parts/block.stl", "--parts", "r.csv"], FAILED, "CAD files after --parts"),
    ("readings below a file", ["identify", "r.csv/x.csv", "--parts", "parts"], FAILED, "Not a directory"),
    ("readings name too long", ["identify", "x" * 5000, "--parts", "parts"], FAILED, "File name too long"),
    ("readings have no name", ["identify", "", "--parts", "parts"], FAILED, "expected a readings file"),
    ("no readings", ["identify", "--parts", "parts"], MISUSED, "READINGS"),
    ("no parts option", ["identify", "r.csv"], MISUSED, "--parts"),
    ("parts without value", ["identify", "r.csv", "--parts"], MISUSED, "--parts"),
    ("empty folder", ["identify", "r.csv", "--sd", "1mm", "--parts", "empty"], FAILED, "got none in this folder"),
    ("missing folder", ["identify", "r.csv", "--sd", "1mm", "--parts", "nowhere"], FAILED, "nowhere"),
    (
        "two missing parts",
        ["identify", "r.csv", "--sd", "1mm", "--parts", "a", "b"],
        FAILED,
        "a: expected a file, got nothing there.",
    ),
    ("locate a folder", ["locate", "r.csv", "--sd", "1mm", "--part", "parts"], FAILED, "expected one CAD file"),
    ("locate nothing", ["locate", "r.csv"], MISUSED, "--part"),
    ("show a folder", ["part", "show", "parts"], FAILED, "expected one CAD file"),
    ("show nothing", ["part", "show"], MISUSED, "FILE"),
    ("show in unknown units", ["part", "show", "parts/block.stl", "--units", "ell"], MISUSED, "unit: expected one of"),
    (
        "rig missing",
        ["identify", "r.csv", "--rig", "none.toml", "--parts", "parts"],
        FAILED,
        "none.toml: expected a",
    ),
    (
        "report into no folder",
        ["identify", "r.csv", "--sd", "1mm", "--parts", "parts", "--units", "mm", "--report", "no/r.html"],
        FAILED,
        "--report: expected a file that can be written, got 'no/r.html': there is no folder 'no'. Make it first.",
    ),
    (
        "plan into no folder",
        [
            "plan",
            "--part",
            "parts/block.stl",
            "--units",
            "mm",
            "--sd",
            "1mm",
            "--goal",
            "9mm",
            "--csv",
            "no/p.csv",
        ],
        FAILED,
        "--csv: expected a file that can be written",
    ),
    (
        "picture of no kind",
        ["see", "i.png", "--camera", "c", "--parts", "parts", "--picture", "p.svg"],
        MISUSED,
        ".png",
    ),
    ("rig into a folder", ["sensor", "fit", "r.csv", "--write", "parts"], FAILED, "it is a folder"),
    ("unknown command", ["recognise", "r.csv"], MISUSED, "recognise"),
    ("unknown part command", ["part", "sow", "x"], MISUSED, "sow"),
]


@pytest.mark.parametrize(("args", "code", "message"), [c[1:] for c in CALLS], ids=[c[0] for c in CALLS])
def test_calls_refused(run, tmp_path, parts, args, code, message, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "r.csv").write_text(GOOD)
    (tmp_path / "empty").mkdir()
    refused(run(*args), code, message)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x_mm,y_mm,z_mm,feature,kind\n0,0,0,A,plane\n10,0,0,A,plane\n20,0,0,A,plane\n", "lie on one line"),
        ("x_mm,y_mm,z_mm,feature,kind\n0,0,0,A,edge\n0,0,0,A,edge\n", "2 readings fit any part"),
        ("x_mm,y_mm,z_mm,dx,dy,dz,status,max_mm\n0,0,0,0,0,1,none,400\n", "No reading met anything"),
        ("x_mm,y_mm,z_mm,feature,kind\n0,0,0,A,vertex\n", "1 reading fits any part"),
        (
            "x_mm,y_mm,z_mm,feature,kind\n"
            + "".join(f"{k},{k},{k},{label},edge\n" * 2 for k, label in enumerate("ABCD")),
            "lie on one line",
        ),
    ],
    ids=["collinear plane", "edge of one point", "free-space rays only", "one vertex", "four labels"],
)
def test_too_few_readings_are_an_insufficient_answer(run, tmp_path, parts, content, message):
    (tmp_path / "r.csv").write_text(content)
    result = run("identify", tmp_path / "r.csv", "--parts", parts, "--units", "mm", "--sd", "0.1mm")
    assert result.code == 3
    assert result.out.startswith("insufficient")
    assert message in result.out


def test_there_are_enough_cases():
    assert len(READINGS) + len(OPTIONS) + len(PARTS) + len(CALLS) >= 80
