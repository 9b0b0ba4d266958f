"""A shaft of facets with a small flat, touched away from it: its turn is one free direction, not one pose a facet."""

from __future__ import annotations

import numpy as np
import trimesh

from bare_scenes import box_centred_pose
from tanteo import Readings, locate, read_part
from tanteo.geometry import SE3


def test_the_turn_of_a_shaft_with_a_small_flat_is_free(tmp_path):
    angles = np.linspace(-np.pi, np.pi, 73)[:-1]
    outline = 0.02 * np.c_[np.cos(angles), np.sin(angles)]
    outline[:, 0] = np.minimum(outline[:, 0], 0.0195)
    walls = trimesh.convex.convex_hull(np.concatenate([np.c_[outline, np.full(72, z)] for z in (0.0, 0.08)]))
    walls.export(tmp_path / "shaft.stl")
    part, rng = read_part(tmp_path / "shaft.stl", unit="m"), np.random.default_rng(4)
    assert not part.symmetry.continuous
    T, n = box_centred_pose(rng), 40
    turn = rng.uniform(np.pi / 2, 3 * np.pi / 2, n)
    side = np.c_[0.02 * np.cos(turn), 0.02 * np.sin(turn), rng.uniform(0.01, 0.07, n)]
    ends = np.c_[rng.uniform(-0.01, 0.01, (8, 2)), np.full(8, 0.08)]
    points = SE3.apply(T, np.concatenate([side, ends])) + 5e-5 * rng.normal(size=(n + 8, 3))
    answer = locate(Readings.from_columns(points=points, sds=np.full(n + 8, 5e-5)), part)
    best = answer.hypotheses[0]
    assert answer.status == "insufficient"
    assert len(best.unobserved) == 1
    assert "rotation" in best.unobserved[0]
    assert best.probability > 0.9
    assert np.degrees(np.sqrt(np.diag(best.covariance)[5])) > 50
