"""Guarded motions: approach a surface up to a stand-off, retreat from it, align square to it, and follow it.

The ranges of the two frontal sensors give the height ``h`` of the hand's front above the surface and the tilt ``a``
about the axis perpendicular to the pair. :class:`~tanteo.hand.motion.Loop` drives both to their references. The hand
rotates about the surface point below its front, so that the tilt loop does not disturb the height loop.
"""

from __future__ import annotations

import math

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Tangents, Transforms, Vectors
from tanteo.hand.motion.steering import Motion, Rules, Steering, blind, frontal
from tanteo.hand.robot import HIT, Hand, HandReading, Robot
from tanteo.hand.twists import advance, rotation_twist, translation_twist
from tanteo.words.findings import (
    AtStandoff,
    Followed,
    MovedBack,
    NoRanges,
    NoSurfaceAhead,
    NotUnderSensors,
    SurfaceBent,
    SurfaceEnded,
    TwoSurfaces,
)

_NEAR_ENOUGH = 0.05
"""Deviation from the stand-off, as a fraction of it, at which an approach has arrived."""

_STILL = 5
"""Number of periods beyond the dead time for which an approach must stay there."""


def approach(robot: Robot, standoff: float, rules: Rules, *, reach: float) -> Motion:
    """Move ahead until the shorter of the two frontal ranges equals the stand-off, and hold it (guarded motion).

    Args:
        robot: robot that carries the hand.
        standoff: distance of the hand's front from the surface [m].
        rules: limits of the motion.
        reach: largest distance to move [m].

    Returns:
        ``reached``; ``nothing`` beyond the reach; ``lost`` if the surface gives no ranges; ``limit``; ``timeout``.
    """
    run = Steering("approach", robot, rules)
    start, still = run.sensed.T_world_hand, 0
    while True:
        ranges, _ = frontal(run)
        ranges = np.where(np.isfinite(ranges), ranges, run.free_range[list(run.hand.frontal)])
        error = float(ranges.min()) - standoff
        if blind(run):
            return run.end("lost", NoRanges())
        still = still + 1 if abs(error) < _NEAR_ENOUGH * standoff else 0
        if still > _STILL + run.loop.delay:
            return run.end("reached", AtStandoff(standoff, square=False))
        gone = float((run.sensed.T_world_hand[:3, 3] - start[:3, 3]) @ start[:3, 2])
        if gone > reach:
            return run.end("nothing", NoSurfaceAhead(reach))
        speed = float(np.clip(run.loop.gain * error, -rules.speed, rules.speed)) if np.isfinite(error) else rules.speed
        if ending := run.step(translation_twist(np.array([0.0, 0.0, speed]))):
            return run.end(ending)


def retreat(robot: Robot, distance: float, rules: Rules) -> Motion:
    """Move straight back by a distance.

    No sensor covers the space behind the hand: retreat along a path that the hand has just taken, or in free space.

    Args:
        robot: robot that carries the hand.
        distance: distance to move [m].
        rules: limits of the motion.

    Returns:
        ``reached``, ``limit`` or ``timeout``.
    """
    run = Steering("retreat", robot, rules)
    start = run.sensed.T_world_hand
    while True:
        left = distance - float((start[:3, 3] - run.sensed.T_world_hand[:3, 3]) @ start[:3, 2])
        if left < 5e-4:
            return run.end("reached", MovedBack(distance))
        speed = min(run.loop.gain * left + 1e-3, rules.speed)
        if ending := run.step(translation_twist(np.array([0.0, 0.0, -speed]))):
            return run.end(ending)


JUMP = 0.5
"""Change between successive ranges, as a fraction of the stand-off, at which the surface is lost."""

SLOWEST_ANSWER = 0.15
"""Largest speed along the surface as a fraction of stand-off times gain; on a slope of 45 degrees the height error then
stays below a sixth of the stand-off."""

_BENT, _CREEP = math.radians(6.0), 0.1
"""Tilt at which the speed is reduced most [rad], and the remaining fraction of the speed."""

_ASTRAY = 3
"""Number of successive outliers that end the motion; a single one may be an echo from the rim of the cone."""

_AT_REST, _LEVEL = 0.03, math.radians(1.0)
"""Largest height error, as a fraction of the stand-off, and tilt [rad] of an aligned hand."""


def align(robot: Robot, standoff: float, rules: Rules, *, max_tilt: float = math.radians(60.0)) -> Motion:
    """Rotate the hand square to the surface in the plane of its two frontal sensors, at the stand-off.

    The tilt about the line through the sensors stays unchanged. The paper's second direction needs a quarter turn of
    the hand, or a scan across.

    Args:
        robot: robot with the hand near the surface.
        standoff: height to hold [m].
        rules: limits of the motion.
        max_tilt: largest tilt of a single surface [rad]; a greater one indicates a step between the sensors.

    Returns:
        ``reached``; ``lost`` if one of the two sensors hits no surface, or a different one; ``limit``; ``timeout``.
    """
    run = Steering("align", robot, rules)
    window = 8 + run.loop.delay
    recent: list[tuple[float, float]] = []
    while True:
        height, tilt, both = seen_surface(run)
        if not both:
            return run.end("lost", NoRanges() if blind(run) else NotUnderSensors(both=True))
        if abs(tilt) > max_tilt:
            return run.end("lost", TwoSurfaces(tilt))
        recent.append((height - standoff, tilt))
        mean = np.abs(np.mean(recent[-window:], axis=0))
        if len(recent) >= window and mean[0] < _AT_REST * standoff and mean[1] < _LEVEL:
            return run.end("reached", AtStandoff(standoff, square=True))
        if ending := run.step(hold(run, standoff, height, tilt)):
            return run.end(ending)


