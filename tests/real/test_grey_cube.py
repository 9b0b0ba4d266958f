"""Real grey images of a cube, ``../shared/data/grey_cube``: first pose refined, followed, and found without one."""

from __future__ import annotations

import numpy as np
import pytest

import grey_cube
from tanteo.geometry import SE3
from tanteo.vision import find_edges, prepare_vision
from tanteo.vision.camera import project
from tanteo.vision.edges import map_edges
from tanteo.vision.fit import refine
from tanteo.vision.solid import follow, see_anywhere

pytestmark = pytest.mark.skipif(not grey_cube.FOLDER.is_dir(), reason="the folder of real measurements is not there")


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return prepare_vision(grey_cube.cube(tmp_path_factory.mktemp("cube")))


@pytest.fixture(scope="module")
def first(model):
    """The published pose, refined on the first image."""
    edges = map_edges(find_edges(grey_cube.load(grey_cube.images()[0])))
    return refine(model.frame, grey_cube.camera(), edges, grey_cube.published()[None])[0]


def test_refined_corners_are_where_the_image_has_them(model, first):
    corners, measured = grey_cube.measured_corners(grey_cube.load(grey_cube.images()[0]), model, first)
    assert len(corners) >= 5
    off = project(grey_cube.camera(), SE3.apply(first, corners)) - measured
    assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 1.0


def test_the_refined_pose_is_about_the_published_one(model, first):
    """The published one was clicked: it misses the corners of the image by three pixels."""
    published = grey_cube.published()
    corners, measured = grey_cube.measured_corners(grey_cube.load(grey_cube.images()[0]), model, first)
    off = [project(grey_cube.camera(), SE3.apply(T, corners)) - measured for T in (first, published)]
    rms = [np.sqrt(np.mean(np.sum(d**2, axis=1))) for d in off]
    assert rms[0] < 0.5 * rms[1]
    assert np.degrees(np.linalg.norm(SE3.log(SE3.inverse(published) @ first)[3:])) < 2.0
    distance = np.linalg.norm(published[:3, 3])
    assert abs(np.linalg.norm(first[:3, 3]) - distance) < 0.015 * distance


@pytest.mark.slow
def test_the_cube_is_found_where_it_was_followed_to(model, first):
    names, camera, rng = grey_cube.images()[:16], grey_cube.camera(), np.random.default_rng(1)
    T, found = first, 0
    for name in names:
        image = grey_cube.load(name)
        T = follow(image, camera, model, T, rng)
        if name in names[::3]:
            seen = see_anywhere(image, camera, [model]).objects
            found += any(grey_cube.same_pose(model.part, h.T_world_part, T) for h in seen[0].answer.hypotheses)
    assert found >= 5  # of six
