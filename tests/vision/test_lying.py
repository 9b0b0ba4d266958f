"""The pose of a part on the table where edges meet at several poses that are near each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.lie import SE3
from tanteo.vision import TableErrors, find_regions, map_edges
from tanteo.vision.candidates import PoseCandidates, _with_best, evidence_at, own_edges, poses_beside
from tanteo.vision.evidence import Evidence, Weights, chance_hits, log_weight
from tanteo.vision.fit import beside, pixel_length, refine
from tanteo.vision.posterior import ImageMode, mixed, settle_lying
from tanteo.vision.settle import Settled, settle
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
    for name in ("normals", "sds", "drifts", "contrasts"):
        values = getattr(points, name)
        out[name] = np.concatenate([values, values[moved]])
    return map_edges(replace(points, **out)), way


def squared_error(settled, T):
    e = SE3.log(SE3.inverse(settled.T_camera_part) @ T)
    return float(e @ settled.information @ e)


def test_a_pose_that_is_one_of_two_is_told_with_both(scene):
    """Every edge across one direction has a copy: the part may as well lie there, and nothing tells which."""
    model, camera, image, points, T, T_camera_table = scene
    length = pixel_length(camera, T, model.part.centroid)
    edges, way = with_copies(camera, points, T, T_camera_table, length, 1.0)
    region = max(find_regions(image, points), key=lambda region: region.mask.sum())
    found = {}
    for name, start in (("truth", T), ("copy", SE3.from_parts(np.eye(3), way) @ T)):
        mode = ImageMode(model, 0, start, 0.0, 1.0)
        found[name] = settle_lying(mode, camera, edges, region, T_camera_table, TableErrors(), Weights())
        assert squared_error(found[name], T) < chi2.ppf(0.999, 6)
    # settled by itself the copy is as sure of itself as the truth
    alone = settle(model, camera, edges, SE3.from_parts(np.eye(3), way) @ T)
    assert squared_error(alone, T) > 100 * chi2.ppf(0.999, 6)
    sds = [np.sqrt(np.diag(np.linalg.inv(each.information)))[:3].max() for each in found.values()]
    print(np.array(sds) / (SHIFT * length))
    assert all(0.1 < sd / (SHIFT * length) < 0.8 for sd in sds)


def test_a_better_pose_beside_is_found(scene):
    """Some edges have a copy: from the pose at the copies that of all edges is found, and it weighs more."""
    model, camera, image, points, T, T_camera_table = scene
    length = pixel_length(camera, T, model.part.centroid)
    edges, way = with_copies(camera, points, T, T_camera_table, length, 0.5)
    region = max(find_regions(image, points), key=lambda region: region.mask.sum())
    wrong = SE3.from_parts(np.eye(3), way) @ T
    Ts = poses_beside(model, 0, camera, T_camera_table, edges, wrong, TableErrors())
    chance = chance_hits(edges.points, own_edges(region, edges))
    log = log_weight(evidence_at(model, camera, edges, Ts, region, chance), Weights())
    off = np.linalg.norm(SE3.apply(Ts, model.part.centroid) - SE3.apply(T, model.part.centroid), axis=-1) / length
    print(off, log)
    assert off[np.argmax(log)] < 0.3
    # those that are one were told once
    gaps = np.linalg.norm(Ts[:, None, :3, 3] - Ts[:, :3, 3], axis=-1)[np.triu_indices(len(Ts), 1)]
    assert len(Ts) < 9
    assert np.all(gaps > 0)


@pytest.mark.parametrize(("hits", "taken"), [((4.0, 6.0), None), ((4.0, 9.0), 1)])
def test_a_pose_beside_is_taken_only_if_it_weighs_more(scene, hits, taken):
    own = Evidence(np.array([1.0, 7.0]), np.zeros(2), np.zeros(2))
    here = PoseCandidates(scene[0], np.stack([np.eye(4)] * 2), np.zeros(2, dtype=np.int64), np.zeros(2), own)
    Ts = np.stack([SE3.exp(np.r_[x, np.zeros(5)]) for x in (0.1, 0.2)])
    found = _with_best(here, 1, Ts, Evidence(np.array(hits), np.zeros(2), np.zeros(2)), Weights())
    assert found.evidence.hits.tolist() == [1.0, 7.0 if taken is None else hits[taken]]
    np.testing.assert_array_equal(found.T_camera_part[1], np.eye(4) if taken is None else Ts[taken])
    np.testing.assert_array_equal(found.T_camera_part[0], np.eye(4))


def settled_at(model, move, sds):
    """A pose moved by so much in the part's frame, with independent errors."""
    xi = np.r_[move, 0.0, 0.0, 0.0]
    return Settled(SE3.exp(xi), np.diag(1 / np.square(sds)), 1.0, 10.0, None)


