"""Formats, units, repairs and refusals of mesh files."""

import numpy as np
import pytest
import trimesh

from tanteo.errors import PartError, UnitError
from tanteo.parts import read_part


def as_trimesh(solid):
    return trimesh.Trimesh(*solid, process=False)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb", "3mf"])
def test_every_format_gives_the_same_part_in_metres(tmp_path, solids, suffix):
    mesh = as_trimesh(solids.box())
    unit = "mm"
    if suffix == "glb":
        mesh.apply_scale(1e-3)
        unit = None
    if suffix == "3mf":
        mesh.units, unit = "millimeter", None
    path = tmp_path / f"box.{suffix}"
    mesh.export(path)
    part = read_part(path, unit=unit)
    np.testing.assert_allclose(part.box, [[0, 0, 0], [0.08, 0.06, 0.05]], atol=1e-8)
    assert (part.name, part.unit) == ("box", "m" if suffix == "glb" else "mm")
    assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)
    assert part.volume == pytest.approx(2.4e-4, rel=1e-6)
    assert part.area == pytest.approx(0.0236, rel=1e-6)
    np.testing.assert_allclose(part.centroid, [0.04, 0.03, 0.025], atol=1e-8)


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("inches", 0.0254), ("cm", 1e-2), ("Meter", 1.0)])
def test_units_scale(tmp_path, solids, unit, metres):
    path = solids.write_off(tmp_path / "p.off", *solids.box(2, 3, 4))
    np.testing.assert_allclose(read_part(path, unit=unit).box[1], np.array([2, 3, 4]) * metres, rtol=1e-12)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off"])
def test_a_format_without_a_unit_requests_one(tmp_path, solids, suffix):
    path = tmp_path / f"p.{suffix}"
    as_trimesh(solids.box()).export(path)
    with pytest.raises(UnitError, match=r"unit: expected the length unit of p\..*Pass unit='mm'"):
        read_part(path)
    with pytest.raises(UnitError, match="'furlong'"):
        read_part(path, unit="furlong")


@pytest.mark.parametrize(("unit", "proposed"), [("m", "'mm'"), ("ft", "'mm'")])
def test_a_part_of_eighty_metres_raises_a_question(tmp_path, solids, unit, proposed):
    path = solids.write_stl(tmp_path / "p.stl", *solids.box(200, 80, 80))
    with pytest.raises(PartError, match=rf"too large\. Did you mean unit=.*{proposed}"):
        read_part(path, unit=unit)
    with pytest.raises(PartError, match=r"too small\. Did you mean unit=.*'mm'"):
        read_part(solids.write_stl(tmp_path / "q.stl", *solids.box()), unit="um")


def test_a_file_that_states_a_wrong_unit_can_be_overridden(tmp_path, solids):
    path = tmp_path / "p.glb"
    as_trimesh(solids.box()).export(path)
    with pytest.raises(PartError, match=r"too large\. The unit is the file's own. If it is wrong, pass unit='mm'"):
        read_part(path)
    part = read_part(path, unit="mm")
    np.testing.assert_allclose(part.box[1], [0.08, 0.06, 0.05], atol=1e-8)
    assert part.repairs == ("Read in mm as requested: the file itself states m.",)


def test_off_with_comments_and_polygons(tmp_path):
    path = tmp_path / "wedge.off"
    faces = ["4 0 1 2 3 # base", "4 0 4 5 1", "3 1 5 2", "4 2 5 4 3 255 0 0", "3 0 3 4"]
    corners = ["0 0 0", "0 50 0", "80 50 0", "80 0 0", "0 0 40", "0 50 40"]
    path.write_text("OFF # made by hand\n6 5 0\n\n" + "\n".join(corners) + "\n# faces\n" + "\n".join(faces))
    part = read_part(path, unit="mm")
    assert (len(part.planes), len(part.edges), len(part.corners)) == (5, 9, 6)
    assert part.volume == pytest.approx(0.5 * 0.08 * 0.05 * 0.04)


