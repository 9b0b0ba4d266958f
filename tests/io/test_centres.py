"""Centres of holes and bosses in tables and reports: their rows, messages, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo import read_readings
from tanteo.errors import InputError, ReadingsError
from tanteo.io import write_readings


def table(tmp_path, text):
    path = tmp_path / "holes.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_single_rows_of_kind_circle_are_centres(tmp_path):
    """As a report lists them: each hole with a name of its own."""
    path = table(tmp_path, "x_mm,y_mm,z_mm,sd_mm,feature,kind\n10,20,-2,0.02,h1,circle\n30,20,-2,0.02,h2,cylinder\n")
    readings = read_readings(path)
    assert readings.kinds == ("centre", "centre")
    assert np.allclose(readings.points[0], [0.01, 0.02, -0.002])
    assert not readings.hole_radii.given.any()
    assert any("h1, h2" in note and "not used" in note for note in readings.notes)


def test_rows_without_label_are_centres(tmp_path):
    path = table(tmp_path, "x_mm,y_mm,z_mm,sd_mm,kind\n10,20,-2,0.02,circle\n30,20,-2,0.02,circle\n")
    assert read_readings(path).kinds == ("centre", "centre")


def test_several_rows_of_one_label_are_contacts(tmp_path):
    rows = "".join(f"{x},0,0,1.5,0.02,bore,cylinder\n" for x in range(4))
    readings = read_readings(table(tmp_path, "x_mm,y_mm,z_mm,radius_mm,sd_mm,feature,kind\n" + rows))
    assert readings.kinds == ("cylinder",) * 4
    assert np.allclose(readings.radii, 1.5e-3)
    assert not any("centre" in note for note in readings.notes)


def test_two_rows_of_one_label_are_refused(tmp_path):
    path = table(tmp_path, "x_mm,y_mm,z_mm,sd_mm,feature,kind\n1,0,0,0.02,a,circle\n2,0,0,0.02,a,circle\n")
    with pytest.raises(ReadingsError, match="feature 'a': expected at least 3"):
        read_readings(path)


@pytest.mark.parametrize(
    ("column", "value"),
    [("hole_radius_mm", 7), ("hole_diameter_mm", 14), ("Hole Diameter [mm]", 14), ("circle_dia_mm", 14)],
)
def test_radius_and_side_are_read(tmp_path, column, value):
    head = f"x_mm,y_mm,z_mm,sd_mm,feature,kind,{column},side\n"
    readings = read_readings(
        table(tmp_path, f"{head}1,2,3,0.02,a,circle,{value},hole\n4,5,6,0.02,b,circle,,boss\n7,8,9,0.02,,,,\n")
    )
    assert np.allclose(readings.hole_radii.filled(np.nan), [7e-3, np.nan, np.nan], equal_nan=True)
    assert readings.material_sides == ("hole", "boss", "")
    assert readings.kinds == ("centre", "centre", "point")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_mm,y_mm,z_mm,radius_mm,sd_mm,feature,kind\n1,2,3,7,0.1,a,circle\n", "hole_radius_mm"),
        ("x_mm,y_mm,z_mm,diameter_mm,sd_mm,feature,kind\n1,2,3,14,0.1,a,circle\n", "hole_diameter_mm"),
        ("x_mm,y_mm,z_mm,hole_radius_mm,sd_mm,feature,kind\n1,2,3,-7,0.1,a,circle\n", "a positive number"),
        ("x_mm,y_mm,z_mm,sd_mm,kind,side\n1,2,3,0.1,circle,inside\n", "one of hole, boss"),
        ("x_mm,y_mm,z_mm,sd_mm,kind,side\n1,2,3,0.1,point,hole\n", "expected one of centre, sphere_centre, apex"),
        ("x_mm,y_mm,z_mm,sd_mm,kind\n1,2,3,0.1,bore\n", "kind circle"),
        ("x_mm,y_mm,z_mm,sd_mm,kind\n1,2,3,0.1,ball\n", "kind sphere"),
        ("x_mm,y_mm,z_mm,sd_mm,kind\n1,2,3,0.1,Cone\n", "in small letters"),
        (
            "x_mm,y_mm,z_mm,sd_mm,kind,hole_radius_mm,hole_diameter_mm\n1,2,3,0.1,circle,7,14\n",
            "line 2: expected the radius or the diameter",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        read_readings(table(tmp_path, text))


def test_a_balls_radius_of_other_rows_is_theirs(tmp_path):
    """A table may have one radius in all rows: the centres are compensated already."""
    text = "x_mm,y_mm,z_mm,radius_mm,sd_mm,feature,kind\n1,2,3,1.5,0.1,a,circle\n4,5,6,1.5,0.1,,\n"
    assert np.allclose(read_readings(table(tmp_path, text)).radii, [0, 1.5e-3])


def test_vectors_of_centres_are_axes(tmp_path):
    text = "x_mm,y_mm,z_mm,i,j,k,sd_mm,feature,kind\n1,2,3,0,0,1,0.1,a,circle\n4,5,6,0,0,1,0.1,,\n"
    readings = read_readings(table(tmp_path, text))
    assert np.allclose(readings.normals[0], [0, 0, 1])
    assert not readings.normals.given[1]
    assert readings.normal_sds[0] == pytest.approx(np.radians(1))
    assert not readings.directions.given[0]
    assert np.allclose(readings.directions[1], [0, 0, -1])
    assert any("1 degree" in note for note in readings.notes)


def test_how_well_axes_are_known_is_not_overruled(tmp_path):
    text = "x_mm,y_mm,z_mm,nx,ny,nz,normal_sd_deg,sd_mm,kind\n1,2,3,0,0,1,0.2,0.1,circle\n"
    readings = read_readings(table(tmp_path, text))
    assert readings.normal_sds[0] == pytest.approx(np.radians(0.2))
    assert not any("1 degree" in note for note in readings.notes)


def test_centres_are_written_and_read_again(tmp_path):
    head = "id,x_mm,y_mm,z_mm,sd_mm,kind,hole_radius_mm,side\n"
    readings = read_readings(table(tmp_path, head + "a,1,2,3,0.1,circle,7,hole\nb,4,5,6,0.1,,,\n"))
    write_readings(readings, tmp_path / "again.csv")
    again = read_readings(tmp_path / "again.csv")
    assert again.kinds == readings.kinds
    assert again.material_sides == readings.material_sides
    assert np.allclose(again.hole_radii.filled(np.nan), readings.hole_radii.filled(np.nan), equal_nan=True)


DMIS = """UNITS/INCH,ANGDEC
FA(P1)=FEAT/POINT,CART,1,2,0,0,0,1
FA(H1)=FEAT/CIRCLE,INNER,CART,1,2,-0.1,0,0,1,0.5
FA(B1)=FEAT/CYLNDR,OUTER,CART,3,2,0,0,0,1,2.0,1.0
FA(L1)=FEAT/LINE,UNBND,CART,1,2,3,0,0,1,0,0,1
"""


def test_circles_of_a_dmis_report_are_centres(tmp_path):
    readings = read_readings(table(tmp_path, DMIS))
    assert readings.ids == ("P1", "H1", "B1")
    assert readings.kinds == ("point", "centre", "centre")
    assert np.allclose(readings.hole_radii.filled(np.nan), [np.nan, 0.25 * 0.0254, 0.0254], equal_nan=True)
    assert readings.material_sides == ("", "hole", "boss")
    assert np.allclose(readings.points[1], 0.0254 * np.array([1, 2, -0.1]))
    assert np.allclose(readings.directions[0], [0, 0, -1])
    assert np.allclose(readings.normals[1], [0, 0, 1])
    assert any("1 feature of other kinds" in note for note in readings.notes)


def test_a_dmis_report_of_circles_alone_is_read(tmp_path):
    lines = [line for line in DMIS.splitlines() if "POINT" not in line and "LINE" not in line]
    readings = read_readings(table(tmp_path, "\n".join(lines) + "\n"))
    assert readings.kinds == ("centre", "centre")
    assert not any("--radius" in note for note in readings.notes)


@pytest.mark.parametrize("diameter", ["0", "-1", "x"])
def test_a_diameter_that_is_none_is_refused(tmp_path, diameter):
    text = DMIS.replace(",0,0,1,0.5", f",0,0,1,{diameter}")
    with pytest.raises(ReadingsError, match="line 3"):
        read_readings(table(tmp_path, text))


BALLS = (
    "x_mm,y_mm,z_mm,sd_mm,feature,kind,sphere_diameter_mm,half_angle_deg,side,nx,ny,nz\n"
    "10,20,-2,0.02,b,sphere,20,,boss,,,\n30,20,-2,0.02,k,cone,,45,hole,0,0,1\n"
)


def test_single_rows_of_spheres_and_cones_are_centres_and_apexes(tmp_path):
    readings = read_readings(table(tmp_path, BALLS))
    write_readings(readings, tmp_path / "again.csv")
    for read in (readings, read_readings(tmp_path / "again.csv")):
        assert read.kinds == ("sphere_centre", "apex")
        assert read.material_sides == ("boss", "hole")
        np.testing.assert_allclose(read.hole_radii.filled(np.nan), [0.01, np.nan])
        np.testing.assert_allclose(read.half_angles.filled(np.nan), [np.nan, np.pi / 4])
        np.testing.assert_allclose(read.normals.filled(np.nan), [[np.nan] * 3, [0, 0, 1]])
    assert any("the centre of a sphere or the apex of a cone (b, k)" in note for note in readings.notes)
    assert not any("height" in note for note in readings.notes)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (",45,", ",95,", "half angle of a cone below"),
        (",20,,boss", ",20,45,boss", "got two of them"),
        (",45,", ",0,", "positive"),
    ],
)
def test_half_angles_that_are_none_are_refused(tmp_path, old, new, message):
    with pytest.raises(ReadingsError, match=message):
        read_readings(table(tmp_path, BALLS.replace(old, new)))
