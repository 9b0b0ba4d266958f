"""Poses that the prior pose allows and no reading has contradicted, whatever the belief makes of them."""

from __future__ import annotations

import numpy as np

from tanteo.active import SensingState, Start
from tanteo.answers import box_corners
from tanteo.inference import PreparedPart
from tanteo.lie import SE3
from tanteo.measurements import ContactPoints, FreeRays
from tanteo.typing import FloatArray, IntArray, Transforms

_DRAWN = 1000
"""Poses of every part that are looked at: of a prior pose as wide as a hand, one is then within 10 mm of the true."""

OFF = 0.010
"""A reading contradicts a pose that puts the surface farther from it, or material deeper into its way [m]."""

_STRAYS = 1
"""Readings that may contradict a pose that is still allowed: one may be wrong."""

_PACE, _MOST = 0.008, 12
"""From point to point on the way of a beam [m], back from its end, and how many of them."""

_APART = 0.005
"""Allowed poses of which every corner of the part's box is nearer than this to another's stand for each other [m]."""


def allowed(state: SensingState, most: int) -> tuple[Transforms, IntArray]:
    """Poses ``(K, 4, 4)``, at most about so many, spread over all that is allowed; and the part of each ``(K,)``.

    Args:
        state: its start and its readings count, its probabilities do not.
        most: of all parts together, though one of each that has one.
    """
    start, Ts, part = state.start, [np.zeros((0, 4, 4))], [np.zeros(0, dtype=np.int64)]
    left = {int(k): _uncontradicted(start, int(k), state.touches, state.free) for k in np.unique(start.part)}
    alive = [k for k, poses in left.items() if len(poses)]
    for k in alive:
        Ts.append(_spread(start.targets[k], left[k], max(1, most // len(alive))))
        part.append(np.full(len(Ts[-1]), k))
    return np.concatenate(Ts), np.concatenate(part)


def _uncontradicted(start: Start, part: int, touches: ContactPoints | None, free: FreeRays) -> Transforms:
    target, Ts = start.targets[part], start.drawn(part, _DRAWN)
    wrong = np.zeros(len(Ts), dtype=np.int64)
    if touches is not None and len(touches):
        wrong += (np.abs(_distances(target, Ts, touches.points) - touches.radii) > OFF).sum(axis=1)
        Ts, wrong = Ts[wrong <= _STRAYS], wrong[wrong <= _STRAYS]
        wrong += _crossed(target, Ts, touches.points, touches.directions, touches.reach)
    wrong += _crossed(target, Ts, free.origins + free.lengths[:, None] * free.directions, free.directions, free.lengths)
    return Ts[wrong <= _STRAYS]


def _crossed(
    target: PreparedPart, Ts: Transforms, ends: FloatArray, along: FloatArray, lengths: FloatArray
) -> IntArray:
    """How many ways, free over some lengths up to their ends, lead deep through the part at each pose ``(S,)``."""
    steps = _PACE * np.arange(1, 1 + _MOST)
    points = ends[:, None] - steps[:, None] * along[:, None]
    deep = _distances(target, Ts, points.reshape(-1, 3)).reshape(len(Ts), len(ends), _MOST) < -OFF
    return np.asarray((deep & (steps < lengths[:, None])).any(axis=2).sum(axis=1))


def _distances(target: PreparedPart, Ts: Transforms, points: FloatArray) -> FloatArray:
    """Of points ``(n, 3)`` from the part at poses ``(S, 4, 4)``, negative inside ``(S, n)`` [m]."""
    return target.field(SE3.apply(SE3.inverse(Ts)[:, None], points))[0]


def _spread(target: PreparedPart, Ts: Transforms, most: int) -> Transforms:
    """At most so many of some poses, each the one whose corners are farthest from those of the ones before."""
    corners = SE3.apply(Ts[:, None], box_corners(target.part))
    chosen, gaps = [0], np.full(len(Ts), np.inf)
    while True:
        np.minimum(gaps, np.linalg.norm(corners - corners[chosen[-1]], axis=-1).max(axis=1), out=gaps)
        if len(chosen) == most or gaps.max() < _APART:
            return Ts[chosen]
        chosen.append(int(np.argmax(gaps)))
