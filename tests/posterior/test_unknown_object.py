"""The unknown object: where an object can be of which only readings are known, and how often a part is denied."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose, no_paths, surface_points, touches_of
from tanteo.factors import FreeRays
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.posterior import PosePrior, Priors, Problem, identify_points, prepare
from tanteo.posterior.unknown import log_unknown, sizes_of_unknown

EXAMPLES = Path(__file__).parents[2] / "examples" / "parts"


def sizes_of(points, radius, **columns):
    """Return the sizes of an unknown object that has some points."""
    problem = Problem(touches_of(points, 1e-4, **columns), FreeRays.none(), Priors(radius=radius), typical_area=0.03)
    return sizes_of_unknown(problem, np.arange(len(points)))


@pytest.mark.quick_sets(2)
@pytest.mark.parametrize("directed", [False, True])
@pytest.mark.parametrize("n", [2, 4])
def test_the_density_of_readings_anywhere_is_a_mean_over_sizes(n, directed):
    """The radius is even up to the largest, the middle even, and so is each reading: in the ball or along its beam."""
    rng, reach = np.random.default_rng(n), 0.04
    points = reach * rng.uniform(-1, 1, (n, 3))
    found = sizes_of(points, 0.1, **({"directions": np.tile([0.0, 0.0, -1.0], (n, 1))} if directed else {}))
    radii, side = 0.1 * rng.random(1_500_000), 0.2 + 2 * reach
    middles = side * (rng.random((len(radii), 3)) - 0.5)
    holds = np.all([np.sum((middles - p) ** 2, axis=1) < radii**2 for p in points], axis=0)
    even = np.mean(np.where(holds, (radii / 0.1) ** (-n if directed else -3.0 * n), 0.0)) * side**3
    volumes = np.array([where.volume for where in found.centres])
    assert np.exp(found.log_densities[0]) @ volumes == pytest.approx(even, rel=0.08)


def test_one_region_of_a_smaller_object_has_more_of_its_area():
    points = 0.01 * np.random.default_rng(2).uniform(-1, 1, (6, 3))
    sizes = sizes_of(points, 0.1)
    gains, radii = np.diff(sizes.log_densities, axis=0)[0], np.array([where.radius for where in sizes.centres])
    chosen = gains > 0  # the region is smaller than the area of the object
    assert 3 < chosen.sum() < len(radii)
    np.testing.assert_allclose(np.diff(gains[chosen]), 10 * np.diff(np.log(radii[chosen])), rtol=1e-6)


@pytest.mark.parametrize(("n", "reach"), [(1, 0.3), (3, 0.3), (12, 0.3), (100, 0.02), (12, [0.5, 0.02, 0.02])])
def test_the_places_of_a_ball_that_holds_all_readings(n, reach):
    """Their volume, against draws; and a normal density as high as the even one."""
    rng = np.random.default_rng(n)
    points = np.array([5.0, -7.0, 1.0]) + rng.uniform(-1, 1, (n, 3)) * reach
    where = sizes_of(points, 0.55).centres[-1]
    sample_prior = points[0] + where.radius * rng.uniform(-1, 1, (40000, 3))
    inside = np.all(np.linalg.norm(sample_prior[:, None] - points, axis=2) < where.radius, axis=1)
    assert where.volume == pytest.approx((2 * where.radius) ** 3 * inside.mean(), rel=0.06)
    assert (2 * np.pi * where.sd**2) ** 1.5 == pytest.approx(where.volume)


def test_readings_of_a_larger_object_get_a_larger_box():
    """A larger unknown object: its ball is a fifth larger than that of its readings, wherever they are."""
    points = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 0, 1]])
    sizes = sizes_of(points, 0.1)
    np.testing.assert_allclose(sizes.centres[0].middle, 0.0, atol=0.1)
    assert all(1 < where.radius < 1.25 for where in sizes.centres)
    assert 4 / 3 * np.pi * 0.1**3 < sizes.centres[-1].volume < 4 / 3 * np.pi * 0.7**3


@pytest.mark.parametrize("far", [2.0, *(pytest.param(far, marks=pytest.mark.slow) for far in (0.2, 50.0))])
@pytest.mark.parametrize("known", [False, True])
def test_a_far_stray_does_not_make_none_of_these_more_probable(far, known):
    """A metre or fifty: it is off the part, and equally uninformative about an unknown object."""
    target, rng = prepare(read_part(EXAMPLES / "bracket_left.step")), np.random.default_rng(3)
    T = box_centred_pose(rng)
    p, _ = surface_points(target, 12, rng)
    points = SE3.apply(T, p) + 1e-3 * rng.normal(size=p.shape)
    points[0, 0] += far
    middle = SE3.apply(T, target.part.centroid)
    pose = PosePrior(box=np.stack([middle - 0.1, middle + 0.1])) if known else None
    priors = Priors(radius=target.part.radius, pose=pose)
    answer = identify_points(touches_of(points, 1e-3), no_paths(), [target], priors=priors)
    assert answer.unknown_probability < 0.05
    assert answer.hypotheses[0].outliers == ("0",)


@pytest.mark.slow
def test_a_part_that_is_there_is_rarely_denied():
    """Of scenes of the part the mean of P(none) is at most the odds of its prior; within three standard errors."""
    target, denied = prepare(read_part(EXAMPLES / "hex_spacer.step")), []
    for seed in range(8):
        rng = np.random.default_rng((31, seed))
        n, T = int(rng.integers(14, 25)), box_centred_pose(rng)
        p, _ = surface_points(target, n, rng)
        touches = touches_of(SE3.apply(T, p) + 3e-3 * rng.normal(size=p.shape), 3e-3)
        priors = Priors(radius=target.part.radius)
        denied.append(identify_points(touches, no_paths(), [target], priors=priors).unknown_probability)
    assert np.mean(denied) < 0.053 + 3 * np.std(denied) / np.sqrt(len(denied))
    assert np.median(denied) < 0.1


def test_the_unknown_object_is_anything_or_a_near_variant():
    """Its evidence is a mixture of readings anywhere, which have the prior already, and of variants of known parts."""
    priors = Priors(unknown=0.1, near_variant=0.2)
    found = np.exp(log_unknown(-3.0, np.log([0.2, 0.3]), priors))
    assert found == pytest.approx(0.8 * np.exp(-3.0) + 0.1 * 0.2 * 0.5)
    assert np.exp(log_unknown(-3.0, np.zeros(0), priors)) == pytest.approx(0.8 * np.exp(-3.0))


@pytest.mark.parametrize("n", [1, 30])
def test_repeated_touches_make_no_object_of_size_zero(n):
    sizes = sizes_of(np.zeros((n, 3)), 0.1)
    assert sizes.centres[0].radius >= 0.1 / 32
    assert np.isfinite(sizes.log_density)