@pytest.mark.parametrize(
    "text",
    ["", "PLY\n", "OFF\n8 12\n0 0 0\n", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n", "OFF\n1 0 0\nx y z\n"],
)
def test_broken_off_files_are_refused(tmp_path, text):
    path = tmp_path / "bad.off"
    path.write_text(text)
    with pytest.raises(PartError, match=r"bad\.off: expected"):
        read_part(path, unit="mm")


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb", "3mf"])
@pytest.mark.parametrize("content", [b"", b"not a mesh at all", bytes(range(256)) * 8])
def test_files_with_a_wrong_suffix_are_refused(tmp_path, suffix, content):
    path = tmp_path / f"bad.{suffix}"
    path.write_bytes(content)
    with pytest.raises(PartError, match=r"bad\..*: expected"):
        read_part(path, unit="mm")


def test_what_is_no_readable_file_is_refused(tmp_path):
    with pytest.raises(PartError, match="got nothing there"):
        read_part(tmp_path / "missing.stl", unit="mm")
    (tmp_path / "part.sldprt").write_text("x")
    with pytest.raises(PartError, match=r"expected one of \.step.*got '\.sldprt'"):
        read_part(tmp_path / "part.sldprt")


def test_winding_is_repaired_and_reported(tmp_path, solids):
    vertices, triangles = solids.box()
    inverted = read_part(solids.write_off(tmp_path / "a.off", vertices, triangles[:, ::-1]), unit="mm")
    assert inverted.volume == pytest.approx(2.4e-4)
    assert "inside out" in inverted.repairs[0]
    mixed = triangles.copy()
    mixed[::3] = mixed[::3, ::-1]
    part = read_part(solids.write_off(tmp_path / "b.off", vertices, mixed), unit="mm")
    assert part.volume == pytest.approx(2.4e-4)
    assert "consistent" in part.repairs[0]
    outward = np.einsum("ni,ni->n", part.planes.normals, part.planes.centroids - part.centroid)
    assert (outward > 0).all()


def test_a_hollow_keeps_its_hole_whatever_the_winding(tmp_path, solids):
    outer, triangles = solids.box(80, 60, 50)
    inner = solids.box(40, 30, 20)[0] + 10
    vertices = np.concatenate([outer, inner])
    hollow = np.concatenate([triangles, triangles[:, ::-1] + 8])
    volume = (80 * 60 * 50 - 40 * 30 * 20) * 1e-9
    assert read_part(solids.write_off(tmp_path / "a.off", vertices, hollow), unit="mm").volume == pytest.approx(volume)
    rng = np.random.default_rng(0)
    flips = rng.random(len(hollow)) < 0.5
    hollow[flips] = hollow[flips, ::-1]
    part = read_part(solids.write_off(tmp_path / "b.off", vertices, hollow), unit="mm")
    assert part.volume == pytest.approx(volume)
    assert len(part.planes) == 12


def test_duplicates_slivers_and_split_edges_are_repaired(tmp_path, solids):
    vertices, triangles = solids.box()
    # A vertex in the middle of an edge: one neighbour is split there, the other gets a triangle without area.
    middle = len(vertices)
    points = np.vstack([vertices, (vertices[0] + vertices[1]) / 2])
    split = []
    for a, b, c in triangles:
        ring = [a, b, c]
        if {0, 1} <= set(ring):
            k = next(i for i in range(3) if {ring[i], ring[(i + 1) % 3]} == {0, 1})
            p, q, r = ring[k], ring[(k + 1) % 3], ring[(k + 2) % 3]
            split += [(p, middle, r), (middle, q, r)] if p == 0 else [(p, q, r), (p, middle, q)]
        else:
            split.append(ring)
    split += [split[0], (4, 4, 5)]
    part = read_part(solids.write_off(tmp_path / "p.off", points, split), unit="mm")
    assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)
    assert {sentence.split()[0] for sentence in part.repairs} == {"Dropped", "Retriangulated"}
    assert part.volume == pytest.approx(2.4e-4)


def test_what_is_no_surface_is_refused(tmp_path, solids):
    vertices, triangles = solids.box()
    line = np.array([(0, 0, 0), (10, 0, 0), (20, 0, 0)], dtype=float)
    with pytest.raises(PartError, match="got triangles without area"):
        read_part(solids.write_off(tmp_path / "line.off", line, [(0, 1, 2)]), unit="mm")
    with pytest.raises(PartError, match="NaN or infinity"):
        read_part(
            solids.write_off(tmp_path / "nan.off", np.where(vertices == 80, np.nan, vertices), triangles), unit="mm"
        )
    (tmp_path / "none.off").write_text("OFF\n1 0 0\n0 0 0\n")
    with pytest.raises(PartError, match="got 1 points alone"):
        read_part(tmp_path / "none.off", unit="mm")


def test_separate_closed_bodies_are_one_part(tmp_path, solids):
    vertices, triangles = solids.box()
    two = np.concatenate([vertices, vertices + np.array([200, 0, 0])]), np.concatenate([triangles, triangles + 8])
    part = read_part(solids.write_off(tmp_path / "two.off", *two), unit="mm")
    assert part.volume == pytest.approx(4.8e-4)
    assert (len(part.planes), len(part.edges), len(part.corners)) == (12, 24, 16)


@pytest.mark.parametrize("kind", ["stl_ascii", "ply", "off"])
def test_texts_of_an_old_mac_are_read(tmp_path, solids, kind):
    mesh = as_trimesh(solids.box())
    text = trimesh.exchange.ply.export_ply(mesh, encoding="ascii") if kind == "ply" else mesh.export(file_type=kind)
    path = tmp_path / f"part.{kind[:3]}"
    path.write_bytes((text if isinstance(text, bytes) else text.encode()).replace(b"\n", b"\r"))
    assert len(read_part(path, unit="mm").planes) == 6


def test_off_files_with_colours_are_read(tmp_path):
    corners = [(x, y, z) for x in (0, 60) for y in (0, 40) for z in (0, 20)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    rows = [f"{x} {y} {z} 255 0 0 255" for x, y, z in corners] + ["4 {} {} {} {}".format(*f) for f in faces]
    (tmp_path / "part.off").write_text("COFF\n8 6 0\n" + "\n".join(rows))
    assert len(read_part(tmp_path / "part.off", unit="mm").planes) == 6


def test_a_truncated_binary_stl_is_reported(tmp_path, solids):
    path = tmp_path / "cut.stl"
    whole = as_trimesh(solids.box()).export(file_type="stl")
    for kept in (len(whole) - 20, len(whole) // 2, 100):
        path.write_bytes(whole[:kept])
        with pytest.raises(PartError, match=rf"of 12 triangles \(684 bytes\), got {kept} bytes: it is cut off"):
            read_part(path, unit="mm")
    path.write_bytes(whole + b"\0" * 200)  # what some programs write behind the last triangle
    assert len(read_part(path, unit="mm").planes) == 6


def test_a_truncated_text_stl_is_reported(tmp_path, solids):
    path = tmp_path / "cut.stl"
    whole = as_trimesh(solids.box()).export(file_type="stl_ascii")
    path.write_text(whole[: len(whole) // 2])
    with pytest.raises(PartError, match="expected the word endsolid, got a text that breaks off"):
        read_part(path, unit="mm")
    for same in (whole.upper(), "\ufeff" + whole, whole.replace("\n", " " + "x" * 2000 + "\n", 1)):
        path.write_text(same, encoding="utf-8")
        assert len(read_part(path, unit="mm").planes) == 6
