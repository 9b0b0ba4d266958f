"""Edges and corners of an image in ``localization``: covariances by simulation, poses from partial pairings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.errors import InputError
from tanteo.features.kinds import EDGE, VERTEX
from tanteo.fitting.localization import ModelFeature, Pairing, estimate_pose, relation_between
from tanteo.geometry import SE3, SO3
from tanteo.vision import Camera
from tanteo.vision.camera import project
from tanteo.vision.features import image_corner, image_edge
from tanteo.vision.segments import Corners, Segments

CAMERA = Camera(np.array([[620.0, 0, 317.0], [0, 615.0, 243.0], [0, 0, 1]]), (640, 480), edge_sd=0.0)
T_WORLD_CAMERA = SE3.exp(np.array([0.3, -0.1, 0.8, 2.6, 0.2, -0.4]))
T_CAMERA_PART = SE3.from_parts(SO3.exp(np.array([0.7, -0.5, 0.3])), np.array([0.03, -0.02, 0.55]))
A, B, C = 0.08, 0.06, 0.04
VERTICES = np.array([[x, y, z] for x in (0, A) for y in (0, B) for z in (0, C)])
EDGES = [(0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (4, 5), (4, 6)]


def segments_of(pixels, rng=None, sd=0.2):
    """Return the model's edges as segments, with middle and direction drawn from the stated covariance."""
    ends, middles, directions, covariances = [], [], [], []
    for i, j in EDGES:
        a, b = pixels[i], pixels[j]
        length = np.linalg.norm(b - a)
        sds = np.array([sd, np.sqrt(12) * sd / length])
        P = np.outer(sds, sds) * np.array([[1.0, 0.6], [0.6, 1.0]])  # off and turned together: the ends differ in noise
        way, middle = (b - a) / length, 0.35 * a + 0.65 * b  # edge points need not be spread evenly
        if rng is not None:
            offset, turn = rng.multivariate_normal(np.zeros(2), P)
            middle = middle + offset * np.array([-way[1], way[0]])
            way = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ way
        ends.append([middle - 0.5 * length * way, middle + 0.5 * length * way])
        middles.append(middle)
        directions.append(way)
        covariances.append(P)
    n = len(EDGES)
    return Segments(*map(np.array, (ends, middles, directions, covariances)), np.full(n, 50))


def edge_model(i, j):
    d = VERTICES[j] - VERTICES[i]
    R = SO3.frame_from_axis(d / np.linalg.norm(d), 0)
    return ModelFeature(EDGE, SE3.from_parts(R, 0.5 * (VERTICES[i] + VERTICES[j])))


def test_an_exact_edge_holds_the_model_edge():
    segments = segments_of(project(CAMERA, SE3.apply(T_CAMERA_PART, VERTICES)))
    for k, (i, j) in enumerate(EDGES):
        pairing = Pairing(image_edge(CAMERA, segments, k, T_WORLD_CAMERA), edge_model(i, j))
        assert pairing.relation.name == "plane_has_edge"
        T = SE3.inverse(T_WORLD_CAMERA @ T_CAMERA_PART @ pairing.model.T_part_feature) @ pairing.sensed.T_world_feature
        f, _ = pairing.relation.linearize(T, np.zeros(()))
        assert f == pytest.approx(np.zeros(2), abs=1e-9)


def test_the_plane_s_covariance_is_the_segment_s():
    rng, runs, stats = np.random.default_rng(1), 400, []
    pixels = project(CAMERA, SE3.apply(T_CAMERA_PART, VERTICES))
    for _ in range(runs):
        segments = segments_of(pixels, rng)
        for k, (i, j) in enumerate(EDGES[:3]):
            sensed, model = image_edge(CAMERA, segments, k, T_WORLD_CAMERA), edge_model(i, j)
            T = SE3.inverse(T_WORLD_CAMERA @ T_CAMERA_PART @ model.T_part_feature) @ sensed.T_world_feature
            f, D = relation_between(sensed.kind, EDGE).linearize(T, np.zeros(()))
            G = D[:, list(sensed.kind.rows)]
            stats.append(f @ np.linalg.solve(G @ sensed.P @ G.T, f))
    low, high = chi2.ppf([0.001, 0.999], 2 * len(stats)) / len(stats)
    assert low < np.mean(stats) < high


