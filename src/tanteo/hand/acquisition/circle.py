"""Acquisition of the rim of a bore or boss: face, crossings of the rim along several radii, fit of a circle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.features import Feature, feature_covariance
from tanteo.geometry.limits import SUSPECT
from tanteo.hand.acquisition.crossings import pose_over, scan_above
from tanteo.hand.acquisition.guesses import RoundGuess
from tanteo.hand.acquisition.plane import acquire_plane
from tanteo.hand.acquisition.record import circle_in_face, face_label, labelled_readings
from tanteo.hand.acquisition.rim import LEAST_PLACES, Place, controlled, cross_rim, disc_through, narrowest, turned
from tanteo.hand.acquisition.rim_seen import LEAST_GAIN, Disc, in_face, seen_disc
from tanteo.hand.acquisition.run import Acquired, Attempt, SensingRun, finish
from tanteo.hand.motion.steering import Rules
from tanteo.hand.robot import Robot
from tanteo.sensors.presets import RobotPreset
from tanteo.words import p_equals
from tanteo.words.findings import (
    AfterMotion,
    BoreTooNarrow,
    Finding,
    NotOneFeature,
    OtherRim,
    RimNotSeen,
    RimSensed,
    StepFailed,
)

ANGLES = tuple(k * 160.0 for k in range(9)) + tuple(k * 160.0 + 20.0 for k in range(9))
"""Directions of the crossings, in order [deg]: ninths of a turn. With sevenths a hexagon could pass for a displaced
circle (its sixth harmonic aliases to the first), and with eighths a square could."""

ENOUGH = 9
"""Sufficient number of positions on the rim, if they verify each other."""

_FIRST, _AGAIN = 0.006, 0.003
"""Largest deviation of the rim from its scanned position, and from the circle through the positions so far [m]."""

_OTHER = 5.0
"""Deviation from the guess, in standard deviations, beyond which a rim is a different one."""

_SCANS = 2
"""Number of additional scans from above if the rim is not clear."""


def sense_circle(
    robot: Robot,
    guess: RoundGuess,
    *,
    standoff: float,
    rules: Rules,
    label: str = "circle",
    errors: RobotPreset | str | None = None,
) -> Acquired:
    """Acquire the rim of a bore or a boss as a circle; its face is acquired with it (:attr:`Acquired.others`).

    Args:
        robot: robot with the hand in front of the face, within the range of its beams.
        guess: approximate position, axis and radius of the bore or boss.
        standoff: distance of the hand's front from the face [m], at least 1.25 times the clearance of the rules.
        rules: limits of the motions.
        label: label of the readings and the feature; the face's is ``<label> face``.
        errors: error model of the reported poses, for the covariance.

    Returns:
        ``acquired``; ``nothing`` if the beams show no such rim; ``unclear`` if the positions on the rim are too few, or
        not on one circle; otherwise the status of the motion that failed.

    Raises:
        InputError: The stand-off is too small for the clearance of the rules.
    """
    run = SensingRun(robot, standoff, rules, errors)
    status, finding, feature, _ = acquire_circle(run, guess, label)
    return finish("circle", run, status, finding, feature)


def acquire_circle(run: SensingRun, guess: RoundGuess, label: str) -> tuple[*Attempt, Feature | None]:
    """Acquire the rim within a running acquisition; return also its face."""
    status, finding, face = acquire_plane(run, guess.face(), face_label(label))
    if face is None:
        return status, StepFailed("face of the rim", finding), None, None
    run.others.append(face)
    disc = _shown(run, face, guess)
    if disc.gain < LEAST_GAIN:
        least = float("nan") if guess.convex else narrowest(run)
        return "nothing", RimNotSeen(guess.convex, least), None, face
    if not guess.convex and 2 * disc.radius < narrowest(run):
        return "unclear", BoreTooNarrow(narrowest(run)), None, face
    places, last = _crossed(run, face, disc, guess)
    places, doubt = controlled(places, face, disc)
    if doubt is not None:
        return "unclear", doubt if last is None else AfterMotion(doubt, last), None, face
    return *_fitted(run, places, face, guess, label), face


def _shown(run: SensingRun, face: Feature, guess: RoundGuess) -> Disc:
    """Return the rim as the beams show it, after additional scans if it is unclear."""
    disc = seen_disc(run, face, guess)
    for _ in range(_SCANS):
        if disc.gain >= 2 * LEAST_GAIN and disc.inside > 20:
            break
        centre, axes = in_face(face, guess)
        T = run.robot.sensed.T_world_hand
        along = turned(face, T[:3, :3] @ run.hand.pair, 0.0)
        scanned = scan_above(
            run, face, np.stack([pose_over(run, face, centre + s * axes[:, 0], along) for s in (0, 0.02, -0.02)])
        )
        disc = seen_disc(run, face, guess)
        if not scanned.reached:
            break
    return disc


def _crossed(run: SensingRun, face: Feature, disc: Disc, guess: RoundGuess) -> tuple[list[Place], Finding | None]:
    """Cross the rim until there are enough positions; return them and the reason of the last failure."""
    first = run.robot.sensed.T_world_hand[:3, :3] @ run.hand.pair
    places, slack = list[Place](), _FIRST
    why: Finding | None = None
    for angle in ANGLES:
        if len(places) >= ENOUGH and controlled(places, face, disc)[1] is None:
            break
        out = turned(face, first, np.radians(angle))
        found, motion = cross_rim(run, face, disc, out, convex=guess.convex, slack=slack)
        if motion.status == "timeout":
            return places, motion.finding
        places += found
        why = why if motion.reached else motion.finding
        better = disc_through(places, face, disc) if len(places) >= 3 else None
        if better is not None:
            disc, slack = better, _AGAIN if len(places) >= LEAST_PLACES else _FIRST
    return places, why


def _fitted(run: SensingRun, places: list[Place], face: Feature, guess: RoundGuess, label: str) -> Attempt:
    """Fit the circle and add its readings to the record of the run."""
    events = [e for place in places for e in place.events]
    readings = labelled_readings(run.hand, events, label, "circle")
    try:
        feature, report = circle_in_face(readings, face, label, run.hand.rig, run.errors)
    except DegenerateError as error:
        return "unclear", NotOneFeature("circle", str(error)), None
    if report.p_value < SUSPECT:
        why = f"the crossings scatter beyond their noise ({p_equals(report.p_value)})"
        return "unclear", NotOneFeature("circle", why), None
    assert feature.size is not None
    if off := _another(feature, guess):
        return "unclear", off, None
    run.readings.append(readings)
    feature = replace(feature, size=replace(feature.size, convex=guess.convex))
    return "acquired", RimSensed(len(events), len(places)), feature


def _another(rim: Feature, guess: RoundGuess) -> OtherRim | None:
    """Return that the rim deviates too much from the guess, or None."""
    gap = rim.T_world_feature[:3, 3] - guess.point
    away = float(np.linalg.norm(gap - (gap @ guess.axis) * guess.axis))
    radius, own = float(rim.radius or 0.0), float(np.linalg.eigvalsh(feature_covariance(rim)[:3, :3])[-1])
    near = away <= _OTHER * np.hypot(guess.sd, np.sqrt(own))
    if near and abs(np.log(radius / guess.radius)) <= _OTHER * guess.radius_share:
        return None
    return OtherRim(radius, away, guess.radius, guess.radius_share, guess.sd)
