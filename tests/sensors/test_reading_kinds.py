"""Kinds of readings: what a row and the rows of one label report."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import ReadingsError
from tanteo.features.kinds import CIRCLE, CONE, PLANE
from tanteo.sensors import Readings, measure, reading_kind
from tanteo.sensors.kinds import reading_kinds


def test_every_kind_is_found_by_its_name():
    assert [reading_kind(name).name for name in reading_kinds()] == list(reading_kinds())


def test_points_lie_on_a_plane_and_centres_on_no_feature():
    assert reading_kind("point").feature is reading_kind("plane").feature is PLANE
    assert reading_kind("apex").feature is None
    assert reading_kind("apex").centre_of is CONE
    assert reading_kind("cylinder").centre == reading_kind("circle").centre == "centre"
    assert reading_kind("centre").centre_of is CIRCLE


@pytest.mark.parametrize("name", ["half_edge", "hole", ""])
def test_an_unknown_kind_is_refused_with_all_kinds(name):
    with pytest.raises(ReadingsError, match="expected one of plane, edge, vertex"):
        reading_kind(name)


@pytest.mark.parametrize(("kind", "column"), [("apex", "hole_radii"), ("centre", "half_angles")])
def test_a_size_that_the_feature_does_not_have_is_refused(kind, column):
    with pytest.raises(ReadingsError, match=f"{column} of reading '1'"):
        Readings.from_columns([[0.0, 0.0, 0.0]], kinds=[kind], sds=np.array([1e-4]), **{column: np.array([0.4])})


def test_measurements_have_the_size_that_was_reported_or_none():
    readings = Readings.from_columns(
        np.zeros((3, 3)), kinds=["apex", "centre", "point"], sds=np.full(3, 1e-4),
        half_angles=np.array([0.4, np.nan, np.nan]), material_sides=["hole", "boss", ""],
    )  # fmt: skip
    measured = measure(readings)
    assert measured.sizes == (0.4, None, None)
    assert measured.material_sides == (1, -1, 0)
