"""A face: look, choose a patch, stand over it, settle square to it, scan it in two directions, fit."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.acquisition.acquired import Acquired, Attempt, Outcome, failed
from tanteo.acquisition.cloud import Cloud, beside, cloud_of, over, room
from tanteo.acquisition.ideas import FaceIdea
from tanteo.acquisition.patch import Patch, all_seen, find_patch, stands
from tanteo.acquisition.record import fitted_feature, join, plane_readings
from tanteo.errors import InputError
from tanteo.features import Feature
from tanteo.hand import Hand, Robot, Sensed, advance, gap
from tanteo.lie import SE3, SO3
from tanteo.motion import Motion, Rules, approach, follow, go_to, look, retreat, settle
from tanteo.sensors import Readings, RobotPreset
from tanteo.typing import FloatArray, Transforms, Vectors

HOVER = 0.03
"""The hand stands so much higher than the stand-off before it comes down [m]."""

LOOKS = ((0.25, 0.09), (0.22, 0.05), (0.22, 0.05), (0.22, 0.05))
"""Of each look around: tilt of the hand's axis at its end, and from turn to turn of the spiral [rad]."""

_BETWEEN = 5e-3
"""Something may be nearer than the points that were met on it, by so much [m]."""

_SLACK = 2e-3
"""Beyond the clearance to the bounds of the workspace: nearer, the guard would slow the hand to a stop [m]."""

_ELSEWHERE = 0.008
"""Another place to stand is this far from those that failed [m]."""

_UNSURE: Attempt = ("unclear", "the face was not found at the same place twice", None)

_MOST_ASKEW = np.radians(25.0)
"""A face over which the hand stands by two looks is not more askew than this [rad]."""

_LEAST_SWING = 0.08
"""A look with less tilt shows nothing new [rad]."""

_ASTRAY = np.radians(12.0)
"""A face whose normal is this far from what it should be is looked at once more from above [rad]."""

LEAST_STANDOFF = 1.25
"""Stand-off in clearances: below, the guard would hold the hand before it arrives."""

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


@dataclass(slots=True)
class Session:
    """One acquisition under way: its robot, its rules, the motions so far and the labelled readings.

    Attributes:
        robot: The hand.
        standoff: Of the hand's front over the surface [m].
        rules: What the motions keep to.
        errors: Of the robot, for the covariance; none are assumed without it.
        motions: All of them, in order.
        readings: Records of the labels so far.
        others: Features sensed on the way.
        places: Where the hand has stood over a patch ``(3,)`` [m].
    """

    robot: Robot
    standoff: float
    rules: Rules
    errors: RobotPreset | str | None
    motions: list[Motion] = field(default_factory=list)
    readings: list[Readings] = field(default_factory=list)
    others: list[Feature] = field(default_factory=list)
    places: list[FloatArray] = field(default_factory=list)

    def __post_init__(self) -> None:
        least = LEAST_STANDOFF * self.rules.clearance
        if not self.standoff >= least:
            raise InputError(
                f"standoff: expected at least {LEAST_STANDOFF:g} times the clearance ({1e3 * least:.3g} mm), got "
                f"{1e3 * self.standoff:.3g} mm. Keep farther away, or lower the clearance."
            )

    @property
    def hand(self) -> Hand:
        """Its hand."""
        return self.robot.hand

    def does(self, motion: Motion) -> Motion:
        """Remember a motion."""
        self.motions.append(motion)
        return motion

    def seen(self) -> Cloud:
        """What all motions so far have met."""
        return cloud_of(self.hand, self.motions)


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
    idea of the face stays the same, and again if the face then is not where it should be.
    """
    attempt: Attempt = ("nothing", "nothing flat was seen where the face should be", None)
    wanted, first, failed_at = idea, len(session.motions), list[FloatArray]()
    for tilt, spacing in LOOKS:
        looked = session.does(look(session.robot, swing(session, tilt), session.rules, spacing=spacing))
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
        closely: Only where the face has been seen all around the fingers, because it comes down next.
    """
    hand, cloud, high = session.hand, session.seen(), session.standoff + HOVER
    raised, other = over(cloud, patch.point, patch.normal), beside(cloud, patch.point, patch.normal)
    now, blocked = session.robot.sensed.T_world_hand, False
    for width, place, along in stands(patch, hand.baseline, wanted):
        if width < _WIDE:
            break
        if any(np.linalg.norm(place - tried) < _ELSEWHERE for tried in avoid):
            continue
        down, up = (facing(hand, place, patch.normal, along, h, now) for h in (session.standoff, high))
        across = SCAN * np.cross(patch.normal, along)
        low = np.stack([moved(down, across), down, moved(down, -across)])
        known = not closely or all_seen(cloud, patch.point, patch.normal, feet(hand, low))
        if known and fits(session, raised, low) and fits(session, other, path(now, up, hand.front, 24)):
            session.places.append(place)
            return session.does(go_to(session.robot, up, session.rules))
        blocked = True
    why = "there is no room for the hand over the face" if blocked else "no face is wide enough for both sensors"
    return Motion("hover", "limit" if blocked else "nothing", why, ())


