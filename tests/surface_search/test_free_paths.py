"""Paths on which nothing was met, exactly known or somewhere in a cone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.localization import SharedGiven
from tanteo.matching import Priors
from tanteo.sensors import Readings, measure
from tanteo.surface_search import FreePaths, as_free_paths, prepare_target
from tanteo.surface_search.free_space import gone_through, log_free_paths

PRIORS = Priors(radius=0.1)
C = PRIORS.clutter
HALF = np.radians(5.0)


@pytest.fixture(scope="module")
def block():
    return prepare_target(tanteo.read_part(Path(__file__).parents[2] / "examples" / "parts" / "block.step"))


def through(path, target, covariance=None, shared=None):
    """How far before its end the part is surely in the way of a path."""
    covariance = np.zeros((6, 6)) if covariance is None else covariance
    return gone_through(path, np.eye(4), covariance, shared, target)[0]


def from_above(target, inside, half_angle):
    """A path down onto the top, so far inside of its border, free to well below it."""
    low, high = target.part.box
    origin = np.array([high[0] - inside, 0.5 * (low[1] + high[1]), high[2] + 0.1])
    slopes = np.array([0.5 * np.tan(half_angle)])
    return FreePaths(origin[None], np.array([[0.0, 0.0, -1.0]]), np.array([0.12]), np.zeros(1), slopes)


def log(target, path):
    return float(log_free_paths(path, np.eye(4)[None], np.zeros((1, 0)), target, PRIORS)[0])


@pytest.mark.parametrize("half_angle", [0.0, HALF])
def test_well_inside_a_face_a_path_is_blocked_and_far_beside_it_is_not(block, half_angle):
    assert log(block, from_above(block, 0.03, half_angle)) == pytest.approx(np.log(C))
    assert log(block, from_above(block, -0.03, half_angle)) == pytest.approx(np.log1p(-C))


def test_a_path_that_is_exact_is_blocked_up_to_the_border(block):
    assert log(block, from_above(block, 1e-3, 0.0)) == pytest.approx(np.log(C))


def test_a_cone_that_grazes_a_border_passes_beside_it_with_about_its_share(block):
    """Against rays at random in the cone: the five rays are not far off, and nowhere near the certainty of one."""
    rng, path = np.random.default_rng(1), from_above(block, 2e-3, HALF)
    radius, turn = np.tan(HALF) * np.sqrt(rng.uniform(size=4000)), rng.uniform(0, 2 * np.pi, 4000)
    rays = np.stack([radius * np.cos(turn), radius * np.sin(turn), -np.ones(4000)], axis=1)
    hits = block.surface.cast(np.broadcast_to(path.origins, rays.shape), rays / np.linalg.norm(rays, axis=1)[:, None])
    share = np.mean(hits.distances > 0.12)
    assert 0.2 < share < 0.45
    assert abs((np.exp(log(block, path)) - C) / (1 - 2 * C) - share) < 0.25
    assert log(block, path) > np.log(C) + 1.5


def slanted(target, incidence, limit, slope=0.0):
    """A path that meets the middle of the top at an angle, of a sensor that answers up to another."""
    low, high = target.part.box
    middle = np.array([*(0.5 * (low + high))[:2], high[2]])
    along = np.array([np.sin(incidence), 0.0, -np.cos(incidence)])
    return FreePaths((middle - 0.1 * along)[None], along[None], np.array([0.2]), np.zeros(1), np.array([slope]), limit)


@pytest.mark.parametrize("slope", [0.0, 0.02])
def test_a_path_that_meets_a_face_beyond_the_limit_of_its_sensor_says_as_much_as_one_that_passes(block, slope):
    for degrees in (0, 30, 55, 65, 80):
        angle, limit = np.radians(degrees), np.radians([60.0])
        said = log(block, slanted(block, angle, limit, slope))
        assert said == pytest.approx(np.log1p(-C) if degrees > 60 else np.log(C))
        assert (through(slanted(block, angle, limit), block) > 0) == (degrees < 60)
        unknown = replace(slanted(block, angle, limit), incidences=np.zeros(0))
        assert log(block, unknown) == pytest.approx(np.log(C))


def test_the_limit_comes_from_the_preset_of_the_sensor_and_a_touch_has_none():
    def paths(**how):
        readings = Readings.from_columns(
            np.zeros((1, 3)), directions=np.eye(3)[2:], is_free=np.array([True]), max_ranges=np.array([0.2])
        )
        return as_free_paths(measure(readings, **how), 0.0)

    assert paths(sensor="keyence_il300").incidences == pytest.approx(np.radians(30))
    assert paths(sensor="keyence_il300").up_to(0.2).incidences == pytest.approx(0.2)
    assert paths(sensor="touch_probe_hobby").incidences == pytest.approx(np.pi / 2)
    assert paths(sd=1e-3).incidences == pytest.approx(np.pi / 2)


def test_a_path_is_named_if_it_meets_the_part_also_with_the_pose_three_standard_deviations_off(block):
    """A path 2 mm inside of the border of the top, and how sure the place of that border is."""
    path = from_above(block, 2e-3, 0.0)
    for sd, surely in ((0.0, True), (0.6e-3, True), (0.75e-3, False)):
        aside, along = (np.diag(np.r_[np.eye(3)[k], 0, 0, 0] * sd**2) for k in (0, 2))
        assert (through(path, block, aside) > 0) == surely
        assert through(path, block, along) == pytest.approx(0.02)  # how high the top is decides nothing
    assert through(from_above(block, -2e-3, 0.0), block) == 0


def test_a_cone_is_named_if_all_of_it_meets_the_part(block):
    rim = 0.1 * np.tan(HALF)
    assert through(from_above(block, rim + 1e-3, HALF), block) > 0
    assert through(from_above(block, rim - 1e-3, HALF), block) == 0


def test_what_moves_path_and_pose_alike_is_no_distance_between_them(block):
    """A base off by 5 mm sd: where the part is said to be in the world is as vague, and the path goes with it."""
    base, vague = 5e-3 * np.eye(3)[None], np.diag([25e-6] * 3 + [0.0] * 3)
    path = replace(from_above(block, 2e-3, 0.0), gains=base, turns=np.zeros((1, 3, 3)))
    follows = np.concatenate([np.eye(3) / 5e-3, np.zeros((3, 3))], axis=1)
    assert through(path, block, vague, SharedGiven(np.zeros(3), follows, np.zeros((3, 3)))) > 0
    assert through(path, block, vague, SharedGiven(np.zeros(3), follows, 0.01 * np.eye(3))) > 0
    assert through(path, block, vague, SharedGiven(np.zeros(3), np.zeros((3, 6)), np.eye(3))) == 0
    off = SharedGiven(np.array([1.0, 0.0, 0.0]), follows, np.zeros((3, 3)))
    assert through(path, block, vague, off) == 0  # it was 3 mm beside the top


def test_paths_are_weighed_where_the_shared_errors_put_them(block):
    path = replace(from_above(block, 2e-3, 0.0), gains=5e-3 * np.eye(3)[None], turns=np.zeros((1, 3, 3)))
    z = np.array([[0.0, 0, 0], [0.3, 0, 0], [0.5, 0, 0], [-0.5, 0, 0]])
    Ts = np.broadcast_to(np.eye(4), (4, 4, 4))
    said = log_free_paths(path, Ts, z, block, PRIORS)
    np.testing.assert_allclose(said, np.log([C, C, 1 - C, C]))
    moved = Ts.copy()
    moved[:, 0, 3] = 5e-3 * z[:, 0]
    np.testing.assert_allclose(log_free_paths(path, moved, z, block, PRIORS), np.log(C))
