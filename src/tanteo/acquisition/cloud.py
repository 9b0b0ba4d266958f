"""Everything that was met so far, as points in the world: what a path must stay clear of, where a face may be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tanteo.hand import FREE, MET, Body, Hand, Sensed
from tanteo.motion import Motion
from tanteo.sensors import error_model
from tanteo.typing import BoolArray, FloatArray, Transforms, Vectors

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
    log: list[Sensed] = [s for motion in motions for s in motion.log]
    log = log[:: max(1, len(log) * len(hand.origins) // (3 * _MOST))]
    T = np.array([s.T_world_hand for s in log])
    states, ranges = np.array([s.states for s in log]), np.array([s.ranges for s in log])
    model = error_model(hand.rig)
    R = T[:, None, :3, :3]
    starts = (R @ hand.origins[..., None])[..., 0] + T[:, None, :3, 3]
    beams = (R @ hand.axes[..., None])[..., 0]
    ahead = np.zeros(states.shape, dtype=bool)
    ahead[:, list(hand.frontal)] = True
    met = states == MET
    reach = np.where(met, ranges, np.where(np.isfinite(model.max_range), model.max_range, 0.0))
    use = met | ((states == FREE) & ahead)
    scale_var = model.cov_unit[:, 6, 6]
    sds = np.sqrt(model.law.sigma(reach) ** 2 + model.bias_sd**2 + scale_var * reach**2)
    slopes = np.broadcast_to(np.tan(model.beam_half_angle), reach.shape)
    return Cloud(starts[use], beams[use], reach[use], met[use], sds[use], slopes[use], ahead[use])


def room(cloud: Cloud, body: Body, Ts_world_hand: Transforms) -> FloatArray:
    """Least distance of the body at each of some poses ``(m, 4, 4)`` from what was met ``(m,)`` [m]."""
    points = cloud.points[cloud.met]
    if not len(points):
        return np.full(len(Ts_world_hand), np.inf)
    centres = body.placed(Ts_world_hand)
    flat = centres.reshape(-1, 3)
    squared = np.sum(flat**2, axis=1)[:, None] + np.sum(points**2, axis=1) - 2 * flat @ points.T
    distances = np.sqrt(np.maximum(squared.min(axis=1), 0.0)).reshape(centres.shape[:-1])
    return np.asarray((distances - body.radii).min(axis=1))
