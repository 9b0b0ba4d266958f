"""Shared errors of sixty times the noise: pose proposals are made with other suppositions of them, too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose, no_paths, off, surface_points, touches_of
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.posterior import identify_points, prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD, TIP = 5e-5, 3e-3


def square_on(target, rng, n=25):
    """Touches by a hand that comes square on, turned about its way, with an unknown offset of its tip; and the pose."""
    T, z = box_centred_pose(rng), rng.normal(size=3)
    p, normals = surface_points(target, n, rng)
    along = -normals @ T[:3, :3].T
    x = np.cross(along, rng.normal(size=(n, 3)))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    shared_jacobian = TIP * np.stack([x, np.cross(along, x), along], axis=-1)
    points = SE3.apply(T, p) - shared_jacobian @ z + SD * rng.normal(size=p.shape)
    return touches_of(points, SD, shared_jacobian=shared_jacobian), T


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_pose_made_by_a_large_offset_is_no_answer(seed):
    """An offset along the hand's path resembles a larger part: poses 10 mm off exclude few readings."""
    target = prepare(read_part(PARTS / "bracket_left.step"))
    touches, T = square_on(target, np.random.default_rng((2026, seed)))
    answer = identify_points(touches, no_paths(), [target])
    assert answer.status == "recognized"
    assert off(target.part, answer.hypotheses[0].T_world_part, T)[0] < 1e-3