def swing(session: Session, tilt: float) -> float:
    """The tilt of a look, less where what was seen leaves no room for it."""
    if not session.motions:
        return tilt
    hand, cloud, T = session.hand, session.seen(), session.robot.sensed.T_world_hand
    pivot = hand.body.centres[int(np.argmax(hand.body.radii))]
    turns = np.arange(12) * np.pi / 6
    while tilt > _LEAST_SWING:
        w = tilt * np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=-1)
        R = SO3.exp(w)
        ring = T @ SE3.from_parts(R, pivot - R @ pivot)
        if fits(session, cloud, ring):
            break
        tilt *= 0.75
    return tilt


def _allowed(session: Session, way: Transforms) -> bool:
    """Whether the workspace has room for the hand at some poses, or as much as where it is now."""
    body, space = session.hand.body, session.rules.workspace
    now = session.robot.sensed.T_world_hand
    here, least = (np.minimum(*space.room(body.placed(T), body.radii)).min() for T in (now, way))
    return bool(least >= min(session.rules.clearance + _SLACK, here - 1e-3))


def fits(session: Session, cloud: Cloud, way: Transforms) -> bool:
    """Whether the hand has room at some poses, as far as is known."""
    return _allowed(session, way) and room(cloud, session.hand.body, way) >= session.rules.clearance + _BETWEEN


def feet(hand: Hand, Ts_world_hand: Transforms) -> Vectors:
    """Where the frontal sensors are at some poses ``(m, 4, 4)``: ``(2 m, 3)`` in the world [m]."""
    origins = hand.origins[list(hand.frontal)]
    return np.concatenate([SE3.apply(T[None], origins) for T in Ts_world_hand])


def moved(T: Transforms, shift: Vectors) -> Transforms:
    """A pose displaced in the world."""
    out = np.array(T)
    out[:3, 3] += shift
    return out


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


def facing(hand: Hand, place: Vectors, normal: Vectors, along: Vectors, height: float, near: Transforms) -> Transforms:
    """The pose of the hand square to a plane, its front this high over a place, its pair along a line.

    Of the two such poses the one that is less turned from ``near``.
    """
    z = -normal
    y = np.cross(z, along)
    P = np.stack([along, y / np.linalg.norm(y), z], axis=1)
    P[:, 0] = np.cross(P[:, 1], z)
    H = np.stack([hand.pair, np.cross([0.0, 0.0, 1.0], hand.pair), [0.0, 0.0, 1.0]], axis=1)
    R = P @ H.T
    other = R @ np.diag([-1.0, -1.0, 1.0])
    if np.trace(near[:3, :3].T @ other) > np.trace(near[:3, :3].T @ R):
        R = other
    return SE3.from_parts(R, place + height * normal - R @ hand.front)


def squared(session: Session, face: Feature) -> Transforms:
    """The pose with the hand turned square to a plane about its front, as little as need be."""
    hand, T, normal = session.hand, session.robot.sensed.T_world_hand, face.T_world_feature[:3, 2]
    front = T[:3, :3] @ hand.front + T[:3, 3]
    along = T[:3, :3] @ hand.pair
    along = along - (along @ normal) * normal
    return facing(hand, front, normal, along / np.linalg.norm(along), 0.0, T)


def path(T_from: Transforms, T_to: Transforms, front: FloatArray, n: int) -> Transforms:
    """Poses on the way of :func:`tanteo.motion.go_to` ``(n, 4, 4)``: the front goes straight."""
    w = gap(T_from, T_to)[1]
    shares = np.linspace(0, 1, n)
    out = np.stack([advance(T_from, np.array([0.0, 0.0, 0.0, *w]), s) for s in shares])
    a, b = (T[:3, :3] @ front + T[:3, 3] for T in (T_from, T_to))
    out[:, :3, 3] = a + shares[:, None] * (b - a) - out[:, :3, :3] @ front
    return out


def back_off(session: Session, distance: float) -> Motion:
    """Away from the surface along the hand's axis."""
    return session.does(retreat(session.robot, distance, session.rules))


def finish(kind: str, session: Session, status: Outcome, message: str, feature: Feature | None) -> Acquired:
    """The result of a session."""
    others = tuple(f for f in session.others if feature is None or f.label != feature.label)
    record = join(session.readings)
    return Acquired(kind, status, message, feature, others, record, tuple(session.motions))
