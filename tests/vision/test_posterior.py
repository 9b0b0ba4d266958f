"""The posterior of an image: probabilities, poses within their spread whatever an edge does, the camera's errors."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.answers import Priors
from tanteo.lie import SE3
from tanteo.measurements import OnTable
from tanteo.vision import TableErrors, map_edges, prepare_vision, project
from tanteo.vision.answers import hypothesis
from tanteo.vision.fit import meet
from tanteo.vision.image_edges import ImageEdges, Weights
from tanteo.vision.posterior import MISSED, infer
from vision_scenes import bracket, seen_alone

ERRORS = TableErrors()
LYING = OnTable(np.eye(4), ERRORS.height, ERRORS.tilt, 1e-2)


@pytest.fixture(scope="module")
def seen():
    """A part on a table: model, camera, its edge points, its pose in the camera."""
    model = bracket()
    camera, _, edges, T = seen_alone(model, 0.6)
    return model, camera, edges.points, T


def answer(model, camera, edges, T, lying=LYING):
    """The best answer of an image, from one pose."""
    image = ImageEdges(camera, edges, np.array([0.05]))
    return hypothesis(infer(image, [(model, T[None])], 1, lying=lying).modes[0], image, lying=lying is not None)


def squared_error(found, truth):
    e = SE3.log(SE3.inverse(truth) @ found.T_world_part)
    return float(e @ np.linalg.solve(found.covariance, e))


def long_edges(model, camera, points, T):
    """Rows of the edge points of each edge of the part that shows for more than 40 px, and about them."""
    met, groups = meet(model.frame, camera, map_edges(points), T, 1.5), model.frame.groups
    found = []
    for k in np.unique(groups[met.hits]):
        own = met.points[met.hits & (groups == k)]
        if met.spans[met.hits & (groups == k)].sum() > 40:
            near = np.min(np.linalg.norm(points.pixels[:, None] - points.pixels[own], axis=-1), axis=1) < 6
            found.append(near & (np.abs(points.normals @ np.mean(points.normals[own], axis=0)) > 0.95))
    return found


def test_the_pose_stays_within_its_spread_whatever_the_edge(seen):
    model, camera, points, T = seen
    edges = long_edges(model, camera, points, T)
    assert len(edges) >= 4
    found = []
    for rows in edges:
        pixels = points.pixels + 0.8 * rows[:, None] * points.normals
        best = answer(model, camera, map_edges(replace(points, pixels=pixels)), T)
        found.append(squared_error(best, camera.T_world_camera @ T))
    print(found)
    assert max(found) < chi2.ppf(0.999, 6)


@pytest.mark.parametrize("stated", [0.15, 0.35])
@pytest.mark.parametrize("seed", [*range(6), *(pytest.param(k, marks=pytest.mark.slow) for k in range(6, 40))])
def test_edges_farther_off_than_rendered_are_taken_as_such(seen, seed, stated):
    """As with a lens or a model that is not exact: every edge is shifted, as is said or by more."""
    model, camera, points, T = seen
    rng, shift = np.random.default_rng([5, seed]), np.zeros(len(points))
    for rows in long_edges(model, camera, points, T):
        shift[rows] = rng.normal(0, 0.35)
    edges = map_edges(replace(points, pixels=points.pixels + shift[:, None] * points.normals))
    best = answer(model, replace(camera, edge_sd=stated), edges, T)
    assert squared_error(best, camera.T_world_camera @ T) < chi2.ppf(0.999, 6)


def test_what_is_said_of_the_lens_is_in_the_covariance(seen):
    model, camera, points, T = seen
    found = [answer(model, replace(camera, edge_sd=sd), map_edges(points), T) for sd in (0.0, 0.15, 0.4, 1.0)]
    assert all(more > less + 0.3 for less, more in pairwise(np.linalg.slogdet(h.covariance)[1] for h in found))


def test_what_is_said_of_the_camera_s_place_is_in_the_covariance(seen):
    """T_world_camera exp(e) T = T_world_part exp(G e); along the table's height and tilts the table holds the part."""
    model, camera, points, T = seen
    rng = np.random.default_rng(3)
    A = rng.normal(size=(6, 6)) * np.r_[np.full(3, 1e-3), np.full(3, 2e-3)][:, None]
    plain, moved = (answer(model, c, map_edges(points), T, None) for c in (camera, replace(camera, covariance=A @ A.T)))
    G = SE3.adjoint_inverse(T)
    expected = plain.covariance + G @ A @ A.T @ G.T
    ratio = np.linalg.eigvals(np.linalg.solve(expected, moved.covariance)).real
    print(ratio)
    assert np.all((ratio > 0.6) & (ratio < 1.8))


def test_a_pose_that_is_off_comes_back(seen):
    model, camera, points, T = seen
    start = T @ SE3.exp(np.array([3e-4, -3e-4, 2e-4, 0.001, 0.0, 0.003]))
    best = answer(model, camera, map_edges(points), start)
    assert squared_error(best, camera.T_world_camera @ T) < chi2.ppf(0.999, 6)
    assert best.chi2 < 2 * best.dof + 10


def test_the_table_counts_as_three_equations(seen):
    model, camera, points, T = seen
    image = ImageEdges(camera, map_edges(points), np.array([0.05]))
    mode = infer(image, [(model, T[None])], 1, lying=LYING).modes[0]
    alone, lying = (hypothesis(mode, image, lying=lies) for lies in (False, True))
    assert lying.dof == alone.dof + 3
    middle = SE3.apply(T, model.part.centroid)
    pixels = project(camera, middle + np.array([alone.rms, 0.0, 0.0])) - project(camera, middle)
    assert 0.01 < np.linalg.norm(pixels) < 1.5


def test_probabilities_weigh_parts_and_the_unknown_object(seen):
    """A part counts by that its edges are there at its best pose, and by the probability of its stable pose."""
    model, camera, points, T = seen
    other = prepare_vision(replace(model.part, name="other"))
    base = ImageEdges(camera, map_edges(points), np.array([0.05]))
    log = float(base.sums(model, T[None]).there[0])
    image = replace(base, log_unknown=log)
    found = infer(image, [(model, T[None]), (other, T[None])], 10, lying=LYING)
    first, second = found.modes
    assert first.probability == pytest.approx(second.probability, rel=0.05)
    best = image.sums_at(model.part, first.T_peak[None], first.z[None]).there[0]
    rest = LYING.log_probability(model.part, first.T_peak)
    priors = Priors()
    odds = priors.unknown / ((1 - priors.unknown) / 10) * np.exp(log - best - rest)
    none = found.unknown * (1 + (1 - priors.unknown) * MISSED / priors.unknown)
    assert none + first.probability + second.probability == pytest.approx(1)
    assert none / first.probability == pytest.approx(odds, rel=1e-6)


def test_without_edges_of_the_part_nothing_is_known(seen):
    model, camera, points, T = seen
    none = map_edges(points, np.zeros(len(points), dtype=bool))
    image = ImageEdges(camera, none, np.array([0.05]), weights=Weights())
    found = infer(image, [(model, T[None])], 1, lying=LYING)
    assert not found.modes or found.unknown > 0.0
    assert infer(image, [(model, np.zeros((0, 4, 4)))], 1).unknown == 1.0
