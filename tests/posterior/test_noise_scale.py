"""The noise is known to a factor: the joint test, the stated scale, and the region of 95 %."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

import tanteo
from altered import altered
from bare_scenes import Sensing, box_centred_pose, no_paths, scene, surface_points, touches_of
from tanteo import Priors, read_part
from tanteo.factors import FreeRays
from tanteo.geometry import SE3
from tanteo.posterior import Misfit, PosePrior, Problem, Table, prepare
from tanteo.posterior.update import posterior_about

TWO = float(np.log(2.0))
BRACKET = Path(__file__).parents[2] / "examples" / "parts" / "bracket_left.step"


@pytest.fixture(scope="module")
def target():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    return prepare(read_part(BRACKET))


@pytest.mark.parametrize("scale", [0.7, 1.0, 1.8])
def test_the_scale_is_that_of_the_residuals(scale):
    scale_stated, low, high = Misfit(scale**2 * 200, 0.0, 200, TWO, 200).noise_scale()
    assert scale_stated == pytest.approx(scale, rel=0.02)
    assert high / scale_stated == pytest.approx(np.exp(1.96 / np.sqrt(400)), rel=0.02)
    assert low < scale_stated < high


def test_a_scale_without_anything_checked_is_as_stated():
    assert Misfit(6.0, 0.0, 6, TWO, 6).noise_scale()[0] == pytest.approx(1.0)
    assert Misfit(50.0, 0.0, 6).noise_scale() == (1.0, 1.0, 1.0)


def test_the_joint_test_forgives_what_the_factor_does():
    exact, known = Misfit(24.0, 1.0, 6), Misfit(24.0, 1.0, 6, TWO)
    assert exact.p_value == pytest.approx(chi2.sf(25.0, 6))
    assert known.p_value > 0.05
    assert Misfit(2400.0, 1.0, 6, TWO).p_value < 1e-3
    assert Misfit(0.0, 25.0, 6, TWO).p_value == pytest.approx(chi2.sf(25.0, 6), rel=1e-6)  # no noise of the sensor
    assert Misfit(1e9, 0.0, 0, TWO).p_value == 1.0


def test_the_stated_region_contains_95_percent_of_the_samples(target):
    contained = []
    for seed in range(6):
        rng = np.random.default_rng((3, seed))
        T = box_centred_pose(rng)
        points = scene(target, T, Sensing("touch", 2e-4, True, ()), 12, rng)[0]
        problem = Problem(points, FreeRays.none(), Priors(radius=target.part.radius, noise_factor=2.0))
        mode = posterior_about(problem, target, T[None], rng).modes[0]
        xi = SE3.log(SE3.inverse(mode.T_world_part) @ mode.Ts)
        gaps = np.sum(xi * np.linalg.solve(mode.covariance, xi.T).T, axis=1)
        contained.append(mode.weights @ (gaps <= chi2.ppf(0.95, 6) * (1 + 1e-6)))
    assert min(contained) > 0.945


def test_beams_that_end_on_the_table_were_free_until_there(target):
    rng = np.random.default_rng(5)
    T = box_centred_pose(rng)
    points = scene(target, T, Sensing("laser", 2e-4, True, ()), 20, rng)[0]
    top = points.points[:, 2].min() - 0.1
    places, directions = points.points.copy(), points.directions.copy()
    places[:8, 2], directions[:8] = top, (0.0, 0.0, -1.0)
    lowered = altered(points, points=places, directions=directions)
    table = PosePrior(table=Table(np.array([0.0, 0.0, top]), np.array([0.0, 0.0, 1.0]), 1e-3))
    furniture = Problem(lowered, FreeRays.none(), Priors(radius=target.part.radius, pose=table)).furniture
    assert np.array_equal(np.flatnonzero(furniture.on_furniture), np.arange(8))
    assert len(furniture.paths) == 8
    ends = (
        furniture.paths.origins
        + (furniture.paths.lengths - furniture.paths.margin)[:, None] * furniture.paths.directions
    )
    assert np.all((ends[:, 2] > top) & (ends[:, 2] < top + 0.01))


def scale_stated(points, target, priors):
    return tanteo.posterior.identify_points(points, FreeRays.none(), [target], priors=priors).hypotheses[0].noise_scale


def test_other_information_takes_no_freedom_of_the_noise(target):
    """An uninformative prior or normals leave the scale unchanged; an exact prior leaves every point to it."""
    rng = np.random.default_rng(5)
    T = box_centred_pose(rng)
    points = scene(target, T, Sensing("touch", 2e-4, False, ()), 12, rng)[0]
    alone = scale_stated(points, target, Priors(noise_factor=2.0))
    for sd, turn_sd in ((0.1, 0.5), (0.02, 0.2)):
        rough = PosePrior(T, np.diag([sd] * 3 + [turn_sd] * 3) ** 2)
        assert scale_stated(points, target, Priors(pose=rough, noise_factor=2.0)) == pytest.approx(alone, rel=0.05)
    tilted = altered(points, normals=facing(target, T, points), normal_sds=np.full(12, np.radians(30.0)))
    assert scale_stated(tilted, target, Priors(noise_factor=2.0)) == pytest.approx(alone, rel=0.05)
    exact = PosePrior(T, np.diag([1e-7] * 6) ** 2)
    local = SE3.apply(SE3.inverse(T), points.points)
    squares = float(np.sum((target.surface.closest(local).distances / 2e-4) ** 2))
    expected = Misfit(squares, 0.0, 12, TWO, 12).noise_scale()
    assert scale_stated(points, target, Priors(pose=exact, noise_factor=2.0)) == pytest.approx(expected, rel=0.02)


def facing(target, T, points):
    """Outward normals of the surface next to the points, in the world."""
    found = target.surface.closest(SE3.apply(SE3.inverse(T), points.points))
    return target.surface.normals[found.triangles] @ T[:3, :3].T


@pytest.mark.parametrize(("times", "explained"), [(1.0, True), (1.5, True), (6.0, False)])
def test_a_part_that_takes_too_much_noise_explains_nothing(target, times, explained):
    """Others stay active, because the first-pass evaluation may have missed their pose."""
    rng = np.random.default_rng(3)
    T = box_centred_pose(rng)
    p, _ = surface_points(target, 40, rng)
    touches = touches_of(SE3.apply(T, p) + times * 1e-4 * rng.normal(size=p.shape), 1e-4)
    problem = Problem(touches, no_paths(), Priors(radius=target.part.radius))
    (search,) = posterior_about(problem, target, T[None], rng).searches
    assert search.on_the_part().mean() > 0.9
    assert search.is_good_fit() == explained
