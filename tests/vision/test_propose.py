"""Pose proposals: their list, their costs, and the ones that are refined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tanteo.geometry import SE3
from tanteo.vision.camera import project
from tanteo.vision.candidates import candidates_in, distinct
from tanteo.vision.image_edges import ImageEdges
from tanteo.vision.propose import edge_costs, propose, slides
from tanteo.vision.regions import dilated, find_regions
from tanteo.vision.settings import EVIDENCE, SEARCH
from tanteo.vision.table import TableErrors
from vision_scenes import bracket, seen_alone


@pytest.fixture(scope="module")
def model():
    return bracket()


@pytest.fixture(scope="module")
def seen(model):
    """Camera, edge map and region of an image of the part on the table, and its pose in the camera."""
    camera, image, edges, T = seen_alone(model, 0.9)
    return camera, edges, find_regions(image, edges.points)[0], T


def test_points_of_the_surface_are_as_dense_everywhere(model):
    assert model.frame.surface.closest(model.inner).distances == pytest.approx(0, abs=1e-9)
    # their middle is that of the surface
    a, b, c = np.moveaxis(model.part.vertices[model.part.triangles], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    middle = area @ ((a + b + c) / 3) / area.sum()
    assert np.linalg.norm(model.inner.mean(axis=0) - middle) < 0.05 * model.part.diagonal


@pytest.mark.slow
def test_a_first_pose_is_next_to_truth_and_costs_what_it_should(model, seen):
    camera, edges, region, T = seen
    table, costs = SE3.inverse(camera.T_world_camera), edge_costs(edges, np.full(len(edges.points), EVIDENCE.rarest))
    proposal = propose(model, np.arange(len(model.rests)), camera, table, costs, slides(region, camera))
    turn = np.linalg.norm(SE3.log(SE3.inverse(proposal.T_camera_part) @ T)[:, 3:], axis=1)
    middle = project(camera, SE3.apply(T, model.part.centroid))
    off = np.abs(project(camera, SE3.apply(proposal.T_camera_part, model.part.centroid)) - middle).max(axis=-1)
    first = proposal.rests == 0
    # half a step of yaw, and the cheapest of two adjacent yaws stands for both
    best = first & (turn < 1.5 * 2 * np.pi / SEARCH.yaws) & (off < EVIDENCE.shortest)
    assert best.any()
    assert proposal.costs[best].min() == proposal.costs[first].min()
    assert proposal.costs[best].min() < 3.0


def test_a_part_is_proposed_in_no_far_smaller_region(model, seen):
    camera, edges, region, _ = seen
    chance = np.full(len(edges.points), EVIDENCE.rarest)
    image, costs, table = ImageEdges(camera, edges, chance), edge_costs(edges, chance), TableErrors()
    found = []
    for size in (1.0, 0.5, 0.1):
        one = replace(region, contour=region.centre + size * (region.contour - region.centre))
        found.append(candidates_in([model], image, SE3.inverse(camera.T_world_camera), one, costs, table))
    assert [len(poses) for _, poses in found] == [1, 1, 0]
    assert found[2][0].log_unknown == image.with_unknown_in(dilated(region.mask)).log_unknown


def test_frequent_edges_cost_more_than_rare_ones(seen):
    _, edges, _, _ = seen
    count = len(edges.points)
    rarest, none = np.full(count, EVIDENCE.rarest), np.full(count, 1.0)
    rare, frequent, never = (edge_costs(edges, chance) for chance in (rarest, np.sqrt(rarest), none))
    on = rare < 1.0
    assert on.sum() > 100
    assert np.all((rare < frequent)[on] & (frequent < never)[on])
    assert np.all(never == EVIDENCE.shortest)


def test_of_poses_that_are_about_one_the_best_is_kept(model):
    T = SE3.exp(np.array([0.1, 0.2, 0.5, 0.3, -0.2, 0.9]))
    near = T @ SE3.exp(np.array([1e-3, 0, 0, 0, 0, 0.002]))
    far = T @ SE3.exp(np.array([0, 0, 0, 0, 0, 0.2]))
    Ts = np.stack([near, T, far])
    assert distinct(model, Ts, np.array([1.0, 2.0, 0.0])).tolist() == [False, True, True]
    assert distinct(model, Ts, np.array([2.0, 1.0, 0.0])).tolist() == [True, False, True]
    assert distinct(model, Ts[:0], np.zeros(0)).tolist() == []
