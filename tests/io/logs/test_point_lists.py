"""Lists of points in JSON and XML: every common form gives the same readings; others are refused by name."""

import json

import numpy as np
import pytest

import tanteo
from tanteo.errors import ReadingsError, UnitError

POINTS = [[264.158, 137.184, -35.992], [1.0, -2.5, 3.25], [4.0, 5.0, 6.0]]
KEYS = [dict(zip("xyz", row, strict=True)) for row in POINTS]

FORMS = {
    "objects": KEYS,
    "capitals": [{k.upper(): v for k, v in one.items()} for one in KEYS],
    "units in names": [{f"{k}_mm": v for k, v in one.items()} for one in KEYS],
    "lists": POINTS,
    "in an object": {"unit": "mm", "points": KEYS},
    "lists in an object": {"meta": {"operator": "A", "size": [1, 2, 3]}, "points": POINTS},
    "positions": {"touches": [{"name": f"T{k}", "position": one} for k, one in enumerate(KEYS)]},
    "positions as lists": [{"id": k, "position": row, "time": 1.5} for k, row in enumerate(POINTS)],
    "texts": [{k: str(v) for k, v in one.items()} for one in KEYS],
    "measured and nominal": [{"nominal": {"x": 0, "y": 0, "z": 0}, "measured": one} for one in KEYS],
    "two lists": {"nominal": [{"x": 0, "y": 0, "z": 0}] * 3, "measured": KEYS},
    "deeper": {"results": [{"element": "P", "actual": {"point": one}} for one in KEYS]},
    "a point without values": [*KEYS, {"x": None, "y": None, "z": None}],
}


def attributes(row):
    return " ".join(f'{k.upper()}="{v}"' for k, v in zip("xyz", row, strict=True))


def children(row):
    return "".join(f"<{k}>{v}</{k}>" for k, v in zip("xyz", row, strict=True))


XML = {
    "attributes": "<points>" + "".join(f"<p {attributes(row)}/>" for row in POINTS) + "</points>",
    "children": "<a><l>" + "".join(f"<point>{children(row)}</point>" for row in POINTS) + "</l></a>",
    "SpatialAnalyzer": '<?xml version="1.0" encoding="UTF-8"?>\n<left>'
    + "".join(
        f'<POINT NAME="C{k}"><NOMINAL X="0" Y="0" Z="0"/><ACTUAL {attributes(row)}/></POINT>'
        for k, row in enumerate(POINTS)
    )
    + "</left>",
    "measured text": '<export xmlns="http://example.org/e"><elements>'
    + "".join(
        f"<element><name>P{k}</name><nominal><coordinate>0 0 0</coordinate></nominal>"
        f"<measured><coordinate>{' '.join(map(str, row))}</coordinate></measured></element>"
        for k, row in enumerate(POINTS)
    )
    + "</elements></export>",
}


def read(tmp_path, text, name="points.json", **options):
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    return tanteo.read_readings(file, **{"unit": "mm", "radius": 0.0} | options)


@pytest.mark.parametrize("form", FORMS)
def test_forms_of_json_give_the_same_points(form, tmp_path):
    readings = read(tmp_path, json.dumps(FORMS[form], indent=1))
    np.testing.assert_allclose(readings.points, np.array(POINTS) / 1e3)


@pytest.mark.parametrize("form", XML)
def test_forms_of_xml_give_the_same_points(form, tmp_path):
    readings = read(tmp_path, XML[form], "points.xml")
    np.testing.assert_allclose(readings.points, np.array(POINTS) / 1e3)


def test_objects_may_stand_on_lines_of_their_own(tmp_path):
    readings = read(tmp_path, "\n".join(json.dumps(one) for one in KEYS))
    np.testing.assert_allclose(readings.points, np.array(POINTS) / 1e3)


def test_names_units_and_excluded_points_are_kept(tmp_path):
    document = {"unit": "inch", "measured": [{"name": f"T{k}", **one} for k, one in enumerate(KEYS)], "nominal": KEYS}
    readings = read(tmp_path, json.dumps(document), unit=None)
    assert list(readings.ids) == ["T0", "T1", "T2"]
    np.testing.assert_allclose(readings.points, np.array(POINTS) * 0.0254)
    assert any("3 nominal points excluded" in note for note in readings.notes)
    with pytest.raises(UnitError, match="in, as the file states"):
        read(tmp_path, json.dumps(document), unit="mm")
    with pytest.raises(UnitError, match="--units"):
        read(tmp_path, json.dumps(KEYS), unit=None)


def test_normals_and_diameters_of_documents_are_read(tmp_path):
    some = [{**one, "nx": 0, "ny": 0.6, "nz": 0.8} for one in KEYS]
    readings = read(tmp_path, json.dumps(some), normal_sd=0.01)
    np.testing.assert_allclose(readings.normals, [[0, 0.6, 0.8]] * 3)
    holes = "<r>" + "".join(f'<circle {attributes(row)} Diameter="8"/>' for row in POINTS) + "</r>"
    readings = read(tmp_path, holes, "holes.xml")
    np.testing.assert_allclose(readings.hole_radii, [4e-3] * 3)


REFUSED = {
    "no points": ('{"a": 1, "b": [1, 2]}', "without any"),
    "nominal only": ('{"nominal": [{"x": 1, "y": 2, "z": 3}]}', "nominal points only"),
    "two different lists": (json.dumps({"path": KEYS, "touches": KEYS}), "3 points in path"),
    "two units": ('[{"x_mm": 1, "y_mm": 2, "z_mm": 3}, {"x_in": 1, "y_in": 2, "z_in": 3}]', "one unit"),
    "a word": ('[{"x": 1, "y": "abc", "z": 3}]', "three numbers of point 1"),
    "an infinite number": ('[{"x": 1, "y": 1e999, "z": 3}]', "three numbers of point 1"),
    "very many digits": ('[{"x": ' + "9" * 5000 + ', "y": 1, "z": 3}]', "expected finite numbers of a point"),
    "a name twice": ('[{"x": 1, "x": 2, "y": 2, "z": 3}]', "'x' twice"),
    "an XML name twice": ('<a><p x="1" y="2" z="3"><x>5</x></p></a>', "'x' twice"),
    "cut off": ('[{"x": 1, "y": 2, "z": 3}, {"x": 4', "well-formed JSON"),
    "nested without end": ('[{"a":' * 5000, "JSON"),
    "cut off XML": ("<a><p x='1' y='2' z='3'/>", "well-formed XML"),
    "a DTD": ("<!DOCTYPE a [<!ENTITY b 'c'>]><a><p x='1' y='2' z='3'/></a>", "DTD"),
    "an empty XML": ("<a><b/></a>", "without any"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_other_documents_are_refused_with_a_reason(case, tmp_path):
    text, message = REFUSED[case]
    with pytest.raises(ReadingsError, match=message):
        read(tmp_path, text, "x.xml" if "XML" in case or "DTD" in case else "x.json")


def test_rows_of_a_list_may_have_decimal_commas(tmp_path):
    rows = [["1,5", "2,5", "3", "0,0", "0,6", "0,8"], ["1", "5", "3", "0", "0", "1"], ["4", "5", "3", "0", "0", "1"]]
    points = read(tmp_path, json.dumps(rows)).points
    np.testing.assert_allclose(points[0], [1.5e-3, 2.5e-3, 3e-3])
