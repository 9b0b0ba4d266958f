"""Distant outliers change no size that decides: of assumed errors, the touched region, the unknown object."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import box_centred_pose, surface_points
from tanteo.factors import FreeRays, as_contact_points
from tanteo.geometry import SE3
from tanteo.posterior import Problem, prepare
from tanteo.sensors import measure
from tanteo.sensors.error_states import Form

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD = 1e-4


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part(PARTS / "block.step"))


def touches(block, distance, count, seed=3):
    """Return twelve touches of the block, of which some are at a distance in other directions."""
    rng = np.random.default_rng(seed)
    p, n = surface_points(block, 12, rng)
    T = box_centred_pose(rng)
    points, away = SE3.apply(T, p) + SD * rng.normal(size=p.shape), rng.normal(size=(count, 3))
    points[:count] += distance * away / np.linalg.norm(away, axis=1, keepdims=True)
    return tanteo.Readings.from_columns(points, directions=-n @ T[:3, :3].T, sds=np.full(12, SD)), T


@pytest.fixture(scope="module")
def answer_at(block):
    """Return the answer to touches with some outliers at a distance, once for both."""
    known = {}

    def answered(distance, count):
        if (distance, count) not in known:
            known[distance, count] = tanteo.locate(touches(block, distance, count)[0], block)
        return known[distance, count]

    return answered


@pytest.mark.quick_sets(1)
@pytest.mark.parametrize("distance", [1e3, pytest.param(1e6, marks=pytest.mark.slow)])
@pytest.mark.parametrize("count", [1, 3])
def test_the_distance_of_outliers_changes_no_answer(answer_at, distance, count):
    """They can be on no object of the part's size: they are no evidence for a variant, and widen no assumed error."""
    found, near = answer_at(distance, count), answer_at(10.0, count)
    assert found.status == near.status == "recognized"
    assert answer_at(1.0, count).best.probability > 0.8
    assert found.best.corner_sd == pytest.approx(near.best.corner_sd, rel=0.05)
    assert found.unknown_probability < 0.02
    assert len(found.best.outliers) == count


def test_touches_of_an_object_larger_than_the_part(block):
    """Readings that are all distant from each other are no outliers."""
    rng = np.random.default_rng(8)
    sides = rng.uniform(-0.6, 0.6, (12, 3))
    sides[np.arange(12), np.arange(12) % 3] = 0.6 * np.where(np.arange(12) % 2, 1, -1)
    answer = tanteo.locate(tanteo.Readings.from_columns(sides, sds=np.full(12, SD)), block)
    assert answer.status == "unknown"
    assert answer.unknown_probability > 0.99


def test_a_distant_outlier_changes_no_touched_region(block):
    areas = []
    for distance in (0.0, 1e3):
        readings = touches(block, distance, 1)[0]
        bare = tanteo.Readings.from_columns(readings.points.values, sds=np.full(12, SD))
        problem = Problem(as_contact_points(measure(bare)), FreeRays.none(), tanteo.Priors(radius=block.part.radius))
        areas.append(problem.region.area)
    assert areas[1] == pytest.approx(areas[0], rel=0.3)


def test_a_distant_outlier_leaves_a_stated_form_in_place(block):
    """The field has the size of the part, so that its states differ between the other readings as without it."""
    moves = []
    for distance in (0.0, 1e3):
        columns = measure(touches(block, distance, 1)[0], shared_errors=(Form(SD),)).jacobians[0][1:]
        moves.append(np.sum(columns**2, axis=(1, 2)).mean() - np.sum(columns.mean(axis=0) ** 2))
    assert moves[1] == pytest.approx(moves[0], rel=0.3)
