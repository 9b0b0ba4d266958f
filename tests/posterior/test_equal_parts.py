"""Laws of several equal parts in one set of readings."""

from __future__ import annotations

import numpy as np
import pytest

import tanteo
from bare_scenes import beams, off
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare
from tanteo.words.findings import SeveralEqual

SD = 5e-5


@pytest.fixture(scope="module")
def wedge():
    return prepare(tanteo.read_part("examples/parts/wedge.step"))


def poses(*moves):
    first = SE3.from_parts(SO3.axis_rotation(2, 0.3), np.array([0.2, 0.1, 0.02]))
    return [first, *(SE3.from_parts(SO3.axis_rotation(2, turn), np.array(place)) @ first for turn, place in moves)]


def touched(part, Ts, n, rng):
    """Return readings of parts in a mixed order, and the part of each."""
    rows = [beams(part, n, rng, tilt=0.1) for _ in Ts]
    points = np.concatenate([SE3.apply(T, p) for T, (p, _) in zip(Ts, rows, strict=True)])
    directions = np.concatenate([d @ T[:3, :3].T for T, (_, d) in zip(Ts, rows, strict=True)])
    order = rng.permutation(len(points))
    points = points + SD * rng.normal(size=points.shape)
    readings = tanteo.Readings.from_columns(
        points=points[order], directions=directions[order], sds=np.full(len(points), SD)
    )
    return readings, order // n


@pytest.mark.parametrize("gap", [0.15, 0.5], ids=["beside each other", "apart"])
def test_each_of_two_parts_has_its_pose_and_readings(wedge, gap):
    Ts = poses((0.05, [gap, 0.03, 0.0]))
    readings, owner = touched(wedge, Ts, 14, np.random.default_rng(3))
    answer = tanteo.locate(readings, wedge, conventions=False)
    assert (answer.status, len(answer.equal)) == ("recognized", 1)
    found = next(one for one in answer.findings if isinstance(one, SeveralEqual))
    first = int(owner[0])
    for k, (one, ids) in enumerate(zip((answer, *answer.equal), found.readings, strict=True)):
        true = first if k == 0 else 1 - first
        assert set(ids) == {str(n + 1) for n in np.flatnonzero(owner == true)}
        assert off(wedge.part, one.best.T_world_part, Ts[true])[0] < 5 * one.best.corner_sd


@pytest.mark.slow
@pytest.mark.parametrize("radius", [pytest.param(0.0, marks=pytest.mark.slow), 2e-3])
def test_touches_on_a_table_are_no_second_part(wedge, radius):
    """Seven touches of one plane fit a face of any part."""
    rng, T = np.random.default_rng(2), poses()[0]
    p, d = beams(wedge, 60, rng, tilt=0.1)
    table = np.column_stack([rng.uniform(0.1, 0.14, 7), rng.uniform(0, 0.04, 7), np.full(7, 0.019)])
    points = np.concatenate([SE3.apply(T, p), table]) + SD * rng.normal(size=(67, 3))
    directions = np.concatenate([d @ T[:3, :3].T, np.tile([0, 0, -1.0], (7, 1))])
    radii = {"radii": np.full(67, radius)}
    readings = tanteo.Readings.from_columns(
        points=points - radius * directions, directions=directions, sds=np.full(67, SD), **radii
    )
    answer = tanteo.locate(readings, wedge, conventions=False)
    assert answer.equal == ()
    assert "lie on one plane beside the part" in answer.message


@pytest.mark.slow
def test_one_part_that_moved_is_not_two(wedge):
    readings, _ = touched(wedge, poses((0.01, [2e-3, 1e-3, 0.0])), 14, np.random.default_rng(4))
    answer = tanteo.locate(readings, wedge, conventions=False)
    assert answer.equal == ()
    assert answer.status != "recognized"


def test_a_stated_count_is_kept(wedge):
    readings, _ = touched(wedge, poses((0.05, [0.5, 0.03, 0.0])), 12, np.random.default_rng(5))
    assert tanteo.locate(readings, wedge, conventions=False, count=1).equal == ()
    assert len(tanteo.locate(readings, wedge, conventions=False, count=2).equal) == 1
    with pytest.raises(tanteo.InputError, match="count: expected a number of equal parts"):
        tanteo.locate(readings, wedge, count=0)


def test_a_true_single_part_stays_one(wedge):
    readings, _ = touched(wedge, poses(), 28, np.random.default_rng(6))
    answer = tanteo.locate(readings, wedge, count=2, conventions=False)
    assert (answer.status, answer.equal) == ("recognized", ())
