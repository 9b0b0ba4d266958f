"""The surface search where there is nothing to find, and where noise puts a reading across an edge."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.parts import read_part
from tanteo.surface_search import FreePaths, Target, Touches, identify_touches, prepare_target
from tanteo.surface_search.polish import polish
from tanteo.surface_search.search import effort_for, groups_of, search

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD, TILT = 5e-4, np.deg2rad(3.0)


@pytest.fixture(scope="module")
def target() -> Target:
    return prepare_target(read_part(PARTS / "bracket_left.step"))


def touched(points, normals=None) -> Touches:
    n, none = len(points), np.zeros((len(points), 3))
    return Touches(
        tuple(map(str, range(n))), points, np.tile(SD**2 * np.eye(3), (n, 1, 1)), np.zeros(n), none,
        none if normals is None else normals, np.full(n, np.pi if normals is None else TILT), np.zeros(n),
        np.zeros((n, 3, 0)), np.full(n, SD),
    )  # fmt: skip


@pytest.mark.parametrize("oriented", [False, True])
def test_no_start_at_all_is_no_mode_and_no_exception(target, oriented):
    points = np.diag([1.0, 2.0, 3.0]) * 10 * target.part.diagonal
    touches = touched(points, np.eye(3) if oriented else None)
    groups, effort = groups_of(touches, target, 2), effort_for(touches, target, 0)
    assert len(search(touches, FreePaths.none(), target, Priors(radius=1.0), effort, groups).Ts) == 0


@pytest.mark.parametrize(("along", "says"), [(0.0, "sense places farther apart"), (0.05, "on one line")])
def test_readings_on_one_line_or_at_one_point_are_not_enough(target, along, says):
    points = np.linspace(0.0, along, 10)[:, None] * np.array([0.6, 0.0, 0.8])
    answer = identify_touches(touched(points), FreePaths.none(), [target])
    assert answer.status == "insufficient"
    assert says in answer.message


def test_a_noise_larger_than_the_part_is_said_and_not_an_exception(target):
    points = target.samples[:12]
    touches = replace(touched(points), covs=np.tile(np.eye(3), (12, 1, 1)), sd=np.ones(12))
    assert identify_touches(touches, FreePaths.none(), [target]).status == "insufficient"


def test_a_direction_that_nothing_resists_does_not_run_away(target):
    """Touches of one face leave three directions free; the climb still lowers the others."""
    rng = np.random.default_rng(5)
    on = np.argmax(target.normals @ [0.0, 0.0, -1.0])
    flat = np.flatnonzero(np.abs((target.samples - target.samples[on]) @ target.normals[on]) < 1e-9)[:8]
    touches = touched(target.samples[flat] + SD * rng.normal(size=(len(flat), 3)))
    start = SE3.exp(np.array([0.0, 0.0, 1e-3, 0.0, 0.0, 0.0]))
    found = polish(touches, FreePaths.none(), start[None], target, Priors(radius=0.2))
    moved = SE3.log(found.Ts[0])
    assert np.linalg.norm(moved[:3]) < 5e-3
    assert np.sum(found.residuals[0] ** 2) < 20


def test_a_normal_tells_the_face_across_an_edge():
    """A point a little past the edge of a block's top is nearer to its side; the sensed normal says top."""
    target = prepare_target(read_part(PARTS / "block.step"))
    low, high = target.part.box
    x, y, z = 0.5 * (low + high)
    beyond = high[0] + 0.3 * SD, y, high[2] - 0.8 * SD
    points = np.array([(x, y, high[2]), (low[0], y, high[2] - 2e-3), (high[0], y, z), (x, low[1], z), beyond])
    sensed = np.array([(0, 0, 1), (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 0, 1)], dtype=float)
    found = polish(touched(points, sensed), FreePaths.none(), np.eye(4)[None], target, Priors(radius=0.2))
    assert found.belongs[0].min() > 0.5
