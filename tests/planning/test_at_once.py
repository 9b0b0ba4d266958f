"""Exact readings given at once and one by one: the same posterior, and a calibrated one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from bare_scenes import inside, nees, no_paths, off, surface_points, touches_of
from sensing_scenes import drawn_truth, rough
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.planning import begin, update
from tanteo.posterior import prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD = 2e-5
"""A hundredth of what the place is known to, and of the distance between pose proposals."""


def touched(target, seed, n=8):
    """Return a start known to 3 mm and 2 degrees, the truth, and exact touches of it."""
    start, rng = rough([target], (3e-3, np.radians(2))), np.random.default_rng((2026, seed))
    _, T = drawn_truth(start, rng)
    p, _ = surface_points(target, n, rng)
    return start, T, touches_of(SE3.apply(T, p) + SD * rng.normal(size=p.shape), SD)


def test_exact_touches_given_at_once_place_the_part():
    """Proposals that end at the grid's error see all readings as outliers: millimetres off, and sure."""
    target, right, within = prepare(read_part(PARTS / "bracket_left.step")), 0, 0
    for seed in range(15):
        start, T, touches = touched(target, seed)
        state = update(begin(start), touches, no_paths())
        right += off(target.part, state.poses[0], T)[0] < 5e-3
        within += inside(*nees(target.part, state.poses[0], state.covariances[0], T))
    assert right >= 14
    assert within >= 12


def test_touches_given_at_once_are_searched_as_a_log():
    """Followed from samples of the prior alone, these were millimetres off at 0.65 to 0.997."""
    target = prepare(read_part(PARTS / "block.step"))
    for seed in (9, 50, 73, 96):
        start, T, touches = touched(target, seed)
        state = update(begin(start), touches, no_paths())
        squared, dof = nees(target.part, state.poses[0], state.covariances[0], T)
        assert squared < chi2.ppf(0.9999, dof), seed


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, *(pytest.param(k, marks=pytest.mark.slow) for k in (3, 6))])
def test_the_order_of_readings_does_not_matter(seed):
    """One by one, in reverse order, and at once: one pose, within its uncertainty."""
    target = prepare(read_part(PARTS / "bracket_left.step"))
    start, _, touches = touched(target, seed, 10)
    at_once = update(begin(start), touches, no_paths())
    for order in (np.arange(10), np.arange(10)[::-1]):
        state = begin(start)
        for n in range(1, 11):
            state = update(state, touches.take(order[:n]), no_paths())
        gap = SE3.log(SE3.inverse(at_once.poses[0]) @ state.poses[0])
        assert gap @ np.linalg.solve(at_once.covariances[0], gap) < 1.0
        assert state.weights[0] == pytest.approx(at_once.weights[0], abs=0.05)
