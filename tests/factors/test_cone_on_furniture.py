"""Ranges of wide beams on furniture: their density over the range."""

import numpy as np
import pytest

from tanteo.factors.cone_range import ConeRange
from tanteo.geometry import SO3
from tanteo.parts import Surface
from tanteo.sensors.noise import cone_rays


@pytest.mark.parametrize("response", ["ray", "nearest", "mean", "strongest"])
def test_ranges_of_a_cone_on_a_table_have_a_density(response):
    """The density integrates to one and has its mean where the device reports the table."""
    tilt, half_angle, height = 0.5, 0.1, 0.3
    axis = SO3.exp(np.array([tilt, 0, 0])) @ np.array([0, 0, -1.0])
    corners = np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0.0]])
    table = Surface(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    ranges = np.linspace(0.25, 0.45, 800)
    origin = np.array([0, 0, height])
    log = [
        ConeRange(
            at=origin + r * axis, cov=1e-6 * np.eye(3), approach=axis, range=r, half_angle=half_angle, response=response
        ).log_on(table, 1e-3)
        for r in ranges
    ]
    density = np.exp(log)
    rays = cone_rays(half_angle, 4000) @ SO3.frame_from_axis(axis, 2).T
    hits = height / -rays[:, 2]
    expected = hits.min() if response == "nearest" else hits.mean()
    total = np.trapezoid(density, ranges)
    assert abs(total - 1) < 2e-2
    assert abs(np.trapezoid(density * ranges, ranges) / total - expected) < 1e-3
