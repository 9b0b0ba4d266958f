"""Small samples of every log format: the same four points from every program."""

from __future__ import annotations

import struct

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.io import pose_as_brand

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
    probe_lines = "".join(f"[PRB:{x:.3f},{y:.3f},{z:.3f}:1]\nok\n" for x, y, z in P)
    return "Grbl 1.1f ['$' for help]\n$13=0\n" + probe_lines + "ALARM:5\n[PRB:300.000,100.000,-60.000:0]\n"


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


def tinyg():
    lines = [f'{{"r":{{"prb":{{"e":1,"x":{x:.3f},"y":{y:.3f},"z":{z:.3f},"a":0.000}}}},"f":[1,0,0,9523]}}'
             for x, y, z in P]  # fmt: skip
    return "\n".join([lines[0], *lines, '{"prb":{"e":0,"x":1.000,"y":2.000,"z":3.000}}', ""])


def listing():
    out = []
    for k, (p, n) in enumerate(zip(P.tolist(), UP.tolist(), strict=True), start=1):
        place, vector = (",".join(f"{x:.4f}" for x in v) for v in (p, n))
        out += [f"PNT{k}       =FEAT/CONTACT/VECTOR POINT/DEFAULT,CARTESIAN",
                f"            THEO/<0.0000,0.0000,{k}.0000>,<{vector}>", f"            ACTL/<{place}>,<{vector}>",
                f"            TARG/<0.0000,0.0000,0.0000>,<{vector}>", "            SNAP=NO"]  # fmt: skip
    return "\n".join([*out, "PLN1 =FEAT/PLANE,CARTESIAN,TRIANGLE", "ACTL/<0,0,0>,<0,0,1>", ""])


def report():
    out = []
    for k, place in enumerate(P, start=1):
        out += [f"DIM LOC{k}= LOCATION OF POINT PNT{k}  UNITS=MM ,$", "GRAPH=OFF  TEXT=OFF",
                "AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL"]  # fmt: skip
        out += [f"{axis}      1.0000     0.0500     0.0500   {x:8.4f}     0.0100     0.0000 ----#----"
                for axis, x in zip("XYZ", place, strict=True)]  # fmt: skip
    return "\n".join([*out, "END OF DIMENSION", ""])


def characteristics():
    out = ["planid\tpartnb\tid\ttype\tidsymbol\tactual\tnominal\tfeatureid\tunit"]
    for k, place in enumerate(P, start=1):
        out += [f"plan\t1\tP{k}_{axis}\tX1\t{axis}Value\t{x:.7f}\t0.0\tP{k}\tmm"
                for axis, x in zip("xyz", place, strict=True)]  # fmt: skip
    return "\n".join([*out, "plan\t1\tF1\tF1\tflatness\t0.01\t0.0\tPL1\tmm", "END", ""])


def bars(values):
    return "".join(f"| {k} | {x} | {y} | {z} |\n" for k, (x, y, z) in enumerate(values.tolist()))


def axis_rows(header, form):
    return "\n".join([header, *(form.format(f"P{k}", axis, f"{x:.4f}")
                                for k, place in enumerate(P, start=1)
                                for axis, x in zip("XYZ", place, strict=True)), ""])  # fmt: skip


def words(form, end="\n"):
    return "POPEN\n" + "".join(form.format(k, *p) + end for k, p in enumerate(P, start=1))


