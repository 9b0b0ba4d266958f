"""STEP files: the shipped examples, solids made with the kernel, and real files against the kernel's numbers."""

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from mesh_laws import distances_from, is_closed
from tanteo.errors import MissingExtraError, PartError
from tanteo.parts import read_part
from tanteo.parts.readers import mirror_part

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert, BRepBuilderAPI_Transform
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Reader, STEPControl_Writer
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples" / "parts"
DATA = ROOT.parent / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"no shared data at {DATA}")


def kinds(part):
    return Counter(face.surface for face in part.faces)


def write(path, *shapes, unit="MM"):
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", unit)
    for shape in shapes:
        writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(path))
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    return path


def tilted(shape):
    """Turn and shift a shape (mm), so that nothing is aligned by chance."""
    turn, shift = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(3, 1, 2), gp_Dir(1, 2, 3)), 0.8)
    shift.SetTranslation(gp_Vec(120, -40, 15))
    return BRepBuilderAPI_Transform(shape, shift.Multiplied(turn), True).Shape()


def cylinder(radius=20, height=50, x=0, y=0, z=0):
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, z), gp_Dir(0, 0, 1)), radius, height).Shape()


def plate():
    """Return a plate of 100 x 60 x 12 mm with two equal bores on its long middle line."""
    shape = BRepPrimAPI_MakeBox(gp_Pnt(-50, -30, 0), gp_Pnt(50, 30, 12)).Shape()
    for x in (-30, 30):
        shape = BRepAlgoAPI_Cut(shape, cylinder(8, 20, x, 0, -4)).Shape()
    return shape


SOLIDS = {
    "box": (lambda: BRepPrimAPI_MakeBox(80, 60, 50).Shape(), {"plane": 6}, 4, False),
    "cylinder": (cylinder, {"plane": 2, "cylinder": 1}, 2, True),
    "frustum": (lambda: BRepPrimAPI_MakeCone(30, 12, 40).Shape(), {"plane": 2, "cone": 1}, 1, True),
    "cone": (lambda: BRepPrimAPI_MakeCone(0, 12, 40).Shape(), {"plane": 1, "cone": 1}, 1, True),
    "ball": (lambda: BRepPrimAPI_MakeSphere(25).Shape(), {"sphere": 1}, 1, True),
    "ring": (lambda: BRepPrimAPI_MakeTorus(30, 8).Shape(), {"torus": 1}, 2, True),
    "plate": (plate, {"plane": 6, "cylinder": 2}, 4, False),
    "one bore": (
        lambda: BRepAlgoAPI_Cut(plate(), cylinder(3, 40, 30, 20, -4)).Shape(),
        {"plane": 6, "cylinder": 3},
        1,
        False,
    ),
    "half bore": (
        lambda: BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(80, 60, 50).Shape(), cylinder(15, 80, 40, 0, -4)).Shape(),
        {"plane": 7, "cylinder": 1},
        2,
        False,
    ),
}


def check_mesh(part):
    assert is_closed(part.triangles)
    assert part.volume > 0
    # The mean outward normal of each plane is the one its triangles have.
    corners = part.vertices[part.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for plane, face in enumerate(part.planes.faces):
        mine = cross[part.triangle_face == face]
        mine = mine[np.linalg.norm(mine, axis=1) > 1e-9 * part.diagonal**2]
        unit = mine / np.linalg.norm(mine, axis=1, keepdims=True)
        assert (unit @ part.planes.normals[plane] > 1 - 1e-4).all()


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("move", [False, True])
def test_solids_have_their_faces_measures_and_symmetry(tmp_path, name, move):
    make, faces, order, continuous = SOLIDS[name]
    shape = tilted(make()) if move else make()
    part = read_part(write(tmp_path / "solid.step", shape))
    check_mesh(part)
    assert kinds(part) == faces
    assert part.symmetry.order == order
    assert part.symmetry.continuous == continuous
    assert part.unit == "mm"
    volume, area = GProp_GProps(), GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, volume)
    BRepGProp.SurfaceProperties_s(shape, area)
    assert part.volume == pytest.approx(volume.Mass() * 1e-9, rel=0.015)
    assert part.area == pytest.approx(area.Mass() * 1e-6, rel=0.01)
    centre = volume.CentreOfMass()
    np.testing.assert_allclose(
        part.centroid * 1e3, [centre.X(), centre.Y(), centre.Z()], atol=2e-3 * 1e3 * part.diagonal
    )


