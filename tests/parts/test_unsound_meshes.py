"""Meshes that are open, have three triangles at an edge, or intersect: repaired, or used unchanged."""

import itertools

import numpy as np
import pytest
import trimesh

import tanteo
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.parts.readers import mesh_edges

BOX = 80 * 60 * 50 * 1e-9


@pytest.fixture
def read_mesh(tmp_path, solids):
    def reader(vertices, triangles):
        path = solids.write_off(tmp_path / "part.off", np.asarray(vertices, float), np.asarray(triangles))
        return read_part(path, unit="mm")

    return reader


def outward(part):
    arms = part.planes.centroids - part.box.mean(axis=0)
    return np.einsum("ni,ni->n", part.planes.normals, arms) > 0


def joined(*meshes):
    starts = np.cumsum([0] + [len(v) for v, _ in meshes])[:-1]
    return np.concatenate([v for v, _ in meshes]), np.concatenate(
        [t + k for (_, t), k in zip(meshes, starts, strict=True)]
    )


def test_a_wall_inside_the_material_is_dropped(solids, read_mesh):
    vertices, triangles = solids.box()
    for wall in ([(0, 1, 7)], [(0, 2, 6), (0, 6, 4)]):
        part = read_mesh(vertices, np.vstack([triangles, wall]))
        assert part.closed
        assert part.volume == pytest.approx(BOX)
        assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)
        assert any("inside the material" in sentence for sentence in part.repairs)


def test_a_wall_that_stands_out_stays(solids, read_mesh):
    vertices, triangles = solids.box()
    part = read_mesh(np.vstack([vertices, [(40, 30, 90), (0, 0, 90)]]), np.vstack([triangles, [(4, 6, 8), (4, 8, 9)]]))
    assert not part.closed
    assert part.box[1, 2] == pytest.approx(0.09)
    assert any("counts on both sides" in sentence for sentence in part.repairs)


def test_loose_needles_leave_no_trace(solids, read_mesh):
    vertices, triangles = solids.box()
    ends = vertices[0] + np.array([(30, 20, 10), (35, 22, 11), (32.5, 21, 10.5001)])
    part = read_mesh(np.vstack([vertices, ends]), np.vstack([triangles, [(8, 9, 10)]]))
    assert any("hang loose" in sentence for sentence in part.repairs)
    assert len(part.vertices) == 8
    assert len(part.symmetry.Ts) == 4


@pytest.mark.parametrize("noise", [0.0, 1e-6, 1e-5])
def test_a_chain_of_needles_across_a_face_does_not_divide_it(solids, read_mesh, noise):
    """The diagonal of a face is a chain of points beside it [mm]: needles between both are the link of its halves."""
    vertices, triangles = solids.box()
    i, j, o = next(t for t in triangles.tolist() if np.ptp(vertices[t[:2]], axis=0).astype(bool).sum() == 2)
    chain = np.linspace(vertices[i], vertices[j], 102)[1:-1]
    chain = chain + noise * np.random.default_rng(0).normal(size=chain.shape)
    ids = [i, *range(len(vertices), len(vertices) + len(chain)), j]
    steps = list(itertools.pairwise(ids))
    needles = [(i, b, a) for a, b in steps[1:]]
    others = [t for t in triangles.tolist() if t != [i, j, o]]
    part = read_mesh(np.vstack([vertices, chain]), np.array(others + [(a, b, o) for a, b in steps] + needles))
    assert part.closed
    assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)
    assert len(part.symmetry.Ts) == 4


def with_chains(vertices, triangles, count):
    """Cut one side of each pair of triangles in a box face at points, with needles from one end to the points."""
    points, done, out = list(vertices), set(), []
    for tri in triangles.tolist():
        sides = [tuple(np.roll(tri, -k).tolist()) for k in range(3)]
        i, j, o = max(sides, key=lambda s: np.linalg.norm(vertices[s[0]] - vertices[s[1]]))
        if (j, i) in done:
            out.append(tri)
            continue
        done.add((i, j))
        ids = [i, *range(len(points), len(points) + count), j]
        points += list(np.linspace(vertices[i], vertices[j], count + 2)[1:-1])
        steps = list(itertools.pairwise(ids))
        out += [(a, b, o) for a, b in steps] + [(i, b, a) for a, b in steps[1:]]
    return np.array(points), np.array(out)


@pytest.mark.parametrize(("size", "count"), [(1.0, 100), (0.1, 3), (0.1, 100), (0.02, 20)])
@pytest.mark.parametrize("turn", [(0.4, 0.9, -0.3), (1.2, -0.2, 0.7)])
def test_needles_of_rounded_decimals_do_not_divide_faces(solids, read_mesh, size, count, turn):
    """Four decimals make needles of faces of 1 to 80 mm that are as wide as the rounding, and up to 1,000 times."""
    vertices, triangles = with_chains(*solids.box(), count)
    turned = (size * vertices) @ SO3.exp(np.array(turn)).T + 10.0
    part = read_mesh(np.round(turned, 4), triangles)
    assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)
    assert len(part.symmetry.Ts) == 4


@pytest.mark.parametrize("sides", [(12.375, 20.125, 0.048), (9.1234, 5.3, 0.004)])
def test_a_thin_sheet_of_few_decimals_keeps_its_rims(solids, read_mesh, sides):
    part = read_mesh(*solids.box(*sides))
    assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)


