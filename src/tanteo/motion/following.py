"""Towards a surface until a stand-off, back from it, and along it without touching it.

The ranges of the two frontal sensors give the height ``h`` of the front over the surface and its tilt ``a`` about the
axis across the pair. Both are driven to their references by the gain of :class:`~tanteo.motion.Loop`; the hand turns
about the point of the surface that it looks at, so that the tilt loop does not disturb the height loop.
"""

from __future__ import annotations

import math

import numpy as np

from tanteo.errors import InputError
from tanteo.hand import MET, Hand, HandReading, Robot, advance, shift, turn
from tanteo.lie import SE3
from tanteo.motion.steering import Motion, Rules, Steering, blind, frontal
from tanteo.typing import FloatArray, Tangents, Transforms, Vectors

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


JUMP = 0.5
"""A range that leaves the last one by this share of the stand-off has lost the surface."""

SLOWEST_ANSWER = 0.15
"""Along the surface the hand goes at most this share of stand-off times gain: on a slope of 45 degrees the height is
then wrong by less than a sixth of the stand-off."""

_BENT, _CREEP = math.radians(6.0), 0.1
"""The more the hand is tilted the slower it goes on, down to this share at this tilt: first it turns, then it goes."""

_ASTRAY = 3
"""Readings in a row that must be outliers: a single one may be an echo from the rim of the cone."""

_AT_REST, _LEVEL = 0.03, math.radians(1.0)
"""The hand has settled with the height within this share of the stand-off and the tilt within this angle [rad]."""


def settle(robot: Robot, standoff: float, rules: Rules, *, max_tilt: float = math.radians(60.0)) -> Motion:
    """Turn the hand square to the surface in the plane of its two frontal sensors, at the stand-off.

    The tilt about the line that joins them stays as it is: the paper's second direction needs a turn of the hand by a
    quarter, or a scan across.

    Args:
        robot: The hand, near the surface.
        standoff: Height to hold [m].
        rules: What to keep to.
        max_tilt: A greater tilt is not that of one surface under both sensors, but a step between them [rad].

    Returns:
        ``reached``; ``lost`` where one of the two sensors meets no surface, or another one; ``limit``; ``timeout``.
    """
    run = Steering("settle", robot, rules)
    window = 8 + run.loop.delay
    recent: list[tuple[float, float]] = []
    while True:
        height, tilt, both = seen_surface(run)
        if not both:
            why = "gives no ranges" if blind(run) else "is not under both frontal sensors"
            return run.end("lost", f"the surface {why}")
        if abs(tilt) > max_tilt:
            return run.end(
                "lost", f"the two sensors are not over one surface: it seems {math.degrees(tilt):.0f} deg askew"
            )
        recent.append((height - standoff, tilt))
        mean = np.abs(np.mean(recent[-window:], axis=0))
        if len(recent) >= window and mean[0] < _AT_REST * standoff and mean[1] < _LEVEL:
            return run.end("reached", f"square to the surface, {1e3 * standoff:.3g} mm from it")
        if ending := run.step(hold(run, standoff, height, tilt)):
            return run.end(ending)


def settled(hand: Hand, sensed: HandReading, standoff: float) -> Transforms | None:
    """Where :func:`settle` would bring the hand over what its two frontal sensors meet now ``(4, 4)``.

    Args:
        hand: The hand.
        sensed: What it senses.
        standoff: Height to hold [m].

    Returns:
        The pose, if the surface is flat; None unless both sensors meet one.
    """
    ranges = sensed.ranges[list(hand.frontal)]
    if not (sensed.states[list(hand.frontal)] == MET).all():
        return None
    height, tilt = _height_and_tilt(hand, ranges)
    turned = advance(sensed.T_world_hand, turn(tilt * _axis(hand), hand.front + np.array([0.0, 0.0, height])), 1.0)
    return advance(turned, shift(np.array([0.0, 0.0, height - standoff])), 1.0)


