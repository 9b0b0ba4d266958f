"""Compute poses of the hand over a plane, check the clearance of paths, and bring the hand into range of a face."""

from __future__ import annotations

import numpy as np

from tanteo.features import Feature
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, Transforms, Vectors
from tanteo.hand.acquisition.guesses import FaceGuess
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.seen import Cloud, clearance
from tanteo.hand.motion.steering import Motion
from tanteo.hand.motion.travelling import go_to, spiral_poses, spiral_scan
from tanteo.hand.robot import Hand
from tanteo.sensors import error_model

_SLACK = 2e-3
"""Additional clearance to the bounds of the workspace [m]; the guard slows the hand at a smaller one."""


BETWEEN = 5e-3
"""Largest distance of a surface from the sensed points on it [m]."""


_NEARLY = 0.97
"""Fraction of the fingers' surface that counts as nearly complete."""

SWING = 0.025
"""Largest displacement of any part of the hand during the first scan [m]."""

_LEAST_SWING = 0.08
"""Smallest useful tilt of a scan [rad]."""


def scan_surroundings(run: SensingRun, tilt: float, spacing: float) -> Motion:
    """Scan the surroundings in a spiral with the largest tilt that the clearance allows; alternate scans interleave.

    Before the first motion to another pose, no part of the hand moves farther than :data:`SWING`.

    Args:
        run: running acquisition.
        tilt: tilt of the hand's axis at the end of the spiral [rad].
        spacing: increase of the tilt from turn to turn [rad].
    """
    names = [motion.name for motion in run.motions]
    led = "look" in names and set(names[names.index("look") :]) != {"look"}
    begin = np.pi * (names.count("look") % 2)
    widest = swing(run, tilt, spacing, begin, np.inf if led else SWING)
    return run.does(spiral_scan(run.robot, widest, run.rules, spacing=spacing, begin=begin))


def swing(run: SensingRun, tilt: float, spacing: float, begin: float, farthest: float) -> float:
    """Return the tilt of a scan, reduced until workspace, sensed points and the allowed displacement permit it [rad].

    Args:
        run: running acquisition.
        tilt: requested tilt [rad].
        spacing: increase of the tilt from turn to turn [rad].
        begin: start angle of the spiral [rad].
        farthest: largest displacement of any part of the hand [m].
    """
    hand, T = run.hand, run.robot.sensed.T_world_hand
    cloud = run.seen() if run.motions else None
    while tilt > _LEAST_SWING:
        way = spiral_poses(hand, T, tilt, spacing=spacing, begin=begin)
        gone = np.linalg.norm(hand.body.placed(way) - hand.body.placed(T), axis=-1).max()
        free = _allowed(run, way).all() if cloud is None else fits(run, cloud, way)
        if free and gone <= farthest:
            break
        tilt *= 0.85
    return tilt


def _allowed(run: SensingRun, way: Transforms) -> BoolArray:
    """Return the mask of the poses within the workspace, or as near to its limits as the current pose ``(m,)``."""
    body, space = run.hand.body, run.rules.workspace
    here = space.of_body(body, run.robot.sensed.T_world_hand)
    least = np.minimum(run.rules.clearance + _SLACK, here - 1e-3)
    return np.asarray((space.of_body(body, way) >= least).all(axis=-1))


def fitting(run: SensingRun, cloud: Cloud, way: Transforms) -> BoolArray:
    """Return the mask of the poses with enough clearance, as far as is known ``(m,)``.

    Args:
        run: running acquisition.
        cloud: sensed points.
        way: poses of the hand ``(m, 4, 4)`` [m].
    """
    return _allowed(run, way) & (clearance(cloud, run.hand.body, way) >= run.rules.clearance + BETWEEN)


def fits(run: SensingRun, cloud: Cloud, way: Transforms) -> bool:
    """Return whether all poses have enough clearance.

    Args:
        run: running acquisition.
        cloud: sensed points.
        way: poses of the hand ``(m, 4, 4)`` [m].
    """
    return bool(fitting(run, cloud, way).all())


