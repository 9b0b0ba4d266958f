"""From pose to pose through free space: the front of the hand goes straight, the hand turns with it."""

from __future__ import annotations

import math

import numpy as np

from tanteo.hand import Robot, gap, shift, turn
from tanteo.motion.result import Motion
from tanteo.motion.steering import Rules, Steering
from tanteo.typing import FloatArray, Transforms

_CLOSE, _TURNED = 5e-4, 2e-3
"""A pose is reached within this distance [m] and angle [rad]."""


def go_to(robot: Robot, T_world_hand: Transforms, rules: Rules) -> Motion:
    """Bring the hand to a pose.

    Args:
        robot: The hand.
        T_world_hand: Where to ``(4, 4)``, as the robot measures it.
        rules: What to keep to.

    Returns:
        ``reached``, ``limit`` or ``timeout``.
    """
    run = Steering("go to", robot, rules)
    while True:
        twist, missing, angle = towards(run, T_world_hand)
        if missing < _CLOSE and angle < _TURNED:
            return run.end("reached", "at the pose")
        if ending := run.step(twist):
            return run.end(ending)


def towards(run: Steering, T_world_hand: Transforms) -> tuple[FloatArray, float, float]:
    """The twist that takes the front straight to where it belongs; what is missing [m] and [rad]."""
    front, T = run.hand.front, run.sensed.T_world_hand
    p, w = gap(T, T_world_hand)
    # of the front: R_gap front + p - front, with the target's axes seen from here
    p = p + (T[:3, :3].T @ (T_world_hand[:3, :3] @ front)) - front
    missing, angle = math.sqrt(p @ p), math.sqrt(w @ w)
    share = min(1.0, run.rules.speed / max(run.loop.gain * missing, 1e-12))
    share = min(share, run.rules.turn / max(run.loop.gain * angle, 1e-12))
    k = run.loop.gain * share
    return shift(k * p) + turn(k * w, front), missing, angle


def spun(T_world_hand: Transforms, front: FloatArray, angle: float) -> Transforms:
    """A pose of the hand turned by an angle [rad] about its own z through its front."""
    c, s = math.cos(angle), math.sin(angle)
    S = np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    S[:3, 3] = front - S[:3, :3] @ front
    return np.asarray(T_world_hand @ S)
