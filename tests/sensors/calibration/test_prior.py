"""What a rig says beforehand of its beams, and the outlier fraction."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.geometry import SE3
from tanteo.sensors import Rig, RigSensor
from tanteo.sensors.calibration.geometry import Setup, make_prior
from tanteo.sensors.calibration.log import mixture_log_likelihood

T = SE3.exp(np.array([0.02, -0.01, 0.03, 0.1, 0.2, -0.1]))


def prior(**values):
    stated = {"sd": 1e-3, "beam_half_angle": 0.2, "max_range": 1.0, "bias_sd": 2e-3, "cov_mount": 1e-6 * np.eye(6)}
    rig = Rig((RigSensor(name="a", T_hand_sensor=T, preset=None, **(stated | values)),))
    start = Setup(np.eye(4)[None], np.zeros(1), np.zeros(1), np.eye(4)[None])
    return make_prior(("a",), 1, rig, None, start)


def test_a_known_bias_is_a_beam_that_begins_farther_back():
    """A sensor that reads 4 mm too far reads right from 4 mm behind."""
    (beam,) = prior(bias=4e-3).T_hand_beams
    target = SE3.apply(T, np.array([0.0, 0.0, 0.1]))
    assert np.linalg.norm(target - beam[:3, 3]) == pytest.approx(0.1 + 4e-3, abs=1e-12)
    np.testing.assert_allclose(beam[:3, :3], T[:3, :3], atol=1e-12)


def test_variances_are_those_of_mounting_bias_scale_and_cone():
    """The disc of a cone of half angle h has a variance of h^2 / 4 an axis: so far a slant may go."""
    found = prior(scale_sd=0.01).covs[0]
    np.testing.assert_allclose(np.diag(found)[[0, 1, 3, 4]], 1e-6)
    assert found[2, 2] == pytest.approx(1e-6 + 4e-6)
    assert found[5, 5] == pytest.approx(1e-4)
    assert found[6, 6] == pytest.approx((0.2**2 / 4) ** 2)


def test_few_good_readings_leave_room_for_half_a_outliers():
    n, variance, width = 20, np.full(20, 1e-6), 1.0
    share, good = 0.5 / (n + 1), 1 / np.sqrt(2 * np.pi * 1e-6)
    expected = n * np.log(share / width + (1 - share) * good)
    assert mixture_log_likelihood(np.zeros(n), variance, width) == pytest.approx(expected, abs=0.01)
