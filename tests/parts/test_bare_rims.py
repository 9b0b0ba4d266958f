"""Bare faces: their circular openings are holes without walls, on which centres may be."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pln, gp_Pnt
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

from tanteo import Readings, locate, read_part
from tanteo.geometry import SE3, SO3
from tanteo.parts import round_features

HOLES = ((-40, -25, 5), (42, -20, 4), (-30, 28, 6), (15, 20, 3))


@pytest.fixture(scope="module")
def sheet(tmp_path_factory):
    """Return a bare face of 120 x 80 mm with round holes and a square one."""
    face = BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), -60, 60, -40, 40).Face()
    for x, y, radius in HOLES:
        tool = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, -5), gp_Dir(0, 0, 1)), radius, 10).Shape()
        face = BRepAlgoAPI_Cut(face, tool).Shape()
    face = BRepAlgoAPI_Cut(face, BRepPrimAPI_MakeBox(gp_Pnt(-5, -10, -5), gp_Pnt(5, 0, 5)).Shape()).Shape()
    writer, path = STEPControl_Writer(), tmp_path_factory.mktemp("bare") / "sheet.step"
    writer.Transfer(face, STEPControl_AsIs)
    writer.Write(str(path))
    return read_part(path)


def test_openings_of_a_bare_face_are_holes(sheet):
    found = round_features(sheet)
    got = sorted((*np.round(1e3 * one.centre, 3), round(1e3 * float(one.radii[0]), 3)) for one in found)
    np.testing.assert_allclose(got, sorted((x, y, 0, r) for x, y, r in HOLES), atol=2e-3)
    assert all(one.hole and one.surface == "rim" and abs(one.axis[2]) == pytest.approx(1) for one in found)


def test_centres_locate_a_bare_face(sheet):
    rng, part = np.random.default_rng(2), sheet
    T = SE3.from_parts(SO3.axis_rotation(2, 0.4), np.array([0.3, 0.1, 0.02]))
    at = np.array([[x, y, 30.0] for x, y, _ in HOLES] + [[-50, 0, 0], [50, 10, 0], [0, -30, 0], [0, 30, 0]]) * 1e-3
    p = SE3.apply(T, at) + 1e-5 * rng.normal(size=at.shape)
    readings = Readings.from_columns(points=p, sds=np.full(len(p), 1e-5), kinds=["centre"] * 4 + ["plane"] * 4,
                                     features=["a", "b", "c", "d"] + ["top"] * 4)  # fmt: skip
    answer = locate(readings, part)
    assert answer.status == "recognized"
    off = SE3.apply(answer.best.T_world_part, part.vertices) - SE3.apply(T, part.vertices)
    assert np.linalg.norm(off, axis=1).max() < 1e-4
