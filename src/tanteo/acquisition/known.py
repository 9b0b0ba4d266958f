"""Where the hand may go: what beams went through and where the hand has been. All else may hold something.

A beam says that its way was free, and the hand that it fitted where it was. A place is known if one of them came near
enough; things narrower than twice :data:`GAP` may stay unseen between two beams.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tanteo.hand import FREE, MET, Body, Hand, Sensed
from tanteo.lie import SE3
from tanteo.sensors import error_model
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors

GAP = 0.0055
"""A place is known if a beam went by at this distance or less [m]."""

_PACE = 0.004
"""From point to point along a beam [m]."""

_CELL = 0.002
"""Points of beams nearer to each other than about this count once [m]."""

_BITS = 21
"""Of a cell's number along each axis."""

_HALF = 2 ** (_BITS - 1)
"""Cells from the origin to the end of the world, which is two kilometres away."""

_EVERY = 2
"""Every second instant of a log counts: the hand hardly moves meanwhile."""


class Known:
    """All places that were seen free or taken by the hand in some logs.

    Args:
        hand: The hand.
        log: What it sensed.
        before: What was known before; it stays known.
    """

    def __init__(self, hand: Hand, log: Sequence[Sensed], before: Known | None = None) -> None:
        from scipy.spatial import cKDTree

        kept = log[::_EVERY]
        T = np.array([s.T_world_hand for s in kept])
        centres, radii = hand.body.placed(T), hand.body.radii
        # between two instants that are kept the hand was nearly as far out
        places = {GAP: _along_beams(hand, kept, T)}
        places |= {float(r) + _CELL: centres[:, radii == r].reshape(-1, 3) for r in np.unique(radii)}
        self._cells = {reach: _cells(points) for reach, points in places.items()}
        for reach, cells in before._cells.items() if before is not None else ():
            self._cells[reach] = _once(np.concatenate([cells, self._cells[reach]]))
        self._trees = [(reach, cKDTree(_middles(cells), balanced_tree=False)) for reach, cells in self._cells.items()]

    def has(self, points: Vectors) -> BoolArray:
        """Which of some places ``(*batch, 3)`` are known."""
        flat = points.reshape(-1, 3)
        out = np.zeros(len(flat), dtype=bool)
        for reach, tree in self._trees:
            left = np.flatnonzero(~out)
            out[left] = np.isfinite(tree.query(flat[left], distance_upper_bound=reach)[0])
        return out.reshape(points.shape[:-1])

    def shares(self, body: Body, Ts_world_hand: Transforms, margin: float) -> Iterator[float]:
        """Pose by pose ``(m, 4, 4)``, how much is known around what is not blind of a body, up to a margin [m]."""
        skin = _skin(body.centres[~body.blind], body.radii[~body.blind] + margin)
        return (float(self.has(SE3.apply(T, skin)).mean()) for T in Ts_world_hand)

    def holds(self, body: Body, Ts_world_hand: Transforms, margin: float) -> bool:
        """Whether that is all of it at all of them."""
        return all(share == 1.0 for share in self.shares(body, Ts_world_hand, margin))


def _skin(centres: Vectors, radii: FloatArray) -> Vectors:
    """Points all over some spheres that are in none of the others ``(n, 3)``."""
    points = (centres[:, None] + radii[:, None, None] * _SHELL).reshape(-1, 3)
    depths = radii - np.linalg.norm(points[:, None] - centres, axis=-1)
    return points[(depths < 1e-9).all(axis=1)]


_SHELL = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], dtype=float)
_SHELL /= np.linalg.norm(_SHELL, axis=1, keepdims=True)


def _along_beams(hand: Hand, log: Sequence[Sensed], T: Transforms) -> Vectors:
    """Points along the free ways of all beams ``(n, 3)``."""
    states, ranges = np.array([s.states for s in log]), np.array([s.ranges for s in log])
    farthest = error_model(hand.rig).max_range
    reach = np.where(states == MET, ranges, np.where((states == FREE) & np.isfinite(farthest), farthest, 0.0))
    R = T[:, None, :3, :3]
    starts = (R @ hand.origins[..., None])[..., 0] + T[:, None, :3, 3]
    beams = (R @ hand.axes[..., None])[..., 0]
    steps = np.arange(0.0, reach.max(initial=0.0), _PACE)
    points = starts[..., None, :] + steps[:, None] * beams[..., None, :]
    return np.asarray(points[steps < reach[..., None]])


def _cells(points: Vectors) -> IntArray:
    """Numbers of the cells that hold some points, each once."""
    i = np.round(points / _CELL).astype(np.int64) + _HALF
    return _once((i[:, 0] << 2 * _BITS) + (i[:, 1] << _BITS) + i[:, 2])


def _once(cells: IntArray) -> IntArray:
    """Each number once: sorted, as :func:`numpy.unique` hashes whole numbers, which is slower here."""
    ordered = np.sort(cells)
    return np.asarray(ordered[np.diff(ordered, prepend=-1) > 0])


def _middles(cells: IntArray) -> Vectors:
    """Of cells ``(n, 3)`` [m]."""
    i = np.stack([cells >> 2 * _BITS, cells >> _BITS, cells], axis=-1) & (2 * _HALF - 1)
    return np.asarray(_CELL * (i - _HALF))
