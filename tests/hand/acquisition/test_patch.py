"""Flat patches that explain the hits, and the allowed places of the hand on them."""

import math

import numpy as np
import pytest

from tanteo.geometry import SO3
from tanteo.hand.acquisition import FaceGuess
from tanteo.hand.acquisition.patch import find_patches, stands
from tanteo.hand.acquisition.seen import Cloud

UP = np.array([0.0, 0.0, 1.0])


def seen(points, eye, sd=4e-4, degrees=5.0, seed=0):
    """Beams from about an eye to points, with the errors that are stated for them."""
    rng = np.random.default_rng(seed)
    starts = np.asarray(eye) + 0.02 * rng.normal(size=points.shape)
    ways = points - starts
    ranges = np.linalg.norm(ways, axis=1)
    beams = ways / ranges[:, None]
    spot = rng.normal(size=points.shape) * 0.5 * ranges[:, None] * math.tan(math.radians(degrees))
    across = spot - np.sum(spot * beams, axis=1)[:, None] * beams
    # the echo comes from beside the axis: met on a level face, it is farther or nearer than the axis
    ranges = (
        ranges - (across @ UP) / np.where(np.abs(beams[:, 2]) > 0.1, beams[:, 2], 1.0) + sd * rng.normal(size=len(ways))
    )
    n = len(points)
    slopes = np.full(n, math.tan(math.radians(degrees)))
    return Cloud(starts, beams, ranges, np.full(n, True), np.full(n, sd), slopes, np.full(n, True))


def grid(xs, ys, z):
    x, y = np.meshgrid(np.linspace(*xs, 18), np.linspace(*ys, 18))
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1)


def test_two_steps_are_not_one_slope():
    """Treads of 30 mm, 15 mm apart in height, seen obliquely: a plane through both meets many points, but none well."""
    points = np.concatenate([grid((0, 0.06), (0, 0.03), 0.015), grid((0, 0.06), (0.03, 0.06), 0.0)])
    for seed in range(4):
        cloud = seen(points, [0.03, 0.0, 0.09], seed=seed)
        guess = FaceGuess([0.03, 0.03, 0.008], SO3.axis_rotation(0, -0.45) @ UP)
        best = find_patches(cloud, guess)[0]
        assert math.degrees(best.turned(UP)) < 4
        assert min(abs(best.point[2]), abs(best.point[2] - 0.015)) < 2e-3


def test_every_face_is_proposed_once_and_the_nearest_first():
    wall = np.roll(grid((0, 0.06), (0, 0.06), 0.0), 1, axis=1)  # x = 0
    cloud = seen(np.concatenate([grid((0, 0.06), (0, 0.06), 0.0), wall]), [0.08, 0.03, 0.08], degrees=0.1)
    found = find_patches(cloud, FaceGuess([0.02, 0.03, 0.02], [0.3, 0, 1]))
    assert math.degrees(found[0].turned(UP)) < 2
    assert sum(p.turned(UP) < 0.1 for p in found) == 1
    assert sum(p.turned(np.array([1.0, 0, 0])) < 0.1 for p in found) == 1


@pytest.mark.parametrize(("off", "turned"), [(0.05, 0), (0.0, 80)])
def test_what_is_too_far_from_the_idea_is_not_meant(off, turned):
    cloud = seen(grid((0, 0.06), (0, 0.06), 0.0), [0.03, 0.03, 0.08])
    near = FaceGuess([0.03, 0.03, 0.02], SO3.axis_rotation(0, math.radians(60)) @ UP)
    assert find_patches(cloud, near)
    assert find_patches(cloud, FaceGuess([0.03, 0.03, off], SO3.axis_rotation(0, math.radians(turned)) @ UP)) == []


def test_both_sensors_need_a_face_below_them():
    """Sensors that are 40 mm apart on a face of 14 mm, and on one that is long enough in one direction."""
    guess, eye = FaceGuess([0, 0, 0], UP), [0.02, 0.01, 0.08]
    small = find_patches(seen(grid((0, 0.014), (0, 0.014), 0.0), eye, degrees=0.1), guess)[0]
    assert stands(small, 0.04, small.point) == []
    long = find_patches(seen(grid((0, 0.06), (0, 0.014), 0.0), eye, degrees=0.1), guess)[0]
    along = [abs(direction[0]) for _, _, direction in stands(long, 0.04, long.point)]
    assert along
    assert min(along) > 0.7
