"""Images beside readings: several views and a few touches give one answer, sharper than either."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rendered import table_camera
from tanteo import _core, identify
from tanteo.errors import InputError
from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry import SE3, SO3
from tanteo.io import read_readings
from tanteo.parts import read_part
from tanteo.posterior import Priors, Problem, prepare, sized, weigh
from tanteo.posterior.part_search import start_search
from tanteo.posterior.update import search_widely
from tanteo.vision import View, prepare_vision, see, see_table, view_factors
from tanteo.vision.camera import Mounting
from tanteo.vision.edges import chance_hits, find_edges, map_edges
from tanteo.vision.image_edges import ImageEdges, sums_of
from tanteo.vision.models import spread
from tanteo.vision.rendering import Stage, render, rendered_part
from tanteo.vision.sight import see_shots, shot_of
from tanteo.vision.table import TableErrors
from vision_scenes import PARTS, hand_views


def other_camera(camera):
    """Return the same camera, rotated about the middle of the table by 40 degrees."""
    turn = SE3.from_parts(SO3.axis_rotation(2, np.radians(40.0)), np.zeros(3))
    return replace(camera, T_world_camera=turn @ camera.T_world_camera)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Similar parts, the pose of one of them, two views of it and a file of readings of its top."""
    parts = [read_part(PARTS / f"{name}.step") for name in ("step_12mm", "step_15mm", "wedge")]
    model, rng = prepare_vision(parts[0]), np.random.default_rng(4)
    T = SE3.from_parts(SO3.axis_rotation(2, 0.5), np.array([0.01, 0.02, 0.0])) @ model.rests[0].T_table_part
    cameras = [table_camera(), other_camera(table_camera())]
    views = [View(render(Stage(camera, [rendered_part(parts[0], T, 120)]), rng)[0], camera) for camera in cameras]
    places, normals = spread(parts[0], 60)
    seen = SE3.apply(T, places[(normals @ T[2, :3]) > 0.2])
    points = seen[[0, len(seen) // 2, -1]] + rng.normal(0, 5e-5, (3, 3))
    file = tmp_path_factory.mktemp("readings") / "top.csv"
    file.write_text("x_mm,y_mm,z_mm\n" + "".join("{:.4f},{:.4f},{:.4f}\n".format(*(1e3 * p)) for p in points))
    return parts, T, views, read_readings(file)


@pytest.fixture(scope="module")
def answers(scene):
    """The answers of no view, one and two beside the readings."""
    parts, _, views, readings = scene
    return [identify(readings, parts, sd=5e-5, views=views[:count], conventions=False) for count in (0, 1, 2)]


@pytest.mark.slow
def test_views_and_touches_give_one_answer(scene, answers):
    parts, T, _, _ = scene
    alone, _, both = answers
    assert alone.status != "recognized"
    assert both.status == "recognized"
    best = both.best
    assert best.part == parts[0].name
    total = both.unknown_probability + sum(h.probability for h in both.hypotheses)
    assert total == pytest.approx(1.0, abs=1e-3)
    images = T @ parts[0].symmetry.Ts
    gaps = SE3.log(SE3.inverse(images) @ best.T_world_part)
    assert min(e @ np.linalg.solve(best.covariance, e) for e in gaps) < 30
    assert np.linalg.norm(gaps[:, :3], axis=1).min() < 1e-3


@pytest.mark.slow
def test_a_second_view_sharpens(answers):
    one, two = answers[1].best, answers[2].best
    assert one is not None
    assert np.linalg.slogdet(two.covariance)[1] < np.linalg.slogdet(one.covariance)[1]


def test_views_add_the_states_of_their_cameras(scene):
    parts, _, views, readings = scene
    known = replace(views[1], camera=replace(views[1].camera, covariance=1e-8 * np.eye(6)))
    first, second = view_factors([views[0], known], readings.points, parts, sized(Priors(), 0.1))
    assert (first.states, second.states) == (3, 9)
    assert len(first.poses(parts[0])) > 0
    assert len(second.poses(parts[0])) == 0


def test_what_cannot_be_compared_is_refused(scene):
    parts, _, views, readings = scene
    with pytest.raises(InputError, match="at most 64 parts"):
        identify(readings, parts * 30, sd=5e-5, views=views)
    nowhere = replace(views[0], camera=replace(views[0].camera, T_world_camera=None))
    with pytest.raises(InputError, match="expected its pose"):
        identify(readings, parts, sd=5e-5, views=[nowhere])


def error_of(part, T, best):
    """Return the error of a pose over its covariance, and of the middle of the part [m]."""
    images = T @ part.symmetry.Ts
    gaps = SE3.log(SE3.inverse(images) @ best.T_world_part)
    squared = np.einsum("ki,ij,kj->k", gaps, np.linalg.inv(best.covariance), gaps)
    nearest = SE3.inverse(images[np.argmin(squared)]) @ best.T_world_part
    return squared.min(), np.linalg.norm(SE3.apply(nearest, part.centroid) - part.centroid)


@pytest.mark.slow
def test_two_views_of_a_table_give_one_answer(scene):
    parts, T, views, _ = scene
    first, second = views
    alone = see_table(first.pixels, first.camera, parts).objects[0].answer
    both = see_table(first.pixels, first.camera, parts, others=[second])
    assert len(both.objects) == 1  # both regions show it
    best = both.objects[0].answer.best
    assert best.part == parts[0].name
    assert best.probability >= alone.best.probability
    squared, middle = error_of(parts[0], T, best)
    assert squared < 30
    assert middle < 5e-4
    (drawn,) = both.others
    there = SE3.inverse(second.camera.T_world_camera) @ best.T_world_part
    np.testing.assert_allclose(drawn.objects[0].modes[0].T_camera_part, there, atol=1e-9)


@pytest.fixture(scope="module")
def floating(scene):
    """A floating part, three images by a camera on a hand with an error of the mounting, and that mounting."""
    part = scene[0][0]
    T = SE3.from_parts(SO3.exp(np.array([0.4, -0.5, 0.3])), np.array([0.4, 0.1, 0.3]))
    spread = np.diag(np.repeat(np.square([5e-4, np.radians(0.05)]), 3))
    mounting = Mounting(SE3.exp(np.array([0.03, 0.0, 0.05, 0.0, 0.0, 0.7])), spread)
    error = np.repeat([5e-4, np.radians(0.05)], 3) * np.array([1.0, -1, 0.5, 0.5, -0.5, 1])
    return part, T, hand_views(part, T, mounting, error, np.random.default_rng(1)), mounting


@pytest.mark.slow
def test_a_hand_eye_error_is_one_of_all_views(scene, floating):
    part, T, views, _ = floating
    first, *others = views
    answer = see(first.pixels, first.camera, scene[0], others=others, on_table=False).objects[0].answer
    assert answer.status == "recognized"
    squared, middle = error_of(part, T, answer.best)
    assert squared < 30
    assert middle < 5e-4
    # as errors of each image they would partly cancel; without them the views contradict each other
    exact = [replace(view, camera=replace(view.camera, mounting=None)) for view in views]
    alone = see(exact[0].pixels, exact[0].camera, [part], others=exact[1:], on_table=False).objects[0].answer.best
    assert np.linalg.slogdet(alone.covariance)[1] < np.linalg.slogdet(answer.best.covariance)[1]


def test_a_wide_search_keeps_the_errors_of_cameras(scene):
    """With exact cameras, images by a mounting that is 3 mm and 0.3 degrees off contradict one another."""
    part, T = scene[0][0], SE3.from_parts(SO3.exp(np.array([0.4, -0.5, 0.3])), np.array([0.4, 0.1, 0.3]))
    sds = np.repeat([2e-3, np.radians(0.2)], 3)
    mounting = Mounting(SE3.exp(np.array([0.03, 0.0, 0.05, 0.0, 0.0, 0.7])), np.diag(sds**2))
    error = 1.5 * np.array([1.0, -1, 0.5, 0.5, -0.5, 1])
    views = hand_views(part, T, mounting, sds * error, np.random.default_rng(1))
    points = [find_edges(view.pixels) for view in views]
    factors = tuple(
        ImageEdges(view.camera, map_edges(edges), chance_hits(edges), proposed={part: T[None]})
        for view, edges in zip(views, points, strict=True)
    )
    problem = Problem(ContactPoints.none(), FreeRays.none(), sized(Priors(), part.radius), pose_factors=factors)
    known, wide = (start_search(problem, prepare(part), np.random.default_rng(0)) for _ in range(2))
    z = np.zeros((1, problem.states))
    z[0, -6:] = error  # the errors of the mounting are the last
    known.peaks = known.objective.maximize(T[None], z, fine=True)
    before = weigh(problem, [known], np.zeros(1), -np.inf, np.random.default_rng(0))
    search_widely(wide, before)
    assert wide.peaks.evidence.max() > known.peaks.evidence.max() - 1.0
    best = wide.peaks.Ts[np.argmax(wide.peaks.evidence)]
    assert np.linalg.norm(SE3.apply(best, part.centroid) - SE3.apply(T, part.centroid)) < 5e-4


@pytest.mark.slow
def test_views_of_one_mounting_have_its_states_once(scene, floating):
    part, T, views, mounting = floating
    points = SE3.apply(T, np.array(part.corners.points)[:4])
    factors = view_factors(views, points, [part], sized(Priors(), part.radius))
    problem = Problem(ContactPoints.none(), FreeRays.none(), sized(Priors(), part.radius), pose_factors=factors)
    assert problem.shared_errors == 3 * 3 + 6  # a shift by the lens and a response curve in each image, one mounting
    other = replace(views[1], camera=replace(views[1].camera, mounting=replace_mounting(mounting)))
    factors = view_factors([views[0], other], points, [part], sized(Priors(), part.radius))
    problem = Problem(ContactPoints.none(), FreeRays.none(), sized(Priors(), part.radius), pose_factors=factors)
    assert problem.shared_errors == 2 * 3 + 2 * 6


def replace_mounting(mounting):
    """Return another mounting with the same numbers."""
    return Mounting(mounting.T_hand_camera, mounting.covariance)


def test_the_mounting_moves_edges_as_its_derivative(floating):
    part, T, views, _ = floating
    moved = T @ SE3.exp(np.array([2e-5, 1e-5, -1e-5, 1e-4, 0, 2e-4]))
    (factor,) = view_factors([views[0]], SE3.apply(T, np.array(part.corners.points)[:4]), [part], sized(Priors(), 0.1))
    term, own, step = factor.term(part, 0, factor.states), factor.states, 1e-4
    z = np.full((1, own + 6), 0.1)
    _, gradient, _ = _core.term_slopes(term, moved[None], z, part.centroid)

    def log(k, sign):
        return sums_of([factor], part, moved[None], z + sign * step * (np.arange(own + 6) == k))[0].log[0]

    differences = [(log(k, 1) - log(k, -1)) / (2 * step) for k in range(own, own + 6)]
    np.testing.assert_allclose(gradient[0, 6 + own :], differences, rtol=2e-2, atol=2e-2)


def test_several_views_need_the_poses_of_cameras(floating):
    part, _, views, _ = floating
    nowhere = replace(views[0].camera, T_world_camera=None)
    with pytest.raises(InputError, match="pose of each camera"):
        see(views[0].pixels, nowhere, [part], others=views[1:])


@pytest.mark.slow
def test_a_further_view_keeps_earlier_proposals(scene):
    parts, _, views, _ = scene
    table, T_world_table = TableErrors(), np.eye(4)
    first, second = (shot_of(view, parts, T_world_table, table) for view in views)
    see_shots([first], parts, T_world_table=T_world_table, table=table)
    kept = dict(first.proposed)
    sight = see_shots([first, second], parts, T_world_table=T_world_table, table=table)
    assert len(kept) > 0
    assert {key: id(one) for key, one in first.proposed.items()} == {key: id(one) for key, one in kept.items()}
    anew = see_table(views[0].pixels, views[0].camera, parts, others=views[1:])
    assert [len(one.answer.hypotheses) for one in sight.objects] == [len(one.answer.hypotheses) for one in anew.objects]
    for one, other in zip(sight.objects, anew.objects, strict=True):
        for own, same in zip(one.answer.hypotheses, other.answer.hypotheses, strict=True):
            assert (own.part, own.probability) == (same.part, same.probability)
