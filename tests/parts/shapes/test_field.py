"""Signed distance against closed forms and winding numbers, and the grid against the exact distance."""

import igl
import numpy as np
import pytest

from tanteo.parts import Surface, signed_distance
from tanteo.parts.shapes import distance_field

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
BOX = np.array(
    [
        *[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)],
        *[(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
    ]
)
SIZE = np.array([0.08, 0.06, 0.05])


@pytest.fixture(scope="module")
def box():
    return Surface(CORNERS * SIZE, BOX)


@pytest.fixture(scope="module")
def sphere():
    return Surface(*icosphere(4))


def icosphere(levels, radius=0.04):
    """Return a sphere of small triangles."""
    g = (1 + np.sqrt(5)) / 2
    v = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g), (0, 1, -g)]
    v = np.array([*v, (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)], dtype=float)
    f = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6)]
    f += [(7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10)]
    f = np.array([*f, (8, 6, 7), (9, 8, 1)])
    v, f = igl.upsample(v, f, levels)
    return radius * v / np.linalg.norm(v, axis=1, keepdims=True), f


def box_distance(p):
    q = np.maximum(-p, p - SIZE)
    return np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(axis=-1), 0.0)


@pytest.mark.parametrize("batch", [(300,), (7, 40), (0,), (2, 0)])
def test_distance_to_a_box_in_closed_form(box, batch):
    p = np.random.default_rng(1).uniform(-0.04, 0.12, (*batch, 3))
    distance, gradient = signed_distance(box, p)
    assert distance.shape == batch
    assert gradient.shape == (*batch, 3)
    np.testing.assert_allclose(distance, box_distance(p), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=-1), 1.0, atol=1e-9)


def test_distance_to_a_sphere_up_to_its_facets(sphere):
    p = np.random.default_rng(2).uniform(-0.08, 0.08, (2000, 3))
    distance, gradient = signed_distance(sphere, p)
    r = np.linalg.norm(p, axis=1)
    sagitta = 0.04 - np.linalg.norm(sphere.vertices[sphere.triangles].mean(axis=1), axis=1).min()
    assert np.abs(distance - (r - 0.04)).max() < sagitta + 1e-12
    clear = np.abs(r - 0.04) > 20 * sagitta
    clear &= r > 0.01
    outward = p / r[:, None]
    assert np.einsum("ni,ni->n", gradient, outward)[clear].min() > 0.98


def test_the_sign_is_that_of_winding_number_even_nearest_to_edge():
    """A wedge with a sharp edge: beside it the plane of the closest triangle gives the wrong side."""
    side = np.array([[0, 0, 0], [0.1, 0, 0.004], [0.1, 0, -0.004]])
    triangles = np.array([(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (0, 5, 2), (0, 3, 5), (1, 5, 4), (1, 2, 5)])
    wedge = Surface(np.concatenate([side, side + np.array([0, 0.05, 0])]), triangles)
    p = np.random.default_rng(3).uniform([-0.03, -0.01, -0.02], [0.03, 0.06, 0.02], (4000, 3))
    distance, _ = signed_distance(wedge, p)
    np.testing.assert_array_equal(distance < 0, wedge.inside(p))


def test_the_gradient_is_the_derivative_away_from_edges(box):
    rng = np.random.default_rng(4)
    p, h = rng.uniform(-0.03, 0.11, (500, 3)), 1e-7
    _, gradient = signed_distance(box, p)
    steps = np.stack([(signed_distance(box, p + h * e)[0] - signed_distance(box, p - h * e)[0]) for e in np.eye(3)], -1)
    smooth = np.abs(np.linalg.norm(steps / (2 * h), axis=1) - 1) < 1e-6
    assert smooth.mean() > 0.95
    np.testing.assert_allclose((steps / (2 * h))[smooth], gradient[smooth], atol=1e-6)


def test_on_the_surface_the_gradient_is_the_outward_normal(box):
    p = np.array([[0.03, 0.02, 0.05], [0.08, 0.02, 0.02], [0.01, 0.0, 0.03]])
    distance, gradient = signed_distance(box, p)
    np.testing.assert_allclose(distance, 0.0, atol=1e-15)
    np.testing.assert_allclose(gradient, [[0, 0, 1], [1, 0, 0], [0, -1, 0]], atol=1e-12)


def test_the_grid_is_exact_in_cells_that_see_one_plane(box):
    field = distance_field(box)
    p = np.array([0.04, 0.03, 0.05]) + np.random.default_rng(5).uniform(-0.5, 0.5, (200, 3)) * [0.02, 0.02, 0.01]
    distance, gradient = field(p)
    np.testing.assert_allclose(distance, box_distance(p), atol=1e-8)
    np.testing.assert_allclose(gradient, np.tile([0, 0, 1.0], (200, 1)), atol=1e-6)


def test_the_grid_errs_by_a_fraction_of_a_cell(box, sphere):
    for surface, exact in ((box, box_distance), (sphere, lambda p: np.linalg.norm(p, axis=-1) - 0.04)):
        field = distance_field(surface)
        low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
        p = np.random.default_rng(6).uniform(low - 0.02, high + 0.02, (5000, 3))
        error = np.abs(field(p)[0] - exact(p))
        assert error.max() < np.sqrt(3) * field.step  # a linear piece of slope one, from half a cell's diagonal away
        assert np.sqrt(np.mean(error**2)) < 0.3 * field.step  # what the search assumes of it


def test_far_from_the_grid_the_distance_still_grows(box):
    field = distance_field(box)
    along = np.linspace(0.1, 2.0, 50)[:, None] * [0.0, 0.0, 1.0] + [0.04, 0.03, 0.05]
    distance, _ = field(along)
    assert (np.diff(distance) > 0).all()
    np.testing.assert_allclose(distance, box_distance(along), atol=1e-6)


def test_the_table_cannot_be_written(box):
    field = distance_field(box)
    with pytest.raises(ValueError, match="read-only"):
        field.table[0, 0] = 1.0
