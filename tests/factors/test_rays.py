"""Free-space rays: joined sets, and the side of a hole that a point of a plane does not have."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.factors import FreeRays, as_free_rays, as_labelled_points
from tanteo.features import Feature
from tanteo.features.kinds import PLANE
from tanteo.sensors import Readings, measure


def rays(n, seed):
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return FreeRays(rng.normal(size=(n, 3)), d, rng.uniform(0.1, 0.2, n), np.full(n, 1e-3))


def test_joined_rays_are_those_of_both_in_order():
    first, second = rays(3, 1), rays(2, 2)
    both = first.join(second)
    for name in ("origins", "directions", "lengths", "margin"):
        np.testing.assert_array_equal(
            getattr(both, name), np.concatenate([getattr(first, name), getattr(second, name)])
        )


@pytest.mark.parametrize("n", [0, 3])
def test_joining_no_rays_changes_nothing(n):
    own = rays(n, 1)
    for both in (own.join(FreeRays.none()), FreeRays.none().join(own)):
        np.testing.assert_array_equal(both.origins, own.origins)


def test_a_point_of_a_plane_states_no_side_of_a_hole():
    points = as_labelled_points([Feature(PLANE, np.eye(4), np.diag([1e-8, 1e-6, 1e-6]), "face")])
    assert [factor.material_side for factor in points.factors] == [0]


def test_a_wide_ray_spreads_as_points_even_over_its_disc():
    """The sd of one coordinate of points even over a disc is half of its radius."""
    path = Readings.from_columns(
        np.zeros((1, 3)), directions=np.eye(3)[2:], is_free=np.array([True]), max_ranges=np.array([0.2])
    )
    made = measure(path, sensor="vl53l1x")
    free = as_free_rays(made, 0.0)
    assert free.slopes == pytest.approx(0.5 * np.tan(made.free.half_angles))
    assert free.slopes > 0