def follow(
    robot: Robot, direction: Vectors, distance: float, standoff: float, rules: Rules, *, max_tilt: float = math.inf
) -> Motion:
    """Go along a surface in a direction of the hand, held at the stand-off and square to it by the frontal sensors.

    Args:
        robot: The hand, near the surface.
        direction: In the hand's frame, across z ``(3,)``.
        distance: How far [m].
        standoff: Height to hold [m].
        rules: What to keep to.
        max_tilt: A surface that turns the hand by more than this has bent away [rad].

    Returns:
        ``reached`` after the distance; ``lost`` where the surface ends or bends away; ``limit``; ``timeout``.
    """
    heading = level(direction)
    run = Steering("follow", robot, rules)
    ahead = run.sensed.T_world_hand[:3, 2]
    speed = min(rules.speed, SLOWEST_ANSWER * standoff * run.loop.gain)
    gone, astray, last = 0.0, 0, frontal(run)[0]
    if not np.isfinite(last).all():
        return run.end("lost", "the surface is not under both frontal sensors")
    while gone < distance:
        height, tilt, both = seen_surface(run)
        ranges = frontal(run)[0]
        jumped = not both or bool((np.abs(ranges - last) > JUMP * standoff).any())
        astray, last = (astray + 1, last) if jumped else (0, ranges)
        if astray >= _ASTRAY:
            return run.end("lost", f"the surface ended after {1e3 * gone:.3g} mm")
        if math.acos(min(float(ahead @ run.sensed.T_world_hand[:3, 2]), 1.0)) > max_tilt:
            return run.end("lost", f"the surface bent away after {1e3 * gone:.3g} mm")
        correction = hold(run, standoff, height, tilt) if not jumped else np.zeros(6)
        before = run.sensed.T_world_hand
        slower = max(_CREEP, 1.0 - abs(tilt) / _BENT)
        if ending := run.step(shift(slower * speed * heading) + correction):
            return run.end(ending)
        moved = SE3.apply(run.sensed.T_world_hand, run.hand.front) - SE3.apply(before, run.hand.front)
        gone += max(float(before[:3, :3] @ heading @ moved), 0.0)
    return run.end("reached", f"{1e3 * distance:.3g} mm along the surface")


def seen_surface(run: Steering) -> tuple[float, float, bool]:
    """Height [m] and tilt [rad] of the surface under the two frontal sensors, and whether both met it."""
    ranges, met = frontal(run)
    if not met.all():
        return float(ranges.min()), 0.0, False
    return *_height_and_tilt(run.hand, ranges), True


def _height_and_tilt(hand: Hand, ranges: FloatArray) -> tuple[float, float]:
    tilt = math.atan((ranges[1] - ranges[0]) / hand.baseline)
    return float(0.5 * (ranges[0] + ranges[1]) * math.cos(tilt)), tilt


def _axis(hand: Hand) -> Vectors:
    """About which a positive turn takes a positive tilt back ``(3,)``."""
    return np.array([hand.pair[1], -hand.pair[0], 0.0])


def hold(run: Steering, standoff: float, height: float, tilt: float) -> Tangents:
    """The twist that brings height and tilt back, within the rules."""
    gain, rules = run.loop.gain, run.rules
    speed = max(-rules.speed, min(rules.speed, gain * (height - standoff)))
    rate = max(-rules.turn, min(rules.turn, gain * tilt))
    below = run.hand.front + np.array([0.0, 0.0, height])
    return shift(np.array([0.0, 0.0, speed])) + turn(rate * _axis(run.hand), below)


def level(direction: Vectors) -> FloatArray:
    """A unit direction across the hand's z.

    Raises:
        InputError: It has no part across z.
    """
    across = np.array([float(direction[0]), float(direction[1]), 0.0])
    length = float(np.linalg.norm(across))
    if not length > 1e-9:
        raise InputError(f"direction: expected one across the hand's z, got {list(direction)}. Give x and y.")
    return np.asarray(across / length)
