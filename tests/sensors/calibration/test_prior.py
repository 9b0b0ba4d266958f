"""A rig states its prior beams: the prior stays where a log has no information."""

from __future__ import annotations

import numpy as np
import pytest

from plane_scenes import random_hands, simulated_log
from tanteo.geometry import SE3
from tanteo.sensors import Rig, RigSensor, calibrate

T = SE3.exp(np.array([0.02, -0.01, 0.03, 0.1, 0.2, -0.1]))
PLANE = SE3.exp(np.array([0.1, 0.2, 0.3, 0.4, 0.1, 0.2]))


def calibrated(**stated):
    """Return the beam after an uninformative log: the hand slides along the plane at one distance and rotation."""
    rng = np.random.default_rng(6)
    hands = np.repeat(random_hands(rng, 1, PLANE, T, tilt=0.4), 30, axis=0)
    hands[:, :3, 3] += rng.uniform(-0.1, 0.1, (30, 2)) @ PLANE[:3, :2].T
    known = {"sd": 1e-3, "beam_half_angle": 0.2, "max_range": 1.0, "bias_sd": 2e-3, "cov_mount": 1e-6 * np.eye(6)}
    rig = Rig((RigSensor(name="eye", T_hand_sensor=T, preset=None, **(known | stated)),))
    return calibrate(simulated_log(rng, T, PLANE, hands), rig=rig).beams[0]


def test_a_known_bias_moves_the_origin_of_the_beam_back():
    """A sensor that reads 4 mm too far reads right from 4 mm behind."""
    beam = calibrated(bias=4e-3).T_hand_beam
    target = SE3.apply(T, np.array([0.0, 0.0, 0.1]))
    assert np.linalg.norm(target - beam[:3, 3]) == pytest.approx(
        0.1 + 4e-3, abs=1e-6
    )  # a fit ends within 1 % of its sd
    np.testing.assert_allclose(beam[:3, 2], T[:3, 2], atol=1e-9)


def test_variances_are_those_of_mounting_bias_scale_and_cone():
    """The disc of a cone of half angle h has a variance of h^2 / 4 an axis: so far a slant may go."""
    cov = calibrated(scale_sd=0.01).cov
    np.testing.assert_allclose(np.diag(cov)[[0, 1, 3, 4]], 1e-6, rtol=1e-4)
    assert cov[2, 2] == pytest.approx(1e-6 + 4e-6, rel=1e-4)
    assert cov[5, 5] == pytest.approx(1e-4, rel=1e-4)
    assert cov[6, 6] == pytest.approx((0.2**2 / 4) ** 2, rel=1e-4)
