"""Parts from vertices and triangles in memory: the same repairs and messages as of a mesh file, and used everywhere."""

import json

import numpy as np
import pytest

import tanteo
from tanteo.errors import PartError, UnitError
from tanteo.io import read_record, recognition_document, write_record
from tanteo.parts import read_part
from tanteo.planning import Sensing
from tanteo.render.html import Run, gather, report_page

BOX = 80 * 60 * 50 * 1e-9


def same(first, second):
    for name in ("vertices", "triangles", "triangle_face", "volume", "area", "box", "repairs"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert [face.surface for face in first.faces] == [face.surface for face in second.faces]


def test_a_part_is_that_of_the_same_mesh_in_a_file(solids, tmp_path):
    for vertices, triangles in (solids.box(), solids.sphere(), solids.tetrahedron()):
        path = solids.write_off(tmp_path / "thing.off", vertices, triangles)
        from_file = read_part(path, unit="mm")
        made = tanteo.part_from_mesh(from_file.vertices, from_file.triangles, unit="m", name="thing", cache=False)
        np.testing.assert_allclose(made.volume, from_file.volume, rtol=1e-9)
        assert (made.name, made.source, made.unit) == ("thing", "", "m")
        assert [f.surface for f in made.faces] == [f.surface for f in from_file.faces]


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("in", 0.0254), ("Millimetres", 1e-3), ("cm", 0.01)])
def test_units(solids, unit, metres):
    vertices, triangles = solids.box(8, 6, 5)
    part = tanteo.part_from_mesh(vertices, triangles, unit=unit)
    assert part.volume == pytest.approx(240 * metres**3)
    np.testing.assert_allclose(part.box[1], np.array([8, 6, 5]) * metres)


def test_lists_and_whole_numbers_are_taken(solids):
    vertices, triangles = solids.box()
    part = tanteo.part_from_mesh(vertices.astype(int).tolist(), triangles.tolist(), unit="mm")
    assert part.volume == pytest.approx(BOX)
    assert not part.vertices.flags.writeable
    assert part.repairs == ()


def test_inward_triangles_are_turned(solids):
    vertices, triangles = solids.box()
    part = tanteo.part_from_mesh(vertices, triangles[:, ::-1], unit="mm")
    assert part.volume == pytest.approx(BOX)
    assert part.repairs == ("Turned the surface inside out: its normals pointed into the material.",)
    mixed = triangles.copy()
    mixed[::3] = mixed[::3, ::-1]
    part = tanteo.part_from_mesh(vertices, mixed, unit="mm")
    assert part.volume == pytest.approx(BOX)
    assert "Made the winding of the triangles consistent." in part.repairs


def test_duplicate_vertices_are_merged(solids):
    vertices, triangles = solids.box()
    loose = vertices[triangles].reshape(-1, 3)
    part = tanteo.part_from_mesh(loose, np.arange(len(loose)).reshape(-1, 3), unit="mm")
    assert part.volume == pytest.approx(BOX)
    assert (len(part.vertices), len(part.planes), len(part.edges), len(part.corners)) == (8, 6, 12, 8)


def test_degenerate_and_duplicate_triangles_are_dropped(solids):
    vertices, triangles = solids.box()
    part = tanteo.part_from_mesh(vertices, [*triangles, (0, 0, 1), triangles[0]], unit="mm")
    assert part.volume == pytest.approx(BOX)
    assert part.repairs[:2] == (
        "Dropped 1 triangles whose corners coincide.", "Dropped 1 duplicate triangles.",
    )  # fmt: skip


def test_an_open_surface_is_a_part_marked_open(solids):
    vertices, triangles = solids.box()
    keep = ~(vertices[triangles][:, :, 2] == 50).all(axis=1)
    part = tanteo.part_from_mesh(vertices, triangles[keep], unit="mm")
    assert not part.closed
    assert any(sentence.startswith("The surface is open") for sentence in part.repairs)
    assert len(part.planes) == 5


TRIANGLE = [[0, 1, 2]]
CORNERS = [[0, 0, 0], [30, 0, 0], [0, 30, 0]]


