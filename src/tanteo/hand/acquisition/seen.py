"""What was met so far, as points in the world, and what is known to be free: beams and the hand itself were there.

A beam says that its way was free, and the hand that it fitted where it was. A place is known if one of them came near
enough; things narrower than twice :data:`GAP` may stay unseen between two beams.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.hand.motion.steering import Motion
from tanteo.hand.robot import FREE, MET, Body, Hand, HandReading
from tanteo.sensors import error_model

_MOST = 1500
"""Beams that are kept, evenly over the logs."""

_OUT, _FORM = 4.0, 1e-3
"""A point is out of a plane beyond so many standard deviations and this much more [m]: of 1,500 on the plane hardly one
is by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """Beams and what they met.

    Attributes:
        starts: Of the beams ``(n, 3)`` in the world [m].
        beams: Unit directions ``(n, 3)``.
        ranges: ``(n,)`` [m]; as far as the sensor reaches where nothing was met.
        met: Something was met ``(n,)``.
        sds: Standard deviation of the range, what the sensor's readings share included ``(n,)`` [m].
        slopes: Tangents of the cones' half angles ``(n,)``.
        ahead: Given by a frontal sensor ``(n,)``.
    """

    starts: Vectors
    beams: Vectors
    ranges: FloatArray
    met: BoolArray
    sds: FloatArray
    slopes: FloatArray
    ahead: BoolArray

    @property
    def points(self) -> Vectors:
        """Ends of all beams ``(n, 3)`` [m]."""
        return np.asarray(self.starts + self.ranges[:, None] * self.beams)

    def deviations(self, cosines: FloatArray) -> FloatArray:
        """Standard deviation of the points across surfaces that are met at these cosines ``(*batch, n)`` [m]."""
        sines = 1.0 - cosines**2
        return np.asarray(np.sqrt((cosines * self.sds) ** 2 + 0.25 * (self.ranges * self.slopes) ** 2 * sines))

    def heights(self, point: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Heights of the points over a plane and their standard deviations there ``(n,)`` [m]."""
        return (self.points - point) @ normal, self.deviations(np.clip(-(self.beams @ normal), 0.0, 1.0))

    def keep(self, rows: BoolArray) -> Cloud:
        """Some of the beams."""
        return Cloud(*(getattr(self, name)[rows] for name in self.__slots__))


def over(cloud: Cloud, point: FloatArray, normal: FloatArray) -> Cloud:
    """What stands out of a plane: a hand that stays over the plane need not mind the rest."""
    height, sd = cloud.heights(point, normal)
    return cloud.keep(cloud.met & (height > _OUT * sd + _FORM))


def beside(cloud: Cloud, point: FloatArray, normal: FloatArray) -> Cloud:
    """All but what lies in a plane, to which the hand keeps its distance by other means."""
    height, sd = cloud.heights(point, normal)
    return cloud.keep(cloud.met & (np.abs(height) > _OUT * sd + _FORM))


def cloud_of(hand: Hand, motions: Iterable[Motion]) -> Cloud:
    """What the beams of some motions met, thinned evenly."""
    log: list[HandReading] = [s for motion in motions for s in motion.log]
    log = log[:: max(1, len(log) * len(hand.origins) // (3 * _MOST))]
    model, (starts, beams, states, ranges) = error_model(hand.rig), _beams(hand, log)
    ahead = np.zeros(states.shape, dtype=bool)
    ahead[:, list(hand.frontal)] = True
    met = states == MET
    reach = np.where(met, ranges, np.where(np.isfinite(model.max_range), model.max_range, 0.0))
    use = met | ((states == FREE) & ahead)
    scale_var = model.cov_unit[:, 6, 6]
    sds = np.sqrt(model.law.sigma(reach) ** 2 + model.bias_sd**2 + scale_var * reach**2)
    slopes = np.broadcast_to(np.tan(model.beam_half_angle), reach.shape)
    return Cloud(starts[use], beams[use], reach[use], met[use], sds[use], slopes[use], ahead[use])


def _beams(hand: Hand, log: Sequence[HandReading]) -> tuple[Vectors, Vectors, IntArray, FloatArray]:
    """Starts and directions of all beams ``(n, k, 3)``, and their states and ranges ``(n, k)``."""
    T = np.array([s.T_world_hand for s in log])[:, None]
    beams = hand.axes @ np.swapaxes(T[:, 0, :3, :3], 1, 2)
    states, ranges = np.array([s.states for s in log]), np.array([s.ranges for s in log])
    return SE3.apply(T, hand.origins), beams, states, ranges


def room(cloud: Cloud, body: Body, Ts_world_hand: Transforms) -> FloatArray:
    """Least distance of the body at each of some poses ``(m, 4, 4)`` from what was met ``(m,)`` [m]."""
    points = cloud.points[cloud.met]
    if not len(points):
        return np.full(len(Ts_world_hand), np.inf)
    centres = body.placed(Ts_world_hand)
    return np.asarray((cKDTree(points).query(centres)[0] - body.radii).min(axis=1))


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

    def __init__(self, hand: Hand, log: Sequence[HandReading], before: Known | None = None) -> None:
        kept = log[::_EVERY]
        T = np.array([s.T_world_hand for s in kept])
        centres, radii = hand.body.placed(T), hand.body.radii
        # between two instants that are kept the hand was nearly as far out
        places = {GAP: _along_beams(hand, kept)}
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


def _along_beams(hand: Hand, log: Sequence[HandReading]) -> Vectors:
    """Points along the free ways of all beams ``(n, 3)``."""
    farthest, (starts, beams, states, ranges) = error_model(hand.rig).max_range, _beams(hand, log)
    reach = np.where(states == MET, ranges, np.where((states == FREE) & np.isfinite(farthest), farthest, 0.0))
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
