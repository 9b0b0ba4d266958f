"""Lines of sight: the numbers of the formula, slopes by differences, poses and covariances by simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import Sensing, box_centred_pose, scene
from tanteo import _core
from tanteo.errors import InputError
from tanteo.factors import FreeRays, SightLines, surface_points
from tanteo.geometry import SE3, SO3
from tanteo.posterior import Priors, Problem, identify_points, prepare

ROOT = Path(__file__).parents[2]
ANGLE_SD = 2e-4
TOUCH = Sensing("touch", 2e-4, False, ())


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part(ROOT / "examples" / "parts" / "block.step"))


def seen(T, points, rng, *, origin=(0.1, -0.2, 0.9), sd=ANGLE_SD, **more):
    """Lines from a station to points of a part, each with its error."""
    away = SE3.apply(T, points) - np.array(origin)
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    errors = sd * rng.normal(size=away.shape)
    errors -= np.sum(errors * away, axis=1, keepdims=True) * away
    return SightLines(origin=origin, directions=away + errors, angle_sd=sd, **more)


def compiled(target, lines):
    priors = Priors(radius=0.1, noise_factor=1.0)
    problem = Problem(surface_points(np.zeros((0, 3)), 1e-4), FreeRays.none(), priors, pose_factors=(lines,))
    return problem.compiled(target), problem.states


def plain(lines, points, T, z=None):
    """Return the value of the formula in the C++ file."""
    L = np.zeros((6, 6)) if lines.station is None else np.linalg.cholesky(lines.station)
    error = np.zeros(6) if z is None else L @ z
    log, each = 0.0, not isinstance(lines.through, str)
    for j, d in enumerate(lines.directions):
        d = SO3.exp(error[3:]) @ (d / np.linalg.norm(d))
        total = lines.outlier_rate
        for c in points[j : j + 1] if each else points:
            off = SE3.apply(T, c) - lines.origin - error[:3]
            s = off @ d
            if s <= 0:
                continue
            variance = lines.angle_sd**2 + (lines.origin_sd / s) ** 2
            square = (off @ off - s**2) / s**2 / variance
            density = np.exp(-0.5 * square) / (2 * np.pi * variance) * 4 * np.pi
            total += (1 - lines.outlier_rate) * density / (1 if each else len(points))
        log += np.log(total)
    return log


@pytest.mark.parametrize("through", ["corners", "points"])
@pytest.mark.parametrize("station", [None, np.diag([1e-3] * 3 + [1e-3] * 3) ** 2])
def test_density_is_that_of_the_formula(block, through, station):
    rng = np.random.default_rng(1)
    T = box_centred_pose(rng)
    corners = block.part.corners.points[:5]
    lines = seen(T, corners, rng, origin_sd=1e-4, station=station, through=corners if through == "points" else through)
    core, D = compiled(block, lines)
    Ts = T @ SE3.exp(1e-4 * rng.normal(size=(6, 6)))
    z = rng.normal(size=(6, D))
    logs = _core.log_densities(block.shape, core, Ts, z)
    own = [plain(lines, lines.points(block.part), T, z[k] if D else None) for k, T in enumerate(Ts)]
    np.testing.assert_allclose(logs + 0.5 * np.sum(z**2, axis=1), own, rtol=1e-9)


@pytest.mark.parametrize("station", [None, np.diag([1e-3] * 3 + [1e-3] * 3) ** 2])
def test_slopes_are_differences_of_the_density(block, station):
    rng = np.random.default_rng(2)
    T = box_centred_pose(rng)
    lines = seen(T, block.part.corners.points[:6], rng, sd=2e-3, station=station)
    core, D = compiled(block, lines)
    T = T @ SE3.exp(np.r_[5e-4 * rng.normal(size=3), 3e-3 * rng.normal(size=3)])
    z, h = 0.3 * rng.normal(size=(1, D)), 1e-6
    _, slope, information = _core.slopes(block.shape, core, T[None], z)
    for k in range(6 + D):
        step = np.zeros((1, 6))
        step[0, min(k, 5)] = h if k < 6 else 0.0
        dz = np.zeros((1, D))
        if k >= 6:
            dz[0, k - 6] = h
        up, down = (
            _core.log_densities(block.shape, core, _core.place(T[None], s * step, block.centre), z + s * dz)[0]
            for s in (1.0, -1.0)
        )
        assert slope[0, k] == pytest.approx((up - down) / (2 * h), rel=2e-3, abs=2e-3 * np.abs(slope).max() + 1e-3)
    assert np.linalg.eigvalsh(information[0]).min() > -1e-9 * np.abs(information).max()


def test_two_stations_locate_a_part_that_touches_leave_open(block):
    """Four touches of one face, and lines from two stations: poses are as far off as reported."""
    squares = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        T = box_centred_pose(rng)
        touches = scene(block, T, TOUCH, 12, rng)[0]
        corners = block.part.corners.points
        lines = [seen(T, corners[:6], rng, origin=at) for at in ((0.2, -0.3, 0.9), (-0.8, 0.2, 0.4))]
        best = identify_points(touches, FreeRays.none(), [block], factors=lines).hypotheses[0]
        away = [SE3.log(SE3.inverse(best.T_world_part @ S) @ T) for S in block.part.symmetry.Ts]
        squares.append(min(xi @ np.linalg.solve(best.covariance, xi) for xi in away))
    # the mean of 20 chi-square variables with 6 degrees of freedom, 99.9 % interval
    assert 3.6 < np.mean(squares) < 9.1


def test_lines_of_an_unlike_direction_are_outliers(block):
    rng = np.random.default_rng(3)
    T = box_centred_pose(rng)
    touches = scene(block, T, TOUCH, 25, rng)[0]
    alone = identify_points(touches, FreeRays.none(), [block]).hypotheses[0]
    off = seen(T @ SE3.exp(np.r_[0.02, 0.01, 0, 0, 0, 0]), block.part.corners.points[:1], rng)
    both = identify_points(touches, FreeRays.none(), [block], factors=[off]).hypotheses[0]
    np.testing.assert_allclose(both.T_world_part, alone.T_world_part, atol=2e-5)


def test_points_in_the_back_of_the_station_are_not_visible(block):
    lines = SightLines(origin=[0, 0, 1], directions=[[0, 0, 1.0]], angle_sd=0.1, through="corners")
    core, _ = compiled(block, lines)
    log = _core.log_densities(block.shape, core, np.eye(4)[None], np.zeros((1, 0)))[0]
    assert log == pytest.approx(np.log(lines.outlier_rate))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"origin": [0, 0]}, "origin"),
        ({"directions": [0, 0, 1]}, "directions"),
        ({"directions": [[0, 0, 0]]}, "some length"),
        ({"directions": [[0, np.nan, 1]]}, "finite"),
        ({"angle_sd": 0.0}, "angle_sd"),
        ({"origin_sd": -1.0}, "origin_sd"),
        ({"outlier_rate": 1.0}, "outlier_rate"),
        ({"through": "holes"}, "corners, rims"),
        ({"through": np.zeros((2, 3))}, "one finite point"),
        ({"station": -np.eye(6)}, "station"),
    ],
)
def test_arguments_that_make_no_sense_are_refused(change, message):
    given = {"origin": [0, 0, 1], "directions": [[0, 0, -1]], "angle_sd": 1e-3} | change
    with pytest.raises(InputError, match=message):
        SightLines(**given)


def test_a_part_without_holes_has_no_rims(block):
    lines = SightLines(origin=[0, 0, 1], directions=[[0, 0, -1]], angle_sd=1e-3, through="rims")
    with pytest.raises(InputError, match=r"expected a part with rims, got block"):
        lines.points(block.part)


def test_lines_of_sight_are_no_prior_of_the_pose(block):
    """The density of the uniform prior counts beside them."""
    T = SE3.exp(np.array([0.1, 0.0, 0.0, 0.1, 0.2, 0.3]))
    lines = seen(T, block.part.corners.points[:4], np.random.default_rng(0))
    touched, priors = surface_points(np.zeros((0, 3)), 1e-4), Priors(radius=0.1)
    alone, beside = (Problem(touched, FreeRays.none(), priors, pose_factors=given) for given in ((), (lines,)))
    assert beside.log_pose_density(block) == alone.log_pose_density(block) != 0