def test_curved_faces_carry_their_axis_radius_and_side(tmp_path):
    part = read_part(write(tmp_path / "plate.step", plate()))
    bores = [face for face in part.faces if face.surface == "cylinder"]
    assert [bore.convex for bore in bores] == [False, False]
    assert [bore.radius for bore in bores] == pytest.approx([0.008, 0.008])
    assert sorted(round(float(bore.axis_point[0]), 6) for bore in bores) == [-0.03, 0.03]
    rod = read_part(write(tmp_path / "rod.step", cylinder()))
    assert [face.convex for face in rod.faces if face.radius] == [True]
    assert len(rod.edges) == 0
    cone = read_part(write(tmp_path / "cone.step", BRepPrimAPI_MakeCone(30, 12, 40).Shape()))
    face = next(face for face in cone.faces if face.surface == "cone")
    assert face.half_angle == pytest.approx(np.arctan(18 / 40))
    np.testing.assert_allclose(face.axis_point, [0, 0, 0.04 * 30 / 18], atol=1e-9)
    np.testing.assert_allclose(face.axis_direction, [0, 0, -1], atol=1e-12)
    ring = read_part(write(tmp_path / "ring.step", BRepPrimAPI_MakeTorus(30, 8).Shape())).faces[0]
    assert (ring.radius, ring.minor_radius) == pytest.approx((0.03, 0.008))


def test_a_half_bore_has_straight_sharp_edges_with_true_angle(tmp_path):
    part = read_part(write(tmp_path / "half.step", SOLIDS["half bore"][0]()))
    curved = np.array([face.surface == "cylinder" for face in part.faces])
    mixed = curved[part.edges.faces].any(axis=1)
    assert mixed.sum() == 2
    # The bore is centred on the face, so its wall stands at right angles to it.
    np.testing.assert_allclose(part.edges.dihedrals[mixed], np.pi / 2, atol=1e-6)
    np.testing.assert_allclose(part.edges.lengths[mixed], 0.05, atol=1e-9)


def test_pieces_of_a_plane_become_one(tmp_path):
    left = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(40, 60, 50)).Shape()
    right = BRepPrimAPI_MakeBox(gp_Pnt(40, 0, 0), gp_Pnt(80, 60, 50)).Shape()
    united = BRepAlgoAPI_Fuse(left, right).Shape()
    explorer, count = TopExp_Explorer(united, TopAbs_FACE), 0
    while explorer.More():
        count, _ = count + 1, explorer.Next()
    assert count == 10  # The kernel leaves the seam in.
    part = read_part(write(tmp_path / "united.step", united))
    assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)
    np.testing.assert_allclose(np.sort(part.edges.lengths), [0.05] * 4 + [0.06] * 4 + [0.08] * 4, atol=1e-9)
    spline = BRepBuilderAPI_NurbsConvert(BRepPrimAPI_MakeBox(80, 60, 50).Shape(), True).Shape()
    part = read_part(write(tmp_path / "spline.step", spline))
    assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)


@pytest.mark.parametrize(("unit", "name"), [("MM", "mm"), ("M", "m"), ("INCH", "in"), ("CM", "cm")])
def test_the_unit_of_the_file_is_read_and_the_part_is_in_metres(tmp_path, unit, name):
    path = write(tmp_path / "box.step", BRepPrimAPI_MakeBox(80, 60, 50).Shape(), unit=unit)
    part = read_part(path)
    assert part.unit == name
    np.testing.assert_allclose(part.box[1], [0.08, 0.06, 0.05], atol=1e-9)


def test_another_unit_than_that_of_the_file_can_be_set(tmp_path):
    inches = write(tmp_path / "plate.step", plate(), unit="INCH")
    part = read_part(inches, unit="mm")
    assert part.unit == "mm"
    np.testing.assert_allclose(np.ptp(part.box, axis=0), np.array([0.1, 0.06, 0.012]) / 25.4, rtol=1e-6)
    assert sorted(face.radius for face in part.faces if face.radius) == pytest.approx([8e-3 / 25.4] * 2)
    assert part.repairs == ("Read in mm as requested: the file itself states in.",)


def test_a_solid_written_inside_out_is_turned(tmp_path):
    part = read_part(write(tmp_path / "in.step", BRepPrimAPI_MakeBox(80, 60, 50).Shape().Reversed()))
    assert part.volume == pytest.approx(2.4e-4)
    check_mesh(part)


