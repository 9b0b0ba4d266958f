"""Which facets of a mesh are planes and which are strips of a curved surface."""

from collections import Counter

import manifold3d
import numpy as np
import pytest


def kinds(part):
    return Counter(face.surface for face in part.faces)


def rounded_box(solids):
    """Return a box of 76 x 56 x 25 mm whose upright edges are rounded by 8 mm in steps of 11.25 degrees."""
    signs = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    arcs = [np.linspace(k, k + 1, 9) * np.pi / 2 for k in range(4)]
    outline = [np.array([30, 20]) * s + 8 * np.c_[np.cos(t), np.sin(t)] for s, t in zip(signs, arcs, strict=True)]
    return solids.prism(np.concatenate(outline), 25)


@pytest.mark.parametrize("sides", [3, 5, 6, 8, 12])
def test_a_prism_with_corners_of_thirty_degrees_stays_planar(read, solids, sides):
    part = read(solids.prism(solids.polygon(sides), 40))
    assert kinds(part) == {"plane": sides + 2}
    assert len(part.edges) == 3 * sides


@pytest.mark.parametrize("sides", [13, 16, 24, 64, 200])
def test_a_prism_with_gentler_corners_is_a_cylinder(read, solids, sides):
    part = read(solids.prism(solids.polygon(sides), 40))
    assert kinds(part) == {"plane": 2, "cylinder": 1}
    face = next(face for face in part.faces if face.surface == "cylinder")
    assert face.radius == pytest.approx(0.03, rel=1e-6)
    assert face.convex is True
    np.testing.assert_allclose(np.abs(face.axis_direction), [0, 0, 1], atol=1e-7)
    np.testing.assert_allclose(face.axis_point[:2], 0, atol=1e-8)
    # The true circle leaves the chord by r (1 - cos(pi / n)).
    assert 0.03 * (1 - np.cos(np.pi / sides)) <= face.sagitta < 0.03 * 4 * (1 - np.cos(np.pi / sides))
    assert len(part.edges) == 0


def test_roundings_are_cylinders_and_flats_stay_planes(read, solids):
    part = read(rounded_box(solids))
    assert kinds(part) == {"plane": 6, "cylinder": 4}
    assert [face.radius for face in part.faces if face.radius] == pytest.approx([0.008] * 4, rel=1e-5)
    np.testing.assert_allclose(sorted(part.planes.areas[part.planes.areas < 2e-3] * 1e6), [1000, 1000, 1500, 1500])
    # Edges where a flat meets top or bottom are straight and sharp; along the roundings there are none.
    assert len(part.edges) == 8
    np.testing.assert_allclose(np.sort(part.edges.lengths), [0.04] * 4 + [0.06] * 4, rtol=1e-6)


def test_cones_and_balls_are_named(read, solids):
    frustum = read(solids.lathe([(0, 0), (30, 0), (15, 40), (0, 40)]), "frustum")
    assert kinds(frustum) == {"plane": 2, "cone": 1}
    cone = next(face for face in frustum.faces if face.surface == "cone")
    assert cone.half_angle == pytest.approx(np.arctan(15 / 40), rel=1e-5)
    np.testing.assert_allclose(cone.axis_point, [0, 0, 0.08], atol=1e-6)
    np.testing.assert_allclose(cone.axis_direction, [0, 0, -1], atol=1e-6)
    ball = read(solids.sphere(), "ball")
    assert kinds(ball) == {"sphere": 1}
    assert ball.faces[0].radius == pytest.approx(0.03, rel=1e-6)
    np.testing.assert_allclose(ball.faces[0].axis_point, 0, atol=1e-8)


def test_a_bore_is_a_concave_cylinder(read, solids):
    ring = solids.lathe([(0, 0), (30, 0), (30, 40), (18, 40), (18, 10), (0, 10)])
    part = read(ring)
    assert kinds(part) == {"plane": 3, "cylinder": 2}
    assert {(round(f.radius * 1e3), f.convex) for f in part.faces if f.radius} == {(30, True), (18, False)}


def test_a_faceted_boss_that_a_hole_cuts_is_a_cylinder(read):
    boss, hole = (manifold3d.Manifold.cylinder(60, r, r, 24) for r in (30, 8))
    mesh = (
        manifold3d.Manifold.cube((100, 100, 10)) + boss.translate((50, 50, 0)) - hole.translate((78, 51, -1))
    ).to_mesh()
    part = read((np.asarray(mesh.vert_properties[:, :3], dtype=float), np.asarray(mesh.tri_verts)))
    rounds = {(round(f.radius * 1e3, 3), f.convex) for f in part.faces if f.surface == "cylinder"}
    assert rounds == {(30, True), (8, False)}


@pytest.mark.parametrize("noise", [0.05, 0.15, 0.6])
def test_a_noisy_scan_is_free_form_and_not_a_thousand_planes(read, solids, noise):
    vertices, triangles = solids.sphere(30, 64)
    vertices = vertices * [1.0, 0.8, 1.3] + np.random.default_rng(0).normal(0, noise, vertices.shape)
    part = read((vertices, triangles))
    assert kinds(part)["plane"] == 0
    assert sum(face.area for face in part.faces if face.surface == "freeform") > 0.98 * part.area
    assert len(part.edges) == len(part.corners) == 0


def test_large_planes_at_gentle_angles_stay_planes(read, solids):
    outline = [(0, 0), (80, 0), (80, 20), (60, 30), (30, 38), (0, 40)]
    part = read(solids.prism(outline, 50))
    assert kinds(part) == {"plane": 8}


def test_a_solid_of_a_free_profile_has_planes_only_at_its_ends(read, solids):
    heights = np.linspace(0, 60, 40)
    profile = [(0, 0), *zip(20 + 6 * np.sin(heights / 9), heights, strict=True), (0, 60)]
    part = read(solids.lathe(profile, 64))
    assert kinds(part) == {"plane": 2, "freeform": 1}


def test_stairs_of_many_quads_stay_planes(read):
    # 20 treads of two triangles each, in a row: large regions of small facets are common in real parts.
    import trimesh

    steps = [trimesh.creation.box(bounds=[[0, 10 * k, 0], [60, 10 * k + 10, 10 * k + 10]]) for k in range(20)]
    mesh = trimesh.boolean.union(steps, engine="manifold") if _has_manifold() else None
    if mesh is None:
        pytest.skip("manifold3d is not installed")
    part = read((mesh.vertices, mesh.faces))
    assert kinds(part) == {"plane": 44}


def _has_manifold():
    import importlib.util

    return importlib.util.find_spec("manifold3d") is not None
