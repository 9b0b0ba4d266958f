"""Gates before any pose is known: what fits on a face by its points alone."""

from __future__ import annotations

import numpy as np

from scenes import plane_feature
from tanteo.lie import SE3
from tanteo.matching.gates import large_enough
from tanteo.matching.sensed import sense


def test_points_in_a_circle_fit_on_no_face_that_is_narrower(models):
    """On the block's largest face: the others are longer than the circle is wide, and not as wide."""
    model, rng = models["block"], np.random.default_rng(1)
    planes = model.candidates["plane"]
    largest, sides = int(np.argmax(planes.measures)), np.sort(np.ptp(model.part.box, axis=1))
    turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle = 0.45 * sides[1] * np.column_stack([np.cos(turns), np.sin(turns), np.zeros(24)])
    T = planes.Ts_part_feature[largest]
    sensed = sense([plane_feature(SE3.apply(T, circle), T[:3, 2], 1e-5, rng)])
    as_large = planes.measures > 0.99 * planes.measures[largest]
    assert 0.9 * sides[1] > 1.1 * sides[0]
    assert (planes.spans > sides[1]).all()
    np.testing.assert_array_equal(large_enough(sensed, 0, model, 0.0), as_large)