@pytest.mark.parametrize(
    ("vertices", "triangles", "message"),
    [
        ([], [], "lump: expected triangles, got an empty mesh"),
        (np.zeros((0, 3)), np.zeros((0, 3), int), "expected triangles, got an empty mesh"),
        (CORNERS, [], "expected triangles, got 3 points alone"),
        ([[0, 0, 0], [30, 0, np.nan], [0, 30, 0]], TRIANGLE, "expected finite coordinates, got NaN or infinity"),
        ([[0, 0, 0], [30, 0, np.inf], [0, 30, 0]], TRIANGLE, "expected finite coordinates"),
        (np.array(CORNERS) * 1e9, TRIANGLE, "which is too large"),
        (np.array(CORNERS) * 1e-9, TRIANGLE, "which is too small"),
        (np.array(CORNERS) * 1e300, TRIANGLE, "which is too large"),
        ([[5, 5, 5]] * 3, TRIANGLE, "which is too small"),
        ([[0, 0, 0], [10, 0, 0], [20, 0, 0]], TRIANGLE, "triangles without area"),
        (CORNERS, [[0, 1, 3]], "expected corner indices from 0 to 2, got 3"),
        (CORNERS, [[0, 1, -1]], "expected corner indices from 0 to 2, got -1"),
        (CORNERS, [[0, 1]], r"expected triangles \(T, 3\), got shape \(1, 2\)"),
        (CORNERS, [0, 1, 2], r"expected triangles \(T, 3\), got shape \(3,\)"),
        (CORNERS, [[0, 1, 2.5]], "expected triangles as whole numbers, got float64"),
        ([[0, 0], [30, 0], [0, 30]], TRIANGLE, r"expected vertices \(V, 3\), got shape \(3, 2\)"),
        ([[0, 0, 0], [30, 0], [0, 30, 0]], TRIANGLE, "rows of unequal length"),
        ([["a", "b", "c"]] * 3, TRIANGLE, "expected vertices as numbers"),
        (np.array(CORNERS) * 1j, TRIANGLE, "expected vertices as numbers, got complex128"),
        (5, TRIANGLE, "expected vertices"),
        (None, TRIANGLE, "expected vertices as numbers, got object"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_sentence(vertices, triangles, message):
    with pytest.raises(PartError, match=message) as raised:
        tanteo.part_from_mesh(vertices, triangles, unit="mm", name="lump")
    assert str(raised.value).startswith("lump: expected")


@pytest.mark.parametrize("unit", ["furlong", "", None, 3])
def test_a_unit_that_is_none_is_refused(unit):
    with pytest.raises(UnitError):
        tanteo.part_from_mesh(CORNERS, TRIANGLE, unit=unit)


def test_faces_are_those_that_are_numbered(solids):
    vertices, triangles = solids.box()
    found = tanteo.part_from_mesh(vertices, triangles, unit="mm")
    numbers = found.triangle_face * 7 - 3
    same(found, tanteo.part_from_mesh(vertices, triangles, unit="mm", faces=numbers))
    # a plane as two faces, and one number at two places that do not touch
    split = tanteo.part_from_mesh(vertices, triangles, unit="mm", faces=np.arange(12))
    assert len(split.planes) == 12
    heights = vertices[triangles][:, :, 2].mean(axis=1)
    ends = np.where((heights == 0) | (heights == 50), 0, 1)
    part = tanteo.part_from_mesh(vertices, triangles, unit="mm", faces=ends)
    assert sorted(face.surface for face in part.faces) == ["freeform", "plane", "plane"]


def test_numbered_faces_are_cylinders_where_they_are(solids):
    vertices, triangles = solids.prism(solids.polygon(48), 40)
    normals = np.cross(*(vertices[triangles[:, k]] - vertices[triangles[:, 0]] for k in (1, 2)))
    numbers = np.where(np.abs(normals[:, 2]) > 1e-9, np.sign(normals[:, 2]), 5).astype(int)
    part = tanteo.part_from_mesh(vertices, triangles, unit="mm", faces=numbers)
    (wall,) = (face for face in part.faces if face.surface == "cylinder")
    assert wall.radius == pytest.approx(0.03, rel=1e-6)
    assert wall.convex is True


def test_numbers_of_faces_go_through_repairs(solids):
    vertices, triangles = solids.box()
    numbers = tanteo.part_from_mesh(vertices, triangles, unit="mm").triangle_face.copy()
    normals = np.cross(*(vertices[triangles[:, k]] - vertices[triangles[:, 0]] for k in (1, 2)))
    numbers[(normals[:, 2] < 0) | (normals[:, 1] < 0)] = 77  # the bottom and one side are one face
    order = np.random.default_rng(3).permutation(12)
    loose = vertices[triangles[order]].reshape(-1, 3)
    corners = np.vstack([np.arange(36).reshape(-1, 3)[:, ::-1], [(0, 0, 1)]])
    part = tanteo.part_from_mesh(loose, corners, unit="mm", faces=[*numbers[order], 99])
    assert part.volume == pytest.approx(BOX)
    assert sorted(face.surface for face in part.faces) == ["freeform", *["plane"] * 4]
    (bent,) = (face for face in part.faces if face.surface == "freeform")
    assert bent.area == pytest.approx((80 * 60 + 80 * 50) * 1e-6)


def test_a_filled_hole_is_a_face_of_its_own(solids):
    vertices, triangles = solids.sphere(30.0, 128)
    part = tanteo.part_from_mesh(vertices, triangles[1:], unit="mm", faces=np.zeros(len(triangles) - 1, int))
    assert part.closed
    assert any("hole" in sentence for sentence in part.repairs)
    assert sorted(face.surface for face in part.faces) == ["plane", "sphere"]


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([0, 1], "expected one face number for each of 12 triangles, got 2"),
        ([0.5] * 12, "expected faces as whole numbers"),
        ([[0]] * 12, r"expected faces \(T,\), got shape \(12, 1\)"),
    ],
)
def test_numbers_of_faces_that_do_not_fit_are_refused(solids, faces, message):
    with pytest.raises(PartError, match=message):
        tanteo.part_from_mesh(*solids.box(), unit="mm", faces=faces)


def test_what_is_remembered_depends_on_the_content_alone(solids, tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    vertices, triangles = solids.box()
    first = tanteo.part_from_mesh(vertices, triangles, unit="mm", name="a")
    second = tanteo.part_from_mesh(vertices.tolist(), triangles, unit="mm", name="b")
    assert (first.name, second.name) == ("a", "b")
    same(first, second)
    others = [
        tanteo.part_from_mesh(2 * vertices, triangles, unit="mm"),
        tanteo.part_from_mesh(vertices, triangles, unit="cm"),
        tanteo.part_from_mesh(vertices, triangles, unit="mm", faces=np.arange(12)),
    ]  # fmt: skip
    assert len({part.derived["key"] for part in (first, second, *others)}) == 4
    assert len(list((tmp_path / "cache").rglob("*.part"))) == 4
    plain = tanteo.part_from_mesh(vertices + 1.0, triangles, unit="mm", cache=False)
    assert "key" not in plain.derived
    assert len(list((tmp_path / "cache").rglob("*.part"))) == 4


def test_it_goes_through_everything(solids, tmp_path):
    """Recognized, reported, written as a document, kept in a record."""
    block = tanteo.part_from_mesh(*solids.box(), unit="mm", name="block")
    ball = tanteo.part_from_mesh(*solids.sphere(), unit="mm", name="ball")
    rng, points = np.random.default_rng(7), []
    for axis in range(3):
        for side in (0, 1):
            p = block.box[0] + rng.uniform(0.1, 0.9, (5, 3)) * (block.box[1] - block.box[0])
            p[:, axis] = block.box[side, axis]
            points.append(p)
    readings = tanteo.Readings.from_columns(
        np.concatenate(points) + 5e-5 * rng.normal(size=(30, 3)), sds=np.full(30, 5e-5)
    )
    answer = tanteo.identify(readings, [ball, block])
    assert (answer.status, answer.best.part, answer.best.file) == ("recognized", "block", "")
    json.dumps(recognition_document(answer))
    page = report_page(answer, gather(readings, Sensing(sd=5e-5)), [ball, block], Run("x", "y", ()))
    assert "block" in page
    session = tanteo.Session(
        tanteo.at_place([block], np.eye(4), np.diag([0.002] * 3 + [0.02] * 3) ** 2),
        tanteo.probe_of(1e-4, contact=True, radius=1e-3), tanteo.Sensing(sd=1e-4),
    )  # fmt: skip
    session.tell(session.ask().read(0.05))
    write_record(session, tmp_path / "run.json")
    with pytest.raises(PartError, match="as it has no file"):
        read_record(tmp_path / "run.json")
    assert read_record(tmp_path / "run.json", [block]).count == 1
    other = tanteo.part_from_mesh(*solids.box(81), unit="mm", name="block")
    with pytest.raises(PartError, match="block"):
        read_record(tmp_path / "run.json", [other])


@pytest.mark.parametrize("seed", range(3))
def test_merged_vertices_keep_the_order_of_triangles(seed):
    """Adjacent triangles of a file stay adjacent in memory, which halves the time of a mesh of 100 MB."""
    corners = np.array([[0, 0, 0], [9.0, 0, 0], [0, 7.0, 0], [0, 0, 5.0]])[np.random.default_rng(seed).permutation(4)]
    triangles = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    a, b, c, d = corners
    outward = triangles if np.linalg.det([b - a, c - a, d - a]) > 0 else triangles[:, ::-1]
    soup = corners[outward].reshape(-1, 3)
    part = tanteo.part_from_mesh(soup, np.arange(12).reshape(-1, 3), unit="mm", name="soup", cache=False)
    order = list(dict.fromkeys(outward.ravel().tolist()))
    np.testing.assert_array_equal(part.vertices, 1e-3 * corners[order])
