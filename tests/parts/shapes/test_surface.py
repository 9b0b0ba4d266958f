"""Surface queries against closed forms on a box and a sphere, and against slower exact routines."""

import pickle

import igl
import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.parts import Surface

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
BOX = np.array(
    [
        *[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)],
        *[(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
    ]
)
SIZE = np.array([0.08, 0.06, 0.05])


@pytest.fixture
def box():
    return Surface(CORNERS * SIZE + 1.0, BOX)


def box_distance(points):
    """Unsigned distance to the surface of the box, in closed form."""
    low = 1.0 - points
    high = points - (1.0 + SIZE)
    q = np.maximum(low, high)
    outside = np.linalg.norm(np.maximum(q, 0.0), axis=-1)
    return np.where(outside > 0, outside, -q.max(axis=-1))


@pytest.mark.parametrize("batch", [(), (7,), (3, 5), (0,), (2, 0, 3)])
def test_closest_and_inside_agree_with_closed_forms(box, batch):
    rng = np.random.default_rng(1)
    points = 1.0 + rng.uniform(-0.05, 0.12, (*batch, 3))
    found = box.closest(points)
    assert found.distances.shape == found.triangles.shape == batch
    assert found.points.shape == (*batch, 3)
    np.testing.assert_allclose(found.distances, box_distance(points), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found.points - points, axis=-1), found.distances, atol=1e-12)
    within = ((points > 1.0) & (points < 1.0 + SIZE)).all(axis=-1)
    np.testing.assert_array_equal(box.inside(points), within)


def test_the_closest_point_lies_on_the_named_triangle(box):
    points = 1.0 + np.random.default_rng(2).uniform(-0.05, 0.12, (200, 3))
    found = box.closest(points)
    corner = box.vertices[box.triangles[found.triangles, 0]]
    off = np.einsum("ni,ni->n", found.points - corner, box.normals[found.triangles])
    assert np.abs(off).max() < 1e-15


@pytest.mark.parametrize("far", [0.0, 0.2, 50.0])
def test_ray_hits_equal_the_slab_formula_to_double_precision(box, far):
    rng = np.random.default_rng(3)
    targets = 1.0 + rng.uniform(-0.02, 0.09, (500, 3))
    directions = rng.normal(size=(500, 3))
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    origins = targets - far * unit
    hits = box.cast(origins, 3.7 * directions)
    with np.errstate(divide="ignore"):
        first, second = (1.0 - origins) / unit, (1.0 + SIZE - origins) / unit
    enter, leave = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
    expected = np.where((enter <= leave) & (leave >= 0), np.where(enter >= 0, enter, leave), np.inf)
    clear = np.abs(enter - leave) > 1e-4  # A ray along an edge may go either way.
    assert (np.isfinite(expected) & clear).sum() > 50
    np.testing.assert_array_equal(np.isfinite(hits.distances[clear]), np.isfinite(expected[clear]))
    both = np.isfinite(expected) & clear
    np.testing.assert_allclose(hits.distances[both], expected[both], atol=1e-12 + 1e-15 * far)
    np.testing.assert_array_equal(hits.triangles == -1, np.isinf(hits.distances))


def test_rays_do_not_slip_through_edges_and_corners(box):
    rng = np.random.default_rng(4)
    ends = box.vertices[box.triangles]
    along = rng.random((40, 1, 1))
    targets = np.concatenate([(along * ends[:, 0] + (1 - along) * ends[:, 1]).reshape(-1, 3), box.vertices])
    centre = 1.0 + SIZE / 2.0
    assert (box.cast(centre, targets - centre).triangles >= 0).all()
    np.testing.assert_allclose(
        box.cast(centre, targets - centre).distances, np.linalg.norm(targets - centre, axis=1), atol=1e-12
    )


def test_origins_and_directions_broadcast(box):
    origins = 1.0 + SIZE / 2 + np.zeros((4, 1, 3))
    hits = box.cast(origins, np.eye(3))
    np.testing.assert_allclose(hits.distances, np.tile(SIZE / 2, (4, 1)), atol=1e-15)


def test_inside_agrees_with_the_exact_winding_number_on_a_ball():
    vertices, triangles = igl.icosahedron()
    for _ in range(3):
        vertices, triangles = igl.upsample(vertices, triangles)
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    ball = Surface(0.03 * vertices, triangles)
    points = np.random.default_rng(5).normal(0, 0.03, (2000, 3))
    exact = igl.winding_number(ball.vertices, ball.triangles, points) > 0.5
    assert 50 < exact.sum() < 1950
    np.testing.assert_array_equal(ball.inside(points), exact)


def test_a_surface_survives_pickling_and_cannot_be_written(box):
    again = pickle.loads(pickle.dumps(box))
    np.testing.assert_array_equal(again.vertices, box.vertices)
    assert again.cast([0.0, 1.02, 1.02], [1.0, 0.0, 0.0]).distances == pytest.approx(1.0, abs=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        box.vertices[0] = 0.0


@pytest.mark.parametrize(
    ("vertices", "triangles", "message"),
    [
        (CORNERS[:, :2], BOX, "vertices: expected shape"),
        (np.where(CORNERS == 1, np.nan, CORNERS), BOX, "vertices: expected finite"),
        (CORNERS, BOX.astype(float), "triangles: expected integers"),
        (CORNERS, np.zeros((0, 3), dtype=int), "triangles: expected integers"),
        (CORNERS, BOX + 1, "triangles: expected indices from 0 to 7"),
    ],
)
def test_a_broken_mesh_is_refused_by_name(vertices, triangles, message):
    with pytest.raises(InputError, match=message):
        Surface(vertices, triangles)


def test_broken_queries_are_refused_by_name(box):
    with pytest.raises(InputError, match="points: expected shape"):
        box.closest(np.zeros((3, 2)))
    with pytest.raises(InputError, match="points: expected finite"):
        box.inside([np.nan, 0, 0])
    with pytest.raises(InputError, match="directions: expected vectors with a length"):
        box.cast(np.zeros((2, 3)), [[1, 0, 0], [0, 0, 0]])
    with pytest.raises(InputError, match="broadcasts with origins"):
        box.cast(np.zeros((2, 3)), np.ones((3, 3)))


def test_unchecked_rays_are_the_checked_ones():
    rng = np.random.default_rng(8)
    surface = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    starts = rng.normal(size=(500, 3)) * 2
    rays = 0.2 - starts + 0.3 * rng.normal(size=(500, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    distances, triangles = surface.cast_unit(starts, rays)
    expected = surface.cast(starts, rays)
    same = triangles == expected.triangles  # rays through an edge may choose either side
    assert same.mean() > 0.99
    np.testing.assert_allclose(distances[same], expected.distances[same], rtol=1e-12)
    assert (triangles < 0).any()
    assert np.isinf(distances[triangles < 0]).all()
