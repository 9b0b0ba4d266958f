"""A face: look, choose a patch, stand over it, settle square to it, scan it in two directions, fit."""

from __future__ import annotations

import numpy as np

from tanteo.acquisition.acquired import Acquired, Attempt, failed
from tanteo.acquisition.cloud import beside, cloud_of, over
from tanteo.acquisition.ideas import FaceIdea
from tanteo.acquisition.patch import Patch, find_patch, stands
from tanteo.acquisition.record import fitted_feature, plane_readings
from tanteo.acquisition.session import Session, back_off, finish
from tanteo.acquisition.ways import facing, fits, known, look_around, moved, path, squared
from tanteo.features import Feature
from tanteo.hand import Hand, Robot, Sensed
from tanteo.motion import Motion, Rules, approach, follow, go_to, settle
from tanteo.sensors import Readings, RobotPreset
from tanteo.typing import FloatArray

HOVER = 0.06
"""The hand stands so much higher than the stand-off before it comes down [m]."""

LOOKS = ((0.25, 0.09), *(((0.22, 0.05),) * 6))
"""Of each look around: tilt of the hand's axis at its end, and from turn to turn of the spiral [rad]."""


_ELSEWHERE = 0.008
"""Another place to stand is this far from those that failed [m]."""

_UNSURE: Attempt = ("unclear", "the face was not found at the same place twice", None)

_MOST_ASKEW = np.radians(25.0)
"""A face over which the hand stands by two looks is not more askew than this [rad]."""


_ASTRAY = np.radians(12.0)
"""A face whose normal is this far from what it should be is looked at once more from above [rad]."""


READINGS = 40
"""Readings of a scan that are kept."""

_WIDE = 0.004
"""Least room around both sensors on a patch [m]."""

SCAN = 0.015
"""Half width of a scan across the pair [m]."""

_SQUARE = np.radians(1.5)
"""A hand that is more askew than this to what it scanned turns square and scans again [rad]."""

_SURE = np.radians(3.0)
"""A plane whose tilt is known no better than this is not acquired [rad]."""


def sense_plane(
    robot: Robot,
    idea: FaceIdea,
    *,
    standoff: float,
    rules: Rules,
    label: str = "plane",
    errors: RobotPreset | str | None = None,
) -> Acquired:
    """Acquire a flat face.

    The scan runs across the line between the two frontal sensors, whose readings are the two rows of it: the paper's
    two directions, each with many points instead of two.

    Args:
        robot: The hand, some way before the face, so that its beams reach it.
        idea: About where the face is.
        standoff: Of the hand's front during the scan [m]; :data:`LEAST_STANDOFF` clearances or more.
        rules: What to keep to.
        label: Of the readings and the feature.
        errors: Of the robot's poses, for the covariance.

    Raises:
        InputError: A stand-off too near to the clearance of the rules.
    """
    session = Session(robot, standoff, rules, errors)
    status, message, feature = acquire_plane(session, idea, label)
    return finish("plane", session, status, message, feature)


def acquire_plane(session: Session, idea: FaceIdea, label: str) -> Attempt:
    """The same within a session; the hand is left over the face, square to it.

    What was seen obliquely from afar is seen better from above: the hand looks again from over the patch, until its
    idea of the face stays the same, and again if the face then is not where it should be, or not all was seen where the
    hand is to go.
    """
    attempt: Attempt = ("nothing", "nothing flat was seen where the face should be", None)
    wanted, first, failed_at = idea, len(session.motions), list[FloatArray]()
    for tilt, spacing in LOOKS:
        looked = look_around(session, tilt, spacing)
        if looked.status == "timeout":
            return failed(looked)
        patch = find_patch(cloud_of(session.hand, session.motions[first:]), wanted) if looked.reached else None
        if patch is None:
            attempt = failed(looked) if not looked.reached else attempt
            continue
        turned = float(np.arccos(np.clip(patch.normal @ wanted.normal, -1, 1)))
        above = hover(session, patch, idea.point, failed_at, closely=turned <= _ASTRAY)
        if not above.reached and turned <= _ASTRAY:
            attempt = failed(above)
            above = hover(session, patch, idea.point, failed_at, closely=False)
            turned = np.inf
        if not above.reached:
            attempt = failed(above)
            continue
        # the next look is from here: what it shows replaces what was seen before
        wanted, first = FaceIdea(patch.point, patch.normal), len(session.motions)
        if turned > _ASTRAY:
            attempt = attempt if np.isinf(turned) else _UNSURE
            continue
        down = session.does(
            approach(session.robot, session.standoff, session.rules, reach=2 * HOVER + session.standoff)
        )
        attempt = scan(session, label) if down.reached else failed(down)
        if attempt[0] not in ("lost", "nothing", "unclear"):
            return attempt
        failed_at.append(session.places[-1])
        first = len(session.motions)
        back = back_off(session, HOVER)
        if not back.reached:
            return attempt
    return attempt


