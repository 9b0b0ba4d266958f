"""The posterior of an image: probabilities, poses within their spread for any edge errors, the camera's errors."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo import part_from_mesh
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.posterior import OnTable, Priors, prepare, search_about, sized, weigh
from tanteo.vision import View, prepare_vision, see_table, view_factors
from tanteo.vision.answers import hypothesis
from tanteo.vision.camera import project
from tanteo.vision.edges import map_edges
from tanteo.vision.fit import meet
from tanteo.vision.image_edges import ImageEdges, Weights, standing, sums_of
from tanteo.vision.posterior import infer, resampled, searched
from tanteo.vision.settings import EVIDENCE
from tanteo.vision.table import TableErrors
from vision_scenes import PARTS, bracket, seen_alone

ERRORS = TableErrors()
LYING = OnTable(np.eye(4), ERRORS.height, ERRORS.tilt, 1e-2)


@pytest.fixture(scope="module")
def seen():
    """A part on a table: model, camera, its edge points, its pose in the camera."""
    model = bracket()
    camera, _, edges, T = seen_alone(model, 0.6)
    return model, camera, edges.points, T


def answer(model, camera, edges, T, lying=LYING):
    """Return the best answer of an image, from one pose."""
    image = ImageEdges(camera, edges, np.array([0.05]))
    found = infer((image,), [(model, (standing(camera) @ T)[None])], 1, lying=lying)
    return hypothesis(found.modes[0], (image,), lying=lying is not None)


def squared_error(found, truth):
    e = SE3.log(SE3.inverse(truth) @ found.T_world_part)
    return float(e @ np.linalg.solve(found.covariance, e))


def long_edges(model, camera, points, T):
    """Rows of the edge points of each edge of the part that shows for more than 40 px, and about them."""
    edge_hits, groups = meet(model.frame, camera, map_edges(points), T, 1.5), model.frame.groups
    found = []
    for k in np.unique(groups[edge_hits.hits]):
        own = edge_hits.points[edge_hits.hits & (groups == k)]
        if edge_hits.spans[edge_hits.hits & (groups == k)].sum() > 40:
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
@pytest.mark.parametrize("seed", [*range(2), *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 40))])
def test_edges_farther_off_than_rendered_are_taken_as_such(seen, seed, stated):
    """As with a lens or a model that is not exact: every edge is shifted, as stated or by more."""
    model, camera, points, T = seen
    rng, shift = np.random.default_rng([5, seed]), np.zeros(len(points))
    for rows in long_edges(model, camera, points, T):
        shift[rows] = rng.normal(0, 0.35)
    edges = map_edges(replace(points, pixels=points.pixels + shift[:, None] * points.normals))
    best = answer(model, replace(camera, edge_sd=stated), edges, T)
    assert squared_error(best, camera.T_world_camera @ T) < chi2.ppf(0.999, 6)


def test_the_stated_lens_error_is_in_the_covariance(seen):
    model, camera, points, T = seen
    found = [answer(model, replace(camera, edge_sd=sd), map_edges(points), T) for sd in (0.0, 0.15, 0.4, 1.0)]
    assert all(more > less + 0.3 for less, more in pairwise(np.linalg.slogdet(h.covariance)[1] for h in found))


def test_the_stated_camera_pose_error_is_in_the_covariance(seen):
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
    mode = infer((image,), [(model, (standing(camera) @ T)[None])], 1, lying=LYING).modes[0]
    alone, lying = (hypothesis(mode, (image,), lying=lies) for lies in (False, True))
    assert lying.dof == alone.dof + 3
    middle = SE3.apply(T, model.part.centroid)
    pixels = project(camera, middle + np.array([alone.rms, 0.0, 0.0])) - project(camera, middle)
    assert 0.01 < np.linalg.norm(pixels) < 1.5


def test_probabilities_weigh_parts_and_the_unknown_object(seen):
    """A part counts by that its edges are there at its best pose, and by the probability of its stable pose."""
    model, camera, points, T = seen
    other = prepare_vision(replace(model.part))
    base = ImageEdges(camera, map_edges(points), np.array([0.05]))
    log = float(base.sums(model, T[None]).there[0])
    image = replace(base, log_unknown=log)
    start = (standing(camera) @ T)[None]
    found = infer((image,), [(model, start), (other, start)], 10, lying=LYING)
    first, second = found.modes
    assert first.probability == pytest.approx(second.probability, rel=0.05)
    best = sums_of((image,), model.part, first.T_peak[None], first.z[None])[0].there[0]
    rest = LYING.log_probability(model.part, first.T_peak)
    priors = Priors()
    odds = priors.unknown / ((1 - priors.unknown) / 10) * np.exp(log - best - rest)
    none = found.unknown * (1 + (1 - priors.unknown) * EVIDENCE.missed / priors.unknown)
    assert none + first.probability + second.probability == pytest.approx(1)
    assert none / first.probability == pytest.approx(odds, rel=1e-6)


def test_without_edges_of_the_part_nothing_is_known(seen):
    model, camera, points, T = seen
    none = map_edges(points, np.zeros(len(points), dtype=bool))
    image = ImageEdges(camera, none, np.array([0.05]), weights=Weights())
    found = infer((image,), [(model, (standing(camera) @ T)[None])], 1, lying=LYING)
    assert not found.modes or found.unknown > 0.0
    assert infer((image,), [(model, np.zeros((0, 4, 4)))], 1).unknown == 1.0


def scene(part):
    """Return a camera, its image of a part alone on a table, and the pose of the part in the world."""
    camera, image, _, T = seen_alone(prepare_vision(part), 0.5)
    return camera, image, camera.T_world_camera @ T


@pytest.mark.slow
def test_parts_of_one_name_keep_their_own_constants():
    wedge, step = (read_part(PARTS / f"{name}.step") for name in ("wedge", "step_12mm"))
    camera, image, T = scene(wedge)
    points, found = SE3.apply(T, prepare_vision(wedge).inner), []
    for other in (step, replace(step, name="wedge")):
        (factor,) = view_factors([View(image, camera)], points, [wedge, other], sized(Priors(), wedge.radius))
        answer = see_table(image, camera, [wedge, other]).objects[0].answer
        log = sums_of((factor,), wedge, T[None])[0].log[0]
        found.append((log, len(factor.poses(wedge)), answer.hypotheses[0].probability, answer.unknown_probability))
        assert answer.hypotheses[0].file == wedge.source
    assert found[0] == pytest.approx(found[1], abs=1e-6)


def cone_frustum():
    """Return a frustum of a cone of 40 mm, of 48 facets."""
    angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    rings = [np.c_[r * np.cos(angles), r * np.sin(angles), np.full(48, z)] for r, z in ((0.02, 0.0), (0.012, 0.04))]
    k, following = np.arange(48), (np.arange(48) + 1) % 48
    sides = np.concatenate([np.c_[k, following, following + 48], np.c_[k, following + 48, k + 48]])
    caps = np.concatenate([np.c_[np.full(48, 96), following, k], np.c_[np.full(48, 97), k + 48, following + 48]])
    ends = np.array([[0, 0, 0], [0, 0, 0.04]])
    return part_from_mesh(np.concatenate([*rings, ends]), np.concatenate([sides, caps]), name="frustum", unit="m")


@pytest.mark.parametrize(
    "name", ["square_post", *(pytest.param(name, marks=pytest.mark.slow) for name in ("flange", "frustum"))]
)
def test_poses_that_symmetry_makes_the_same_have_one_constant(name):
    part = cone_frustum() if name == "frustum" else read_part(PARTS / f"{name}.step")
    assert (part.symmetry.axis is not None) == (name == "frustum")
    camera, image, T = scene(part)
    if name != "frustum":  # an image of another part leaves several poses
        image = scene(read_part(PARTS / "bracket_left.step"))[1]
    model = prepare_vision(part)
    (factor,) = view_factors([View(image, camera)], SE3.apply(T, model.inner), [part], sized(Priors(), part.radius))
    # the same place, in all stable poses and yaws
    middle = SE3.from_parts(np.eye(3), SE3.apply(T, part.centroid))
    back = SE3.from_parts(np.eye(3), -part.centroid)
    yaws = [SE3.from_parts(SO3.axis_rotation(2, a), np.zeros(3)) for a in np.linspace(0, 6, 12)]
    rests = [SE3.from_parts(rest.T_table_part[:3, :3], np.zeros(3)) for rest in model.rests]
    start = [(part, np.stack([T, *(middle @ yaw @ rest @ back for rest in rests for yaw in yaws)]))]
    (levelled,), _, _ = searched((replace(factor, levels={}, proposed={}),), start, sized(Priors(), part.radius))
    turns = part.symmetry.Ts
    if part.symmetry.axis is not None:
        point, axis = part.symmetry.axis
        spins = [SE3.from_parts(SO3.exp(a * axis), point - SO3.exp(a * axis) @ point) for a in (0.7, 2.0, 3.0, 4.5)]
        turns = np.concatenate([turns @ spin for spin in spins])
    Ts, _ = levelled.levels[part]
    found = []
    for pose in Ts:
        sums = sums_of((levelled,), part, pose @ turns)[0]
        found.append(sums.there + sums.located - sums.log)
    levels = np.array(found)
    assert np.ptp(levels) > 1  # not all poses have the same
    np.testing.assert_allclose(levels, np.broadcast_to(levels[:, :1], levels.shape), atol=1e-6)


def test_a_wrong_constant_of_one_part_does_not_drop_the_others(seen):
    model, camera, points, T = seen
    other = prepare_vision(read_part(PARTS / "bracket_right.step"))
    edges = ImageEdges(camera, map_edges(points), np.array([0.05]))
    start = [(one.part, (standing(camera) @ T)[None]) for one in (model, other)]
    (image,), problem, searches = searched((edges,), start, sized(Priors(), model.part.radius), LYING)
    at, constants = image.levels[other.part]
    image = replace(image, levels={**image.levels, other.part: (at, constants - 80.0)})
    problem = replace(problem, pose_factors=(image, LYING))
    starts = [(prepare(part), Ts) for part, Ts in start]
    searches = search_about(problem, starts, np.random.default_rng(0))
    once = weigh(problem, searches, np.zeros(2), 0.0, np.random.default_rng(0))
    assert {mode.prepared.part for mode in once.modes} == {other.part}
    _, found = resampled((image,), problem, searches, LYING)
    assert found.modes[0].prepared.part is model.part
