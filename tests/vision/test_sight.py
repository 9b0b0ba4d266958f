"""Whole images: what lies there, where, how sure; nothing invented about what is hidden or unknown."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from rendered import rendered_slab, table_camera
from tanteo.errors import InputError, MissingExtraError
from tanteo.geometry import SE3, SO3
from tanteo.io import read_camera, read_image, read_marks
from tanteo.parts import read_part
from tanteo.posterior import Priors
from tanteo.render import draw_sight
from tanteo.render.image_picture import FOUND
from tanteo.vision import Camera, View, find_edges, prepare_vision, see_table
from tanteo.vision.answers import deciding_touch, heights, judged
from tanteo.vision.candidates import candidates_in
from tanteo.vision.edges import map_edges
from tanteo.vision.fit import meet, refine
from tanteo.vision.image_edges import Weights
from tanteo.vision.posterior import ImagePosterior
from tanteo.vision.regions import find_regions
from tanteo.vision.rendering import Appearance, Stage, render, rendered_part
from tanteo.vision.sight import shot_of
from tanteo.vision.solid import proposed_anywhere, see_anywhere
from tanteo.vision.table import TableErrors, fit_camera
from tanteo.words import message_of
from vision_scenes import random_shot

EXAMPLES = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def models():
    names = ("bracket_left", "bracket_right", "step_12mm", "step_15mm", "clamp")
    return [prepare_vision(read_part(EXAMPLES / f"{name}.step")) for name in names]


def lay_down(model, k, x, y, yaw):
    turned = SE3.from_parts(SO3.axis_rotation(2, yaw), np.array([x, y, 0.0]))
    return turned @ model.rests[k].T_table_part


@pytest.fixture(scope="module")
def two(models):
    """Two parts on a table, far apart."""
    camera = table_camera()
    poses = [lay_down(models[0], 0, -0.08, 0.05, 0.6), lay_down(models[4], 1, 0.08, -0.04, -1.0)]
    slabs = [rendered_part(models[0].part, poses[0], 110), rendered_part(models[4].part, poses[1], 130)]
    image, whose = render(Stage(camera, slabs), np.random.default_rng(2))
    return image, camera, poses, whose


def test_every_part_of_a_scene_is_recognized(two, models):
    image, camera, poses, _ = two
    sight = see_table(image, camera, models)
    assert len(sight.objects) == 2
    by_part = {seen.answer.hypotheses[0].part: seen for seen in sight.objects}
    for model, truth in ((models[0], poses[0]), (models[4], poses[1])):
        seen = by_part[model.part.name]
        best = seen.answer.hypotheses[0]
        assert seen.answer.status == "recognized"
        assert best.probability > 0.95
        e = SE3.log(SE3.inverse(truth) @ best.T_world_part)
        assert np.linalg.norm(e[:3]) < 1e-3
        assert e @ np.linalg.solve(best.covariance, e) < 30
        total = sum(h.probability for h in seen.answer.hypotheses) + seen.answer.unknown_probability
        assert total <= 1 + 1e-9
        assert seen.outline is not None
        assert seen.outline["area"] > 0


def test_an_error_of_the_camera_is_not_one_of_the_table(two, models):
    """The part is on the table at its own height, however uncertain the pose of the camera is."""
    image, camera, _, _ = two
    unsure = replace(camera, covariance=np.diag([1e-3, 1e-3, 1e-3, 1e-4, 1e-4, 1e-4]) ** 2)
    best = see_table(image, unsure, models[:1], table=TableErrors(height=1e-4)).objects[0].answer.hypotheses[0]
    R = best.T_world_part[:3, :3]
    assert np.sqrt((R @ best.covariance[:3, :3] @ R.T)[2, 2]) < 4e-4


@pytest.mark.slow
def test_the_same_image_gives_the_same_answer(two, models):
    image, camera, _, _ = two
    first, second = (see_table(image, camera, models[:2]) for _ in range(2))
    for a, b in zip(first.objects, second.objects, strict=True):
        assert a.answer.unknown_probability == b.answer.unknown_probability
        for one, other in zip(a.answer.hypotheses, b.answer.hypotheses, strict=True):
            assert np.array_equal(one.T_world_part, other.T_world_part)


def test_regions_are_the_objects_and_their_shadows(two):
    image, _, _, whose = two
    regions = find_regions(image, find_edges(image))
    for k in (0, 1):
        covers = [(region.mask & (whose == k)).sum() / (whose == k).sum() for region in regions]
        assert max(covers) > 0.99
    assert not any(region.cut for region in regions)


def test_an_empty_table_shows_nothing(models):
    rng = np.random.default_rng(3)
    camera = table_camera()
    y, x = np.mgrid[0:480, 0:640]
    image = np.rint(180 + 0.03 * x - 0.02 * y + rng.normal(0, 2.0, (480, 640)))
    assert see_table(image, camera, models).objects == ()


@pytest.mark.slow
def test_an_unknown_object_does_not_get_a_part_s_name(models):
    shots = [random_shot(models, np.random.default_rng([4, k]), 0.0, models[4]) for k in range(4)]
    called = [see_table(shot.image, shot.camera, models[:4]).objects[0].answer for shot in shots]
    assert sum(answer.status == "recognized" for answer in called) == 0
    # more so than before the image was seen
    assert np.mean([answer.unknown_probability for answer in called]) > 2 * Priors().unknown


def test_the_question_is_where_two_answers_differ(models):
    twelve, fifteen = models[2], models[3]
    T12, T15 = lay_down(twelve, 0, 0, 0, 0), lay_down(fifteen, 0, 0, 0, 0)
    answers = ("step_12mm", twelve.frame.surface, T12), ("step_15mm", fifteen.frame.surface, T15)
    question = deciding_touch(*answers, np.eye(4))
    place = question.point[None, :2]
    found = [heights(m.frame.surface, T, place)[0] for m, T in ((twelve, T12), (fifteen, T15))]
    assert question.heights == pytest.approx(found)
    assert abs(found[0] - found[1]) > 1e-3
    assert "step_12mm" in question.words
    assert deciding_touch(("a", twelve.frame.surface, T12), ("b", twelve.frame.surface, T12), np.eye(4)) is None


def test_the_offset_s_derivative_is_one(two, models):
    image, camera, poses, _ = two
    edges, frame = map_edges(find_edges(image)), models[0].frame
    T = SE3.inverse(camera.T_world_camera) @ poses[0]
    hits = meet(frame, camera, edges, T, 2.5)
    seen, h, checked = hits.seen, 1e-6, 0
    for k, e in enumerate(h * np.eye(6)):
        plus, minus = (meet(frame, camera, edges, T @ SE3.exp(s * e), 2.5, seen) for s in (1, -1))
        # the same edge point, measured from a sample that has moved: along the sample's own normal, which turns too
        same = hits.hits & (plus.points == hits.points) & (minus.points == hits.points)
        moved = np.sum((plus.pixels - minus.pixels) * hits.normals, axis=-1) / (2 * h)
        assert hits.jacobian[same, k] == pytest.approx(moved[same], rel=1e-4, abs=0.05)
        checked += int(same.sum())
    assert checked > 300


def test_poses_come_in_from_about_ten_pixels(two, models):
    image, camera, poses, _ = two
    rng, edges = np.random.default_rng(5), map_edges(find_edges(image))
    truth = SE3.inverse(camera.T_world_camera) @ poses[0]
    moves = rng.normal(size=(30, 6)) * np.r_[np.full(3, 2e-3), np.full(3, 0.025)]
    found = refine(models[0].frame, camera, edges, truth @ SE3.exp(moves))
    off = np.linalg.norm(SE3.log(SE3.inverse(truth) @ found)[:, :3], axis=1)
    assert np.mean(off < 2e-3) > 0.8


def test_a_part_in_the_air_is_found_without_a_table(models):
    camera = Camera(table_camera().K, (640, 480))
    rng = np.random.default_rng(6)
    model = models[0]
    R = SO3.exp(np.array([2.3, -0.6, 0.4]))
    truth = SE3.from_parts(R, np.array([0.02, -0.01, 0.55]) - R @ model.part.centroid)
    above = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 5.0], [0, 0, 0, 1]])
    far = Camera(camera.K, camera.size, T_world_camera=above)
    scene = Stage(far, [rendered_part(model.part, far.T_world_camera @ truth, 120)], Appearance(light=(0.3, -0.5, 1.0)))
    image, _ = render(scene, rng)
    sight = see_anywhere(image, camera, [model])
    best = sight.objects[0].answer.hypotheses[0]
    e = SE3.log(SE3.inverse(truth) @ best.T_world_part)
    assert np.degrees(np.linalg.norm(e[3:])) < 1.0
    assert np.linalg.norm(best.T_world_part[:3, 3] - truth[:3, 3]) < 4e-3
    assert e @ np.linalg.solve(best.covariance, e) < 40


# half of the edges are hidden, and other poses hide fewer; most edges are a few grey levels
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "camera_at", "part_at", "paint", "table"),
    [
        ("t_slot", "1.613 -0.036 -0.805 -0.119 -2.859 0.781", "0.174 0.266 0.512 0.701 1.141 -0.217", 150, 132),
        ("wedge", "1.474 -0.815 -0.556 -1.942 -2.083 0.397", "0.406 -0.293 0.364 0.052 0.315 1.352", 141, 116),
    ],
)
def test_weak_and_hidden_edges_leave_the_pose_proposed(name, camera_at, part_at, paint, table):
    K = np.array([[1000.0, 0, 399.5], [0, 1000.0, 299.5], [0, 0, 1]])
    part, T = read_part(EXAMPLES / f"{name}.step"), SE3.exp(np.fromstring(part_at, sep=" "))
    camera = Camera(K, (800, 600), T_world_camera=SE3.exp(np.fromstring(camera_at, sep=" ")))
    scene = Stage(camera, [rendered_part(part, T, paint)], Appearance(table=table))
    image, _ = render(scene, np.random.default_rng(1))
    best = see_anywhere(image, camera, [part]).objects[0].answer.best
    gaps = SE3.inverse(T @ part.symmetry.Ts) @ best.T_world_part
    nearest = gaps[np.argmin(np.linalg.norm(SE3.log(gaps)[:, 3:], axis=1))]
    assert np.linalg.norm(SE3.log(nearest)[3:]) < 0.05
    assert np.linalg.norm(SE3.apply(nearest, part.centroid) - part.centroid) < 5e-3


def test_a_pose_is_proposed_beside_a_local_maximum():
    # the pose of the twin plate differs in depth and tilt from one at which nearly as many edges match
    folder = EXAMPLES.parent / "images"
    image, camera = read_image(folder / "twins.png"), read_camera(folder / "camera.yaml")
    posed = fit_camera(camera, *read_marks(folder / "marks.csv"))
    row = next(r for r in csv.DictReader((folder / "truth.csv").read_text().splitlines()) if r["image"] == "twins")
    R = SO3.from_quaternion(np.array([float(row[key]) for key in ("qw", "qx", "qy", "qz")]))
    T = SE3.from_parts(R, 1e-3 * np.array([float(row[f"{axis}_mm"]) for axis in "xyz"]))
    part = read_part(EXAMPLES / f"{row['part']}.step")
    edges = [find_edges(image)]
    _, ((_, Ts),), _ = proposed_anywhere([View(image, camera)], edges, [prepare_vision(part)], Weights())
    middle = SE3.apply(SE3.inverse(posed.T_world_camera) @ T, part.centroid)
    assert np.linalg.norm(SE3.apply(Ts, part.centroid) - middle, axis=1).min() < 2e-3


def test_texture_makes_few_regions(models):
    image = np.full((480, 640), 120.0)
    for row in range(200, 300, 30):
        for column in range(260, 400, 30):  # twenty squares, four of which are around each
            image[row : row + 14, column : column + 14] = 170.0
    image = cv2.GaussianBlur(image, (0, 0), 0.8) + np.random.default_rng(1).normal(0, 1.5, image.shape)
    assert 0 < len(shot_of(View(image, table_camera()), models, np.eye(4), TableErrors()).regions) <= 8


def test_an_object_that_no_part_resembles_has_no_hypothesis(models):
    camera = table_camera()
    turns = 2 * np.pi * (np.arange(5) + 0.5) / 5
    slab = rendered_slab(0.03 * np.stack([np.cos(turns), np.sin(turns)], axis=1), 0.01, np.eye(4), 60.0)
    image, _ = render(Stage(camera, [slab]), np.random.default_rng(2))
    (seen,) = see_table(image, camera, models[:1]).objects
    assert seen.answer.status == "unknown"
    assert seen.answer.hypotheses == ()
    assert seen.answer.unknown_probability > 0.5


def test_an_image_of_noise_shows_no_part(models):
    image = np.random.default_rng(7).normal(120, 5, (480, 640))
    sight = see_anywhere(image, Camera(table_camera().K, (640, 480)), models[:1])
    assert not sight.objects or sight.objects[0].answer.status != "recognized"


@pytest.mark.slow
def test_the_picture_shows_what_was_seen(two, models):
    image, camera, _, _ = two
    sight = see_table(image, camera, models[:1])
    picture = draw_sight(image, camera, sight)
    assert picture.shape == (1000, 1280, 3)
    assert (picture[960:] == 255).all(axis=2).mean() > 0.8, "a legend below the image"
    picture = picture[:960]
    grey = np.repeat(cv2.resize(image.astype(np.uint8), None, fx=2, fy=2)[..., None], 3, axis=2)
    changed = (picture.astype(int) - grey != 0).any(axis=2)
    assert 0.002 < changed.mean() < 0.1


def test_the_picture_has_no_part_in_an_unknown_object(two, models):
    image, camera, _, _ = two
    sight = see_table(image, camera, models[:1])
    seen = sight.objects[0]
    answer = replace(seen.answer, status="unknown", findings=(), hypotheses=())
    unlikely = replace(seen, modes=(replace(seen.modes[0], probability=1e-3),), answer=answer)
    known, unknown = (draw_sight(image, camera, replace(sight, objects=(one,)))[:960] for one in (seen, unlikely))
    found = [(picture == FOUND).all(axis=2).sum() for picture in (known, unknown)]
    assert found[0] > 100
    assert found[1] == 0


def test_the_picture_names_part_with_its_probability_in_any_pose(two, models, monkeypatch):
    image, camera, _, _ = two
    sight = see_table(image, camera, models[:1])
    seen = sight.objects[0]
    best = seen.answer.hypotheses[0]
    halves = tuple(replace(best, probability=p) for p in (0.5, 0.25))
    sight = replace(sight, objects=(replace(seen, answer=replace(seen.answer, hypotheses=halves)),))
    rejected = []
    monkeypatch.setattr(
        "tanteo.render.image_picture._put_outlined", lambda picture, text, at, size: rejected.append(text)
    )
    draw_sight(image, camera, sight)
    assert f"{best.part} 75.0 %" in rejected


def test_what_does_not_fit_together_is_refused(two, models):
    image, camera, _, _ = two
    with pytest.raises(InputError, match="at least one part"):
        see_table(image, camera, [])
    with pytest.raises(InputError, match="640 columns"):
        see_table(image[:-1], camera, models[:1])
    with pytest.raises(InputError, match="expected its pose"):
        see_table(image, Camera(camera.K, camera.size), models[:1])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda T: np.diag([1.0, 1, -1, 1]) @ T @ np.diag([1.0, 1, -1, 1]), "below"),
        (lambda T: np.block([[T[:3, :3], 1e3 * T[:3, 3:]], [np.zeros((1, 3)), 1]]), "another unit"),
        (lambda T: T @ SE3.from_parts(SO3.exp(np.array([np.pi, 0, 0])), np.zeros(3)), "points away"),
    ],
)
def test_a_camera_that_cannot_stand_there_is_refused(two, models, change, words):
    image, camera, _, _ = two
    with pytest.raises(InputError, match=words):
        see_table(image, replace(camera, T_world_camera=change(camera.T_world_camera)), models[:1])


@pytest.fixture(scope="module")
def anywhere(two, models):
    """The same image without the table."""
    image, camera, _, _ = two
    return see_anywhere(image, camera, models[:1])


@pytest.mark.slow
def test_poses_are_in_the_camera_frame_without_its_place(two, models, anywhere):
    image, camera, _, _ = two
    assert see_table(image, camera, models[:1]).frame == "world"
    assert anywhere.frame == "world"
    assert see_anywhere(image, Camera(camera.K, camera.size), models[:1]).frame == "camera"


@pytest.mark.slow
@pytest.mark.parametrize(("p_value", "rejected"), [(0.5, False), (1e-9, True)])
def test_badly_fitting_edges_are_reported(anywhere, p_value, rejected):
    best = anywhere.objects[0].answer.hypotheses[0]
    findings = judged([replace(best, p_value=p_value, probability=0.99)], ImagePosterior((), 0.01))[1]
    assert ("The edges fit badly" in message_of(findings)) == rejected


def test_without_opencv_the_message_names_the_package(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "cv2", None)
    with pytest.raises(MissingExtraError, match=r"pip install -e '\.\[vision\]'"):
        find_edges(np.zeros((40, 40)))


@pytest.mark.slow
def test_a_part_is_proposed_beyond_what_differs_from_the_table():
    """Faces as bright as a woven table are in no region; only the part's dark sides and its shadow are."""
    post, step = (prepare_vision(read_part(EXAMPLES / f"{name}.step")) for name in ("square_post", "step_15mm"))
    camera, T = table_camera(), lay_down(post, 1, 0.02, 0.01, 2.2)
    light = Appearance((0.5, 0.2, 1.0), 0.5, 150, (0, 0), 0.7, 2.0)
    image, whose = render(Stage(camera, [rendered_part(post.part, T, 155)], light), np.random.default_rng(2))
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    weave = 12 * (np.sin(0.45 * x + 0.1 * y) + np.sin(0.45 * y - 0.1 * x))
    sight = see_table(np.clip(np.rint(image + np.where(whose < 0, weave, 0)), 0, 255), camera, [post, step])
    best = sight.objects[0].answer.hypotheses[0]
    assert best.part == "square_post"
    assert SE3.apply(best.T_world_part, post.part.centroid) == pytest.approx(SE3.apply(T, post.part.centroid), abs=1e-3)


