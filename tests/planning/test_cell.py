"""The cell judged by touches of a part: what was put in comes out, and what was stated rightly is not contradicted."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.planning import Sensing, begin, check_cell, update
from tanteo.planning.start import at_pose
from tanteo.sensors import Readings

SD = 5e-5
WIDE = np.diag([0.02] * 3 + [np.radians(10)] * 3) ** 2


@pytest.fixture
def rng():
    return np.random.default_rng(39)


def touches(part, rng, tip, *, turned: bool, count: int = 60) -> Readings:
    """Touches all over a part that lies at the origin, by a hand whose tip is off by ``tip`` in its own frame [m]."""
    triangles = part.vertices[part.triangles]
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(cross, axis=1)
    k = rng.choice(len(areas), count, p=areas / areas.sum())
    a, b = np.sort(rng.random((2, count)), axis=0)
    points = np.einsum("ni,nij->nj", np.stack([a, b - a, 1 - b], axis=1), triangles[k])
    ways = -cross[k] / areas[k, None]
    R = SO3.exp(rng.normal(0, 1.0, (count, 3)) if turned else np.zeros((count, 3)))
    hands = SE3.from_parts(R, points + rng.normal(0, SD, points.shape) - R @ np.array([0, 0, 0.1]))
    sensed = points + np.sum(rng.normal(0, SD, points.shape) * ways, axis=1)[:, None] * ways - R @ tip
    return Readings.from_columns(sensed, directions=ways, Ts_world_hand=hands)


def checked(part, readings: Readings, **errors):
    sensing = Sensing(sd=SD, **errors)
    state = update(begin(at_pose(part, np.eye(4), WIDE)), *sensing.touches(readings))
    return check_cell(state, readings, sensing.measured)


def test_a_tip_that_is_off_is_found(models, rng):
    tip = np.array([6e-4, -3e-4, 2e-4])
    found = checked(models["wedge"], touches(models["wedge"].part, rng, tip, turned=True), tip_sd=[1e-4] * 3)
    (error,) = found.errors
    assert error.contradicted
    assert np.all(np.abs(np.abs(error.estimate) - np.abs(tip)) < 4 * error.sd + 5e-5)
    assert error.sd.max() < 5e-5


def test_a_tip_as_stated_is_not_contradicted(models, rng):
    found = checked(models["wedge"], touches(models["wedge"].part, rng, np.zeros(3), turned=True), tip_sd=[1e-4] * 3)
    assert not found.errors[0].contradicted


def test_undetermined_directions_are_reported(models, rng):
    """A hand that never turns: its tip's offset moves the part, and nothing else."""
    readings = touches(models["wedge"].part, rng, np.array([6e-4, 0, 0]), turned=False)
    found = checked(models["wedge"], readings, tip_sd=[1e-4] * 3)
    assert found.errors[0].explained < 0.1
    assert found.errors[0].p_value == 1.0
    assert found.following is not None
    assert found.following.turn != 0
    assert found.following.gain > 0.3


def test_two_errors_of_a_still_hand_are_both_judged(models, rng):
    readings = touches(models["wedge"].part, rng, np.zeros(3), turned=False)
    found = checked(models["wedge"], readings, tip_sd=[1e-4] * 3, bias_sd=1e-4)
    assert sorted(len(e.estimate) for e in found.errors) == [2, 3]
    assert not any(e.contradicted for e in found.errors)


def test_a_cell_without_stated_errors_is_refused(models, rng):
    with pytest.raises(InputError, match="--tip-sd"):
        checked(models["wedge"], touches(models["wedge"].part, rng, np.zeros(3), turned=True))
