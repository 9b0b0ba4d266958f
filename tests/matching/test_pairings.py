"""What pairings leave open: free motions, the side of a plane, and its back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenes import random_pose, sensed_planes
from tanteo.answers import Priors
from tanteo.lie import SE3
from tanteo.localization.start import first_pose
from tanteo.matching import tree
from tanteo.matching.evidence import log_evidence, perfect_evidence
from tanteo.matching.freedom import free_projector, pose_scale
from tanteo.matching.pairings import build
from tanteo.matching.sensed import sense
from tanteo.matching.tree import interpret, prune


@pytest.mark.parametrize("seed", range(3))
def test_two_faces_that_noise_tilts_neither_beat_the_bound_nor_move_along_what_is_free(models, seed):
    """Opposite faces of a block: taken at its word, the tilt between them would say where the block lies along them."""
    model, rng = models["block"], np.random.default_rng(seed)
    opposite = int(np.argmin(model.part.planes.normals @ model.part.planes.normals[0]))
    sensed = sense(sensed_planes(model.part, random_pose(rng), [0, opposite], 1e-3, rng))
    choices, priors = np.array([[0, opposite]]), Priors(radius=model.radius)
    kept, solution = prune(sensed, model, choices, 0.0, iterations=20)
    np.testing.assert_array_equal(kept, choices)
    free = free_projector(sensed, model, choices, model.radius)[0][0]
    start = first_pose(build(sensed, model, choices, 0.0))
    moved = SE3.log(SE3.inverse(start[0]) @ solution.T_world_part[0])
    moved = np.linalg.solve(pose_scale(model.radius, model.middle), moved)
    assert np.linalg.norm(free @ moved) < 1e-2 * np.linalg.norm(moved)
    found = interpret(sensed, model, 0)
    assert perfect_evidence(sensed, model, priors)[0] >= log_evidence(sensed, model, found, priors).max()


def test_a_plane_whose_side_is_unknown_has_half_the_evidence_on_either(models):
    model, rng = models["bracket_left"], np.random.default_rng(11)
    known = sensed_planes(model.part, random_pose(rng), [0, 2, 4, 1], 1e-4, rng)
    over, signs = np.diag([1.0, -1.0, -1.0, 1.0]), np.diag([-1.0, 1.0, -1.0])  # turned about x: z and ry change sign
    behind = replace(known[0], T_world_feature=known[0].T_world_feature @ over, P=signs @ known[0].P @ signs)
    priors, best = Priors(radius=model.radius), []
    for features in (known, [(known[0], behind), *known[1:]]):
        sensed = sense(features)
        best.append(log_evidence(sensed, model, interpret(sensed, model, 0), priors).max())
    assert best[0] - best[1] == pytest.approx(np.log(2), abs=1e-9)


def test_a_pose_that_turns_a_normal_over_explains_nothing(models, monkeypatch):
    """The offset of a face is that of its back; only the side condition tells them apart."""
    model, rng = models["block"], np.random.default_rng(12)
    sensed = sense(sensed_planes(model.part, random_pose(rng), [0], 1e-4, rng))
    T_face = model.part.planes.Ts_part_feature[0]
    over = T_face @ np.diag([1.0, -1.0, -1.0, 1.0]) @ SE3.inverse(T_face)
    choices = np.zeros((1, 1), dtype=int)
    assert len(prune(sensed, model, choices, 0.0)[0]) == 1
    monkeypatch.setattr(tree, "first_pose", lambda blocks: first_pose(blocks) @ over)
    assert len(prune(sensed, model, choices, 0.0)[0]) == 0