def aligned_pose(hand: Hand, sensed: HandReading, standoff: float) -> Transforms | None:
    """Return the pose to which :func:`align` would bring the hand, computed from one reading.

    Args:
        hand: sensors and body of the hand.
        sensed: current reading.
        standoff: height to hold [m].

    Returns:
        The pose ``(4, 4)`` for a flat surface; None unless both frontal sensors have a range.
    """
    ranges = sensed.ranges[list(hand.frontal)]
    if not (sensed.states[list(hand.frontal)] == HIT).all():
        return None
    height, tilt = _height_and_tilt(hand, ranges)
    turned = advance(
        sensed.T_world_hand, rotation_twist(tilt * _axis(hand), hand.front + np.array([0.0, 0.0, height])), 1.0
    )
    return advance(turned, translation_twist(np.array([0.0, 0.0, height - standoff])), 1.0)


def follow(
    robot: Robot, direction: Vectors, distance: float, standoff: float, rules: Rules, *, max_tilt: float = math.inf
) -> Motion:
    """Move along a surface, at the stand-off and square to it by control of the frontal ranges.

    Args:
        robot: robot with the hand near the surface.
        direction: direction of motion, perpendicular to z ``(3,)``, hand frame.
        distance: distance to move [m].
        standoff: height to hold [m].
        rules: limits of the motion.
        max_tilt: rotation of the hand from its start at which the surface has bent away [rad].

    Returns:
        ``reached`` after the distance; ``lost`` if the surface ends or bends away; ``limit``; ``timeout``.
    """
    heading = level(direction)
    run = Steering("follow", robot, rules)
    ahead = run.sensed.T_world_hand[:3, 2]
    speed = min(rules.speed, SLOWEST_ANSWER * standoff * run.loop.gain)
    gone, astray, last = 0.0, 0, frontal(run)[0]
    if not np.isfinite(last).all():
        return run.end("lost", NotUnderSensors(both=True))
    while gone < distance:
        height, tilt, both = seen_surface(run)
        ranges = frontal(run)[0]
        jumped = not both or bool((np.abs(ranges - last) > JUMP * standoff).any())
        astray, last = (astray + 1, last) if jumped else (0, ranges)
        if astray >= _ASTRAY:
            return run.end("lost", SurfaceEnded(gone))
        if math.acos(min(float(ahead @ run.sensed.T_world_hand[:3, 2]), 1.0)) > max_tilt:
            return run.end("lost", SurfaceBent(gone))
        correction = hold(run, standoff, height, tilt) if not jumped else np.zeros(6)
        before = run.sensed.T_world_hand
        slower = max(_CREEP, 1.0 - abs(tilt) / _BENT)
        if ending := run.step(translation_twist(slower * speed * heading) + correction):
            return run.end(ending)
        moved = SE3.apply(run.sensed.T_world_hand, run.hand.front) - SE3.apply(before, run.hand.front)
        gone += max(float(before[:3, :3] @ heading @ moved), 0.0)
    return run.end("reached", Followed(distance))


def seen_surface(run: Steering) -> tuple[float, float, bool]:
    """Return height [m] and tilt [rad] of the surface under the frontal sensors, and whether both have a range."""
    ranges, hit = frontal(run)
    if not hit.all():
        return float(ranges.min()), 0.0, False
    return *_height_and_tilt(run.hand, ranges), True


def _height_and_tilt(hand: Hand, ranges: FloatArray) -> tuple[float, float]:
    tilt = math.atan((ranges[1] - ranges[0]) / hand.baseline)
    return float(0.5 * (ranges[0] + ranges[1]) * math.cos(tilt)), tilt


def _axis(hand: Hand) -> Vectors:
    """Return the axis about which a positive rotation reduces a positive tilt ``(3,)``, hand frame."""
    return np.array([hand.pair[1], -hand.pair[0], 0.0])


def hold(run: Steering, standoff: float, height: float, tilt: float) -> Tangents:
    """Return the twist that corrects height [m] and tilt [rad], within the speed limits of the rules."""
    gain, rules = run.loop.gain, run.rules
    speed = max(-rules.speed, min(rules.speed, gain * (height - standoff)))
    rate = max(-rules.turn, min(rules.turn, gain * tilt))
    below = run.hand.front + np.array([0.0, 0.0, height])
    return translation_twist(np.array([0.0, 0.0, speed])) + rotation_twist(rate * _axis(run.hand), below)


def level(direction: Vectors) -> FloatArray:
    """Return the unit direction of the part of a vector that is perpendicular to the hand's z.

    Raises:
        InputError: The vector is parallel to z.
    """
    across = np.array([float(direction[0]), float(direction[1]), 0.0])
    length = float(np.linalg.norm(across))
    if not length > 1e-9:
        raise InputError(f"direction: expected one across the hand's z, got {list(direction)}. Give x and y.")
    return np.asarray(across / length)
