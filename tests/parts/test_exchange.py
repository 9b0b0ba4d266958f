"""STEP and IGES files that are no single solid: shells, loose faces, triangles, other files, faces that do not mesh."""

import numpy as np
import pytest

from tanteo.errors import PartError
from tanteo.parts import read_part
from tanteo.parts.readers import mesh_edges

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Pnt, gp_Trsf, gp_Vec
from OCP.IGESControl import IGESControl_Writer
from OCP.Interface import Interface_Static
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Face, TopoDS_Shell, TopoDS_Solid
from OCP.XCAFDoc import XCAFDoc_DocumentTool

BASE, BOSS = 60 * 40 * 20, 30 * 20 * 15


def box(at, *sides):
    return BRepPrimAPI_MakeBox(gp_Pnt(*map(float, at)), *map(float, sides)).Shape()


def base():
    return box((0, 0, 0), 60, 40, 20)


def boss():
    return box((10, 10, 20), 30, 20, 15)


def pieces(shape, kind=TopAbs_FACE):
    found, explorer = [], TopExp_Explorer(shape, kind)
    while explorer.More():
        found.append(BRepBuilderAPI_Copy(explorer.Current(), True, True).Shape())
        explorer.Next()
    return found


def together(*shapes):
    whole, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(whole)
    for shape in shapes:
        builder.Add(whole, shape)
    return whole


def triangles_alone(shape):
    """Return a solid whose faces have triangles and no surfaces."""
    BRepMesh_IncrementalMesh(shape, 0.1, False, 0.3, False)
    builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
    builder.MakeShell(shell)
    for face in map(TopoDS.Face, pieces(shape)):
        other = TopoDS_Face()
        builder.MakeFace(other, BRep_Tool.Triangulation_s(face, TopLoc_Location()))
        other.Orientation(face.Orientation())
        builder.Add(shell, other)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return solid


def step(path, shape):
    STEPControl_Writer()  # makes the settings, which the next one takes
    Interface_Static.SetIVal_s("write.step.tessellated", 1)
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(path))
    return path


def sides(part):
    return np.round(1e3 * np.ptp(part.box, axis=0), 6).tolist()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: together(base(), *pieces(boss(), TopAbs_SHELL)), "Made a solid of a closed shell."),
        (lambda: together(base(), *pieces(boss())), "Sewed 6 faces to a closed body."),
        (lambda: together(*pieces(base(), TopAbs_SHELL), *pieces(boss())), "Sewed 6 faces to a closed body."),
        (lambda: together(*pieces(base()), boss()), "Sewed 6 faces to a closed body."),
        (lambda: together(base(), triangles_alone(boss())), "6 faces have triangles and no surfaces."),
        (lambda: together(triangles_alone(base()), boss()), "6 faces have triangles and no surfaces."),
        (lambda: together(triangles_alone(base()), triangles_alone(boss())), "The file has triangles and no surfaces."),
    ],
    ids=[
        "closed shell",
        "loose faces",
        "shell and faces",
        "faces and solid",
        "triangles",
        "triangles first",
        "triangles only",
    ],
)
def test_every_body_of_a_file_is_kept(tmp_path, make, message):
    part = read_part(step(tmp_path / "part.step", make()))
    assert sides(part) == [60, 40, 35]
    assert part.volume == pytest.approx((BASE + BOSS) * 1e-9)
    assert len(part.planes) == 11  # 6 + 6 less the bottom of the boss, which is inside the material
    assert message in part.repairs


def test_six_faces_that_close_a_box_are_one(tmp_path):
    part = read_part(step(tmp_path / "part.step", together(*pieces(base()))))
    assert part.volume == pytest.approx(BASE * 1e-9)
    assert part.repairs == ("Sewed 6 faces to a closed body.",)


def test_faces_beside_a_solid_that_enclose_nothing_are_named(tmp_path):
    part = read_part(step(tmp_path / "part.step", together(base(), pieces(boss())[0])))
    assert sides(part) == [60, 40, 20]
    assert part.repairs == ("Excluded 1 loose face (300 mm2), which enclose nothing beside the solids.",)


