"""The ways in which a pose may be off, and their overlays."""

from __future__ import annotations

import numpy as np
import pytest

from report_scenes import touches
from tanteo.geometry import SE3
from tanteo.posterior.answers import corner_moves
from tanteo.recognition import locate
from tanteo.render.html import find_ways


@pytest.fixture(scope="module")
def answer(wedge):
    return locate(touches(wedge, np.random.default_rng(1)), wedge).hypotheses[0]


def motions(answer, ways, enlarged):
    """Return one standard deviation of each motion in the overlays."""
    T = np.stack([way.Ts_world_part[0, 1] for way in ways])
    return SE3.log(SE3.inverse(answer.T_world_part) @ T) / enlarged


def test_the_ways_make_up_the_covariance(wedge, answer):
    ways, enlarged = find_ways(wedge, answer.T_world_part, answer.covariance)
    xi = motions(answer, ways, enlarged)
    scale = np.r_[np.full(3, wedge.diagonal), np.ones(3)]
    C = answer.covariance / np.outer(scale, scale)
    # motions that hardly move the part are excluded: a hundredth of the largest
    assert xi.T @ xi / np.outer(scale, scale) == pytest.approx(C, abs=0.02 * np.abs(C).max())


def test_the_largest_comes_first_and_moves_corners_as_stated(wedge, answer):
    ways, enlarged = find_ways(wedge, answer.T_world_part, answer.covariance)
    moves = [way.moves for way in ways]
    J = corner_moves(wedge)
    assert moves == pytest.approx(
        [np.linalg.norm(J @ xi, axis=-1).max() for xi in motions(answer, ways, enlarged)], rel=1e-3
    )
    assert moves[0] == max(moves)
    assert 0.6 * answer.corner_sd < moves[0] <= answer.corner_sd * (1 + 1e-9)


def test_ghosts_stand_at_one_two_and_three_both_ways(wedge, answer):
    (way, *_), enlarged = find_ways(wedge, answer.T_world_part, answer.covariance)
    xi = SE3.log(SE3.inverse(answer.T_world_part) @ way.Ts_world_part)
    one = xi[0, 1]
    assert xi == pytest.approx(np.array([[[-k], [k]] for k in (1, 2, 3)])[..., 0, None] * one, abs=1e-9)
    assert enlarged > 1


def test_they_are_enlarged_until_they_can_be_seen_and_not_beyond(wedge, answer):
    for factor in (1e-6, 1e-2, 1.0, 1e4):
        (way, *_), enlarged = find_ways(wedge, answer.T_world_part, answer.covariance * factor)
        shown = 3 * way.moves * enlarged / wedge.diagonal
        assert enlarged == 1 or 0.05 < shown <= 0.16


def test_a_free_direction_is_named(wedge, answer):
    free = np.array(answer.covariance)
    free[0, 0] += 0.1**2
    (way, *_), enlarged = find_ways(wedge, answer.T_world_part, free)
    assert "sliding along part x" in str(way.motion)
    assert enlarged == 1
