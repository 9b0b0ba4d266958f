"""A hand keeps clear of the true part for every posterior, and of no pose that readings rule out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bare_scenes import SENSORS, no_paths, scene, touches_of
from sensing_scenes import without_modes
from tanteo.factors import FreeRays
from tanteo.geometry import SE3
from tanteo.planning import at_place, begin, update
from tanteo.planning.execution import PossiblePoses
from unknown_scenes import CLEARANCE, SDS

RIGHT = 1
FAR = 0.010
"""A reading speaks against a pose whose surface is farther away than that [m]."""


@pytest.fixture(scope="module")
def start(targets):
    return at_place(targets, np.eye(4), np.diag(SDS**2))


def drawn(start, part, rng):
    return start.Ts[part] @ SE3.exp(np.linalg.cholesky(start.covariances[part]) @ rng.normal(size=6))


@pytest.mark.parametrize("draws", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_the_true_part_is_kept_clear_of_for_a_mirror_belief(targets, start, draws):
    """Readings of the right bracket, and an assumption so wrong that all of the belief is on the left one."""
    rng, covered = np.random.default_rng(1), []
    wrong = replace(start, weights=np.array([1 - 2e-9, 1e-9, 1e-9]))
    for _ in range(draws):
        T = drawn(start, RIGHT, rng)
        few = scene(targets[RIGHT], T, SENSORS[1], 2, rng)[0]
        state = update(begin(wrong), few, no_paths())
        assert state.of_parts()[RIGHT] < 1e-3
        there = SE3.apply(T, targets[RIGHT].samples)
        covered.append(PossiblePoses.of(state).distances(there).max())
    # nowhere is the true surface farther from what is kept clear of than the clearance
    assert max(covered) < CLEARANCE


def test_what_is_allowed_agrees_with_all_readings_but_one(targets, start):
    rng = np.random.default_rng(2)
    T = drawn(start, RIGHT, rng)
    touches = scene(targets[RIGHT], T, SENSORS[1], 6, rng)[0]
    possible = PossiblePoses.of(without_modes(start, touches, no_paths()))
    assert RIGHT in possible.part
    assert len(possible.part) > 20
    for P, k in zip(possible.Ts, possible.part, strict=True):
        gaps = np.abs(targets[k].surface.closest(SE3.apply(SE3.inverse(P), touches.points)).distances)
        assert (gaps > FAR + targets[k].field.step).sum() <= 1


def test_two_free_space_rays_rule_a_pose_out_one_does_not(targets):
    """A solid wedge whose place is known well; the beams go through it as if it were not there."""
    place = at_place(targets[2:], np.eye(4), np.diag(np.repeat([1e-3, 1e-2], 3)) ** 2)
    origins = np.array([[0.0, 0.0, 0.3], [0.003, 0.0, 0.3]])
    down = np.tile([0.0, 0.0, -1.0], (2, 1))
    points = touches_of(np.zeros((0, 3)), 1e-3)
    for count, left in ((0, True), (1, True), (2, False)):
        paths = FreeRays(origins[:count], down[:count], np.full(count, 0.3), np.zeros(count))
        state = without_modes(place, points, paths)
        assert bool(len(PossiblePoses.of(state).Ts)) is left
    shallow = FreeRays(origins, down, np.full(2, 0.2), np.zeros(2))  # the ways end above it
    assert len(PossiblePoses.of(without_modes(place, points, shallow)).Ts)
