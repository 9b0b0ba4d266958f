"""The rotation group of parts: orders that are known, and the axioms of a group."""

from pathlib import Path

import numpy as np
import pytest

from tanteo.parts import Surface, read_part
from tanteo.parts.readers import mirror_part

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"


def chiral(solids):
    """Return a prism over a scalene triangle, skewed: it has no plane and no axis of symmetry."""
    vertices, triangles = solids.prism([(0, 0), (70, 0), (20, 45)], 30)
    return vertices + vertices[:, 2:] * [0.3, 0.5, 0.0], triangles


def make(solids, name):
    return {
        "box": lambda: solids.box(80, 60, 50),
        "cube": lambda: solids.box(50, 50, 50),
        "square": lambda: solids.box(50, 50, 80),
        "nearly square": lambda: solids.box(50, 50.2, 80),
        "tetrahedron": lambda: solids.tetrahedron(),
        "hexagon": lambda: solids.prism(solids.polygon(6), 40),
        "triangle": lambda: solids.prism(solids.polygon(3), 40),
        "isosceles": lambda: solids.prism([(0, 0), (60, 0), (30, 50)], 40),
        "pyramid": lambda: solids.lathe([(0, 0), (40, 0), (0, 50)], 4),
        "chiral": lambda: chiral(solids),
    }[name]()


@pytest.mark.parametrize(
    ("name", "order"),
    [
        ("box", 4),
        ("cube", 24),
        ("square", 8),
        ("nearly square", 4),
        ("tetrahedron", 12),
        ("hexagon", 12),
        ("triangle", 6),
        ("isosceles", 2),
        ("pyramid", 4),
        ("chiral", 1),
    ],
)
def test_polyhedra_have_the_order_of_their_rotation_group(read, solids, name, order):
    vertices, triangles = make(solids, name)
    R = solids.rotation(np.random.default_rng(order))
    for k, points in enumerate((vertices, vertices @ R.T + [40, -300, 12])):
        part = read((points, triangles), f"pose{k}")
        assert part.symmetry.order == order
        assert not part.symmetry.continuous
        check_group(part)


def check_group(part):
    Ts = part.symmetry.Ts
    np.testing.assert_allclose(Ts[0], np.eye(4), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(Ts[:, :3, :3]), 1.0)
    # Closed under composition, and no motion twice.
    products = np.einsum("aij,bjk->abik", Ts, Ts)
    scale = np.array([1, 1, 1, 1 / part.diagonal])
    apart = np.abs((products[:, :, None] - Ts) * scale).max(axis=(3, 4))
    assert apart.min(axis=2).max() < 1e-4
    np.testing.assert_array_equal((apart < 1e-2).sum(axis=2), 1)
    # Each maps the mesh onto itself.
    surface = Surface(part.vertices, part.triangles)
    slack = max(face.sagitta for face in part.faces)
    for T in Ts:
        moved = part.vertices @ T[:3, :3].T + T[:3, 3]
        assert surface.closest(moved).distances.max() < 2e-4 * part.diagonal + 2 * slack


@pytest.mark.parametrize(
    ("profile", "order"),
    [
        ([(0, 0), (30, 0), (30, 40), (0, 40)], 2),
        ([(0, 0), (30, 0), (15, 40), (0, 40)], 1),
        ([(0, 0), (30, 0), (30, 15), (20, 15), (20, 35), (30, 35), (30, 50), (0, 50)], 2),
        ([(0, 0), (30, 0), (30, 15), (20, 15), (20, 35), (30, 35), (30, 52), (0, 52)], 1),
    ],
)
def test_solids_of_revolution_have_an_axis_and_perhaps_a_flip(read, solids, profile, order):
    vertices, triangles = solids.lathe(profile, 60)
    R = solids.rotation(np.random.default_rng(7))
    part = read((vertices @ R.T + [5, 60, -20], triangles))
    assert part.symmetry.order == order
    point, direction = part.symmetry.axis
    assert abs(direction @ R[:, 2]) == pytest.approx(1.0, abs=1e-6)
    off = np.cross(point - np.array([5, 60, -20]) * 1e-3, R[:, 2])
    assert np.linalg.norm(off) < 1e-5
    check_group(part)


def test_a_ball_turns_any_way_and_an_eccentric_disc_does_not(read, solids):
    assert read(solids.sphere(), "ball").symmetry.spherical
    disc, triangles = solids.lathe([(0, 0), (30, 0), (30, 10), (0, 10)], 60)
    knob, more = solids.lathe([(0, 0), (8, 0), (8, 20), (0, 20)], 60)
    apart = np.concatenate([disc, knob + np.array([12, 0, 60])]), np.concatenate([triangles, more + len(disc)])
    part = read(apart, "eccentric")
    assert part.symmetry.order == 1
    assert not part.symmetry.continuous


def test_a_mirror_image_has_a_group_of_the_same_order(read, solids):
    for name in ("chiral", "isosceles", "tetrahedron"):
        part = read(make(solids, name), name)
        assert mirror_part(part).symmetry.order == part.symmetry.order


@pytest.mark.skipif(not DATA.exists(), reason=f"no shared data at {DATA}")
@pytest.mark.parametrize(
    ("file", "unit", "order"),
    [
        ("bracket/bracket.stl", "mm", 1),
        ("cmm_block/calibration_block_from_drawing.stl", "mm", 2),
        ("fingertip_touches/models/box.off", "m", 4),
        ("fingertip_touches/models/tetrahedron.off", "m", 12),
        ("fingertip_touches/models/helmet.off", "m", 1),
        ("fingertip_touches/models/cleaner.off", "m", 1),
    ],
)
def test_real_parts(file, unit, order):
    part = read_part(DATA / file, unit=unit)
    assert part.symmetry.order == order
    assert not part.symmetry.continuous
    check_group(part)
