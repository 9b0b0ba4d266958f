"""Round features of QIF results: centres and apexes, with side, size and spread; what was set is not measured."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo import read_readings
from tanteo.errors import ReadingsError

UNITS = (
    "<FileUnits><PrimaryUnits><AngularUnit><SIUnitName>radian</SIUnitName><UnitName>degree</UnitName></AngularUnit>"
    "<LinearUnit><UnitName>mm</UnitName></LinearUnit></PrimaryUnits></FileUnits>"
)
SIDES = {"1": "INTERNAL", "2": "EXTERNAL", "3": "NOT_APPLICABLE"}


def document(measured, *, modes=None, extra=""):
    """Return a document with these measurements; each ``item`` refers to a nominal and a definition of its number."""
    items = "".join(
        f'<CircleFeatureItem id="i{k}"><FeatureNominalId>n{k}</FeatureNominalId><FeatureName>F{k}</FeatureName>'
        f"<DeterminationMode><{(modes or {}).get(k, 'Checked')}/></DeterminationMode></CircleFeatureItem>"
        f'<CircleFeatureNominal id="n{k}"><FeatureDefinitionId>d{k}</FeatureDefinitionId></CircleFeatureNominal>'
        f'<CircleFeatureDefinition id="d{k}"><InternalExternal>{side}</InternalExternal></CircleFeatureDefinition>'
        for k, side in SIDES.items()
    )
    return f'<QIFDocument xmlns="http://qifstandards.org/xsd/qif3">{UNITS}{items}{measured}{extra}</QIFDocument>'


def feature(kind, inner, item="1", way="Measurement"):
    return f"<{kind}Feature{way}><FeatureItemId>i{item}</FeatureItemId>{inner}</{kind}Feature{way}>"


CIRCLE = (
    '<Location combinedUncertainty="0.02">10 20 30</Location><Normal>0 0 1</Normal>'
    '<Diameter linearUnit="mm">9.5</Diameter>'
)
AXIS = "<Axis><AxisPoint>1 2 3</AxisPoint><Direction>0 0 1</Direction></Axis>"


def read(tmp_path, text, **stated):
    path = tmp_path / "results.qif"
    path.write_text(text)
    return read_readings(path, **stated)


@pytest.mark.parametrize("way", ["Measurement", "Actual"])
def test_circles_cylinders_and_spheres_are_centres(tmp_path, way):
    readings = read(
        tmp_path,
        document(
            feature("Circle", CIRCLE, "1", way)
            + feature("Cylinder", AXIS + "<Diameter>8</Diameter>", "2", way)
            + feature("Sphere", "<Location>5 6 7</Location><Diameter>20</Diameter>", "3", way)
        ),
    )
    assert readings.kinds == ("centre", "centre", "sphere_centre")
    assert readings.ids == ("F1", "F2", "F3")
    assert readings.material_sides == ("hole", "boss", "")
    np.testing.assert_allclose(readings.hole_radii, [4.75e-3, 4e-3, 10e-3])
    np.testing.assert_allclose(readings.points, [[0.01, 0.02, 0.03], [1e-3, 2e-3, 3e-3], [5e-3, 6e-3, 7e-3]])
    np.testing.assert_allclose(readings.sds.filled(np.nan), [2e-5, np.nan, np.nan])
    np.testing.assert_allclose(readings.normals.filled(np.nan), [[0, 0, 1], [0, 0, 1], [np.nan] * 3])


@pytest.mark.parametrize("angle", ["<HalfAngle>45</HalfAngle>", "<FullAngle>90</FullAngle>"])
def test_the_apex_of_a_cone_follows_from_its_diameter(tmp_path, angle):
    readings = read(tmp_path, document(feature("Cone", AXIS + "<Diameter>4</Diameter>" + angle)))
    assert readings.kinds == ("apex",)
    np.testing.assert_allclose(readings.points, [[1e-3, 2e-3, 1e-3]])
    np.testing.assert_allclose(readings.half_angles, np.pi / 4)


def test_what_was_not_measured_is_left_out(tmp_path):
    text = document(feature("Circle", CIRCLE, "1") + feature("Circle", CIRCLE, "2"), modes={"2": "Set"})
    readings = read(tmp_path, text)
    assert readings.ids == ("F1",)
    assert "1 feature of other kinds than points and round ones, or not measured, excluded." in readings.notes


def test_features_of_a_point_set_do_not_count_twice(tmp_path):
    points = "<MeasuredPointSet><Points>1 2 3 4 5 6 7 8 8</Points></MeasuredPointSet>"
    readings = read(tmp_path, document(feature("Circle", CIRCLE), extra=points), radius=0.0)
    assert readings.kinds == ("point",) * 3
    assert any("1 round feature excluded" in note for note in readings.notes)


@pytest.mark.parametrize(
    ("inner", "message"),
    [
        ("<Location>1 2 3</Location><Diameter>0</Diameter>", "a positive diameter"),
        ("<Location>1 2 3</Location><Diameter>wide</Diameter>", "Diameter"),
        ('<Location linearUnit="inch">1 2 3</Location><Diameter>3</Diameter>', "linearUnit 'inch'"),
        ("<Location>1 2</Location><Diameter>3</Diameter>", "three numbers of Location"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, inner, message):
    with pytest.raises(ReadingsError, match=message):
        read(tmp_path, document(feature("Circle", inner)))


def test_a_sphere_of_dmis_is_a_centre(tmp_path):
    path = tmp_path / "results.dmo"
    path.write_text(
        "UNITS/MM,ANGDEC\nFA(B1)=FEAT/SPHERE,OUTER,CART,1,2,3,20\nFA(C1)=FEAT/CIRCLE,INNER,CART,4,5,6,0,0,1,8\n"
        "FA(K1)=FEAT/CONE,INNER,CART,1,2,3,0,0,1,90\n"
    )
    readings = read_readings(path)
    assert readings.kinds == ("sphere_centre", "centre")
    assert readings.material_sides == ("boss", "hole")
    np.testing.assert_allclose(readings.hole_radii, [10e-3, 4e-3])
    assert any("1 feature of other kinds" in note for note in readings.notes)
