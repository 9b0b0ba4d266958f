"""Poses of the hand over a plane, ways between them and whether there is room for them; from afar to before a face."""

from __future__ import annotations

import numpy as np

from tanteo.features import Feature
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, Transforms, Vectors
from tanteo.hand.acquisition.guesses import FaceGuess
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.seen import Cloud, room
from tanteo.hand.motion.steering import Motion
from tanteo.hand.motion.travelling import go_to, look, looked
from tanteo.hand.robot import Hand
from tanteo.sensors import error_model

_SLACK = 2e-3
"""Beyond the clearance to the bounds of the workspace: nearer, the guard would slow the hand to a stop [m]."""


BETWEEN = 5e-3
"""Something may be nearer than the points that were met on it, by so much [m]."""


_NEARLY = 0.97
"""So much of the fingers' skin is nearly all of it."""

ROOM = 0.025
"""Where it looks for the first time the hand swings no part of it farther to any side [m]."""

_LEAST_SWING = 0.08
"""A look with less tilt shows nothing new [rad]."""


def look_around(run: SensingRun, tilt: float, spacing: float) -> Motion:
    """A look with as much tilt as there is room for; every second one goes between the turns of the one before.

    Until it has gone somewhere after a look, no part of it goes farther than the free space around its start allows.
    """
    names = [motion.name for motion in run.motions]
    led = "look" in names and set(names[names.index("look") :]) != {"look"}
    begin = np.pi * (names.count("look") % 2)
    widest = swing(run, tilt, spacing, begin, np.inf if led else ROOM)
    return run.does(look(run.robot, widest, run.rules, spacing=spacing, begin=begin))


def swing(run: SensingRun, tilt: float, spacing: float, begin: float, farthest: float) -> float:
    """The tilt of a look, less where the workspace or what was met leaves no room, or a finger would go too far [m]."""
    hand, T = run.hand, run.robot.sensed.T_world_hand
    cloud = run.seen() if run.motions else None
    while tilt > _LEAST_SWING:
        way = looked(hand, T, tilt, spacing=spacing, begin=begin)
        gone = np.linalg.norm(hand.body.placed(way) - hand.body.placed(T), axis=-1).max()
        free = _allowed(run, way).all() if cloud is None else fits(run, cloud, way)
        if free and gone <= farthest:
            break
        tilt *= 0.85
    return tilt


def _allowed(run: SensingRun, way: Transforms) -> BoolArray:
    """At which poses the workspace has room for the hand, or as much to every limit as where it is now."""
    body, space = run.hand.body, run.rules.workspace
    here = space.of_body(body, run.robot.sensed.T_world_hand)
    least = np.minimum(run.rules.clearance + _SLACK, here - 1e-3)
    return np.asarray((space.of_body(body, way) >= least).all(axis=-1))


def fitting(run: SensingRun, cloud: Cloud, way: Transforms) -> BoolArray:
    """At which of some poses ``(m, 4, 4)`` the hand has room, as far as is known ``(m,)``."""
    return _allowed(run, way) & (room(cloud, run.hand.body, way) >= run.rules.clearance + BETWEEN)


def fits(run: SensingRun, cloud: Cloud, way: Transforms) -> bool:
    """Whether it has room at all of them."""
    return bool(fitting(run, cloud, way).all())


def known(run: SensingRun, way: Transforms) -> bool:
    """Whether all that the fingers take at some poses was seen free or taken before."""
    return run.known().holds(run.hand.body, way, 0.0)


def nearly_known(run: SensingRun, way: Transforms) -> bool:
    """The same, but for gaps between single beams: beside places that are known."""
    return all(share >= _NEARLY for share in run.known().shares(run.hand.body, way, 0.0))


def moved(T: Transforms, shift: Vectors) -> Transforms:
    """A pose displaced in the world by one shift ``(3,)`` or by several ``(m, 3)``, or poses ``(m, 4, 4)`` by one."""
    out = np.array(np.broadcast_to(T, (*np.broadcast_shapes(T.shape[:-2], np.shape(shift)[:-1]), 4, 4)))
    out[..., :3, 3] += shift
    return out


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


def squared(run: SensingRun, face: Feature) -> Transforms:
    """The pose with the hand turned square to a plane about its front, as little as need be."""
    hand, T, normal = run.hand, run.robot.sensed.T_world_hand, face.T_world_feature[:3, 2]
    front = T[:3, :3] @ hand.front + T[:3, 3]
    along = T[:3, :3] @ hand.pair
    along = along - (along @ normal) * normal
    return facing(hand, front, normal, along / np.linalg.norm(along), 0.0, T)


_FAR, _NEAR = 0.8, 0.5
"""Shares of the frontal sensors' range: beyond the first the hand comes nearer, to the second."""

_WORTH = 0.025
"""Within range it stays where it begins, with free space around it, if it would win no more than this [m]."""


def come_near(run: SensingRun, guess: FaceGuess) -> Motion | None:
    """Bring the hand before a face that its frontal beams would hardly reach; None where they do.

    It keeps its distance until it stands over the place, and comes straight down then.

    Returns:
        The last motion; one that did not reach its pose ends the way.
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
