"""Beams as touches of the surface search: across no better known than three tenths of along."""

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose, nees, no_paths, thin_beams
from tanteo.factors import as_contact_points
from tanteo.parts import read_part
from tanteo.posterior import identify_points, prepare
from tanteo.sensors import Readings, measure

SLOTTED = Path(__file__).parents[2] / "examples" / "parts" / "t_slot.step"
SD = 2e-3


@pytest.fixture(scope="module")
def slotted():
    return prepare(read_part(SLOTTED))


def made(directions, half_angle, tolerance=0.0):
    """Return readings of 100 mm with a standard deviation of 2 mm along the beam, as touches."""
    n = len(directions)
    readings = Readings.from_columns(np.zeros((n, 3)), directions=directions, ranges=np.full(n, 0.1))
    return as_contact_points(measure(readings, sd=SD, beam_half_angle=half_angle), tolerance)


@pytest.mark.parametrize(("half_angle", "across"), [(0.0, 6e-4), (0.002, 6e-4), (0.03, 1.5e-3), (0.1, 5e-3)])
def test_across_a_beam_is_three_tenths_of_along_or_its_cone(half_angle, across):
    d = np.random.default_rng(1).normal(size=(20, 3))
    touches = made(d, half_angle, tolerance=1e-4)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    own = d[:, :, None] * d[:, None]
    expected = SD**2 * own + across**2 * (np.eye(3) - own) + 1e-8 * np.eye(3)
    np.testing.assert_allclose(touches.covs, expected, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(touches.sd, np.hypot(max(SD, across), 1e-4), rtol=1e-9)


def test_without_direction_or_beam_uncertainty_stays():
    points = Readings.from_columns(np.zeros((3, 3)))
    np.testing.assert_allclose(as_contact_points(measure(points, sd=SD)).covs, np.tile(SD**2 * np.eye(3), (3, 1, 1)))
    np.testing.assert_allclose(made(np.eye(3), np.nan).covs, np.tile(SD**2 * np.eye(3), (3, 1, 1)), atol=1e-18)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [14, 22])
def test_a_pose_that_thin_beams_just_miss_is_not_ruled_out(slotted, seed):
    """Without a floor on their width, twelve beams of 3 mm along slots put the truth 9 and 19 sd off."""
    rng = np.random.default_rng((54, seed))
    T = box_centred_pose(rng)
    answer = identify_points(thin_beams(slotted, T, 12, rng), no_paths(), [slotted], top=100)
    assert min(nees(slotted.part, h.T_world_part, h.covariance, T)[0] for h in answer.hypotheses) < 22.5
