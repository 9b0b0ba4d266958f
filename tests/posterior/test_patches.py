"""Readings of a small patch of a part: many a part has it twice, and the answer reports that."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose, no_paths, surface_points, touches_of
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.posterior import PosePrior, Priors, identify_points, prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD = 5e-5


@pytest.fixture(scope="module")
def block():
    return prepare(read_part(PARTS / "block.step"))


def corner_patch(target, seed, radius=5e-3, n=24):
    """Touches within 5 mm of one corner, and the pose."""
    rng = np.random.default_rng((300, seed))
    T = box_centred_pose(rng)
    p, normals = surface_points(target, 40_000, rng)
    corner = target.part.corners.points[rng.integers(len(target.part.corners.points))]
    near = np.flatnonzero(np.linalg.norm(p - corner, axis=1) < radius)
    near = rng.choice(near, n)
    points = SE3.apply(T, p[near]) + SD * rng.normal(size=(n, 3))
    return touches_of(points, SD, directions=-normals[near] @ T[:3, :3].T), T


@pytest.mark.quick_sets(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_patch_alone_is_no_place(block, seed):
    """One corner of a block is like others: there is no single answer, for any result of the search."""
    touches, _ = corner_patch(block, seed)
    answer = identify_points(touches, no_paths(), [block])
    assert answer.status in ("ambiguous", "insufficient", "unknown")


def test_a_patch_of_a_part_that_is_roughly_known_to_be_there_is(block):
    touches, T = corner_patch(block, 1)
    rough = PosePrior(T, np.diag(np.repeat([2e-3, 0.02], 3)) ** 2)
    answer = identify_points(touches, no_paths(), [block], priors=Priors(pose=rough))
    assert answer.status == "recognized", answer.message
