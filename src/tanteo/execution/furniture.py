"""What is known to stand in the cell: which readings are of it rather than of a part, and what they still say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.active import SensingState, draw, predict
from tanteo.sensors import PointMeasurements, Readings, Rig, RobotPreset, error_model, measure
from tanteo.shapes import Surface
from tanteo.typing import BoolArray, FloatArray

_NEAR, _FORM = 4.0, 1e-3
"""A reading within so many standard deviations and this much more [m] of furniture may be of the furniture."""

_SURE, _SAMPLES = 0.9, 128
"""Probability from which it is of a part nevertheless, which is expected there; poses by which it is counted."""


@dataclass(frozen=True, slots=True, eq=False)
class Furniture:
    """Solids that are known to stand in the cell: a table, clamps, a fixture.

    Attributes:
        surface: of all of them, in the world.
    """

    surface: Surface

    def met(
        self, readings: Readings, rig: Rig, robot: RobotPreset | None, state: SensingState | None = None
    ) -> BoolArray:
        """Which readings are of it rather than of a part ``(n,)``.

        A point is taken on the beam's axis; any ray of its cone may have met it, so where the beam comes in flat the
        point may lie before the furniture by as much as the cone's spot reaches. Such a reading is of a part only where
        the belief expects one, nine to one: a touch that is none puts the true pose out of question, a reading less
        costs little.

        Args:
            readings: some of which may be free.
            rig: where the sensors sit.
            robot: errors of its poses.
            state: where parts are expected; None for nowhere.
        """
        measured = measure(readings, rig=rig, robot=robot)
        out = np.zeros(len(readings), dtype=bool)
        if not len(measured):
            return out
        rows = measured.rows
        half_angles = error_model(rig).beam_half_angle[rig.numbers(readings.sensors)[rows]]
        spots = readings.ranges[rows] * np.tan(half_angles)
        near, density = self._reached(measured, spots)
        if state is not None and near.any():
            hit, passed = _expected(state, measured, readings.ranges[rows], spots)
            near &= hit <= _SURE * (hit + passed * density)
        out[rows] = near | self.surface.inside(measured.points)
        return out

    def _reached(self, measured: PointMeasurements, spots: FloatArray) -> tuple[BoolArray, FloatArray]:
        """Whether each reading may be of it ``(n,)``, and how densely it then reads that ``(n,)`` [1/m]."""
        closest = self.surface.closest(measured.points)
        across = (measured.points - closest.points) / np.maximum(closest.distances, 1e-12)[:, None]
        cosines = np.abs(np.sum(across * measured.directions, axis=1)).clip(1e-3, 1.0)
        total = np.einsum("ni,nij,nj->n", across, measured.total_covs(), across)
        # of a point even over a disc the variance is a quarter of the radius squared, in every direction across
        flat = np.sqrt(1 - cosines**2)
        own = (total - 0.25 * (spots * flat) ** 2).clip(0.0)
        near = closest.distances <= _NEAR * np.sqrt(own) + spots * flat + _FORM
        away = closest.distances**2 / total
        return near, np.exp(-0.5 * away) * cosines / np.sqrt(2 * np.pi * total)


def _expected(
    state: SensingState, measured: PointMeasurements, ranges: FloatArray, spots: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """How densely parts are expected at the ranges ``(n,)`` [1/m], and how probably none is before them ``(n,)``."""
    samples, d = draw(state, _SAMPLES), measured.directions
    if not len(samples):
        return np.zeros(len(ranges)), np.ones(len(ranges))
    p = predict(samples, measured.points - ranges[:, None] * d, d)
    along = np.einsum("ni,nij,nj->n", d, measured.total_covs(), d)
    met, cosines = p.met, np.maximum(p.cosines, 0.1)
    variances = p.variances + along[:, None] + (0.5 * spots[:, None]) ** 2 * (1 / cosines**2 - 1)
    gaps = ranges[:, None] - np.where(met, p.ranges, 0.0)
    density = np.where(met, np.exp(-0.5 * gaps**2 / variances) / np.sqrt(2 * np.pi * variances), 0.0)
    known = 1 - state.unknown
    return known * (density @ samples.weights), state.unknown + known * ((gaps < 0) | ~met) @ samples.weights


def beyond_furniture(readings: Readings, of_it: BoolArray, rig: Rig) -> Readings:
    """The same with beams to furniture as free as far as it: nothing else stands between."""
    if not of_it.any():
        return readings
    law = error_model(rig).law
    number = rig.numbers(readings.sensors)
    sds = law.sigma(np.nan_to_num(readings.ranges, nan=0.1)[:, None] * np.ones(len(rig.sensors)))
    sd = sds[np.arange(len(readings)), number]
    short = np.maximum(readings.ranges - _NEAR * sd - 5 * _FORM, 1e-3)
    return Readings.from_columns(
        ids=readings.ids, ranges=np.where(of_it, np.nan, readings.ranges), sensors=readings.sensors,
        Ts_world_hand=readings.Ts_world_hand, sds=np.where(of_it, np.nan, readings.sds),
        is_free=readings.is_free | of_it, max_ranges=np.where(of_it, short, readings.max_ranges),
        source=readings.source,
    )  # fmt: skip
