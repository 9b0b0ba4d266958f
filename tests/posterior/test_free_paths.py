"""Paths without a hit, exactly known or somewhere in a cone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.factors import FreeRays, as_free_rays
from tanteo.fitting.localization import SharedGiven
from tanteo.posterior import prepare
from tanteo.posterior.free_space import gone_through
from tanteo.sensors import Readings, measure

HALF = np.radians(5.0)


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part(Path(__file__).parents[2] / "examples" / "parts" / "block.step"))


def through(path, target, covariance=None, shared=None):
    """Return how far before its end the part surely blocks a path."""
    covariance = np.zeros((6, 6)) if covariance is None else covariance
    return gone_through(path, np.eye(4), covariance, shared, target)[0]


def from_above(target, inside, half_angle):
    """Return a path down onto the top, at a distance inside its border, free to well below it."""
    low, high = target.part.box
    origin = np.array([high[0] - inside, 0.5 * (low[1] + high[1]), high[2] + 0.1])
    slopes = np.array([0.5 * np.tan(half_angle)])
    return FreeRays(origin[None], np.array([[0.0, 0.0, -1.0]]), np.array([0.12]), np.zeros(1), slopes)


def test_the_limit_comes_from_the_preset():
    def paths(**how):
        readings = Readings.from_columns(
            np.zeros((1, 3)), directions=np.eye(3)[2:], is_free=np.array([True]), max_ranges=np.array([0.2])
        )
        return as_free_rays(measure(readings, **how), 0.0)

    assert paths(sensor="keyence_il300").incidences == pytest.approx(np.radians(30))
    assert paths(sensor="keyence_il300").up_to(0.2).incidences == pytest.approx(0.2)
    assert paths(sensor="touch_probe_hobby").incidences == pytest.approx(np.pi / 2)
    assert paths(sd=1e-3).incidences == pytest.approx(np.pi / 2)


def test_a_ray_through_the_part_is_named_at_three_sds(block):
    """A path 2 mm inside of the border of the top, and how sure the place of that border is."""
    path = from_above(block, 2e-3, 0.0)
    for sd, surely in ((0.0, True), (0.6e-3, True), (0.75e-3, False)):
        sideways, along = (np.diag(np.r_[np.eye(3)[k], 0, 0, 0] * sd**2) for k in (0, 2))
        assert (through(path, block, sideways) > 0) == surely
        assert through(path, block, along) == pytest.approx(0.02)  # how high the top is decides nothing
    assert through(from_above(block, -2e-3, 0.0), block) == 0


def test_a_cone_is_named_if_all_of_it_meets_the_part(block):
    rim = 0.1 * np.tan(HALF)
    assert through(from_above(block, rim + 1e-3, HALF), block) > 0
    assert through(from_above(block, rim - 1e-3, HALF), block) == 0


def test_a_common_motion_of_ray_and_pose_is_no_distance(block):
    """A base off by 5 mm sd: the pose of the part in the world is as uncertain, and the path moves with it."""
    base, vague = 5e-3 * np.eye(3)[None], np.diag([25e-6] * 3 + [0.0] * 3)
    path = replace(from_above(block, 2e-3, 0.0), shared_jacobian=base, turns=np.zeros((1, 3, 3)))
    follows = np.concatenate([np.eye(3) / 5e-3, np.zeros((3, 3))], axis=1)
    assert through(path, block, vague, SharedGiven(np.zeros(3), follows, np.zeros((3, 3)))) > 0
    assert through(path, block, vague, SharedGiven(np.zeros(3), follows, 0.01 * np.eye(3))) > 0
    assert through(path, block, vague, SharedGiven(np.zeros(3), np.zeros((3, 6)), np.eye(3))) == 0
    off = SharedGiven(np.array([1.0, 0.0, 0.0]), follows, np.zeros((3, 3)))
    assert through(path, block, vague, off) == 0  # it was 3 mm beside the top
