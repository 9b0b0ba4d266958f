"""Through free space: to a pose, the front of the hand going straight, and a look around from a safe distance.

A look runs the hand's axis along a spiral of tilts about the hand's thickest part. Nothing looks where the back of the
hand goes, so that the back stays where it is and the fingers, which carry the sensors, swing and turn.
"""

from __future__ import annotations

import math

import numpy as np

from tanteo.hand import Hand, Robot, advance, gap, shift, turn
from tanteo.lie import SE3
from tanteo.motion.steering import Motion, Rules, Steering
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


def dwell(robot: Robot, instants: int, rules: Rules) -> Motion:
    """Stay at rest and read: ``reached`` after so many periods, or ``timeout``."""
    run = Steering("dwell", robot, rules)
    for _ in range(instants):
        if run.step(np.zeros(6)) == "timeout":
            return run.end("timeout")
    return run.end("reached", f"{instants} readings at rest")


def path(T_from: Transforms, T_to: Transforms, front: FloatArray, n: int) -> Transforms:
    """Poses on the way of :func:`go_to` ``(n, 4, 4)``: the front goes straight."""
    turned, shares = gap(T_from, T_to)[1], np.linspace(0, 1, n)
    out = np.stack([advance(T_from, np.array([0.0, 0.0, 0.0, *turned]), s) for s in shares])
    a, b = (SE3.apply(T, front) for T in (T_from, T_to))
    out[:, :3, 3] = a + shares[:, None] * (b - a) - out[:, :3, :3] @ front
    return out


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


_SPIN, _SPIN_OVER = 0.8, 2.8
"""Meanwhile the hand turns about its axis to both sides by so much [rad], slower than the spiral by so many times: four
lateral beams a quarter apart then sweep all the way round."""

_PACE = 0.4
"""Along the spiral from pose to pose where all of it is asked for [rad]."""

_LAG = 0.15
"""The spiral waits while the hand is this far behind it [rad]."""


def look(robot: Robot, widest: float, rules: Rules, *, spacing: float = 0.09, begin: float = 0.0) -> Motion:
    """Turn the hand so that its beams sweep a cone, and back.

    Args:
        robot: The hand, some way off what it shall see.
        widest: Tilt of the hand's axis at the end of the spiral [rad].
        rules: What to keep to. Where the hand cannot go, it leaves that part of the spiral out.
        spacing: From turn to turn of the spiral [rad].
        begin: Where the spiral begins [rad]; one that begins half a turn later goes between the turns of the first.

    Returns:
        ``reached``; ``nothing`` if no frontal beam met anything; ``timeout``.
    """
    run = Steering("look", robot, rules)
    start, seen, angle = run.sensed.T_world_hand, False, 0.0
    frontal = list(run.hand.frontal)
    pivot = _pivot(run.hand)
    while (tilt := spacing * angle / (2 * math.pi)) < widest:
        target = _tilted(start, pivot, tilt, angle, begin)
        twist, _, behind = towards(run, target)
        ending = run.step(twist)
        if ending == "timeout":
            return run.end(ending)
        seen |= bool(np.isfinite(run.sensed.ranges[frontal]).any())
        if behind < _LAG or run.share < 0.5:
            angle += rules.turn * robot.period / max(tilt, 0.5 * spacing)
    while True:
        twist, missing, behind = towards(run, start)
        if missing < 1e-3 and behind < 0.01:
            break
        if ending := run.step(twist):
            return run.end(ending)
    return run.end("reached", "looked around") if seen else run.end("nothing", "nothing was within range")


def looked(
    hand: Hand, T_world_hand: Transforms, widest: float, *, spacing: float = 0.09, begin: float = 0.0
) -> Transforms:
    """The poses that a look from a pose takes, about a finger's breadth from one to the next ``(n, 4, 4)``."""
    last = 2 * math.pi * widest / spacing
    angles = np.linspace(0.0, last, 2 + int(last / _PACE))
    poses = [_tilted(T_world_hand, _pivot(hand), spacing * a / (2 * math.pi), a, begin) for a in angles]
    return np.stack(poses)


def _pivot(hand: Hand) -> FloatArray:
    """The middle of the hand's thickest part ``(3,)``, in its frame [m]."""
    return np.asarray(hand.body.centres[int(np.argmax(hand.body.radii))])


def _tilted(T: Transforms, pivot: FloatArray, tilt: float, angle: float, begin: float) -> Transforms:
    """A pose turned by ``tilt`` about an axis across z at ``angle``, and about z, through a point of the hand."""
    x, y = math.cos(begin + angle), math.sin(begin + angle)
    tilted = advance(T, turn(np.array([tilt * x, tilt * y, 0.0]), pivot), 1.0)
    return advance(tilted, turn(np.array([0.0, 0.0, _SPIN * math.sin(angle / _SPIN_OVER)]), pivot), 1.0)