def test_regions_beside_which_no_edge_is_rare_are_not_searched(models):
    model, camera = models[0], table_camera()
    stage = Stage(camera, [rendered_part(model.part, lay_down(model, 0, 0.02, 0.01, 0.6), 120)])
    image, _ = render(stage, np.random.default_rng(2))
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    stains = sum(np.exp(-0.5 * ((x - at) ** 2 + (y - 60) ** 2) / 30**2) for at in (80, 240, 560))
    image = np.rint(image - 30 * stains)
    assert len(find_regions(image, find_edges(image))) == 4
    assert len(shot_of(View(image, camera), models, np.eye(4), TableErrors()).regions) == 1


def test_edges_of_a_recognized_part_are_not_searched_again(models, monkeypatch):
    """Two dark sides of a part as bright as the table are two regions; the first shows the whole part."""
    clamp, camera, searched = models[4], table_camera(), []
    stage = Stage(
        camera,
        [rendered_part(clamp.part, lay_down(clamp, 1, 0.02, 0.01, 1.0), 151)],
        Appearance((0.5, 0.2, 1.0), 0.5, 150, (0, 0), 0.7, 2.0),
    )
    image, _ = render(stage, np.random.default_rng(2))
    assert len(shot_of(View(image, camera), [clamp], np.eye(4), TableErrors()).regions) == 2
    monkeypatch.setattr("tanteo.vision.shots.candidates_in", lambda *a: (searched.append(a), candidates_in(*a))[1])
    (seen,) = see_table(image, camera, [clamp]).objects
    assert seen.answer.status == "recognized"
    assert len(searched) == 1