@pytest.mark.slow
def test_a_fine_scan_of_three_decimals_stays_one_free_form(read_mesh):
    ball = trimesh.creation.icosphere(6, 12.0)
    part = read_mesh(np.round(ball.vertices * (1, 1.2, 0.8), 3), ball.faces)
    assert [face.surface for face in part.faces] == ["freeform"]


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_bodies_that_touch_at_an_edge_come_apart(solids, read_mesh, seed):
    vertices, triangles = joined(solids.box(), (solids.box()[0] + [80, 60, 0], solids.box()[1]))
    if seed is not None:  # for any winding
        flips = np.random.default_rng(seed).random(len(triangles)) < 0.5
        triangles[flips] = triangles[flips, ::-1]
    part = read_mesh(vertices, triangles)
    assert part.volume == pytest.approx(2 * BOX)
    assert (len(part.planes), len(part.edges)) == (12, 24)
    assert part.repairs[0] == "Cut the surface at 1 edge of three or more triangles; no point moved."


def test_bodies_that_overlap_or_touch_become_one(solids, read_mesh):
    plate, boss = solids.box(80, 60, 20), solids.box(30, 20, 15)
    for lift, volume in ((20, 80 * 60 * 20 + 30 * 20 * 15), (10, 80 * 60 * 20 + 30 * 20 * 5)):
        part = read_mesh(*joined(plate, (boss[0] + [10, 10, lift], boss[1])))
        assert part.volume == pytest.approx(volume * 1e-9)
        assert len(part.planes) == 11
        assert part.repairs[0].startswith("United 2 bodies")


def test_a_vertex_on_a_neighbours_side_opens_no_gap(solids, read_mesh):
    vertices, triangles = solids.box()
    a, b, c = triangles[0]
    points = np.vstack([vertices, [(vertices[a] + 2 * vertices[b]) / 3]])
    part = read_mesh(points, np.vstack([triangles[1:], [(a, 8, c), (8, b, c)]]))
    assert part.closed
    assert part.volume == pytest.approx(BOX)
    assert part.repairs == ("Split 1 triangles at corners of others that lie on their sides; no point moved.",)


def test_a_pinhole_is_filled_and_its_width_reported(solids, read_mesh):
    vertices, triangles = solids.sphere(30, 160)
    part = read_mesh(vertices, triangles[1:])
    assert part.closed
    assert part.repairs == ("Filled 1 small hole, up to 1.5 % of the size wide.",)


@pytest.mark.parametrize("wound", [1, -1])
def test_an_open_box_has_its_outside_from_winding_numbers(solids, read_mesh, wound):
    vertices, triangles = solids.box()
    floor = (vertices[triangles][:, :, 2] == 0).all(axis=1)
    part = read_mesh(vertices, triangles[~floor][:, ::wound])
    assert not part.closed
    assert part.volume == 0
    assert (len(part.planes), len(part.edges)) == (5, 8)
    assert outward(part).all()
    assert int(mesh_edges(part.triangles).rims.sum()) == 4
    np.testing.assert_array_equal(np.diff(part.planes.boundary_start), 4)
    assert part.repairs[0].startswith("The surface is open: it ends at 4 edges")


def test_a_sheet_counts_on_both_sides(solids, read_mesh):
    part = read_mesh([(0, 0, 0), (80, 0, 0), (80, 60, 0), (0, 60, 0)], [(0, 1, 2), (0, 2, 3)])
    assert len(part.planes) == 2
    np.testing.assert_allclose(part.planes.normals.sum(axis=0), 0)
    np.testing.assert_allclose(part.centroid, [0.04, 0.03, 0])
    both = [(0, 1, 2), (0, 2, 1), (0, 2, 3), (0, 3, 2)]
    assert len(read_mesh([(0, 0, 0), (80, 0, 0), (80, 60, 0), (0, 60, 0)], both).planes) == 2


def test_a_strip_with_one_side_is_cut(read_mesh):
    turns = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    half = np.stack([np.cos(turns / 2) * np.cos(turns), np.cos(turns / 2) * np.sin(turns), np.sin(turns / 2)], axis=1)
    ring = 30 * np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    rows = [(i, (i + 1) % 40, i + 40) for i in range(40)]
    rows += [(i + 1, i + 41, i + 40) for i in range(39)]
    rows.append((0, 0 + 40, 79))
    part = read_mesh(np.vstack([ring - 8 * half, ring + 8 * half]), rows)
    assert not part.closed


def test_a_surface_that_crosses_itself_is_noticed(solids, read_mesh):
    vertices, triangles = solids.box()
    vertices = vertices.copy()
    vertices[6, 2] = -20.0  # a corner of the top, pulled through the floor
    assert any("crosses itself" in sentence for sentence in read_mesh(vertices, triangles).repairs)
    assert read_mesh(*solids.box()).repairs == ()


def test_an_open_box_is_located(solids, read_mesh, tmp_path):
    vertices, triangles = solids.box()
    floor = (vertices[triangles][:, :, 2] == 0).all(axis=1)
    part = read_mesh(vertices, triangles[~floor])
    T = SE3.exp(np.array([0.3, 0.1, 0.02, 0.1, -0.2, 0.5]))
    rng = np.random.default_rng(3)
    faces = rng.choice(np.flatnonzero(~floor), 30)
    touched = np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], 30), vertices[triangles[faces]]) * 1e-3
    rows = "\n".join(",".join(f"{1e3 * x:.4f}" for x in p) for p in SE3.apply(T, touched))
    (tmp_path / "touches.csv").write_text("x_mm,y_mm,z_mm\n" + rows)
    answer = tanteo.locate(tanteo.read_readings(tmp_path / "touches.csv"), part, sd=1e-4)
    assert answer.status in ("recognized", "ambiguous")
    assert part.symmetry.order == 2
    symmetric = [T @ turn for turn in part.symmetry.Ts]
    assert min(np.abs(answer.hypotheses[0].T_world_part - pose).max() for pose in symmetric) < 5e-3