def test_several_solids_are_one_part_even_where_they_touch(tmp_path):
    first = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(40, 40, 40)).Shape()
    second = BRepPrimAPI_MakeBox(gp_Pnt(40, 40, 0), gp_Pnt(90, 80, 30)).Shape()
    part = read_part(write(tmp_path / "two.step", first, second))
    check_mesh(part)
    assert len(part.planes) == 12
    assert part.volume == pytest.approx((40 * 40 * 40 + 50 * 40 * 30) * 1e-9)


def test_files_without_a_face_are_refused(tmp_path):
    box = BRepPrimAPI_MakeBox(80, 60, 50).Shape()
    with pytest.raises(PartError, match=r"line\.step: expected a solid, got curves or points only"):
        read_part(write(tmp_path / "line.step", TopExp_Explorer(box, TopAbs_EDGE).Current()))
    (tmp_path / "text.step").write_text("this is not STEP")
    with pytest.raises(PartError, match="without ISO-10303-21"):
        read_part(tmp_path / "text.step")
    whole = (EXAMPLES / "block.step").read_text()
    (tmp_path / "cut.step").write_text(whole[: len(whole) // 2])
    with pytest.raises(PartError, match=r"cut\.step: expected"):
        read_part(tmp_path / "cut.step")


def test_a_file_that_contradicts_itself_is_refused(tmp_path):
    text = (EXAMPLES / "block.step").read_text()
    points = re.findall(r"#\d+ = CARTESIAN_POINT\('',\(120\.,80\.,50\.\)\);", text)
    assert points
    for point in points:
        text = text.replace(point, point.replace("50.", "57."))
    (tmp_path / "bent.step").write_text(text)
    with pytest.raises(PartError, match=r"bent\.step: expected flat faces .* leaves it by"):
        read_part(tmp_path / "bent.step")


def test_without_the_kernel_the_pip_command_is_named(monkeypatch):
    for module in ("tanteo.parts.readers.step", "tanteo.parts.readers.exchange"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setitem(sys.modules, "OCP.STEPControl", None)
    with pytest.raises(MissingExtraError, match=r"pip install -e '\.\[step\]'"):
        read_part(EXAMPLES / "block.step")


@pytest.mark.parametrize(
    ("name", "planes", "edges", "corners", "curved", "order"),
    [
        ("block", 6, 12, 8, 0, 4),
        ("bracket_left", 14, 36, 24, 0, 1),
        ("bracket_right", 14, 36, 24, 0, 1),
        ("clamp", 18, 48, 32, 0, 1),
        ("flange", 7, 12, 8, 6, 2),
        ("hex_spacer", 8, 18, 12, 1, 12),
        ("housing", 17, 45, 30, 0, 1),
        ("square_post", 11, 24, 16, 0, 4),
        ("step_12mm", 11, 27, 18, 0, 1),
        ("step_15mm", 11, 27, 18, 0, 1),
        ("t_slot", 14, 36, 24, 0, 2),
        ("wedge", 7, 15, 10, 0, 1),
    ],
)
def test_the_examples_have_the_shapes_of_their_names(name, planes, edges, corners, curved, order):
    part = read_part(EXAMPLES / f"{name}.step")
    check_mesh(part)
    assert (len(part.planes), len(part.edges), len(part.corners)) == (planes, edges, corners)
    assert (len(part.faces) - len(part.planes), part.symmetry.order) == (curved, order)
    assert part.repairs == ()


def test_the_brackets_are_mirror_images():
    left, right = read_part(EXAMPLES / "bracket_left.step"), read_part(EXAMPLES / "bracket_right.step")
    mirror = mirror_part(left)
    np.testing.assert_allclose(np.sort(mirror.planes.areas), np.sort(right.planes.areas), rtol=1e-9)
    order = [np.lexsort(np.round(p.corners.points.T * 1e6)) for p in (mirror, right)]
    np.testing.assert_allclose(mirror.corners.points[order[0]], right.corners.points[order[1]], atol=1e-9)


def test_the_examples_come_out_of_their_script(tmp_path):
    script = ROOT / "examples" / "make_parts.py"
    subprocess.run([sys.executable, str(script), str(tmp_path)], check=True, capture_output=True)
    made = sorted(tmp_path.iterdir())
    assert [path.name for path in made] == sorted(path.name for path in EXAMPLES.iterdir())
    number = r"-?\d+\.\d*(?:E[+-]?\d+)?"
    for path in made:
        text, kept = path.read_text(), (EXAMPLES / path.name).read_text()
        # The same words; coordinates to rounding, which may differ between builds of the kernel.
        words, kept_words = (re.sub(r"\s+", "", re.sub(number, "#", t)) for t in (text, kept))
        assert words == kept_words
        values, kept_values = (np.array(re.findall(number, t), dtype=float) for t in (text, kept))
        np.testing.assert_allclose(values, kept_values, atol=1e-9)


def kernel_numbers(path):
    """Volume and area of the solids, by the kernel, in SI."""
    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    explorer = TopExp_Explorer(reader.OneShape(), TopAbs_SOLID)
    volume = area = 0.0
    while explorer.More():
        solid = TopoDS.Solid(explorer.Current())
        explorer.Next()
        v, a = GProp_GProps(), GProp_GProps()
        BRepGProp.VolumeProperties_s(solid, v)
        BRepGProp.SurfaceProperties_s(solid, a)
        volume, area = volume + v.Mass(), area + a.Mass()
    return volume * 1e-9, area * 1e-6


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize(
    "pattern", ["step_parts/*.st*p", "step_nist/nist_[cf]tc_0[136]*.stp", "step_confusable/*-1-*-23.step"]
)
def test_real_files_agree_with_the_kernel(pattern):
    files = sorted(DATA.glob(pattern))
    assert files
    for file in files[:: max(1, len(files) // 6)]:
        part = read_part(file)
        check_mesh(part)
        volume, area = kernel_numbers(file)
        assert part.volume == pytest.approx(volume, rel=2e-3), file.name
        assert part.area == pytest.approx(area, rel=2e-3), file.name


@pytest.mark.slow
@needs_data
def test_curved_faces_of_real_parts_lie_on_the_surface_they_name():
    checked = 0
    for file in [
        *sorted((DATA / "step_parts").glob("*.st*p"))[::3],
        *sorted((DATA / "step_nist").glob("*_0[37]_*.stp")),
    ]:
        part = read_part(file)
        for index, face in enumerate(part.faces):
            if face.surface in ("plane", "freeform"):
                continue
            mine = part.triangles[part.triangle_face == index]
            assert np.abs(distances_from(face, part.vertices[np.unique(mine)])).max() < 2e-4 * part.diagonal
            # Chords lie inside a boss and outside the wall of a bore: the side that `convex` names.
            if face.surface in ("cylinder", "sphere"):
                middle = part.vertices[mine].mean(axis=1)
                inward = distances_from(face, middle).sum()
                assert inward < 1e-6
                corners = part.vertices[mine]
                normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
                radial = middle - face.axis_point
                if face.axis_direction is not None:
                    radial = radial - np.outer(radial @ face.axis_direction, face.axis_direction)
                assert (np.einsum("ni,ni->n", radial, normals).sum() > 0) == face.convex
            checked += 1
    assert checked > 150


@needs_data
def test_all_planar_parts_obey_euler():
    """For a solid without handles whose faces are all discs, V - E + F = 2; holes in faces add to it."""
    counted = 0
    for file in sorted((DATA / "step_confusable").glob("0-*-23.step"))[:25]:
        part = read_part(file)
        assert set(kinds(part)) == {"plane"}
        # Rings of edges that lie inside a face make it no disc: count loops from the mesh.
        loops = face_loops(part)
        ends = np.round(part.edges.ends.reshape(-1, 3) / part.diagonal, 6)
        vertices = len(np.unique(ends, axis=0))
        shells_minus_handles = vertices - len(part.edges) + len(part.planes) - (loops - len(part.planes))
        assert shells_minus_handles % 2 == 0
        assert shells_minus_handles <= 2
        counted += shells_minus_handles == 2
    assert counted > 5


def face_loops(part):
    """Count boundary loops over all faces."""
    from tanteo.parts.readers import components, mesh_edges

    edges = mesh_edges(part.triangles)
    left, right = part.triangle_face[edges.left], part.triangle_face[edges.right]
    border = left != right
    total = 0
    for face in range(len(part.faces)):
        mine = edges.ends[border & ((left == face) | (right == face))]
        names, index = np.unique(mine, return_inverse=True)
        index = index.reshape(-1, 2)
        total += int(components(len(names), index[:, 0], index[:, 1]).max()) + 1
    return total
