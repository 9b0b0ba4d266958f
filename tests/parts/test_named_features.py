"""Features of a part by name: where a point is nearest to them, and how they are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from report_scenes import prism_text
from tanteo.parts import named_class, named_feature, read_part


@pytest.fixture(scope="module")
def wedge(tmp_path_factory):
    path = tmp_path_factory.mktemp("parts") / "wedge.off"
    path.write_text(prism_text([(0, 0), (60, 0), (45, 40), (0, 40)], 30))
    return read_part(path, unit="mm")


@pytest.mark.parametrize("name", ["face 99", "edge 999", "vertex 999", "hole 1", "edge", "edge x", ""])
def test_a_feature_that_a_part_does_not_have_is_none(wedge, name):
    assert named_feature(wedge, name) is None


def test_the_foot_of_a_point_is_the_nearest_point_of_the_feature(wedge):
    point = np.array([0.01, -0.02, 0.03])
    for name, count in (("plane 0", 1), ("edge 1", 2), ("vertex 2", 3)):
        foot, across = named_feature(wedge, name).nearest(point)
        assert across.shape == (count, 3)
        np.testing.assert_allclose(across @ across.T, np.eye(count), atol=1e-9)
        np.testing.assert_allclose((point - foot) @ across.T @ across, point - foot, atol=1e-12)


def test_only_the_face_of_an_unlabelled_reading_is_not_labelled():
    assert not named_class("face 1").is_labelled
    assert all(named_class(f"{word} 1").is_labelled for word in ("plane", "edge", "vertex"))
