"""Acquisition of a bore or boss as a cylinder: rim, two rings of readings of the wall below it, fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.features import Feature
from tanteo.hand.acquisition.circle import acquire_circle
from tanteo.hand.acquisition.guesses import RoundGuess
from tanteo.hand.acquisition.record import fitted_feature, labelled_readings
from tanteo.hand.acquisition.rim import turned
from tanteo.hand.acquisition.run import Acquired, Attempt, SensingRun, finish
from tanteo.hand.acquisition.wall import WallReading, depths, read_wall
from tanteo.hand.motion.steering import Rules
from tanteo.hand.robot import Robot
from tanteo.sensors.presets import RobotPreset
from tanteo.words.findings import AfterMotion, FewWallPlaces, Finding, NotOneFeature, NoTwoRings, StepFailed, WallSensed

ANGLES = 0, 120, 240, 60, 180, 300
"""Directions of the readings of the wall in each ring [deg]."""

FARTHER = 0.008, 0.012
"""Smallest and largest distance of the second ring below the first [m]; between them it is the radius."""

LEAST_RING, LEAST_GAP = 3, 0.003
"""Smallest number of readings per ring, and smallest distance between the rings [m]."""


def sense_cylinder(
    robot: Robot,
    guess: RoundGuess,
    *,
    standoff: float,
    rules: Rules,
    label: str = "cylinder",
    errors: RobotPreset | str | None = None,
) -> Acquired:
    """Acquire the wall of a bore or a boss as a cylinder; face and rim are acquired with it.

    The hand stays above the face and measures the wall obliquely over the rim: nothing enters a bore.

    Args:
        robot: robot with the hand in front of the face, within the range of its beams.
        guess: approximate position, axis and radius of the bore or boss.
        standoff: distance of the hand's front from the face [m], at least 1.25 times the clearance of the rules.
        rules: limits of the motions.
        label: label of the readings and the feature; the rim's is ``<label> rim``, the face's ``<label> rim face``.
        errors: error model of the reported poses, for the covariance.

    Returns:
        As :func:`sense_circle`; besides, ``unclear`` where a ring has too few places, or is too near the other one.

    Raises:
        InputError: The stand-off is too small for the clearance of the rules.
    """
    run = SensingRun(robot, standoff, rules, errors)
    status, finding, circle, _ = acquire_circle(run, guess, f"{label} rim")
    if circle is None:
        return finish("cylinder", run, status, StepFailed("rim", finding), None)
    run.others.append(circle)
    status, finding, feature = acquire_wall(run, circle, label)
    return finish("cylinder", run, status, finding, feature)


def acquire_wall(run: SensingRun, circle: Feature, label: str) -> Attempt:
    """Acquire the wall within a running acquisition that has the rim.

    The second ring is a radius below the first, within the reach of the beams. If it misses the wall, its distance from
    the first is halved.
    """
    first, deepest = depths(run, circle)
    second = min(first + min(max(FARTHER[0], circle.radius or 0.0), FARTHER[1]), deepest)
    if second - first < LEAST_GAP:
        return "unclear", NoTwoRings(), None
    found, why = _ring(run, circle, first)
    if len(found) < LEAST_RING:
        return "unclear", _coverage(found, first, why), None
    while second - first >= LEAST_GAP:
        other, why = _ring(run, circle, second)
        if len(other) >= LEAST_RING:
            return _fitted(run, (found, other), (first, second), label)
        missed, second = second, first + 0.5 * (second - first)
    return "unclear", _coverage(other, missed, why), None


def _ring(run: SensingRun, circle: Feature, depth: float) -> tuple[list[WallReading], Finding | None]:
    """Read the wall in one ring; return the readings and the reason of the last failure."""
    out, found = run.robot.sensed.T_world_hand[:3, :3] @ run.hand.pair, list[WallReading]()
    why: Finding | None = None
    for number, angle in enumerate(ANGLES):
        if number == LEAST_RING and not found:
            break
        sensor = run.hand.frontal[number % 2]
        reading, motion = read_wall(run, circle, turned(circle, out, np.radians(angle)), depth, sensor)
        found += [] if reading is None else [reading]
        why = why if motion.reached else motion.finding
    return found, why


def _coverage(ring: Sequence[WallReading], depth: float, last: Finding | None) -> Finding:
    """Return that the wall was measured at too few positions, with the last motion that failed."""
    few = FewWallPlaces(len(ring), len(ANGLES), depth)
    return few if last is None else AfterMotion(few, last)


def _fitted(run: SensingRun, found: tuple[list[WallReading], ...], rings: tuple[float, ...], label: str) -> Attempt:
    """Fit the cylinder to two rings and add its readings to the record of the run."""
    readings = labelled_readings(run.hand, [r for ring in found for r in ring], label, "cylinder")
    feature, doubt = fitted_feature(readings, label, run.hand.rig, run.errors)
    if feature is None or doubt:
        return "unclear", NotOneFeature("cylinder", doubt), None
    run.readings.append(readings)
    return "acquired", WallSensed(len(readings), (rings[0], rings[1])), feature
