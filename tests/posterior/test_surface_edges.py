"""The surface search where there is nothing to find, and where noise puts a reading across an edge."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from altered import altered
from tanteo.factors import ContactPoints, FreeRays, surface_points
from tanteo.parts import read_part
from tanteo.posterior import PreparedPart, identify_points, prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD, TILT = 5e-4, np.deg2rad(3.0)


@pytest.fixture(scope="module")
def target() -> PreparedPart:
    return prepare(read_part(PARTS / "bracket_left.step"))


def touched(points, normals=None) -> ContactPoints:
    return surface_points(points, SD, normals=normals, normal_sds=np.pi if normals is None else TILT)


@pytest.mark.parametrize(("along", "advice"), [(0.0, "or sense places farther apart"), (0.05, "on one line")])
def test_readings_on_one_line_or_at_one_point_are_not_enough(target, along, advice):
    points = np.linspace(0.0, along, 10)[:, None] * np.array([0.6, 0.0, 0.8])
    answer = identify_points(touched(points), FreeRays.none(), [target])
    assert answer.status == "insufficient"
    assert advice in answer.message


def test_a_noise_larger_than_the_part_is_a_message_no_exception(target):
    points = target.samples[:12]
    touches = altered(touched(points), covs=np.tile(np.eye(3), (12, 1, 1)), sd=np.ones(12))
    assert identify_points(touches, FreeRays.none(), [target]).status == "insufficient"