def test_faces_alone_are_a_surface_with_its_rims(tmp_path):
    open_box = together(*pieces(base())[:5])
    part = read_part(step(tmp_path / "part.step", open_box))
    assert not part.closed
    assert len(part.planes) == 5
    assert int(mesh_edges(part.triangles).rims.sum()) == 4
    assert part.repairs[0] == "Its 5 faces enclose nothing."
    tube = BRepPrimAPI_MakeCylinder(20.0, 50.0).Shape()
    shaft = next(
        face for face in pieces(tube) if BRep_Tool.Surface_s(TopoDS.Face(face)).DynamicType().Name() != "Geom_Plane"
    )
    part = read_part(step(tmp_path / "tube.step", shaft))
    assert [face.surface for face in part.faces if face.convex] == ["cylinder"]
    assert part.faces[0].radius == pytest.approx(0.02)


def test_a_solid_of_triangles_has_its_planes(tmp_path):
    part = read_part(step(tmp_path / "part.step", triangles_alone(base())))
    assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)
    assert part.volume == pytest.approx(BASE * 1e-9)


def test_the_body_over_again_as_triangles_is_left_out(tmp_path):
    part = read_part(step(tmp_path / "part.step", together(base(), triangles_alone(base()))))
    assert len(part.planes) == 6
    assert part.repairs == ("Excluded 6 faces of triangles: they repeat the body.",)


@pytest.mark.parametrize(("mode", "unit"), [(0, "MM"), (1, "MM"), (0, "IN")])
def test_iges_files_are_read(tmp_path, mode, unit):
    writer = IGESControl_Writer(unit, mode)
    writer.AddShape(base())
    writer.ComputeModel()
    path = tmp_path / "part.igs"
    writer.Write(str(path))
    part = read_part(path)
    assert sides(part) == [60, 40, 20]
    assert part.volume == pytest.approx(BASE * 1e-9)
    assert part.unit == unit.lower()
    path.write_text("S no IGES")
    with pytest.raises(PartError, match=r"part\.igs: expected"):
        read_part(path)


def test_a_solid_that_touches_itself_along_an_edge_is_closed(tmp_path):
    shell, builder = TopoDS_Shell(), BRep_Builder()
    builder.MakeShell(shell)
    for face in pieces(base()) + pieces(box((60, 40, 0), 60, 40, 20)):
        builder.Add(shell, face)
    solid = TopoDS_Solid()
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    part = read_part(step(tmp_path / "part.step", solid))
    assert part.closed
    assert part.volume == pytest.approx(2 * BASE * 1e-9)
    assert len(part.planes) == 12


def test_a_face_that_one_setting_leaves_out_is_meshed_at_another(tmp_path, monkeypatch):
    settings = []

    def fails_at_first(shape, deflection, *rest):
        settings.append(deflection)
        if len(settings) > 1:
            BRepMesh_IncrementalMesh(shape, deflection, *rest)

    monkeypatch.setattr("tanteo.parts.readers.brep_mesh.BRepMesh_IncrementalMesh", fails_at_first)
    part = read_part(step(tmp_path / "part.step", base()))
    assert part.volume == pytest.approx(BASE * 1e-9)
    assert part.repairs == ("Meshed a solid at setting 2 of 4.",)


@pytest.fixture
def assembly(tmp_path):
    """A STEP file that refers to one file for each of its two bodies."""
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    move = gp_Trsf()
    move.SetTranslation(gp_Vec(10.0, 10.0, 20.0))
    whole = tool.NewShape()
    tool.AddComponent(whole, tool.AddShape(base(), False), TopLoc_Location())
    tool.AddComponent(whole, tool.AddShape(box((0, 0, 0), 30, 20, 15), False), TopLoc_Location(move))
    tool.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    writer.Transfer(document, STEPControl_AsIs, "body_")
    writer.Write(str(tmp_path / "whole.step"))
    return tmp_path / "whole.step"


def test_files_that_a_file_refers_to_are_read_beside_it(assembly):
    part = read_part(assembly)
    assert sides(part) == [60, 40, 35]
    assert part.repairs[0].startswith("Read 2 files that it refers to: body_")
    gone = sorted(assembly.parent.glob("body_*"))[0]
    gone.rename(gone.with_suffix(".old"))
    with pytest.raises(PartError, match=rf"whole\.step: expected the file '{gone.name}' beside it"):
        read_part(assembly)


def test_files_elsewhere_are_not_followed(assembly):
    text = assembly.read_text()
    (assembly.parent / "deeper").mkdir()
    other = assembly.parent / "deeper" / "whole.step"
    other.write_text(text.replace("'body_", "'../body_"))
    with pytest.raises(PartError, match=r"expected the file '\.\./body_.*' beside it"):
        read_part(other)
