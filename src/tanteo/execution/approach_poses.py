"""Poses of the hand in which one of its frontal sensors looks along a beam: its turn about the beam is free."""

from __future__ import annotations

import numpy as np

from tanteo.active import Candidates, SensingState
from tanteo.execution.possible import Room
from tanteo.hand import Hand
from tanteo.lie import SE3
from tanteo.typing import BoolArray, Transforms, Vectors

_TURNS = 8
"""Turns about a beam that are tried."""


def approach_poses(hand: Hand, origins: Vectors, directions: Vectors) -> Transforms:
    """Poses of the hand with a frontal sensor at ``origins (C, 3)`` that looks along ``directions (C, 3)``.

    Returns:
        ``T_world_hand`` ``(C, m, 4, 4)``: all turns of the first sensor, then those of the second.
    """
    z = np.asarray(directions, dtype=np.float64)
    helper = np.eye(3)[np.argmin(np.abs(z), axis=1)]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    T_world_beam: Transforms = SE3.from_parts(
        np.stack([x, np.cross(z, x), z], axis=-1), np.asarray(origins, dtype=np.float64)
    )
    turns = np.zeros((_TURNS, 6))
    turns[:, 5] = np.arange(_TURNS) * (2 * np.pi / _TURNS)
    T_sensor_hand = SE3.inverse(np.stack([hand.rig.sensors[k].T_hand_sensor for k in hand.frontal]))
    each = SE3.exp(turns) @ T_sensor_hand[:, None]
    return np.asarray(T_world_beam[:, None] @ each.reshape(-1, 4, 4))


def back(Ts_world_hand: Transforms, distance: float) -> Transforms:
    """Poses moved back along the hand's own axis [m]."""
    out = np.array(Ts_world_hand)
    out[..., :3, 3] -= distance * out[..., :3, 2]
    return out


def feasible(hand: Hand, room: Room, candidates: Candidates, retreat: float) -> BoolArray:
    """Which candidates the hand can make in one of its approach poses, and come to from behind ``(C,)``."""
    Ts = approach_poses(hand, candidates.origins, candidates.directions)
    ways = np.stack([Ts, back(Ts, retreat)], axis=2)
    ok: BoolArray = np.all(room.within(ways), axis=2)
    ok[ok] = (room.gaps(ways[ok]) >= room.clearance).all(axis=1)
    return np.asarray(ok.any(axis=1))


def ranked(hand: Hand, state: SensingState, Ts: Transforms, near: Transforms, reach: float) -> Transforms:
    """Approach poses ``(m, 4, 4)``, first those in which more beams meet the likeliest mode, then the least turned."""
    target, to_part = state.target(0), SE3.inverse(state.poses[0])
    pair = list(hand.frontal)
    starts = SE3.apply(to_part, SE3.apply(Ts[:, None], hand.origins[pair]))
    beams = (to_part[:3, :3] @ Ts[:, None, :3, :3] @ hand.axes[pair][..., None])[..., 0]
    hits = target.surface.cast(starts.reshape(-1, 3), beams.reshape(-1, 3)).distances.reshape(len(Ts), -1) < reach
    alike = np.einsum("ij,nij->n", near[:3, :3], Ts[:, :3, :3])
    return np.asarray(Ts[np.lexsort((-alike, -hits.sum(axis=1)))])
