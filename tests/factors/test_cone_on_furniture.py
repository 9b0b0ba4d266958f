"""Ranges of wide beams on furniture: their density over the range."""

import numpy as np
import pytest

from tanteo.factors import as_contact_points
from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface
from tanteo.sensors import Readings, Rig, RigSensor, measure
from tanteo.sensors.noise import cone_rays

HALF_ANGLE, HEIGHT, SD = 0.1, 0.3, 1e-3


@pytest.mark.parametrize("response", ["ray", "nearest", "mean", "strongest"])
def test_ranges_of_a_cone_on_a_table_have_a_density(response):
    """The density integrates to one and has its mean where the device reports the table."""
    axis = SO3.exp(np.array([0.5, 0, 0])) @ np.array([0, 0, -1.0])
    hand = SE3.from_parts(SO3.frame_from_axis(axis, 2), np.array([0, 0, HEIGHT]))
    ranges = np.linspace(0.25, 0.45, 800)
    readings = Readings.from_columns(ranges=ranges, sensors=["eye"] * 800, Ts_world_hand=np.array([hand] * 800))
    sensor = RigSensor("eye", np.eye(4), None, SD, HALF_ANGLE, 1.0, 0.0, np.zeros((6, 6)), response=response)
    corners = np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0.0]])
    table = Surface(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    factors = as_contact_points(measure(readings, rig=Rig((sensor,)))).factors
    density = np.exp([factor.log_on(table, SD) for factor in factors])
    hits = HEIGHT / -(cone_rays(HALF_ANGLE, 4000) @ hand[:3, :3].T)[:, 2]
    expected = hits.min() if response == "nearest" else hits.mean()
    total = np.trapezoid(density, ranges)
    assert abs(total - 1) < 2e-2
    assert abs(np.trapezoid(density * ranges, ranges) / total - expected) < 1e-3