def test_what_lens_and_calibration_add_is_in_the_covariances():
    lens, pixels = replace(CAMERA, edge_sd=0.4), project(CAMERA, SE3.apply(T_CAMERA_PART, VERTICES))
    segments = segments_of(pixels)
    wider = replace(segments, covariances=segments.covariances + np.diag([0.4, 0.0]) ** 2)
    for k in range(len(EDGES)):
        ours, same = image_edge(lens, segments, k, T_WORLD_CAMERA), image_edge(CAMERA, wider, k, T_WORLD_CAMERA)
        np.testing.assert_array_equal(ours.P, same.P)
    none = np.zeros((8, 2), dtype=int)
    ours, same = (
        image_corner(camera, Corners(pixels, np.tile(P, (8, 1, 1)), none, none), 0, T_WORLD_CAMERA)
        for camera, P in ((lens, np.diag([0.09, 0.16])), (CAMERA, np.diag([0.25, 0.32])))
    )
    np.testing.assert_allclose(ours.P, same.P, rtol=1e-12)


def test_image_edges_give_a_pose_with_calibrated_covariance():
    rng, runs, nees, fits = np.random.default_rng(2), 120, [], []
    pixels, truth = project(CAMERA, SE3.apply(T_CAMERA_PART, VERTICES)), T_WORLD_CAMERA @ T_CAMERA_PART
    for _ in range(runs):
        segments = segments_of(pixels, rng)
        pairings = [
            Pairing(image_edge(CAMERA, segments, k, T_WORLD_CAMERA), edge_model(i, j)) for k, (i, j) in enumerate(EDGES)
        ]
        start = truth @ SE3.exp(rng.normal(size=6) * np.r_[np.full(3, 0.005), np.full(3, 0.05)])
        found = estimate_pose(pairings, start=start)
        e = SE3.log(SE3.inverse(truth) @ found.T_world_part)
        nees.append(e @ np.linalg.solve(found.covariance, e))
        fits.append(found.chi2)
        assert not found.unobserved
    low, high = chi2.ppf([0.001, 0.999], 6 * runs) / runs
    assert low < np.mean(nees) < high
    dof = 2 * len(EDGES) - 6
    low, high = chi2.ppf([0.001, 0.999], dof * runs) / runs
    assert low < np.mean(fits) < high


def test_corners_of_an_image_do_too():
    rng, runs, nees = np.random.default_rng(3), 150, []
    pixels, truth = project(CAMERA, SE3.apply(T_CAMERA_PART, VERTICES)), T_WORLD_CAMERA @ T_CAMERA_PART
    P = np.array([[0.09, 0.03], [0.03, 0.16]])
    for _ in range(runs):
        noisy = pixels + rng.multivariate_normal(np.zeros(2), P, len(pixels))
        corners = Corners(noisy, np.tile(P, (8, 1, 1)), np.zeros((8, 2), dtype=int), np.zeros((8, 2), dtype=int))
        pairings = [
            Pairing(
                image_corner(CAMERA, corners, k, T_WORLD_CAMERA),
                ModelFeature(VERTEX, SE3.from_parts(np.eye(3), VERTICES[k])),
            )
            for k in range(7)
        ]
        found = estimate_pose(pairings, start=truth @ SE3.exp(0.01 * rng.normal(size=6)))
        e = SE3.log(SE3.inverse(truth) @ found.T_world_part)
        nees.append(e @ np.linalg.solve(found.covariance, e))
    low, high = chi2.ppf([0.001, 0.999], 6 * runs) / runs
    assert low < np.mean(nees) < high


def test_one_edge_leaves_four_directions_free():
    segments = segments_of(project(CAMERA, SE3.apply(T_CAMERA_PART, VERTICES)))
    pairing = Pairing(image_edge(CAMERA, segments, 0, T_WORLD_CAMERA), edge_model(*EDGES[0]))
    found = estimate_pose([pairing], start=T_WORLD_CAMERA @ T_CAMERA_PART)
    assert found.status == "insufficient"
    assert len(found.free) == 4


def test_a_camera_that_stands_nowhere_is_refused():
    segments = segments_of(project(CAMERA, SE3.apply(T_CAMERA_PART, VERTICES)))
    with pytest.raises(InputError, match="expected its pose"):
        image_edge(CAMERA, segments, 0)
