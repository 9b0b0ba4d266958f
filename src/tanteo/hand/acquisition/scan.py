"""A scan of a face: settle square to it, go across the line of the two frontal sensors and along it, fit.

Across it each sensor sees one line of the surface. Two lines along a bend, one on each side of it, are in one plane
that is not there; along the line each sensor sees the slope of what is under it alone, and the fit tells.
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
from tanteo.hand.motion.following import follow, settle, settled
from tanteo.hand.motion.steering import Motion
from tanteo.hand.motion.travelling import go_to, path
from tanteo.hand.robot import Hand, HandReading
from tanteo.sensors import Readings
from tanteo.words.findings import NoRoom, NotOneFeature, ReadingsTaken, ScanTooShort, SurfaceLost

INSTANTS = 20
"""Instants that are kept of the scan across the pair, and as many of that along it; each is two readings."""

ALONG = 0.005
"""The scan along the pair goes so far to each side [m]."""

WIDTHS = 0.015, 0.0075, 0.004
"""Half widths of a scan across the pair, where there is room for it [m]."""

_MOST_ASKEW = np.radians(25.0)
"""A face over which the hand stands by two looks is not more askew than this [rad]."""

_LITTLE = np.radians(6.0)
"""A turn by less takes the fingers no farther aside than they had to have room for when they came down [rad]."""

_SQUARE = np.radians(1.5)
"""A hand that is more askew than this to what it scanned turns square and scans again [rad]."""

_FLAT = np.radians(6.0)
"""A scan along which the hand has to turn by more than this has left the face: over a ridge its fingers would come near
to it [rad]."""

_SURE = np.radians(3.0)
"""A plane whose tilt is known no better than this is not acquired [rad]."""

_NO_TURN = Motion("turn", "limit", NoRoom("to turn it square to the face"), ())


def scan(run: SensingRun, label: str, width: float) -> Attempt:
    """Settle and scan, again and narrower where the hand was not square or the readings disagree with one plane.

    The hand is at the stand-off over the face.
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
    """Settle, go across the pair and along it to both sides, fit; and what speaks against one plane."""
    hand, robot, standoff, rules = run.hand, run.robot, run.standoff, run.rules
    square = _settle(run)
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


def _settle(run: SensingRun) -> Motion:
    """Settle, where there is room for the turn."""
    target = settled(run.hand, run.robot.sensed, run.standoff)
    if target is not None and not _may_turn(run, target):
        return _NO_TURN
    return run.does(settle(run.robot, run.standoff, run.rules, max_tilt=_MOST_ASKEW))


def _may_turn(run: SensingRun, target: Transforms) -> bool:
    """Whether what was seen leaves room to turn over a face: far behind the sensors the fingers go far aside."""
    hand, T = run.hand, run.robot.sensed.T_world_hand
    if T[:3, 2] @ target[:3, 2] > math.cos(_LITTLE):
        return True
    normal = -target[:3, 2]
    foot = SE3.apply(target, hand.front) - run.standoff * normal
    way = path(T, target, hand.front, 6)
    return fits(run, over(run.seen(), foot, normal), way) and nearly_known(run, way)


def _askew(run: SensingRun, face: Feature) -> float:
    """Angle between the hand's axis and the normal of a plane [rad]."""
    cosine = -face.T_world_feature[:3, 2] @ run.robot.sensed.T_world_hand[:3, 2]
    return float(np.arccos(np.clip(cosine, -1, 1)))


def _on_surface(log: tuple[HandReading, ...], hand: Hand, standoff: float) -> list[HandReading]:
    """Of a scan, the instants at which both frontal sensors read about the stand-off."""
    pair = list(hand.frontal)
    return [s for s in log if bool((np.abs(np.nan_to_num(s.ranges[pair]) - standoff) < 0.25 * standoff).all())]
