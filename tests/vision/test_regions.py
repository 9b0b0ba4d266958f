"""What is not table, and how high answers say that it is."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.geometry import SE3, SO3
from tanteo.vision import find_edges
from tanteo.vision.answers import heights
from tanteo.vision.regions import find_regions


def test_a_disc_has_a_circular_outline_and_outward_normals():
    pytest.importorskip("cv2", reason="needs tanteo[vision]")
    rng, centre, radius = np.random.default_rng(1), np.array([70.3, 62.8]), 28.5
    y, x = np.mgrid[0:130, 0:150]
    far = np.hypot(x - centre[0], y - centre[1]) - radius
    image = 160 - 90 / (1 + np.exp(far / 0.6)) + rng.normal(size=far.shape)
    (region,) = find_regions(image, find_edges(image))
    spokes = region.contour - centre
    away = np.linalg.norm(spokes, axis=1)
    assert np.abs(away - radius).max() < 0.3
    assert np.sum(region.normals * spokes, axis=1) / away == pytest.approx(1, abs=0.02)
    assert region.centre == pytest.approx(centre, abs=0.2)
    assert not region.cut


def test_heights_over_a_table_are_the_surface_s(models):
    model = models["block"]
    part = model.part
    T = SE3.from_parts(SO3.axis_rotation(2, 0.4), np.array([0.03, -0.02, 0.01]))
    middle = SE3.apply(T, part.centroid)
    found = heights(model.surface, T, np.array([middle[:2], middle[:2] + 1.0]))
    assert found == pytest.approx([part.box[1, 2] + 0.01, 0.0])


def test_rare_edges_near_one_another_are_a_region():
    """A texture may interrupt the outline of an object, so that no edges enclose it."""
    rng = np.random.default_rng(4)
    image = 100 + rng.normal(0, 2, (240, 320))
    for x in range(80, 240, 30):  # dashes of 20 px, gaps of 10 px
        for y in (60, 160):
            image[y : y + 2, x : x + 20] += 60
    for y in range(60, 160, 30):
        for x in (80, 240):
            image[y : y + 20, x : x + 2] += 60
    (region,) = find_regions(image, find_edges(image))
    outline = np.zeros(image.shape, dtype=bool)
    outline[60:162, 80:242] = True
    assert (region.mask & outline).sum() > 0.9 * outline.sum()
