"""Centres of tips whose radius was taken off along a sensed normal."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo import Readings
from tanteo.sensors import measure


def test_centres_stay_as_sensed_with_their_noise():
    rng = np.random.default_rng(1)
    points, normals = rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    radii, tilts = np.array([2e-3, 0.0, 5e-3]), np.array([0.1, 0.1, 0.02])
    readings = Readings.from_columns(points, sds=np.full(3, 1e-4), radii=radii, normals=normals, normal_sds=tilts)
    measured = measure(readings)
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    assert measured.points == pytest.approx(points - radii[:, None] * unit, abs=1e-15)
    assert not measured.radii.any()
    across = np.linalg.eigvalsh(measured.covs)[:, -1]
    assert across == pytest.approx(1e-8 + (radii * tilts) ** 2)
    centres, covs, off = measured.centres()
    assert centres == pytest.approx(points, abs=1e-15)
    assert covs == pytest.approx(np.tile(1e-8 * np.eye(3), (3, 1, 1)), abs=1e-18)
    assert off == pytest.approx(radii)


def test_a_ball_without_a_normal_is_its_centre_already():
    readings = Readings.from_columns(np.ones((2, 3)), sds=np.full(2, 1e-4), radii=np.array([1e-3, 0.0]))
    measured = measure(readings)
    centres, _, off = measured.centres()
    assert centres == pytest.approx(measured.points, abs=0)
    assert off == pytest.approx([1e-3, 0.0])