PLY_HEAD = "ply\nformat {} 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty float z\n"
NORMALS = "property float nx\nproperty float ny\nproperty float nz\n"
PCD_HEAD = (
    "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 8 8 8 4\nTYPE F F F F\n"
    "COUNT 1 1 1 1\nWIDTH 4\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA {}\n"
)
GRID = "0 40 2\n0 50 2\n-5 5 100\n\n\n"
MM, TIP = {"unit": "mm"}, {"unit": "mm", "radius": 0.0015}

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
    "tinyg": ("tinyg", tinyg(), {"radius": 0.0015}),
    "klipper": ("klipper", "".join(f"// probe at {x:.3f},{y:.3f} is z={z:.6f}\n" for x, y, z in P), {}),
    "klipper since 2026": (
        "klipper", "".join(f"// probe: at {x:.3f},{y:.3f} bed will contact at z={z:.6f}\n" for x, y, z in P), {}
    ),
    "marlin": ("marlin", "".join(f"Bed X: {x:.2f} Y: {y:.2f} Z: {z:.2f}\nok\n" for x, y, z in P), {}),
    "pcdmis": ("pcdmis", listing(), MM),
    "pcdmis report": ("report", report(), {}),
    "characteristics": ("report", characteristics(), {}),
    "report with a row an axis": ("report", axis_rows("Name,Control,Nominal,Measured,Dev", "{0},{1},1.0,{2},0.1"), MM),
    "report with the axis in the name": ("report", axis_rows("id;actual;nominal;unit", "{0}.{1};{2};1.0;mm"), {}),
    "report in German": (
        "report", axis_rows("Merkmal\tAchse\tSollwert\tIstwert", "{0}\t{1}-Position\t1,0\t{2}").replace(".", ","), MM,
    ),
    "report in columns of blanks": ("report", axis_rows("Point Axis Nominal Actual Dev", "{0}  {1}  1.0  {2} 0.1"), MM),
    "dprnt": ("words", words("N{} X{:9.4f}Y{:9.4f}Z{:9.4f}").replace("Z  -7", "Z-  7"), MM),
    "words with signs": ("words", words("POINT {}  X={:+.3f}  Y={:+.3f}  Z={:+.3f}"), MM),
    "words on three lines": ("words", words("TOUCH {}\nX-ACTUAL: {:.3f}\nY-ACTUAL: {:.3f}\nZ-ACTUAL: {:.3f}"), MM),
    "words with vectors": (
        "words", "".join(f"P{k}, X={x}, Y={y}, Z={z}, I={i}, J={j}, K={c}\n"
                         for k, (x, y, z, i, j, c) in enumerate(np.c_[P, UP].tolist(), start=1)), MM,
    ),
    "report in German of blanks": (
        "report", axis_rows("AX    NENNWERT +TOL -TOL MESS ABW", "{1}  1.0 0.1 0.1 {2} 0.0"), MM,
    ),
    "report with the axis first": ("report", axis_rows("Merkmal;Istwert;Nennwert", "{1}-Wert_{0};{2};1.0"), MM),
    "report of words in its header": (
        "report", axis_rows("Name    Measured value   Nominal value", "{1}-Value   {2}   1.0"), MM,
    ),
    "words of values": ("words", words("X-WERT: {1:+.3f} Y-WERT: {2:+.3f} Z-WERT: {3:+.3f}"), MM),
    "csv in GBK": ("csv", ("X实测值,Y实测值,Z实测值\n" + rows(P, ",")).encode("gbk"), MM),
    "words with numbered axes": ("words", words("X1={1:.3f} Y1={2:.3f} Z1={3:.3f}"), MM),
    "words with units": ("words", words("X: {1:.3f} mm, Y: {2:.3f} mm, Z: {3:.3f} mm"), {}),
    "words of an I++ session": (
        "words", words("000{0}5 PtMeas(X(1),Y(2),Z(3))\n000{0}5 &\n000{0}5 # X({1:.3f}), Y({2:.3f}), Z({3:.3f})"), MM,
    ),
    "words of touch variables": ("words", words("Q115 = {1:+.3f}\nQ116 = {2:+.3f}\nQ117 = {3:+.3f}"), MM),
    "points in brackets": ("asc", "".join(f"P{k}: ({x}, {y}, {z})\n" for k, (x, y, z) in enumerate(P.tolist())), MM),
    "points of an array": ("asc", "[[" + "]\n [".join(f"{x} {y} {z}" for x, y, z in P.tolist()) + "]]\n", MM),
    "csv with bars": ("csv", "| No | X | Y | Z |\n|---|---|---|---|\n" + bars(P), MM),
    "csv with groups of columns": (
        "csv", ";Nominal;;;Actual;;\nName;X;Y;Z;X;Y;Z\n"
        + "".join(f"P{k};1;2;3;{x};{y};{z:.4f}\n" for k, (x, y, z) in enumerate(P.tolist())), MM,
    ),
    "csv with units in its cells": (
        "csv", "X,Y,Z\n" + "".join(f"{x} mm,{y} mm,{z:.4f} mm\n" for x, y, z in P.tolist()), {}
    ),
    "csv with a unit above": ("csv", "# Units: mm\nx,y,z\n" + rows(P, ","), {}),
    "csv with remarks and a mean": (
        "csv", "Name,X,Y,Z\n" + "".join(f"P{k},{x},{y},{z:.4f}\n" for k, (x, y, z) in enumerate(P.tolist()))
        + "Name,X,Y,Z\nMean,1,2,3\nEnd of report\n", MM,
    ),
    "csv in Russian": ("csv", "X ном.;X изм.;Y изм.;Z изм.\n" + rows(np.c_[P[:, :1] + 1, P], ";"), MM),
    "csv with glued names": ("csv", "NX,NY,NZ,MX,MY,MZ\n" + rows(np.c_[P + 1, P], ","), MM),
    "csv of a survey": ("csv", "Northing,Easting,Elevation\n" + rows(P[:, [1, 0, 2]], ","), MM),
    "xyzijk with names": (
        "xyzijk", "".join(f"P{k + 1} {row}" for k, row in enumerate(rows(np.c_[P, UP]).splitlines(True))), MM
    ),
    "xyzijk with names and tolerances": (
        "xyzijk", "".join(f'"top {k}" {row.strip()} 0.1 -0.1 0.1 SP\n'
                          for k, row in enumerate(rows(np.c_[P, UP]).splitlines())), MM,
    ),
    "points in collections": (
        "asc", "".join(f"A MEAS p{k},{row}" for k, row in enumerate(rows(P, ",").splitlines(True))), MM
    ),
    "numbered points": ("asc", "".join(f"{k + 1};{row}" for k, row in enumerate(rows(P, ";").splitlines(True))), MM),
    "points with head angles": ("asc", "".join(f"{row.strip()} 7.5 -90.0\n" for row in rows(P).splitlines()), MM),
    "csv with titles": (
        "csv", "Messprotokoll;;\nTeil;Lasche;\n\nPunkt;X (mm);Y (mm);Z (mm);Bemerkung\n"
        + "".join(f"P{k};{row};gut\n" for k, row in enumerate(rows(P, ";").replace(".", ",").splitlines())), {},
    ),
    "csv of XYZIJK": ("csv", "X,Y,Z,I,J,K\n" + rows(np.c_[P, UP], ","), MM),
}  # fmt: skip


def save(tmp_path, content, name="log"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path
