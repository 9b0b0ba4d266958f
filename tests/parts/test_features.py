"""Laws that planes, edges and corners of every part obey."""

from pathlib import Path

import igl
import numpy as np
import pytest

from mesh_laws import is_closed
from tanteo.parts import read_part
from tanteo.parts.readers import mirror_part

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
SOLIDS = ["box", "hexagon", "tetrahedron", "wedge", "rounded", "frustum", "ball", "notched"]


def notched(solids):
    """Return an L-shaped bar as a fan of triangles, exact because the outline is star-shaped about (25, 25)."""
    ring = np.array([(25, 25), (25, 60), (0, 60), (0, 0), (80, 0), (80, 25)], dtype=float)
    return solids.prism(ring, 40)


def make(solids, name):
    return {
        "box": lambda: solids.box(),
        "hexagon": lambda: solids.prism(solids.polygon(6), 40),
        "tetrahedron": lambda: solids.tetrahedron(),
        "wedge": lambda: solids.prism([(0, 0), (90, 0), (0, 35)], 45),
        "rounded": lambda: solids.prism(solids.polygon(40)[:21], 30),
        "frustum": lambda: solids.lathe([(0, 0), (30, 0), (15, 40), (0, 40)]),
        "ball": lambda: solids.sphere(),
        "notched": lambda: notched(solids),
    }[name]()


