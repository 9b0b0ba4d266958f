"""Images beside readings: several views and a few touches give one answer, sharper than either."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rendered import table_camera
from tanteo import identify
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io import read_readings
from tanteo.parts import read_part
from tanteo.posterior import Priors, sized
from tanteo.vision import View, prepare_vision, view_factors
from tanteo.vision.models import spread
from tanteo.vision.rendering import Stage, render, rendered_part
from vision_scenes import PARTS


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


def test_a_second_view_sharpens(answers):
    one, two = answers[1].best, answers[2].best
    assert one is not None
    assert np.linalg.slogdet(two.covariance)[1] < np.linalg.slogdet(one.covariance)[1]


def test_views_add_the_states_of_their_cameras(scene):
    parts, _, views, readings = scene
    known = replace(views[1], camera=replace(views[1].camera, covariance=1e-8 * np.eye(6)))
    first, second = view_factors([views[0], known], readings.points, parts, sized(Priors(), 0.1))
    assert (first.states, second.states) == (2, 8)
    assert len(first.poses(parts[0])) > 0
    assert len(second.poses(parts[0])) == 0


def test_what_cannot_be_compared_is_refused(scene):
    parts, _, views, readings = scene
    with pytest.raises(InputError, match="at most 64 parts"):
        identify(readings, parts * 30, sd=5e-5, views=views)
    nowhere = replace(views[0], camera=replace(views[0].camera, T_world_camera=None))
    with pytest.raises(InputError, match="expected its pose"):
        identify(readings, parts, sd=5e-5, views=[nowhere])
