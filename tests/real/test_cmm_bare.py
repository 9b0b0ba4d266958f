"""Real touches of the block with their labels taken away and shuffled: the same part at the same place."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import nees, no_paths, off, touches_of
from tanteo.geometry import SE3
from tanteo.posterior import identify_points, prepare

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
FOLDER = DATA / "cmm_block"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no data at {FOLDER}")

RADIUS, SD, TOLERANCE = 1.5e-3, 0.05e-3, 0.15e-3
"""The ball sits in its dimple, this far from the face; one touch; made block against drawing [m]."""

PLACEMENTS = {"first": range(1, 21), "second": range(21, 41)}


def rows_of(name):
    with (FOLDER / name).open() as file:
        rows = [row for row in csv.reader(file) if len(row) >= 6][1:]
    numbers = np.array([int("".join(c for c in row[0] if c.isdigit())) for row in rows])
    return numbers, 1e-3 * np.array([[float(v) for v in row[3:6]] for row in rows])


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part(FOLDER / "calibration_block_from_drawing.stl", unit="mm", name="block"))


def bare_touches(placement, seed=0):
    """Return all touches of a placement, without labels, in random order."""
    numbers, points = rows_of("rob1_self_transform_092024.csv")
    points = points[np.isin(numbers, PLACEMENTS[placement])]
    points = np.random.default_rng(seed).permutation(points)
    touches = touches_of(points, np.hypot(SD, TOLERANCE), radii=RADIUS)
    return replace(touches, tolerance=TOLERANCE)


def labelled_pose(placement):
    """Return the block's own frame from the order of the dimples: rigid motion of ``tool_cloud`` onto the means."""
    numbers, points = rows_of("rob1_self_transform_092024.csv")
    means = np.array([points[numbers == k].mean(axis=0) for k in PLACEMENTS[placement]])
    own = rows_of("tool_cloud.csv")[1]
    U, _, Vt = np.linalg.svd((means - means.mean(axis=0)).T @ (own - own.mean(axis=0)))
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return SE3.from_parts(R, means.mean(axis=0) - R @ own.mean(axis=0))


@pytest.fixture(scope="module")
def located(block):
    return {name: identify_points(bare_touches(name), no_paths(), [block]) for name in PLACEMENTS}


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_located_without_labels(located, placement):
    answer = located[placement]
    best = answer.hypotheses[0]
    assert answer.status == "recognized"
    assert best.probability > 0.99
    assert len(best.outliers) <= 2
    assert best.rms < 0.2e-3
    assert best.corner_sd < 0.5e-3


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_the_pose_is_that_of_the_labelled_dimples(block, located, placement):
    """Up to the rotation of 13 mrad between the drawing's frame and ``tool_cloud``'s, equal in both placements."""
    images = located[placement].hypotheses[0].T_world_part @ block.part.symmetry.Ts
    gaps = SE3.log(SE3.inverse(images) @ labelled_pose(placement))
    gap = gaps[np.argmin(np.linalg.norm(gaps[:, 3:], axis=1))]
    assert np.linalg.norm(gap[:3]) < 0.5e-3
    np.testing.assert_allclose(gap[3:], [-0.0139, 0.0, 0.002], atol=0.004)


def test_both_placements_show_the_same_difference_of_frames(block, located):
    gaps = []
    for placement in PLACEMENTS:
        images = located[placement].hypotheses[0].T_world_part @ block.part.symmetry.Ts
        candidates = SE3.log(SE3.inverse(images) @ labelled_pose(placement))
        gaps.append(candidates[np.argmin(np.linalg.norm(candidates[:, 3:], axis=1))])
    joint = sum(located[placement].hypotheses[0].covariance for placement in PLACEMENTS)
    apart = gaps[0] - gaps[1]
    assert apart @ np.linalg.solve(joint, apart) < 22.5


@pytest.mark.slow
def test_identified_among_all_real_parts(block):
    folder = DATA / "step_parts"
    if not folder.is_dir():
        pytest.skip(f"no data at {folder}")
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    others = [prepare(part) for part in tanteo.read_parts([folder]).parts]
    assert len(others) >= 40
    for placement in PLACEMENTS:
        answer = identify_points(bare_touches(placement), no_paths(), [*others, block])
        assert answer.status == "recognized"
        assert answer.hypotheses[0].part == "block"
        assert answer.hypotheses[0].probability > 0.99


def holds(block, answer, truth):
    """Return whether some reported mode has the truth in its region, or within 1 mm and 20 mrad."""
    for h in answer.hypotheses:
        moved, angle = off(block.part, h.T_world_part, truth)
        if nees(block.part, h.T_world_part, h.covariance, truth)[0] < 25 or (moved < 1e-3 and angle < 0.02):
            return True
    return False


@pytest.mark.slow
def test_eight_touches_do_not_exclude_the_truth(block, located):
    """Eight touches of a block of ten planes fit a hundred poses: the truth must be one of them.

    Over 200 subsets the script ``benchmarks/cmm_subsets.py`` counts the same.
    """
    rng, hits, trials = np.random.default_rng(8), 0, 8
    for k in range(trials):
        placement = list(PLACEMENTS)[k % 2]
        touches = bare_touches(placement)
        some = touches.take(np.sort(rng.choice(len(touches), 8, replace=False)))
        answer = identify_points(some, no_paths(), [block], top=10_000)
        assert answer.status != "recognized"
        hits += holds(block, answer, located[placement].hypotheses[0].T_world_part)
    assert hits >= trials - 1
