"""A STEP file of very many triangles is a mesh: its faces are found from the triangles."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")

from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeSolid,
    BRepBuilderAPI_Sewing,
)
from OCP.gp import gp_Pnt
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopoDS import TopoDS

from tanteo import read_part


def written(mesh, path):
    """Write each triangle as a plane of a solid."""
    sewing = BRepBuilderAPI_Sewing(1e-6)
    for corners in mesh.triangles:
        polygon = BRepBuilderAPI_MakePolygon(*(gp_Pnt(*map(float, p)) for p in corners), True)
        sewing.Add(BRepBuilderAPI_MakeFace(polygon.Wire(), True).Face())
    sewing.Perform()
    writer = STEPControl_Writer()
    writer.Transfer(BRepBuilderAPI_MakeSolid(TopoDS.Shell(sewing.SewedShape())).Solid(), STEPControl_AsIs)
    writer.Write(str(path))
    return read_part(path)


def test_a_ball_of_triangles_is_no_set_of_planes(tmp_path):
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=30.0)
    part = written(mesh, tmp_path / "ball.step")
    assert len(part.planes) == 0
    assert [face.surface for face in part.faces] == ["sphere"]
    assert part.faces[0].radius == pytest.approx(0.03, rel=1e-3)
    assert part.volume == pytest.approx(1e-9 * mesh.volume, rel=1e-6)
    assert "mesh of 1,280 flat faces" in part.repairs[0]


def test_few_triangles_stay_planes(tmp_path):
    part = written(trimesh.creation.icosphere(subdivisions=1, radius=30.0), tmp_path / "gem.step")
    assert len(part.planes) == 80
    np.testing.assert_allclose(part.planes.areas, part.area / 80, rtol=0.2)