def test_the_mixture_has_the_moments_of_its_poses(scene):
    model = scene[0]
    sds = np.r_[1e-4, 2e-4, 1e-4, 1e-3, 1e-3, 1e-3]
    poses = [settled_at(model, [0.0, 0.0, 0.0], sds), settled_at(model, [2e-3, 0.0, 0.0], 2 * sds)]
    both = mixed(model, poses, np.array([np.log(3), 0.0]), 1.0)  # the larger volume of the second counts for nothing
    np.testing.assert_allclose(both.T_camera_part[:3, 3], [5e-4, 0, 0], atol=1e-6)
    covariance = np.linalg.inv(both.information)
    expected = np.diag((0.75 + 0.25 * 4) * sds**2) + np.diag(np.r_[0.75 * 0.25 * 4e-6, np.zeros(5)])
    sd = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(covariance / np.outer(sd, sd), np.eye(6), atol=5e-3)


def test_one_pose_found_twice_counts_once(scene):
    model = scene[0]
    sds = np.r_[1e-4, 2e-4, 1e-4, 1e-3, 1e-3, 1e-3]
    pose = settled_at(model, [0.0, 0.0, 0.0], sds)
    other = settled_at(model, [1e-3, 0.0, 0.0], sds)
    once = mixed(model, [pose, other], np.zeros(2), 1.0)
    twice = mixed(model, [pose, other, settled_at(model, [1e-5, 0.0, 0.0], sds)], np.array([0.0, 0.0, -0.1]), 1.0)
    np.testing.assert_allclose(twice.T_camera_part, once.T_camera_part, atol=1e-12)


def test_a_pose_beside_leaves_no_more_open_than_about_it(scene):
    """Only the best pose may leave a direction open: others stand for what is near them."""
    model, width = scene[0], 1e-3
    sharp = np.r_[1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3]
    loose = np.where(np.arange(6) == 1, 10.0, sharp)
    poses = [settled_at(model, [0.0, 0.0, 0.0], sharp), settled_at(model, [1e-3, 0.0, 0.0], loose)]
    sd = np.sqrt(np.linalg.inv(mixed(model, poses, np.array([5.0, 0.0]), width).information)[1, 1])
    assert 1e-4 < sd < width
    alone = np.sqrt(np.linalg.inv(mixed(model, poses, np.array([-20.0, 0.0]), width).information)[1, 1])
    assert alone > model.part.diagonal


def test_starts_beside_are_so_many_pixels_off_on_the_table(scene):
    model, camera, _, _, T, T_camera_table = scene
    Ts = beside(camera, T, T_camera_table, model.part.centroid)
    moves = SE3.apply(Ts, model.part.centroid) - SE3.apply(T, model.part.centroid)
    np.testing.assert_allclose(moves @ T_camera_table[:3, 2], 0.0, atol=1e-12)
    lengths = np.linalg.norm(moves, axis=1) / pixel_length(camera, T, model.part.centroid)
    np.testing.assert_allclose(lengths, np.r_[0.0, np.full(8, 1.5)], atol=1e-9)


def test_the_prior_holds_a_refinement_to_where_it_is_told(scene):
    model, camera, _, points, T, _ = scene
    nothing = map_edges(points, np.zeros(len(points), dtype=bool))
    moved = T @ SE3.exp(np.r_[1e-3, 0, 0, 0, 0, 0.01])
    found = refine(
        model.frame, camera, nothing, moved[None], prior=np.eye(6)[None] * 1e8, start=T[None], reaches=(2.0, 2.0)
    )
    np.testing.assert_allclose(found[0], T, atol=1e-6)
