"""Guarded motions along the hand's own axis: towards a surface until a stand-off, and away from it."""

from __future__ import annotations

import numpy as np

from tanteo.hand import Robot, shift
from tanteo.motion.result import Motion
from tanteo.motion.steering import Rules, Steering, blind, frontal

_NEAR_ENOUGH = 0.05
"""An approach has arrived within this share of the stand-off."""

_STILL = 5
"""Periods, beyond the dead time, that it has to stay there."""


def approach(robot: Robot, standoff: float, rules: Rules, *, reach: float) -> Motion:
    """Move ahead until the nearer of the two frontal ranges is the stand-off, and hold it (guarded motion).

    Args:
        robot: The hand.
        standoff: Of the hand's front from the surface [m].
        rules: What to keep to.
        reach: How far to go at most [m].

    Returns:
        ``reached``; ``nothing`` after the reach; ``lost`` where the surface gives no ranges; ``limit``; ``timeout``.
    """
    run = Steering("approach", robot, rules)
    start, still = run.sensed.T_world_hand, 0
    while True:
        ranges, _ = frontal(run)
        ranges = np.where(np.isfinite(ranges), ranges, run.room[list(run.hand.frontal)])
        error = float(ranges.min()) - standoff
        if blind(run):
            return run.end("lost", "what is ahead gives no ranges: it is met too obliquely")
        still = still + 1 if abs(error) < _NEAR_ENOUGH * standoff else 0
        if still > _STILL + run.loop.delay:
            return run.end("reached", f"{1e3 * standoff:.3g} mm before the surface")
        gone = float((run.sensed.T_world_hand[:3, 3] - start[:3, 3]) @ start[:3, 2])
        if gone > reach:
            return run.end("nothing", f"no surface within {1e3 * reach:.3g} mm ahead")
        speed = float(np.clip(run.loop.gain * error, -rules.speed, rules.speed)) if np.isfinite(error) else rules.speed
        if ending := run.step(shift(np.array([0.0, 0.0, speed]))):
            return run.end(ending)


def retreat(robot: Robot, distance: float, rules: Rules) -> Motion:
    """Move straight back by a distance [m]: ``reached``, ``limit`` or ``timeout``.

    Nothing looks backwards; the hand goes back along a path that it has just come, or through free space.
    """
    run = Steering("retreat", robot, rules)
    start = run.sensed.T_world_hand
    while True:
        left = distance - float((start[:3, 3] - run.sensed.T_world_hand[:3, 3]) @ start[:3, 2])
        if left < 5e-4:
            return run.end("reached", f"{1e3 * distance:.3g} mm back")
        speed = min(run.loop.gain * left + 1e-3, rules.speed)
        if ending := run.step(shift(np.array([0.0, 0.0, -speed]))):
            return run.end(ending)