def check_laws(part):
    assert is_closed(part.triangles)
    assert part.volume > 0
    corners = part.vertices[part.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    sums = np.bincount(part.triangle_face, areas, len(part.faces))
    np.testing.assert_allclose(sums, [face.area for face in part.faces], rtol=1e-12)
    assert part.area == pytest.approx(areas.sum())
    assert (np.linalg.norm(part.vertices - part.centroid, axis=1) <= part.radius * (1 + 1e-12)).all()
    check_planes(part)
    check_edges(part)
    for vectors in (part.vertices, part.planes.areas, part.edges.ends, part.symmetry.Ts):
        assert not vectors.flags.writeable


def check_planes(part):
    planes = part.planes
    assert [part.faces[i].surface for i in planes.faces] == ["plane"] * len(planes)
    assert sum(face.surface == "plane" for face in part.faces) == len(planes)
    R = planes.Ts_part_feature[:, :3, :3]
    np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (len(planes), 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    for k, face in enumerate(planes.faces):
        mine = np.unique(part.triangles[part.triangle_face == face])
        points = part.vertices[mine]
        local = (points - planes.centroids[k]) @ R[k]
        assert np.abs(local[:, 2]).max() < 2e-5 * part.diagonal
        hull = planes.boundary[planes.boundary_start[k] : planes.boundary_start[k + 1]]
        assert len(hull) >= 3
        # Any linear function over the face has its extremes on the hull.
        ways = np.random.default_rng(k).normal(size=(3, 20))
        np.testing.assert_allclose((hull @ ways).max(axis=0), (points @ ways).max(axis=0), atol=1e-9)
        np.testing.assert_allclose((hull @ ways).min(axis=0), (points @ ways).min(axis=0), atol=1e-9)
        turned = np.cross(np.roll(hull, -1, axis=0) - hull, np.roll(hull, -2, axis=0) - np.roll(hull, -1, axis=0))
        assert (turned @ planes.normals[k] > 0).all()
        assert planes.gyration[k, 0] >= planes.gyration[k, 1] > 0


def check_edges(part):
    edges = part.edges
    if not len(edges):
        return
    T = edges.Ts_part_feature
    x, y, z = T[:, :3, 0], T[:, :3, 1], T[:, :3, 2]
    np.testing.assert_allclose(np.linalg.det(T[:, :3, :3]), 1.0)
    np.testing.assert_allclose(edges.ends.mean(axis=1), edges.midpoints, atol=1e-15)
    np.testing.assert_allclose(edges.ends[:, 1] - edges.ends[:, 0], x * edges.lengths[:, None], atol=1e-12)
    assert (edges.faces[:, 0] < edges.faces[:, 1]).all()
    assert ((edges.dihedrals > 0) & (edges.dihedrals < 2 * np.pi)).all()
    np.testing.assert_array_equal(edges.convex, edges.dihedrals < np.pi)
    row = np.full(len(part.faces), -1)
    row[part.planes.faces] = np.arange(len(part.planes))
    plane = row[edges.faces]
    assert (plane >= 0).any(axis=1).all()
    flat = (plane >= 0).all(axis=1)
    left, right = part.planes.normals[plane[flat, 0]], part.planes.normals[plane[flat, 1]]
    bisector = left + right
    bisector /= np.linalg.norm(bisector, axis=1, keepdims=True)
    np.testing.assert_allclose(z[flat], bisector, atol=1e-6)
    # The material angle: half of it lies between -z and each face.
    half = edges.dihedrals[flat] / 2
    into_left = y[flat] * np.sin(half)[:, None] - z[flat] * np.cos(half)[:, None]
    into_right = -y[flat] * np.sin(half)[:, None] - z[flat] * np.cos(half)[:, None]
    np.testing.assert_allclose(np.einsum("ni,ni->n", into_left, left), 0, atol=1e-6)
    np.testing.assert_allclose(np.einsum("ni,ni->n", into_right, right), 0, atol=1e-6)
    # A short step from the edge along -z is in the material, along +z it is not.
    step = 1e-4 * np.minimum(edges.lengths, part.diagonal)[:, None]
    probes = np.concatenate([edges.midpoints - step * z, edges.midpoints + step * z])
    winding = igl.winding_number(part.vertices, part.triangles, probes)
    np.testing.assert_allclose(winding, np.repeat([1.0, 0.0], len(edges)), atol=0.01)


@pytest.mark.parametrize("name", SOLIDS)
def test_laws_hold_for_solids_in_any_pose(read, solids, name):
    vertices, triangles = make(solids, name)
    part = read((vertices, triangles), "still")
    check_laws(part)
    R = solids.rotation(np.random.default_rng(len(name)))
    moved = read((vertices @ R.T + [300, -20, 7], triangles), "moved")
    check_laws(moved)
    assert len(moved.planes) == len(part.planes)
    assert len(moved.corners) == len(part.corners)
    assert moved.symmetry.order == part.symmetry.order
    np.testing.assert_allclose(moved.planes.centroids, part.planes.centroids @ R.T + [0.3, -0.02, 0.007], atol=1e-6)
    np.testing.assert_allclose(moved.planes.gyration, part.planes.gyration, atol=1e-6)
    np.testing.assert_allclose(moved.edges.lengths, part.edges.lengths, atol=1e-6)
    np.testing.assert_allclose(moved.edges.dihedrals, part.edges.dihedrals, atol=1e-4)
    turned = np.einsum("ij,njk->nik", R, part.edges.Ts_part_feature[:, :3, :3])
    np.testing.assert_allclose(moved.edges.Ts_part_feature[:, :3, :3], turned, atol=1e-4)


def test_a_rectangle_has_the_gyration_of_its_sides(read, solids):
    part = read(solids.box())
    top = int(np.argmax(part.planes.normals[:, 2]))
    np.testing.assert_allclose(part.planes.gyration[top], np.array([0.08, 0.06]) / np.sqrt(12), rtol=1e-6)
    np.testing.assert_allclose(np.abs(part.planes.Ts_part_feature[top, :3, 0]), [1, 0, 0], atol=1e-9)
    assert part.planes.areas[top] == pytest.approx(0.0048)


def test_dihedrals_are_material_angles(read, solids):
    np.testing.assert_allclose(read(solids.box(), "a").edges.dihedrals, np.pi / 2, atol=1e-6)
    np.testing.assert_allclose(read(solids.tetrahedron(), "b").edges.dihedrals, np.arccos(1 / 3), atol=1e-6)
    part = read(notched(solids), "c")
    assert (~part.edges.convex).sum() == 1
    assert part.edges.dihedrals[~part.edges.convex][0] == pytest.approx(1.5 * np.pi, abs=1e-6)
    assert len(part.edges) == 18
    assert len(part.corners) == 12


def test_corners_list_the_edges_that_end_there(read, solids):
    corners = read(notched(solids)).corners
    part = read(notched(solids))
    np.testing.assert_array_equal(np.diff(corners.edges_start), 3)
    for i, point in enumerate(part.corners.points):
        for edge in part.corners.edges[part.corners.edges_start[i] : part.corners.edges_start[i + 1]]:
            assert np.linalg.norm(part.edges.ends[edge] - point, axis=1).min() < 1e-12


def test_a_mirror_image_keeps_lengths_and_changes_hand(read, solids):
    part = read(notched(solids))
    mirror = mirror_part(part)
    check_laws(mirror)
    assert mirror.name == "part_mirrored"
    assert mirror.volume == pytest.approx(part.volume)
    np.testing.assert_allclose(np.sort(mirror.edges.lengths), np.sort(part.edges.lengths), atol=1e-12)
    np.testing.assert_allclose(np.sort(mirror.edges.dihedrals), np.sort(part.edges.dihedrals), atol=1e-9)
    again = mirror_part(mirror)
    np.testing.assert_allclose(again.planes.normals, part.planes.normals, atol=1e-12)


@pytest.mark.skipif(not DATA.exists(), reason=f"no shared data at {DATA}")
@pytest.mark.parametrize(
    ("file", "unit", "planes", "edges", "corners"),
    [
        ("bracket/bracket.stl", "mm", 24, 66, 44),
        ("cmm_block/calibration_block_from_drawing.stl", "mm", 10, 24, 16),
        ("fingertip_touches/models/box.off", "m", 6, 12, 8),
        ("fingertip_touches/models/tetrahedron.off", "m", 4, 6, 4),
        ("fingertip_touches/models/cylinder.off", "m", 2, 0, 0),
        ("fingertip_touches/models/robot.off", "m", 0, 0, 0),
        ("fingertip_touches/models/helmet.off", "m", 0, 0, 0),
    ],
)
def test_real_meshes_have_the_features_one_counts_by_hand(file, unit, planes, edges, corners):
    part = read_part(DATA / file, unit=unit)
    check_laws(part)
    assert (len(part.planes), len(part.edges), len(part.corners)) == (planes, edges, corners)


@pytest.mark.skipif(not DATA.exists(), reason=f"no shared data at {DATA}")
@pytest.mark.parametrize(
    ("name", "closed", "stated"), [("legoBox", True, "Split 8"), ("seashell", False, "it ends at 148")]
)
def test_real_meshes_with_gaps_are_closed_or_open(name, closed, stated):
    part = read_part(DATA / "fingertip_touches" / "models" / f"{name}.off", unit="m")
    assert part.closed == closed
    assert any(stated in sentence for sentence in part.repairs)


@pytest.mark.skipif(not DATA.exists(), reason=f"no shared data at {DATA}")
def test_a_real_bone_with_crowded_edges_is_closed():
    part = read_part(DATA / "field_cases" / "t01_pa4_bone_nonmanifold" / "bone.ply", unit="mm")
    fixed = read_part(DATA / "field_cases" / "t01_pa4_bone_nonmanifold" / "bone_fixed.ply", unit="mm")
    assert part.closed
    assert part.area == pytest.approx(fixed.area, rel=5e-3)
    assert part.volume == pytest.approx(fixed.volume, rel=5e-3)
