"""Ways of the hand from where it is to an approach pose: straight, or back, up and over what may stand between."""

from __future__ import annotations

import numpy as np

from tanteo.execution.approach_poses import back
from tanteo.execution.possible import Room
from tanteo.hand import Hand, advance, gap
from tanteo.typing import FloatArray, Transforms

_STEP = 0.01
"""Of the front from pose to pose where a way is checked [m]; and that of the turn, in radians, is ten times it."""

_LIFTS = (0.0, 0.1)
"""Heights over what may be there at which the hand crosses it [m]."""


def way(hand: Hand, T_from: Transforms, T_to: Transforms) -> Transforms:
    """Poses on the way of :func:`tanteo.motion.go_to` ``(n, 4, 4)``: the front goes straight."""
    front, turn = hand.front, gap(T_from, T_to)[1]
    a, b = (T[:3, :3] @ front + T[:3, 3] for T in (T_from, T_to))
    n = 2 + int(max(np.linalg.norm(b - a) / _STEP, np.linalg.norm(turn) / (10 * _STEP)))
    shares = np.linspace(0.0, 1.0, n)
    out = np.stack([advance(T_from, np.array([0.0, 0.0, 0.0, *turn]), s) for s in shares])
    out[:, :3, 3] = a + shares[:, None] * (b - a) - out[:, :3, :3] @ front
    return out


def route(hand: Hand, room: Room, T_from: Transforms, T_to: Transforms, retreat: float) -> list[Transforms] | None:
    """Poses to go through to ``T_to``, itself last, with room on the whole way; None if none was found.

    Args:
        hand: the hand.
        room: what it must keep clear of.
        T_from: where it is ``(4, 4)``.
        T_to: where it shall be ``(4, 4)``.
        retreat: how far it goes back before it turns, and comes straight in the end [m].
    """
    before, behind = back(T_to, retreat), back(T_from, retreat)
    ways = [[before, T_to], [behind, before, T_to]]
    for lift in _LIFTS:
        over = [_lifted(room, T, lift) for T in (T_from, behind, before)]
        ways += [[over[0], over[2], before, T_to], [behind, over[1], over[2], before, T_to]]
    for stops in sorted(ways, key=lambda stops: _length(hand, [T_from, *stops])):
        legs = zip([T_from, *stops], stops, strict=False)
        if all(room.along(way(hand, a, b)) for a, b in legs):
            return stops
    return None


def _lifted(room: Room, T: Transforms, more: float) -> Transforms:
    """A pose raised until the whole body is above all that is possible, and some more."""
    lowest = float((room.body.placed(T)[:, 2] - room.body.radii).min())
    out = np.array(T)
    out[2, 3] += max(room.possible.top() + room.clearance + more - lowest, 0.0)
    return out


def _length(hand: Hand, stops: list[Transforms]) -> FloatArray | float:
    fronts = np.array([T[:3, :3] @ hand.front + T[:3, 3] for T in stops])
    return float(np.linalg.norm(np.diff(fronts, axis=0), axis=1).sum())
