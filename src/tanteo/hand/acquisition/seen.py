"""Store the sensed points in the world, and the space that is known to be free.

The path of a beam is free, and so is the space that the hand has occupied. A point is known if one of them came near
enough. Objects narrower than twice :data:`GAP` may remain undetected between two beams.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.hand.motion.steering import Motion
from tanteo.hand.robot import FREE, HIT, Body, Hand, HandReading
from tanteo.sensors import error_model

_MOST = 1500
"""Largest number of stored beams, spread evenly over the logs."""

_OUT, _FORM = 4.0, 1e-3
"""Distance from a plane, in standard deviations and additional [m], above which a point is not on it; of 1,500 points
on the plane, about none exceeds it by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """Beams with their ranges.

    Attributes:
        starts: starts of the beams ``(n, 3)``, world frame [m].
        beams: unit directions ``(n, 3)``.
        ranges: ranges ``(n,)`` [m]; the largest range of the sensor without an echo.
        hit: mask of the beams with an echo ``(n,)``.
        sds: standard deviations of the ranges, including the sensor's shared errors ``(n,)`` [m].
        slopes: tangents of the cones' half angles ``(n,)``.
        ahead: mask of the beams of frontal sensors ``(n,)``.
    """

    starts: Vectors
    beams: Vectors
    ranges: FloatArray
    hit: BoolArray
    sds: FloatArray
    slopes: FloatArray
    ahead: BoolArray

    @property
    def points(self) -> Vectors:
        """Ends of all beams ``(n, 3)`` [m]."""
        return np.asarray(self.starts + self.ranges[:, None] * self.beams)

    def deviations(self, cosines: FloatArray) -> FloatArray:
        """Return the standard deviations of the points across a surface ``(*batch, n)`` [m].

        Args:
            cosines: cosines of the incidences ``(*batch, n)``.
        """
        sines = 1.0 - cosines**2
        return np.asarray(np.sqrt((cosines * self.sds) ** 2 + 0.25 * (self.ranges * self.slopes) ** 2 * sines))

    def heights(self, point: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the heights of the points over a plane, and their standard deviations ``(n,)`` [m].

        Args:
            point: point on the plane ``(3,)`` [m].
            normal: unit normal ``(3,)``.
        """
        return (self.points - point) @ normal, self.deviations(np.clip(-(self.beams @ normal), 0.0, 1.0))

    def keep(self, rows: BoolArray) -> Cloud:
        """Return some of the beams.

        Args:
            rows: mask of the beams ``(n,)``.
        """
        return Cloud(*(getattr(self, name)[rows] for name in self.__slots__))


def over(cloud: Cloud, point: FloatArray, normal: FloatArray) -> Cloud:
    """Return the points above a plane, which are the only obstacles for a hand over it.

    Args:
        cloud: sensed points.
        point: point on the plane ``(3,)`` [m].
        normal: unit normal ``(3,)``.
    """
    height, sd = cloud.heights(point, normal)
    return cloud.keep(cloud.hit & (height > _OUT * sd + _FORM))


def beside(cloud: Cloud, point: FloatArray, normal: FloatArray) -> Cloud:
    """Return the points that do not lie in a plane, to which the hand controls its distance.

    Args:
        cloud: sensed points.
        point: point on the plane ``(3,)`` [m].
        normal: unit normal ``(3,)``.
    """
    height, sd = cloud.heights(point, normal)
    return cloud.keep(cloud.hit & (np.abs(height) > _OUT * sd + _FORM))


def cloud_of(hand: Hand, motions: Iterable[Motion]) -> Cloud:
    """Return the beams of some motions, thinned evenly.

    Args:
        hand: sensors and body of the hand.
        motions: motions with their logs.
    """
    log: list[HandReading] = [s for motion in motions for s in motion.log]
    log = log[:: max(1, len(log) * len(hand.origins) // (3 * _MOST))]
    model, (starts, beams, states, ranges) = error_model(hand.rig), _beams(hand, log)
    ahead = np.zeros(states.shape, dtype=bool)
    ahead[:, list(hand.frontal)] = True
    hit = states == HIT
    reach = np.where(hit, ranges, np.where(np.isfinite(model.max_range), model.max_range, 0.0))
    use = hit | ((states == FREE) & ahead)
    scale_var = model.cov_unit[:, 6, 6]
    sds = np.sqrt(model.law.sigma(reach) ** 2 + model.bias_sd**2 + scale_var * reach**2)
    slopes = np.broadcast_to(np.tan(model.beam_half_angle), reach.shape)
    return Cloud(starts[use], beams[use], reach[use], hit[use], sds[use], slopes[use], ahead[use])


def _beams(hand: Hand, log: Sequence[HandReading]) -> tuple[Vectors, Vectors, IntArray, FloatArray]:
    """Return starts and directions of all beams ``(n, k, 3)``, and their states and ranges ``(n, k)``."""
    T = np.array([s.T_world_hand for s in log])[:, None]
    beams = hand.axes @ np.swapaxes(T[:, 0, :3, :3], 1, 2)
    states, ranges = np.array([s.states for s in log]), np.array([s.ranges for s in log])
    return SE3.apply(T, hand.origins), beams, states, ranges


def clearance(cloud: Cloud, body: Body, Ts_world_hand: Transforms) -> FloatArray:
    """Return the smallest distance of the body from the sensed points at each pose ``(m,)`` [m].

    Args:
        cloud: sensed points.
        body: body of the hand.
        Ts_world_hand: poses of the hand ``(m, 4, 4)`` [m].
    """
    points = cloud.points[cloud.hit]
    if not len(points):
        return np.full(len(Ts_world_hand), np.inf)
    centres = body.placed(Ts_world_hand)
    return np.asarray((cKDTree(points).query(centres)[0] - body.radii).min(axis=1))


GAP = 0.0055
"""Largest distance of a known point from a beam [m]."""

_PACE = 0.004
"""Distance of consecutive points along a beam [m]."""

CELL = 0.002
"""Size of the cells in which points of beams count once [m]."""

_BITS = 21
"""Number of bits of a cell's index along each axis."""

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
        places |= {float(r) + CELL: centres[:, radii == r].reshape(-1, 3) for r in np.unique(radii)}
        self._cells = {reach: cells_of(points) for reach, points in places.items()}
        for reach, cells in before._cells.items() if before is not None else ():
            self._cells[reach] = _once(np.concatenate([cells, self._cells[reach]]))
        self._trees = [(reach, cKDTree(middles_of(cells), balanced_tree=False)) for reach, cells in self._cells.items()]

    def has(self, points: Vectors) -> BoolArray:
        """Return the mask of the known points ``(*batch,)``.

        Args:
            points: points to check ``(*batch, 3)``, world frame [m].
        """
        flat = points.reshape(-1, 3)
        out = np.zeros(len(flat), dtype=bool)
        for reach, tree in self._trees:
            left = np.flatnonzero(~out)
            out[left] = np.isfinite(tree.query(flat[left], distance_upper_bound=reach)[0])
        return out.reshape(points.shape[:-1])

    def shares(self, body: Body, Ts_world_hand: Transforms, margin: float) -> Iterator[float]:
        """Return, pose by pose, the known fraction of the space around the spheres of a body that are not blind.

        Args:
            body: body of the hand.
            Ts_world_hand: poses of the hand ``(m, 4, 4)`` [m].
            margin: distance from the spheres that is included [m].
        """
        skin = _skin(body.centres[~body.blind], body.radii[~body.blind] + margin)
        return (float(self.has(SE3.apply(T, skin)).mean()) for T in Ts_world_hand)

    def holds(self, body: Body, Ts_world_hand: Transforms, margin: float) -> bool:
        """Return whether the space around a body is completely known at all poses.

        Args:
            body: body of the hand.
            Ts_world_hand: poses of the hand ``(m, 4, 4)`` [m].
            margin: distance from the spheres that is included [m].
        """
        return all(share == 1.0 for share in self.shares(body, Ts_world_hand, margin))


def _skin(centres: Vectors, radii: FloatArray) -> Vectors:
    """Return points on spheres that are not inside of another one ``(n, 3)``."""
    points = (centres[:, None] + radii[:, None, None] * _SHELL).reshape(-1, 3)
    depths = radii - np.linalg.norm(points[:, None] - centres, axis=-1)
    return points[(depths < 1e-9).all(axis=1)]


_SHELL = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], dtype=float)
_SHELL /= np.linalg.norm(_SHELL, axis=1, keepdims=True)


