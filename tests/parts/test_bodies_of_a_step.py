"""Several solids in one STEP file: one outer surface for sensing, and single bodies by number or name."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")

from OCP.BRep import BRep_Builder
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopoDS import TopoDS_Compound

from tanteo import read_part, read_parts
from tanteo.errors import PartError


def box(low, high):
    return BRepPrimAPI_MakeBox(gp_Pnt(*low), gp_Pnt(*high)).Shape()


def pin(low, high, radius, turn=(1.0, 0.0)):
    where = gp_Ax2(gp_Pnt(0, 0, low), gp_Dir(0, 0, 1), gp_Dir(*turn, 0))
    return BRepPrimAPI_MakeCylinder(where, radius, high - low).Shape()


def written(path, *shapes):
    whole, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(whole)
    for shape in shapes:
        builder.Add(whole, shape)
    writer = STEPControl_Writer()
    writer.Transfer(whole if len(shapes) > 1 else shapes[0], STEPControl_AsIs)
    writer.Write(str(path))
    return path


LOWER, UPPER = box((-40, -30, 0), (40, 30, 12)), box((-20, -30, 12), (40, 10, 25))


def test_stacked_bodies_have_one_outer_surface(tmp_path):
    two = read_part(written(tmp_path / "two.step", LOWER, UPPER))
    one = read_part(written(tmp_path / "one.step", BRepAlgoAPI_Fuse(LOWER, UPPER).Shape()))
    assert two.area == pytest.approx(one.area, rel=1e-9)
    assert two.volume == pytest.approx(one.volume, rel=1e-9)
    assert any("United 2 bodies" in repair for repair in two.repairs)
    levels = np.unique(np.round(two.planes.Ts_part_feature[np.abs(two.planes.normals[:, 2]) > 0.9, 2, 3], 6))
    np.testing.assert_allclose(levels, [0.0, 0.012, 0.025])


@pytest.mark.parametrize("turn", [(1.0, 0.0), (np.cos(0.05), np.sin(0.05))])
def test_a_pin_in_its_hole_leaves_no_wall(tmp_path, turn):
    """The walls of pin and hole are meshed differently; what lies between them is not surface."""
    plate = BRepAlgoAPI_Cut(LOWER, pin(-1, 13, 8)).Shape()
    part = read_part(written(tmp_path / "pin.step", plate, pin(0, 12, 8, turn)))
    solid = read_part(written(tmp_path / "plate.step", LOWER))
    assert part.area == pytest.approx(solid.area, rel=1e-6)
    assert part.volume == pytest.approx(solid.volume, rel=1e-3)


def test_separate_bodies_stay_as_they_are(tmp_path):
    away = box((60, 0, 0), (80, 20, 12))
    part = read_part(written(tmp_path / "apart.step", LOWER, away))
    assert len(part.planes) == 12
    assert not any("United" in repair for repair in part.repairs)


def test_curved_faces_keep_their_surface(tmp_path):
    """A boss that stands on a plate is a cylinder after the union."""
    part = read_part(written(tmp_path / "boss.step", LOWER, pin(12, 30, 8)))
    wall = next(face for face in part.faces if face.surface == "cylinder")
    assert wall.radius == pytest.approx(0.008)
    assert wall.convex
    assert part.area == pytest.approx(
        read_part(written(tmp_path / "plate.step", LOWER)).area + 2 * np.pi * 0.008 * 0.018, rel=1e-3
    )


def test_one_body_is_selected(tmp_path):
    path = written(tmp_path / "two.step", LOWER, UPPER)
    parts = read_parts([f"{path}#1", f"{path}#2"])
    assert not parts.failures
    assert [part.name for part in parts] == ["two#1", "two#2"]
    np.testing.assert_allclose(parts[1].box, np.array([[-20, -30, 12], [40, 10, 25]]) * 1e-3, atol=1e-9)
    with pytest.raises(PartError, match=r"expected one of its 2 bodies \(#1 .*, #2 .*\), got none"):
        read_part(f"{path}#lid")


def test_a_body_of_a_mesh_file_is_refused(tmp_path):
    (tmp_path / "a.stl").write_text("solid\nendsolid\n")
    with pytest.raises(PartError, match="expected a STEP file before '#2'"):
        read_part(f"{tmp_path / 'a.stl'}#2", unit="mm")
