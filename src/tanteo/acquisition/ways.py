"""Poses of the hand over a plane, ways between them, and whether there is room for them."""

from __future__ import annotations

import numpy as np

from tanteo.acquisition.cloud import Cloud, room
from tanteo.acquisition.session import Session
from tanteo.features import Feature
from tanteo.hand import Hand, advance, gap
from tanteo.lie import SE3
from tanteo.motion import Motion, look, looked
from tanteo.typing import BoolArray, FloatArray, Transforms, Vectors

_SLACK = 2e-3
"""Beyond the clearance to the bounds of the workspace: nearer, the guard would slow the hand to a stop [m]."""


_BETWEEN = 5e-3
"""Something may be nearer than the points that were met on it, by so much [m]."""


_NEARLY = 0.97
"""So much of the fingers' skin is nearly all of it."""

ROOM = 0.025
"""Where it looks for the first time the hand swings no part of it farther to any side [m]."""

_LEAST_SWING = 0.08
"""A look with less tilt shows nothing new [rad]."""


def look_around(session: Session, tilt: float, spacing: float) -> Motion:
    """A look with as much tilt as there is room for; every second one goes between the turns of the one before.

    Until it has gone somewhere after a look, no part of it goes farther than the free space around its start allows.
    """
    names = [motion.name for motion in session.motions]
    led = "look" in names and set(names[names.index("look") :]) != {"look"}
    begin = np.pi * (names.count("look") % 2)
    widest = swing(session, tilt, spacing, begin, np.inf if led else ROOM)
    return session.does(look(session.robot, widest, session.rules, spacing=spacing, begin=begin))


def swing(session: Session, tilt: float, spacing: float, begin: float, most: float) -> float:
    """The tilt of a look, less where the workspace or what was met leaves no room, or a finger would go too far [m]."""
    hand, T = session.hand, session.robot.sensed.T_world_hand
    cloud = session.seen() if session.motions else None
    while tilt > _LEAST_SWING:
        way = looked(hand, T, tilt, spacing=spacing, begin=begin)
        gone = np.linalg.norm(hand.body.placed(way) - hand.body.placed(T), axis=-1).max()
        free = _allowed(session, way).all() if cloud is None else fits(session, cloud, way)
        if free and gone <= most:
            break
        tilt *= 0.85
    return tilt


def _allowed(session: Session, way: Transforms) -> BoolArray:
    """At which poses the workspace has room for the hand, or as much to every limit as where it is now."""
    body, space = session.hand.body, session.rules.workspace
    here = space.of_body(body, session.robot.sensed.T_world_hand)
    least = np.minimum(session.rules.clearance + _SLACK, here - 1e-3)
    return np.asarray((space.of_body(body, way) >= least).all(axis=-1))


def fitting(session: Session, cloud: Cloud, way: Transforms) -> BoolArray:
    """At which of some poses ``(m, 4, 4)`` the hand has room, as far as is known ``(m,)``."""
    return _allowed(session, way) & (room(cloud, session.hand.body, way) >= session.rules.clearance + _BETWEEN)


def fits(session: Session, cloud: Cloud, way: Transforms) -> bool:
    """Whether it has room at all of them."""
    return bool(fitting(session, cloud, way).all())


def known(session: Session, way: Transforms) -> bool:
    """Whether all that the fingers take at some poses was seen free or taken before."""
    return session.known().holds(session.hand.body, way, 0.0)


def nearly_known(session: Session, way: Transforms) -> bool:
    """The same, but for gaps between single beams: beside places that are known."""
    return all(share >= _NEARLY for share in session.known().shares(session.hand.body, way, 0.0))


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