def hover(session: Session, patch: Patch, wanted: FloatArray, avoid: list[FloatArray], *, closely: bool) -> Motion:
    """Bring the hand over a patch, where what was seen leaves room for it there and below at the stand-off.

    Args:
        session: The acquisition.
        patch: Where the face seems to be.
        wanted: Where the hand should rather stand ``(3,)`` [m].
        avoid: Places where the face could not be scanned.
        closely: Only where all was seen free that the fingers will take, because it comes down next.
    """
    hand, cloud, high = session.hand, session.seen(), session.standoff + HOVER
    raised, other = over(cloud, patch.point, patch.normal), beside(cloud, patch.point, patch.normal)
    now, why = session.robot.sensed.T_world_hand, "no face is wide enough for both sensors"
    for width, place, along in stands(patch, hand.baseline, wanted):
        if width < _WIDE:
            break
        if any(np.linalg.norm(place - tried) < _ELSEWHERE for tried in avoid):
            continue
        down, up = (facing(hand, place, patch.normal, along, h, now) for h in (session.standoff, high))
        across = SCAN * np.cross(patch.normal, along)
        low = np.stack([moved(down, across), down, moved(down, -across)])
        if not (fits(session, raised, low) and fits(session, other, path(now, up, hand.front, 24))):
            why = "there is no room for the hand over the face"
        elif closely and not known(session, np.concatenate([low, path(down, up, hand.front, 8)])):
            why = "not all was seen around the place where the hand should come down"
        else:
            session.places.append(place)
            return session.does(go_to(session.robot, up, session.rules))
    return Motion("hover", "nothing" if why.startswith("no face") else "limit", why, ())


def scan(session: Session, label: str) -> Attempt:
    """Settle and scan, again and narrower where the hand was not square or the readings disagree with one plane."""
    width = SCAN
    for again in range(3):
        readings, attempt, doubt = _scan_once(session, width, label)
        if readings is None or attempt[2] is None or again == 2:
            break
        if doubt:
            width *= 0.5
        if _askew(session, attempt[2]) > _SQUARE:
            turned = session.does(go_to(session.robot, squared(session, attempt[2]), session.rules))
            if not turned.reached:
                return failed(turned)
        elif not doubt:
            break
    if readings is None or attempt[2] is None:
        return attempt
    if doubt:
        return "unclear", f"what was scanned is not one plane: {doubt}", None
    if float(np.sqrt(np.diag(attempt[2].P)[1:].max())) > _SURE:
        return "unclear", "the scan is too short for the tilt of the face", None
    session.readings.append(readings)
    return attempt


def _scan_once(session: Session, width: float, label: str) -> tuple[Readings | None, Attempt, str]:
    """Settle, go across the pair to both sides, fit; and what speaks against one plane."""
    hand, robot, standoff, rules = session.hand, session.robot, session.standoff, session.rules
    settled = session.does(settle(robot, standoff, rules, most=_MOST_ASKEW))
    if not settled.reached:
        return None, failed(settled), ""
    across = np.cross([0.0, 0.0, 1.0], hand.pair)
    log, home = list[Sensed](), robot.sensed.T_world_hand
    for direction in (across, -across):
        part = session.does(follow(robot, direction, width, standoff, rules))
        if part.status in ("limit", "timeout"):
            return None, failed(part), ""
        log += _on_surface(part.log, hand, standoff)
        back = session.does(go_to(robot, home, rules))
        if not back.reached:
            return None, failed(back), ""
    readings = plane_readings(hand, log, label, READINGS)
    if readings is None or len(readings) < 4:
        return None, ("lost", "the surface was not under the frontal sensors for long enough", None), ""
    feature, why = fitted_feature(readings, label, hand.rig, session.errors)
    if feature is None:
        return None, ("unclear", why, None), ""
    return readings, ("acquired", f"{len(readings)} readings", feature), why


def _askew(session: Session, face: Feature) -> float:
    """Angle between the hand's axis and the normal of a plane [rad]."""
    cosine = -face.T_world_feature[:3, 2] @ session.robot.sensed.T_world_hand[:3, 2]
    return float(np.arccos(np.clip(cosine, -1, 1)))


def _on_surface(log: tuple[Sensed, ...], hand: Hand, standoff: float) -> list[Sensed]:
    """Of a scan, the instants at which both frontal sensors read about the stand-off."""
    pair = list(hand.frontal)
    return [s for s in log if bool((np.abs(np.nan_to_num(s.ranges[pair]) - standoff) < 0.25 * standoff).all())]
