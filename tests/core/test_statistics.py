"""The posterior is calibrated: ranks of the truth among its samples are uniform, errors follow the covariance.

Truths are drawn from what is assumed: poses anywhere, points even over the surface, normal noise, some outliers.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from core.questions import random_pose
from random_parts import random_part
from tanteo import _core
from tanteo.factors import FreeRays, surface_points
from tanteo.geometry import SE3
from tanteo.posterior import Priors, Problem, infer, prepare

SD = 3e-4
"""Of the noise in every direction [m]."""

SLOW = pytest.mark.slow


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """A handful of workpieces, prepared."""
    folder, rng = tmp_path_factory.mktemp("parts"), np.random.default_rng(17)
    return [prepare(random_part(folder / f"{k}.off", rng)) for k in range(5)]


def drawn(prepared, n, rng, rate):
    """Return a pose, and points of the part there."""
    part, T = prepared.part, random_pose(rng)
    corners = part.vertices[part.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    a, b, c = corners[rng.choice(len(corners), size=n, p=areas / areas.sum())].transpose(1, 0, 2)
    u, v = np.sort(rng.uniform(size=(2, n, 1)), axis=0)
    points = SE3.apply(T, u * a + (v - u) * b + (1 - v) * c) + SD * rng.normal(size=(n, 3))
    lost = rng.uniform(size=n) < rate
    ball = rng.normal(size=(n, 3))
    ball *= (part.radius * rng.uniform(size=n) ** (1 / 3) / np.linalg.norm(ball, axis=1))[:, None]
    points[lost] = SE3.apply(T, part.centroid) + ball[lost]
    return T, points


def posterior(prepared, points, rng, rate):
    touched = surface_points(points, SD)
    priors = Priors(radius=prepared.part.radius, outlier_rate=rate, noise_factor=1.0)
    problem = Problem(touched, FreeRays.none(), priors, typical_area=prepared.part.area)
    return infer(problem, [prepared], 1, prepared.part.centroid, rng)


def rank(found, T):
    """Return for three coordinates of a corner of the box the fraction of samples below the truth."""
    corner = found.modes[0].prepared.part.box[1]
    truth, below = SE3.apply(T, corner), np.zeros(3)
    for mode in found.modes:
        below += mode.probability * mode.weights @ (SE3.apply(mode.Ts, corner) < truth)
    return below / sum(mode.probability for mode in found.modes)


def squared_error(mode, T):
    """Return the squared error of the pose relative to the stated covariance."""
    xi = SE3.log(SE3.inverse(mode.T_world_part) @ T)
    return xi @ np.linalg.solve(mode.covariance, xi)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenes", "n"), [(30, 12), pytest.param(600, 12, marks=SLOW), pytest.param(600, 30, marks=SLOW)]
)
def test_ranks_of_the_truth_are_uniform(parts, scenes, n):
    ranks = []
    for k in range(scenes):
        rng = np.random.default_rng((1, n, k))
        T, points = drawn(parts[k % len(parts)], n, rng, 0.02)
        ranks.append(rank(posterior(parts[k % len(parts)], points, rng, 0.02), T))
    for of_axis in np.transpose(ranks):
        assert kstest(of_axis, "uniform").pvalue > 1e-3


def error_by_plain_draws(mode, T, rng, draws=3000, freedom=5):
    """Squared error of the mean of the likelihood about a maximum, by its covariance: no search, no adaptation."""
    shape, core, none = mode.prepared.shape, mode.objective.core, np.zeros((draws, 0))
    peak = np.ascontiguousarray(mode.T_peak[None])
    information = mode.objective.of_pose(_core.slopes(shape, core, peak, none[:1])[2])[0]
    L = np.linalg.cholesky(1.5 * np.linalg.inv(information))
    z = rng.normal(size=(draws, 6)) / np.sqrt(rng.chisquare(freedom, size=(draws, 1)) / freedom)
    x = z @ L.T
    log = _core.log_densities(shape, core, _core.place(peak.repeat(draws, axis=0), x, shape.centre), none)
    log += 0.5 * (freedom + 6) * np.log1p(np.sum(z * z, axis=1) / freedom)
    w = np.exp(log - log.max())
    w /= w.sum()
    mean = w @ x
    off = _core.offsets(peak[0], T[None], shape.centre)[0] - mean
    return off @ np.linalg.solve((w[:, None] * (x - mean)).T @ (x - mean), off)


@pytest.mark.slow
@pytest.mark.parametrize(("scenes", "n"), [(40, 30), pytest.param(600, 30, marks=SLOW)])
def test_errors_follow_the_stated_covariance(parts, scenes, n):
    """By the likelihood itself, exactly; by the covariance of the answer, which may be a little too small.

    The truth may be in another mode, as improbable as that is: there an error counts as the largest of a thousand.
    """
    stated, plain = [], []
    for k in range(scenes):
        rng = np.random.default_rng((2, n, k))
        T, points = drawn(parts[k % len(parts)], n, rng, 0.02)
        mode = posterior(parts[k % len(parts)], points, rng, 0.02).modes[0]
        assert mode.probability > 0.5
        stated.append(squared_error(mode, T))
        plain.append(error_by_plain_draws(mode, T, rng))
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 6 * scenes)
    stated, plain = np.minimum([stated, plain], chi2.ppf(0.999, 6))
    assert low < plain.sum() < high
    assert low < stated.sum() < 1.15 * high
