"""Hand poses that align a frontal sensor with a planned beam, and safe paths to them."""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, Transforms, Vectors
from tanteo.hand import Hand
from tanteo.hand.motion import path
from tanteo.hand.twists import pose_difference
from tanteo.planning.candidates import Candidates
from tanteo.planning.execution.possible import FreeSpace
from tanteo.planning.state import SensingState

_TURNS = 8
"""Number of rotations of the hand about a beam that are tried."""


def approach_poses(hand: Hand, origins: Vectors, directions: Vectors) -> Transforms:
    """Return the hand poses that align a frontal sensor with each beam, with several rotations about it.

    Args:
        hand: sensors and body of the hand.
        origins: beam origins ``(C, 3)``, world frame [m].
        directions: unit beam directions ``(C, 3)``, world frame.

    Returns:
        Poses ``T_world_hand`` ``(C, m, 4, 4)``: all rotations with the first frontal sensor, then those with the
        second.
    """
    T_world_beam = SE3.from_parts(SO3.frame_from_axis(directions, 2), np.asarray(origins, dtype=np.float64))
    turns = np.zeros((_TURNS, 6))
    turns[:, 5] = np.arange(_TURNS) * (2 * np.pi / _TURNS)
    T_sensor_hand = SE3.inverse(np.stack([hand.rig.sensors[k].T_hand_sensor for k in hand.frontal]))
    each = SE3.exp(turns) @ T_sensor_hand[:, None]
    return np.asarray(T_world_beam[:, None] @ each.reshape(-1, 4, 4))


def retreated_poses(Ts_world_hand: Transforms, distance: float) -> Transforms:
    """Return hand poses moved backward along the hand's z axis.

    Args:
        Ts_world_hand: poses ``(*batch, 4, 4)``.
        distance: length of the retreat [m].
    """
    out = np.array(Ts_world_hand)
    out[..., :3, 3] -= distance * out[..., :3, 2]
    return out


def feasible(hand: Hand, space: FreeSpace, candidates: Candidates, retreat: float) -> BoolArray:
    """Return flags of the candidate beams that the hand can reach by a straight approach ``(C,)``.

    Args:
        hand: sensors and body of the hand.
        space: free space of the hand.
        candidates: beams to check.
        retreat: length of the straight final approach [m].
    """
    Ts = approach_poses(hand, candidates.origins, candidates.directions)
    paths = np.stack([Ts, retreated_poses(Ts, retreat)], axis=2)
    ok: BoolArray = np.all(space.within(paths), axis=2)
    ok[ok] = (space.gaps(paths[ok]) >= space.clearance).all(axis=1)
    if space.reach is not None:
        # of each candidate one pose is enough: the attitudes are tried in turn
        for k in range(ok.shape[1]):
            open_ = np.flatnonzero(ok[:, k] & ~ok[:, :k].any(axis=1))
            ok[open_, k] = space.reaches(Ts[open_, k])
            ok[ok[:, :k].any(axis=1), k] = False
    return np.asarray(ok.any(axis=1))


def ranked(hand: Hand, state: SensingState, Ts: Transforms, near: Transforms, reach: float) -> Transforms:
    """Return approach poses in the order of preference.

    First are those whose frontal beams both hit the part at the most probable mode, then those with the smallest
    rotation from the current pose.

    Args:
        hand: sensors and body of the hand.
        state: posterior of the session.
        Ts: approach poses ``(m, 4, 4)``, world frame.
        near: current pose ``T_world_hand`` ``(4, 4)``.
        reach: largest useful range of a beam [m].
    """
    target, to_part = state.target(0), SE3.inverse(state.poses[0])
    pair = list(hand.frontal)
    starts = SE3.apply(to_part, SE3.apply(Ts[:, None], hand.origins[pair]))
    beams = (to_part[:3, :3] @ Ts[:, None, :3, :3] @ hand.axes[pair][..., None])[..., 0]
    hits = target.surface.cast(starts.reshape(-1, 3), beams.reshape(-1, 3)).distances.reshape(len(Ts), -1) < reach
    similarity = np.einsum("ij,nij->n", near[:3, :3], Ts[:, :3, :3])
    return np.asarray(Ts[np.lexsort((-similarity, -hits.sum(axis=1)))])


_STEP = 0.01
"""Largest displacement of the hand's front between two checked poses of a path [m]. The largest rotation in radians is
ten times that number."""

_LIFTS = (0.0, 0.1)
"""Heights above all possible poses of parts at which the hand may cross them [m], tried in this order."""


def approach_path(hand: Hand, T_from: Transforms, T_to: Transforms) -> Transforms:
    """Return poses ``(n, 4, 4)`` on the path of :func:`tanteo.hand.motion.go_to`, dense enough to check for collisions.

    Args:
        hand: sensors and body of the hand.
        T_from: first pose ``T_world_hand`` ``(4, 4)``.
        T_to: last pose ``T_world_hand`` ``(4, 4)``.
    """
    a, b = (SE3.apply(T, hand.front) for T in (T_from, T_to))
    turn = pose_difference(T_from, T_to)[1]
    n = 2 + int(max(np.linalg.norm(b - a) / _STEP, np.linalg.norm(turn) / (10 * _STEP)))
    return path(T_from, T_to, hand.front, n)


def route(
    hand: Hand, space: FreeSpace, T_from: Transforms, T_to: Transforms, retreat: float
) -> list[Transforms] | None:
    """Return the waypoints of a motion without collision to a target pose, or None if none was found.

    The direct path and paths above the possible parts are tried, shortest first. The hand retreats before it rotates,
    and it approaches the target along a straight line.

    Args:
        hand: sensors and body of the hand.
        space: free space of the hand.
        T_from: current pose of the hand ``(4, 4)``.
        T_to: target pose of the hand ``(4, 4)``.
        retreat: length of the straight retreat and of the final approach [m].
    """
    before, retreated = retreated_poses(T_to, retreat), retreated_poses(T_from, retreat)
    paths = [[before, T_to], [retreated, before, T_to]]
    for lift in _LIFTS:
        over = [_lifted(space, T, lift) for T in (T_from, retreated, before)]
        paths += [[over[0], over[2], before, T_to], [retreated, over[1], over[2], before, T_to]]
    for stops in sorted(paths, key=lambda stops: _length(hand, [T_from, *stops])):
        legs = zip([T_from, *stops], stops, strict=False)
        paths_of_legs = [approach_path(hand, a, b) for a, b in legs]
        if all(space.along(one) for one in paths_of_legs) and space.follows(np.concatenate(paths_of_legs)):
            return stops
    return None


def _lifted(space: FreeSpace, T: Transforms, more: float) -> Transforms:
    """Return a pose raised until the whole body is above all possible parts by the clearance and ``more`` [m]."""
    lowest = float((space.body.placed(T)[:, 2] - space.body.radii).min())
    out = np.array(T)
    out[2, 3] += max(space.possible.top() + space.clearance + more - lowest, 0.0)
    return out


def _length(hand: Hand, stops: list[Transforms]) -> float:
    fronts = SE3.apply(np.array(stops), hand.front)
    return float(np.linalg.norm(np.diff(fronts, axis=0), axis=1).sum())
