"""A part with one displaced face: its evidence against integrals, and the message about such parts."""

from __future__ import annotations

import numpy as np
import pytest

from bare_scenes import SENSORS, box_centred_pose, inside, nees, scene
from tanteo.factors import FreeRays
from tanteo.posterior import Priors, identify_points, prepare

LASER = SENSORS[1]


@pytest.fixture(scope="module")
def steps(parts):
    return {name: prepare(parts[name]) for name in ("step_12mm", "step_15mm", "wedge")}


def read(steps, name, seed, n=30):
    """Return readings of a laser on a part at a random pose."""
    rng, target = np.random.default_rng(seed), steps[name]
    T = box_centred_pose(rng)
    return T, scene(target, T, LASER, n, rng, radius=target.part.radius)[0]


@pytest.mark.slow
@pytest.mark.xfail(strict=False, reason="a near variant whose readings a wider noise explains is refused, not named")
def test_a_higher_step_than_the_known_part_s_is_named(steps):
    """Ten scenes, five of which have three readings or more off the known part: one is taken for it.

    There a pose that excludes none of them, and scatters 1.7 times as much as stated, hides the right one.
    """
    known = [steps["step_12mm"], steps["wedge"]]
    seen = taken = 0
    for seed in range(10):
        T, touches = read(steps, "step_15mm", seed)
        local = (touches.points - T[:3, 3]) @ T[:3, :3]
        off = steps["step_12mm"].surface.closest(local).distances > 8 * LASER.sd
        answer = identify_points(touches, FreeRays.none(), known)
        if off.sum() < 3:
            continue
        seen += 1
        best, part = answer.hypotheses[0], steps["step_12mm"].part
        assert best.part == "step_12mm"
        if answer.status == "recognized":
            taken += 1
            assert "scatter" in answer.message
            continue
        assert answer.status == "unknown"
        assert "readings agree that face 8 of step_12mm is" in answer.message
        assert "mm farther out." in answer.message
        assert inside(*nees(part, best.T_world_part, best.covariance, T), 0.999)
    assert seen == 5
    assert taken <= 1


@pytest.mark.parametrize("n", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_many_readings_with_strays_leave_no_doubt_of_the_part(steps, n):
    for seed in range(3):
        rng, target = np.random.default_rng((6, seed)), steps["step_12mm"]
        T = box_centred_pose(rng)
        touches = scene(target, T, LASER, n, rng, outlier=0.02, radius=target.part.radius)[0]
        answer = identify_points(touches, FreeRays.none(), [target])
        assert answer.status == "recognized"
        assert answer.unknown_probability < 0.01


@pytest.mark.slow
def test_the_part_itself_stays_what_it_is_with_strays_anywhere(steps):
    known, right = [steps["step_12mm"], steps["wedge"]], 0
    for seed in range(10):
        rng, target = np.random.default_rng((5, seed)), steps["step_12mm"]
        T = box_centred_pose(rng)
        touches = scene(target, T, LASER, 30, rng, outlier=0.1, radius=target.part.radius)[0]
        answer = identify_points(touches, FreeRays.none(), known, priors=Priors(outlier_rate=0.1))
        right += answer.status == "recognized"
        assert "agree" not in answer.message
    assert right >= 9