def known(run: SensingRun, way: Transforms) -> bool:
    """Return whether the space of the fingers at some poses is completely known to be free.

    Args:
        run: running acquisition.
        way: poses of the hand ``(m, 4, 4)`` [m].
    """
    return run.known().holds(run.hand.body, way, 0.0)


def nearly_known(run: SensingRun, way: Transforms) -> bool:
    """Return whether the space of the fingers is known to be free except for gaps between single beams.

    Args:
        run: running acquisition.
        way: poses of the hand ``(m, 4, 4)`` [m].
    """
    return all(share >= _NEARLY for share in run.known().shares(run.hand.body, way, 0.0))


def moved(T: Transforms, shift: Vectors) -> Transforms:
    """Return poses after a translation in the world.

    Args:
        T: one pose ``(4, 4)``, or several ``(m, 4, 4)`` [m].
        shift: one translation ``(3,)``, or several ``(m, 3)`` [m].
    """
    out = np.array(np.broadcast_to(T, (*np.broadcast_shapes(T.shape[:-2], np.shape(shift)[:-1]), 4, 4)))
    out[..., :3, 3] += shift
    return out


def facing(hand: Hand, place: Vectors, normal: Vectors, along: Vectors, height: float, near: Transforms) -> Transforms:
    """Return the pose of the hand square to a plane, with its sensor pair along a line.

    There are two such poses; this is the one with the smaller rotation from ``near``.

    Args:
        hand: sensors and body of the hand.
        place: point on the plane under the hand's front ``(3,)`` [m].
        normal: unit normal of the plane ``(3,)``.
        along: direction of the sensor pair ``(3,)``.
        height: height of the hand's front over the plane [m].
        near: reference pose ``(4, 4)`` [m].
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


def squared(run: SensingRun, face: Feature) -> Transforms:
    """Return the pose of the hand after the smallest rotation about its front that aligns it with a plane.

    Args:
        run: running acquisition.
        face: plane.
    """
    hand, T, normal = run.hand, run.robot.sensed.T_world_hand, face.T_world_feature[:3, 2]
    front = T[:3, :3] @ hand.front + T[:3, 3]
    along = T[:3, :3] @ hand.pair
    along = along - (along @ normal) * normal
    return facing(hand, front, normal, along / np.linalg.norm(along), 0.0, T)


_FAR, _NEAR = 0.8, 0.5
"""Distances as fractions of the frontal sensors' range: above the first the hand approaches, to the second."""

_WORTH = 0.025
"""Gain in distance below which a hand within range does not approach [m]."""


def come_near(run: SensingRun, guess: FaceGuess) -> Motion | None:
    """Bring the hand into range of a face; it first moves over the face at constant distance, then straight down.

    Args:
        run: running acquisition.
        guess: approximate pose of the face.

    Returns:
        The last motion, which may have failed; None if the face is already in range.
    """
    hand, T = run.hand, run.robot.sensed.T_world_hand
    front = T[:3, :3] @ hand.front + T[:3, 3]
    away = float(np.linalg.norm(guess.point - front))
    reach = float(error_model(hand.rig).max_range[list(hand.frontal)].min())
    least = max(_NEAR * reach, 2 * run.standoff)
    if not np.isfinite(reach) or away < _FAR * reach or away < min(reach, least + _WORTH):
        return None
    along = T[:3, :3] @ hand.pair
    along = along - (along @ guess.normal) * guess.normal
    if np.linalg.norm(along) < 1e-6:
        along = np.cross(guess.normal, T[:3, 2])
    along = along / np.linalg.norm(along)
    for height in (away, least):
        pose = facing(hand, guess.point, guess.normal, along, height, T)
        motion = run.does(go_to(run.robot, pose, run.rules))
        if not motion.reached:
            break
    return motion
