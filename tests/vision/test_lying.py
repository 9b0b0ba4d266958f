"""The pose of a part on the table where edges meet at several poses that are near each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.geometry import SE3
from tanteo.posterior import OnTable
from tanteo.vision.answers import stated
from tanteo.vision.candidates import poses_beside, with_unknown
from tanteo.vision.edges import chance_hits, find_edges, map_edges
from tanteo.vision.fit import beside, pixel_length, refine
from tanteo.vision.image_edges import ImageEdges
from tanteo.vision.posterior import infer
from tanteo.vision.regions import find_regions
from tanteo.vision.sight import area_of
from tanteo.vision.table import TableErrors
from vision_scenes import bracket, seen_alone

SHIFT = 1.5
"""How far copies of edges lie beside them [px]."""


@pytest.fixture(scope="module")
def scene():
    """A bracket on a table: model, camera, picture, its edge points, pose in the camera, and the table there."""
    model = bracket()
    camera, image, edges, T = seen_alone(model, 0.6)
    return model, replace(camera, edge_sd=0.0), image, edges.points, T, SE3.inverse(camera.T_world_camera)


def with_copies(camera, points, T, T_camera_table, length, share):
    """Edge points and ``share`` of them again, as the part would show them a bit farther along the table's x."""
    way = T_camera_table[:3, 0] * SHIFT * length
    pixels = camera.focal * (T[:3, 3] + way)[:2] / (T[:3, 3] + way)[2] - camera.focal * T[:2, 3] / T[2, 3]
    across = np.abs(points.normals @ pixels)
    moved = np.flatnonzero(across > 0.3 * np.linalg.norm(pixels))
    moved = moved[np.arange(len(moved)) % 10 < 10 * share]
    out = {"pixels": np.concatenate([points.pixels, points.pixels[moved] + pixels])}
    for name in ("normals", "sds", "drifts", "responses", "contrasts", "widths"):
        values = getattr(points, name)
        out[name] = np.concatenate([values, values[moved]])
    return map_edges(replace(points, **out)), way


def factor_of(model, camera, image, edges):
    """Return the image's factor of the largest region, and the prior of the table there."""
    region = max(find_regions(image, edges.points), key=lambda region: region.mask.sum())
    T_camera_table = SE3.inverse(camera.T_world_camera)
    errors = TableErrors()
    lying = OnTable(np.eye(4), errors.height, errors.tilt, area_of(region, camera, T_camera_table))
    return region, with_unknown(ImageEdges(camera, edges, chance_hits(edges.points)), region, []), lying


def test_edges_of_an_occluder_are_no_unknown_object(scene):
    """Where something lies on the part, the part explains fewer edges, and so does an object that is like no part."""
    model, camera, image, _, T, _ = scene
    middle = camera.focal * SE3.apply(T, model.part.centroid)[:2] / SE3.apply(T, model.part.centroid)[2]
    row, column = np.indices(image.shape)
    near = np.hypot(column - middle[0] - camera.K[0, 2], row - middle[1] - camera.K[1, 2])
    logs, counts = [], []
    for pixels in (image, np.where((near < 60) & (near.astype(int) // 10 % 2 == 0), 20.0, image)):
        points = find_edges(pixels)
        chance = np.full(len(points), 0.05)
        logs.append(ImageEdges(camera, map_edges(points), chance).with_unknown(model, T).log_unknown)
        counts.append(len(points))
    assert counts[1] > 1.2 * counts[0]
    assert logs[1] < logs[0]


def test_a_pose_that_is_one_of_two_is_reported_with_both(scene):
    """Every edge across one direction has a copy: the part may as well lie there, and nothing decides it."""
    model, camera, image, points, T, T_camera_table = scene
    length = pixel_length(camera, T, model.part.centroid)
    edges, way = with_copies(camera, points, T, T_camera_table, length, 1.0)
    _, seen, lying = factor_of(model, camera, image, edges)
    Ts = np.stack([T, SE3.from_parts(np.eye(3), way) @ T])
    found = infer((seen,), [(model, camera.T_world_camera @ Ts)], 1, lying=lying)
    answers, _ = stated(found, (seen,), camera, 8, lying=True)
    assert sum(h.probability for h in answers) > 0.9
    middle = [SE3.apply(SE3.inverse(camera.T_world_camera) @ h.T_world_part, model.part.centroid) for h in answers]
    off = [np.linalg.norm(m - SE3.apply(T, model.part.centroid)) / length for m in middle]
    print(off, [h.probability for h in answers])
    assert len(answers) == 1  # both are one region, as wide as their distance
    e = SE3.log(SE3.inverse(camera.T_world_camera @ T) @ answers[0].T_world_part)
    assert e @ np.linalg.solve(answers[0].covariance, e) < chi2.ppf(0.999, 6)


def test_a_better_pose_beside_is_proposed(scene):
    """Some edges have a copy: from the pose at the copies that of all edges is found, and it is denser."""
    model, camera, image, points, T, T_camera_table = scene
    length = pixel_length(camera, T, model.part.centroid)
    edges, way = with_copies(camera, points, T, T_camera_table, length, 0.5)
    _, seen, _ = factor_of(model, camera, image, edges)
    wrong = SE3.from_parts(np.eye(3), way) @ T
    Ts = poses_beside(model, 0, seen, T_camera_table, wrong, TableErrors())
    log = seen.sums(model, Ts).there
    off = np.linalg.norm(SE3.apply(Ts, model.part.centroid) - SE3.apply(T, model.part.centroid), axis=-1) / length
    print(off, log)
    assert off[np.argmax(log)] < 0.3
    gaps = np.linalg.norm(Ts[:, None, :3, 3] - Ts[:, :3, 3], axis=-1)[np.triu_indices(len(Ts), 1)]
    assert len(Ts) < 9
    assert np.all(gaps > 0)


def test_starts_beside_are_so_many_pixels_off_on_the_table(scene):
    model, camera, _, _, T, T_camera_table = scene
    Ts = beside(camera, T, T_camera_table, model.part.centroid)
    moves = SE3.apply(Ts, model.part.centroid) - SE3.apply(T, model.part.centroid)
    np.testing.assert_allclose(moves @ T_camera_table[:3, 2], 0.0, atol=1e-12)
    lengths = np.linalg.norm(moves, axis=1) / pixel_length(camera, T, model.part.centroid)
    np.testing.assert_allclose(lengths, np.r_[0.0, np.full(8, 1.5)], atol=1e-9)


def test_the_prior_keeps_a_refinement_at_its_stated_pose(scene):
    model, camera, _, points, T, _ = scene
    nothing = map_edges(points, np.zeros(len(points), dtype=bool))
    moved = T @ SE3.exp(np.r_[1e-3, 0, 0, 0, 0, 0.01])
    found = refine(
        model.frame, camera, nothing, moved[None], prior=np.eye(6)[None] * 1e8, start=T[None], reaches=(2.0, 2.0)
    )
    np.testing.assert_allclose(found[0], T, atol=1e-6)
