"""Scan a face: align the hand with it, move across the line of the two frontal sensors and along it, and fit a plane.

In a motion across the line, each sensor measures one line of the surface. Two lines along a bend, one on each side,
lie in one plane that does not exist. In a motion along the line, each sensor measures the slope of its own side, so the
fit rejects that plane.
"""

from __future__ import annotations

import math

import numpy as np

from tanteo.features import Feature
from tanteo.geometry import SE3
from tanteo.geometry.typing import Transforms
from tanteo.hand.acquisition.record import fitted_feature, plane_readings
from tanteo.hand.acquisition.run import Attempt, SensingRun, failed
from tanteo.hand.acquisition.seen import over
from tanteo.hand.acquisition.ways import fits, nearly_known, squared
from tanteo.hand.motion.following import align, aligned_pose, follow
from tanteo.hand.motion.steering import Motion
from tanteo.hand.motion.travelling import go_to, path
from tanteo.hand.robot import Hand, HandReading
from tanteo.sensors import Readings
from tanteo.words.findings import NoSpace, NotOneFeature, ReadingsTaken, ScanTooShort, SurfaceLost

INSTANTS = 20
"""Number of instants of the scan across the pair, and of that along it; each has two readings."""

ALONG = 0.005
"""Distance of the scan along the pair to each side [m]."""

WIDTHS = 0.015, 0.0075, 0.004
"""Half widths of a scan across the pair, the largest with enough clearance first [m]."""

_MOST_ASKEW = np.radians(25.0)
"""Largest tilt of a face after two scans from above [rad]."""

_LITTLE = np.radians(6.0)
"""Rotation below which the clearance of the descent is sufficient for the fingers [rad]."""

_SQUARE = np.radians(1.5)
"""Tilt to the scanned plane above which the hand is aligned and scans again [rad]."""

_FLAT = np.radians(6.0)
"""A scan along which the hand has to turn by more than this has left the face: over a ridge its fingers would come near
to it [rad]."""

_SURE = np.radians(3.0)
"""A plane whose tilt is known no better than this is not acquired [rad]."""

_NO_TURN = Motion("turn", "limit", NoSpace("to turn it square to the face"), ())


def scan(run: SensingRun, label: str, width: float) -> Attempt:
    """Align and scan; repeat with a smaller width if the hand was not aligned or the readings do not fit one plane.

    The hand is at the stand-off over the face.

    Args:
        run: running acquisition.
        label: label of the plane.
        width: half width of the scan across the pair [m].
    """
    for again in range(3):
        readings, attempt, doubt = _scan_once(run, width, label)
        if readings is None or attempt[2] is None or again == 2:
            break
        if doubt:
            width = min(width, WIDTHS[1])
        if _askew(run, attempt[2]) > _SQUARE:
            target = squared(run, attempt[2])
            allowed = _may_turn(run, target)
            turned = run.does(go_to(run.robot, target, run.rules)) if allowed else _NO_TURN
            if not turned.reached:
                return failed(turned)
        elif not doubt:
            break
    if readings is None or attempt[2] is None:
        return attempt
    if doubt:
        return "unclear", NotOneFeature("plane", doubt), None
    if float(np.sqrt(np.diag(attempt[2].P)[1:].max())) > _SURE:
        return "unclear", ScanTooShort(), None
    run.readings.append(readings)
    return attempt


def _scan_once(run: SensingRun, width: float, label: str) -> tuple[Readings | None, Attempt, str]:
    """Align, scan across the pair and along it, and fit; return readings, result, and why they fit no plane."""
    hand, robot, standoff, rules = run.hand, run.robot, run.standoff, run.rules
    square = _align(run)
    if not square.reached:
        return None, failed(square), ""
    log, home = list[HandReading](), robot.sensed.T_world_hand
    for direction, distance in ((np.cross([0.0, 0.0, 1.0], hand.pair), width), (hand.pair, ALONG)):
        line = list[HandReading]()
        for way in (direction, -direction):
            part = run.does(follow(robot, way, distance, standoff, rules, max_tilt=_FLAT))
            if part.status in ("limit", "timeout"):
                return None, failed(part), ""
            line += _on_surface(part.log, hand, standoff)
            back = run.does(go_to(robot, home, rules))
            if not back.reached:
                return None, failed(back), ""
        log += [line[k] for k in np.unique(np.linspace(0, len(line) - 1, INSTANTS).round().astype(int))] if line else []
    readings = plane_readings(hand, log, label)
    if readings is None or len(readings) < 4:
        return None, ("lost", SurfaceLost(), None), ""
    feature, why = fitted_feature(readings, label, hand.rig, run.errors)
    if feature is None:
        return None, ("unclear", NotOneFeature("plane", why), None), ""
    return readings, ("acquired", ReadingsTaken(len(readings)), feature), why


def _align(run: SensingRun) -> Motion:
    """Align the hand with the face if there is clearance for the rotation."""
    target = aligned_pose(run.hand, run.robot.sensed, run.standoff)
    if target is not None and not _may_turn(run, target):
        return _NO_TURN
    return run.does(align(run.robot, run.standoff, run.rules, max_tilt=_MOST_ASKEW))


def _may_turn(run: SensingRun, target: Transforms) -> bool:
    """Return whether the sensed points leave clearance for a rotation, which moves the rear of the fingers sideways."""
    hand, T = run.hand, run.robot.sensed.T_world_hand
    if T[:3, 2] @ target[:3, 2] > math.cos(_LITTLE):
        return True
    normal = -target[:3, 2]
    foot = SE3.apply(target, hand.front) - run.standoff * normal
    way = path(T, target, hand.front, 6)
    return fits(run, over(run.seen(), foot, normal), way) and nearly_known(run, way)


def _askew(run: SensingRun, face: Feature) -> float:
    """Return the angle between the hand's axis and the normal of a plane [rad]."""
    cosine = -face.T_world_feature[:3, 2] @ run.robot.sensed.T_world_hand[:3, 2]
    return float(np.arccos(np.clip(cosine, -1, 1)))


def _on_surface(log: tuple[HandReading, ...], hand: Hand, standoff: float) -> list[HandReading]:
    """Return the readings of a scan in which both frontal sensors measure approximately the stand-off."""
    pair = list(hand.frontal)
    return [s for s in log if bool((np.abs(np.nan_to_num(s.ranges[pair]) - standoff) < 0.25 * standoff).all())]