def _along_beams(hand: Hand, log: Sequence[HandReading]) -> Vectors:
    """Return points along the clear paths of all beams ``(n, 3)``."""
    farthest, (starts, beams, states, ranges) = error_model(hand.rig).max_range, _beams(hand, log)
    reach = np.where(states == HIT, ranges, np.where((states == FREE) & np.isfinite(farthest), farthest, 0.0))
    steps = np.arange(0.0, reach.max(initial=0.0), _PACE)
    points = starts[..., None, :] + steps[:, None] * beams[..., None, :]
    return np.asarray(points[steps < reach[..., None]])


def cells_of(points: Vectors) -> IntArray:
    """Return the sorted unique indices of the cubic cells (edge :data:`CELL`) that contain points ``(n, 3)`` [m]."""
    i = np.round(points / CELL).astype(np.int64) + _HALF
    return _once((i[:, 0] << 2 * _BITS) + (i[:, 1] << _BITS) + i[:, 2])


def _once(cells: IntArray) -> IntArray:
    """Return unique indices by sorting, because :func:`numpy.unique` hashes integers, which is slower here."""
    ordered = np.sort(cells)
    return np.asarray(ordered[np.diff(ordered, prepend=-1) > 0])


def middles_of(cells: IntArray) -> Vectors:
    """Return the centres of cells ``(n, 3)`` [m]."""
    i = np.stack([cells >> 2 * _BITS, cells >> _BITS, cells], axis=-1) & (2 * _HALF - 1)
    return np.asarray(CELL * (i - _HALF))
