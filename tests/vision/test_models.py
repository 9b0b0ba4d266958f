"""Parts made ready for the camera: stable poses, visible edges, silhouettes."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from random_parts import random_part, write_off
from tanteo.catalogue import known_stable_poses, read_parts, stable_poses
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.vision import Camera, prepare_vision
from tanteo.vision.edges import chance_hits
from tanteo.vision.image_edges import ImageEdges
from tanteo.vision.models import lay
from tanteo.vision.regions import silhouette
from tanteo.vision.wireframe import see_edges, wireframe
from vision_scenes import PARTS, seen_alone

CAMERA = Camera(np.array([[620.0, 0, 320.0], [0, 620.0, 240.0], [0, 0, 1]]), (640, 480))
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
BOX = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])


def block(folder, a, b, c):
    corners = np.array([[x, y, z] for x in (0, a) for y in (0, b) for z in (0, c)], dtype=float)
    write_off(folder / "block.off", corners, BOX)
    return read_part(folder / "block.off", unit="mm")


def test_a_block_lies_in_three_ways(tmp_path):
    found = stable_poses(block(tmp_path, 90, 50, 20))
    assert [round(1e3 * rest.height) for rest in found] == [20, 50, 90]
    assert sum(rest.probability for rest in found) == pytest.approx(1)
    assert found[0].probability > found[1].probability > found[2].probability


def test_a_cube_lies_in_one(tmp_path):
    assert len(stable_poses(block(tmp_path, 40, 40, 40))) == 1


@pytest.mark.parametrize("seed", range(6))
def test_what_lies_lies_stably(tmp_path, seed):
    part = random_part(tmp_path / "part.off", np.random.default_rng(seed))
    for rest in stable_poses(part):
        lying = SE3.apply(rest.T_table_part, part.vertices)
        assert lying[:, 2].min() == pytest.approx(0, abs=1e-9)
        foot = lying[lying[:, 2] < 1e-6, :2]
        centre = SE3.apply(rest.T_table_part, part.centroid)
        assert centre[:2] == pytest.approx([0, 0], abs=1e-9)
        # the middle is over the foot: no direction in which all of the foot is on one side
        for angle in np.linspace(0, 2 * np.pi, 60):
            assert (foot @ [np.cos(angle), np.sin(angle)]).max() > -1e-9


def test_a_part_is_laid_down_where_it_was(tmp_path):
    rng = np.random.default_rng(5)
    part = random_part(tmp_path / "part.off", rng)
    for rest in stable_poses(part):
        turned = SE3.from_parts(SO3.axis_rotation(2, rng.uniform(-3, 3)), np.array([*rng.normal(size=2), 0]))
        truth = turned @ rest.T_table_part
        tipped = truth @ SE3.exp(rng.normal(size=6) * np.r_[np.full(3, 1e-3), np.full(3, 0.02)])
        laid = lay(part, rest, tipped)
        assert SE3.apply(laid, part.vertices)[:, 2].min() == pytest.approx(0, abs=1e-9)
        assert np.abs(SE3.log(SE3.inverse(truth) @ laid)[3:]).max() < 0.05
        assert lay(part, rest, truth) == pytest.approx(truth, abs=1e-9)


def test_a_block_shows_nine_edges_and_six_of_them_are_rims(tmp_path):
    frame = wireframe(block(tmp_path, 90, 50, 20))
    T = SE3.from_parts(SO3.exp(np.array([2.4, 0.5, 0.3])), np.array([0.0, 0.0, 0.6]))
    for hidden in (True, False):
        seen = see_edges(frame, T, hidden=hidden)
        shown, rims = (np.unique(frame.groups[mask]) for mask in (seen.shown, seen.rims))
        assert (len(np.unique(frame.groups)), len(shown), len(rims)) == (12, 9, 6)


def test_a_step_hides_the_points_that_it_covers(tmp_path):
    part = read_part(Path(__file__).parents[2] / "examples" / "parts" / "housing.step")
    frame = wireframe(part)
    T = SE3.from_parts(SO3.exp(np.array([2.0, 0.4, 0.2])), np.array([0.0, 0.0, 0.6]))
    all_of_it, seen = see_edges(frame, T, hidden=False), see_edges(frame, T)
    assert (seen.shown <= all_of_it.shown).all()
    assert seen.shown.sum() < all_of_it.shown.sum()
    # a sample is hidden exactly where a ray to it hits the surface first
    eye = SE3.inverse(T)[:3, 3]
    inside = frame.points + 2e-4 * part.diagonal * (n := frame.normals.sum(axis=1)) / np.linalg.norm(
        n, axis=1, keepdims=True
    )
    for k in np.flatnonzero(all_of_it.shown)[::7]:
        way = inside[k] - eye
        free = frame.surface.cast(eye, way).distances > np.linalg.norm(way) - 2e-4 * part.diagonal
        assert bool(free) == bool(seen.shown[k])


def test_lengths_of_samples_add_up(tmp_path):
    part = block(tmp_path, 90, 50, 20)
    frame = wireframe(part)
    assert frame.lengths[frame.sharp].sum() == pytest.approx(4 * 0.16)
    assert not (~frame.sharp).any()


@pytest.mark.parametrize("name", ["flange", "clamp"])
def test_the_order_of_vertices_changes_no_evidence(tmp_path, name):
    rng, part = np.random.default_rng(3), read_part(PARTS / f"{name}.step")
    camera, _, edges, T = seen_alone(prepare_vision(part), 0.6)
    image, logs = ImageEdges(camera, edges, chance_hits(edges.points)), []
    for _ in range(3):
        order, rows = rng.permutation(len(part.vertices)), rng.permutation(len(part.triangles))
        write_off(tmp_path / "part.off", part.vertices[order], np.argsort(order)[part.triangles[rows]])
        model = prepare_vision(read_part(tmp_path / "part.off", unit="m"))
        logs.append(image.sums(model, T[None]).there[0])
    assert logs == pytest.approx([logs[0]] * 3, abs=1e-6)


def test_a_silhouette_covers_what_rays_meet(tmp_path):
    part = random_part(tmp_path / "part.off", np.random.default_rng(8))
    frame = wireframe(part)
    T = SE3.from_parts(SO3.exp(np.array([2.2, 0.3, 0.9])), np.array([0.0, 0.02, 0.6])) @ SE3.from_parts(
        np.eye(3), -part.centroid
    )
    mask = silhouette(frame.surface, CAMERA, T)
    x, y = np.meshgrid(np.arange(640), np.arange(480))
    rays = np.stack([(x - 320) / 620, (y - 240) / 620, np.ones(x.shape)], axis=-1)
    hits = frame.surface.cast(SE3.inverse(T)[:3, 3], rays @ T[:3, :3]).triangles >= 0
    # polygons are filled to the border, half a pixel more than rays through the middles meet
    wide, narrow = (f(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0 for f in (cv2.dilate, cv2.erode))
    assert (hits <= wide).all()
    assert (narrow <= hits).all()


def test_resting_poses_are_cached_and_found_anew_if_damaged(tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    block(tmp_path, 90, 50, 20)
    file = tmp_path / "block.off"
    first = known_stable_poses(read_parts([file], unit="mm").parts[0])
    (kept,) = (tmp_path / "cache").rglob("*.rests2")
    monkeypatch.setattr("tanteo.catalogue.stability._computed", lambda part: pytest.fail("it is in the cache"))
    again = known_stable_poses(read_parts([file], unit="mm").parts[0])
    assert [(r.probability, r.height) for r in again] == [(r.probability, r.height) for r in first]
    np.testing.assert_array_equal([r.T_table_part for r in again], [r.T_table_part for r in first])
    monkeypatch.undo()
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    whole = kept.read_bytes()
    for damaged in (whole[:-9], np.full(18, np.nan).tobytes(), b""):
        kept.write_bytes(damaged)
        found = known_stable_poses(read_parts([file], unit="mm").parts[0])
        np.testing.assert_array_equal([r.T_table_part for r in found], [r.T_table_part for r in first])
        assert kept.read_bytes() == whole
