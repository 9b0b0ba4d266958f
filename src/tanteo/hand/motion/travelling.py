"""Motions through free space: go to a pose with the hand's front on a straight line, and scan the surroundings.

A scan moves the hand's axis along a spiral of tilts about the centre of the hand's thickest part. No sensor covers the
space lag the hand, so its back stays in place while the fingers, which carry the sensors, swing and rotate.
"""

from __future__ import annotations

import math

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.hand.motion.steering import Motion, Rules, Steering
from tanteo.hand.robot import Hand, Robot
from tanteo.hand.twists import advance, pose_difference, rotation_twist, translation_twist
from tanteo.words.findings import AtPose, AtRest, NothingInRange, SurroundingsScanned

_CLOSE, _TURNED = 5e-4, 2e-3
"""Distance [m] and angle [rad] within which a pose counts as reached."""


def go_to(robot: Robot, T_world_hand: Transforms, rules: Rules) -> Motion:
    """Move the hand to a pose.

    Args:
        robot: robot that carries the hand.
        T_world_hand: target pose ``(4, 4)``, as the robot reports poses.
        rules: limits of the motion.

    Returns:
        ``reached``, ``limit`` or ``timeout``.
    """
    run = Steering("go to", robot, rules)
    while True:
        twist, missing, angle = towards(run, T_world_hand)
        if missing < _CLOSE and angle < _TURNED:
            return run.end("reached", AtPose())
        if ending := run.step(twist):
            return run.end(ending)


def dwell(robot: Robot, instants: int, rules: Rules) -> Motion:
    """Stay at rest and read.

    Args:
        robot: robot that carries the hand.
        instants: number of readings.
        rules: limits of the motion.

    Returns:
        ``reached`` after the readings, or ``timeout``.
    """
    run = Steering("dwell", robot, rules)
    for _ in range(instants):
        if run.step(np.zeros(6)) == "timeout":
            return run.end("timeout")
    return run.end("reached", AtRest(instants))


def path(T_from: Transforms, T_to: Transforms, front: FloatArray, n: int) -> Transforms:
    """Return evenly spaced poses on the path of :func:`go_to`, whose front moves on a straight line.

    Args:
        T_from: first pose of the hand ``(4, 4)``.
        T_to: last pose of the hand ``(4, 4)``.
        front: midpoint of the frontal sensors ``(3,)``, hand frame [m].
        n: number of poses.

    Returns:
        Poses ``(n, 4, 4)``.
    """
    turned, shares = pose_difference(T_from, T_to)[1], np.linspace(0, 1, n)
    out = np.stack([advance(T_from, np.array([0.0, 0.0, 0.0, *turned]), s) for s in shares])
    a, b = (SE3.apply(T, front) for T in (T_from, T_to))
    out[:, :3, 3] = a + shares[:, None] * (b - a) - out[:, :3, :3] @ front
    return out


def towards(run: Steering, T_world_hand: Transforms) -> tuple[FloatArray, float, float]:
    """Return the twist that moves the front straight to a pose, and the remaining distance [m] and angle [rad]."""
    front, T = run.hand.front, run.sensed.T_world_hand
    p, w = pose_difference(T, T_world_hand)
    # displacement of the front in the current hand frame: p + R_gap front - front
    p = p + (T[:3, :3].T @ (T_world_hand[:3, :3] @ front)) - front
    missing, angle = math.sqrt(p @ p), math.sqrt(w @ w)
    share = min(1.0, run.rules.speed / max(run.loop.gain * missing, 1e-12))
    share = min(share, run.rules.turn / max(run.loop.gain * angle, 1e-12))
    k = run.loop.gain * share
    return translation_twist(k * p) + rotation_twist(k * w, front), missing, angle


_SPIN, _SPIN_OVER = 0.8, 2.8
"""Amplitude of the oscillation about the hand's axis during a scan [rad], and its period relative to the spiral's. Four
lateral beams a quarter turn apart then cover the full circle."""

_PACE = 0.4
"""Spacing along the spiral of the poses of :func:`spiral_poses` [rad]."""

_LAG = 0.15
"""Lag of the hand behind the spiral at which the spiral waits [rad]."""


def spiral_scan(robot: Robot, widest: float, rules: Rules, *, spacing: float = 0.09, begin: float = 0.0) -> Motion:
    """Rotate the hand so that its beams scan a cone, and return to the initial pose.

    Args:
        robot: robot with the hand at a safe distance from the surfaces to scan.
        widest: tilt of the hand's axis at the end of the spiral [rad].
        rules: limits of the motion; parts of the spiral that they forbid are skipped.
        spacing: tilt between two turns of the spiral [rad].
        begin: start angle of the spiral [rad]; an offset of half a turn interleaves two scans.

    Returns:
        ``reached``; ``nothing`` if no frontal beam hit anything; ``timeout``.
    """
    run = Steering("look", robot, rules)
    start, seen, angle = run.sensed.T_world_hand, False, 0.0
    frontal = list(run.hand.frontal)
    pivot = _pivot(run.hand)
    while (tilt := spacing * angle / (2 * math.pi)) < widest:
        target = _tilted(start, pivot, tilt, angle, begin)
        twist, _, lag = towards(run, target)
        ending = run.step(twist)
        if ending == "timeout":
            return run.end(ending)
        seen |= bool(np.isfinite(run.sensed.ranges[frontal]).any())
        if lag < _LAG or run.fraction < 0.5:
            angle += rules.turn * robot.period / max(tilt, 0.5 * spacing)
    while True:
        twist, missing, lag = towards(run, start)
        if missing < 1e-3 and lag < 0.01:
            break
        if ending := run.step(twist):
            return run.end(ending)
    return run.end("reached", SurroundingsScanned()) if seen else run.end("nothing", NothingInRange())


def spiral_poses(
    hand: Hand, T_world_hand: Transforms, widest: float, *, spacing: float = 0.09, begin: float = 0.0
) -> Transforms:
    """Return the poses of a scan by :func:`spiral_scan`, about a finger's breadth apart.

    Args:
        hand: sensors and body of the hand.
        T_world_hand: pose of the hand at the start of the scan ``(4, 4)``.
        widest: tilt of the hand's axis at the end of the spiral [rad].
        spacing: tilt between two turns of the spiral [rad].
        begin: start angle of the spiral [rad].

    Returns:
        Poses ``(n, 4, 4)``.
    """
    last = 2 * math.pi * widest / spacing
    angles = np.linspace(0.0, last, 2 + int(last / _PACE))
    poses = [_tilted(T_world_hand, _pivot(hand), spacing * a / (2 * math.pi), a, begin) for a in angles]
    return np.stack(poses)


def _pivot(hand: Hand) -> FloatArray:
    """Return the centre of the largest sphere of the body ``(3,)``, hand frame [m]."""
    return np.asarray(hand.body.centres[int(np.argmax(hand.body.radii))])


def _tilted(T: Transforms, pivot: FloatArray, tilt: float, angle: float, begin: float) -> Transforms:
    """Return a pose rotated about a fixed point: by ``tilt`` about an axis perpendicular to z, then about z."""
    x, y = math.cos(begin + angle), math.sin(begin + angle)
    tilted = advance(T, rotation_twist(np.array([tilt * x, tilt * y, 0.0]), pivot), 1.0)
    return advance(tilted, rotation_twist(np.array([0.0, 0.0, _SPIN * math.sin(angle / _SPIN_OVER)]), pivot), 1.0)
