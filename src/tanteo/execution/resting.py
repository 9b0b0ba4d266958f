"""What the hand reads at rest, which of it is of furniture rather than of a part, and what that still says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.active import SensingState, draw, predict
from tanteo.execution.possible import OFF, Possible
from tanteo.hand import FREE, MET, Hand, HandReading, Robot
from tanteo.lie import SE3, SO3
from tanteo.sensors import PointMeasurements, Readings, Rig, RobotPreset, error_model, measure
from tanteo.shapes import Surface
from tanteo.typing import BoolArray, FloatArray, Transforms

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


_SCATTER = 6.0
"""Readings that lie farther apart than so many standard deviations of their noise met a slope or more than one thing:
their mean may be of neither, so each is told then."""

_ALONE = 4
"""How many of them."""

_ALONG, _FARTHEST = 24, 0.3
"""Places along a beam at which is asked what may be there, and how far out [m]."""


def rest(robot: Robot, count: int) -> list[HandReading]:
    """Readings of a hand that stays where it is."""
    return [robot.step(np.zeros(6)) for _ in range(count)]


def as_readings(hand: Hand, log: Sequence[HandReading], name: str) -> Readings | None:
    """The readings of the sensors at rest: one of each, the mean; None if none of them says anything.

    Where those of one sensor disagree more than its noise, it looks over an edge: some of them are taken as they are.
    Readings that are too near or get no echo say nothing, nor does a beam that meets something at times only: its cone
    passes an edge, and to call it free would contradict the poses at which its axis does not.
    """
    model, rows = error_model(hand.rig), list[tuple[str, Transforms, float, float]]()
    T = log[-1].T_world_hand
    for i in range(len(hand.rig.sensors)):
        met = np.array([s.ranges[i] for s in log if s.states[i] == MET])
        free = sum(bool(s.states[i] == FREE) for s in log)
        sensor = hand.rig.sensors[i].name
        if len(met) and not free:
            sd = float(model.law.sigma(np.full(len(model), met.mean()))[i])
            if np.ptp(met) <= _SCATTER * sd:
                rows.append((sensor, T, float(met.mean()), sd / np.sqrt(len(met))))
            else:
                some = np.unique(np.linspace(0, len(met) - 1, _ALONE).round().astype(np.int64))
                rows += [(sensor, T, float(r), float("nan")) for r in met[some]]
        elif free and not len(met):
            rows.append((sensor, T, float("nan"), float("nan")))
    return _readings(rows, name) if rows else None


def of_parts(hand: Hand, readings: Readings, possible: Possible) -> Readings | None:
    """Those of the frontal sensors, and of the others those whose beams come to where a part may be; None for none.

    The others were not aimed at anything: what they meet elsewhere is something else, and that they are free there
    tells no part from another.
    """
    sensors = hand.rig.numbers(readings.sensors)
    reach = np.where(readings.is_free, error_model(hand.rig).max_range[sensors], readings.ranges)
    Ts = readings.Ts_world_hand
    along = np.linspace(0.0, 1.0, _ALONG)[:, None] * np.minimum(reach, _FARTHEST)
    points = SE3.apply(Ts, hand.origins[sensors] + along[..., None] * hand.axes[sensors])
    told = np.isin(sensors, hand.frontal) | (possible.distances(points).min(axis=0) < OFF)
    return readings.take(np.flatnonzero(told)) if told.any() else None


def _readings(rows: list[tuple[str, Transforms, float, float]], name: str) -> Readings:
    sensors, Ts, ranges, sds = zip(*rows, strict=True)
    free = np.isnan(np.array(ranges))
    return Readings.from_columns(
        ids=[f"{name}.{k + 1}" for k in range(len(rows))],
        ranges=np.array(ranges), sensors=sensors, Ts_world_hand=_rigid(np.array(Ts)), sds=np.array(sds), is_free=free,
        source="sense part",
    )  # fmt: skip


def _rigid(Ts: Transforms) -> Transforms:
    """Poses as a readings file keeps them."""
    Ts[:, :3, :3] = SO3.from_quaternion(SO3.as_quaternion(Ts[:, :3, :3]))
    return Ts
