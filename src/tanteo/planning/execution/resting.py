"""Readings of a hand at rest, and the separation of readings of known furniture from those of a part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.hand import FREE, HIT, Hand, HandReading, Robot
from tanteo.parts import Surface
from tanteo.planning.execution.possible import OFF, PossiblePoses
from tanteo.planning.predictions import predict
from tanteo.planning.samples import draw
from tanteo.planning.state import SensingState
from tanteo.sensors import Column, PointMeasurements, Readings, Rig, error_model, measure
from tanteo.sensors.presets import RobotPreset

_NEAR, _FORM = 4.0, 1e-3
"""Standard deviations, and an additional form error [m], within which a reading may belong to furniture."""

_SURE, _SAMPLES = 0.9, 128
"""Probability above which such a reading is still used as one of a part, and number of belief samples for it."""


@dataclass(frozen=True, slots=True, eq=False)
class Furniture:
    """Known solids in the cell, such as a table, clamps or a fixture.

    Attributes:
        surface: joint surface of the solids, world frame.
    """

    surface: Surface

    def met(
        self, readings: Readings, rig: Rig, robot: RobotPreset | None, state: SensingState | None = None
    ) -> BoolArray:
        """Return which readings belong to furniture rather than to a part.

        A point lies on the beam axis, but any ray of the cone may have hit the surface. At grazing incidence the point
        may therefore lie before the furniture by the extent of the spot. Such a reading counts as one of a part only if
        the belief gives that a probability of 0.9: a false touch excludes the true pose, a dropped one costs little.

        Args:
            readings: readings, free ones included.
            rig: range sensors of the hand.
            robot: error model of the reported poses.
            state: belief about the parts; None if no part is expected.

        Returns:
            One flag per reading ``(n,)``.
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
        """Return whether each reading may be of furniture ``(n,)``, and its density if it is ``(n,)`` [1/m]."""
        closest = self.surface.closest(measured.points)
        across = (measured.points - closest.points) / np.maximum(closest.distances, 1e-12)[:, None]
        cosines = np.abs(np.sum(across * measured.directions, axis=1)).clip(1e-3, 1.0)
        total = np.einsum("ni,nij,nj->n", across, measured.total_covs(), across)
        # the variance of a uniform disc along any diameter is a quarter of its squared radius
        flat = np.sqrt(1 - cosines**2)
        own = (total - 0.25 * (spots * flat) ** 2).clip(0.0)
        near = closest.distances <= _NEAR * np.sqrt(own) + spots * flat + _FORM
        away = closest.distances**2 / total
        return near, np.exp(-0.5 * away) * cosines / np.sqrt(2 * np.pi * total)


def _expected(
    state: SensingState, measured: PointMeasurements, ranges: FloatArray, spots: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the density of part surfaces at the ranges [1/m] and the probability of no part before them, ``(n,)``."""
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
    """Return the readings with those of furniture replaced by free-space rays that end before it.

    Args:
        readings: readings of the hand.
        of_it: whether a reading is of furniture ``(n,)``.
        rig: range sensors of the hand.
    """
    if not of_it.any():
        return readings
    law = error_model(rig).law
    number = rig.numbers(readings.sensors)
    sds = law.sigma(readings.ranges.filled(0.1)[:, None] * np.ones(len(rig.sensors)))
    sd = sds[np.arange(len(readings)), number]
    short = np.maximum(readings.ranges[of_it] - _NEAR * sd[of_it] - 5 * _FORM, 1e-3)
    return Readings.from_columns(
        ids=readings.ids, ranges=readings.ranges.only(~of_it), sensors=readings.sensors,
        Ts_world_hand=readings.Ts_world_hand, sds=readings.sds.only(~of_it), is_free=readings.is_free | of_it,
        max_ranges=Column(of_it, short).coalesce(readings.max_ranges),
        source=readings.source,
    )  # fmt: skip


_SCATTER = 6.0
"""Spread of a sensor's readings at rest, in noise standard deviations, above which they are kept separately: the beam
then covers a step or a slope, and the mean may lie on no surface."""

_ALONE = 4
"""Number of readings that are kept in that case."""

_ALONG, _FARTHEST = 24, 0.3
"""Number of points along a beam that are checked for possible parts, and the largest checked range [m]."""


def rest(robot: Robot, count: int) -> list[HandReading]:
    """Return readings of a hand that does not move.

    Args:
        robot: robot that carries the hand.
        count: number of readings.
    """
    return [robot.step(np.zeros(6)) for _ in range(count)]


def as_readings(hand: Hand, log: Sequence[HandReading], name: str) -> Readings | None:
    """Return one averaged reading per sensor from a hand at rest, or None if no sensor has a valid reading.

    If a sensor's readings scatter beyond its noise, its beam covers an edge, and a few single readings are kept.
    Readings that are too near or have no echo are dropped. A beam that hits something only sometimes is dropped too:
    its cone passes an edge, and as a free-space ray it would contradict valid poses.

    Args:
        hand: sensors and body of the hand.
        log: readings at rest.
        name: prefix of the identifiers of the readings.
    """
    model, rows = error_model(hand.rig), list[tuple[str, Transforms, float | None, float | None]]()
    T = log[-1].T_world_hand
    for i in range(len(hand.rig.sensors)):
        met = np.array([s.ranges[i] for s in log if s.states[i] == HIT])
        free = sum(bool(s.states[i] == FREE) for s in log)
        sensor = hand.rig.sensors[i].name
        if len(met) and not free:
            sd = float(model.law.sigma(np.full(len(model), met.mean()))[i])
            if np.ptp(met) <= _SCATTER * sd:
                rows.append((sensor, T, float(met.mean()), sd / np.sqrt(len(met))))
            else:
                some = np.unique(np.linspace(0, len(met) - 1, _ALONE).round().astype(np.int64))
                rows += [(sensor, T, float(r), None) for r in met[some]]
        elif free and not len(met):
            rows.append((sensor, T, None, None))
    return _readings(rows, name) if rows else None


def of_parts(hand: Hand, readings: Readings, possible: PossiblePoses) -> Readings | None:
    """Return readings of the frontal sensors, and of others whose beams pass a possible part; None if there are none.

    The other sensors were not aimed at anything. Elsewhere they hit other objects, and free-space rays carry no
    information.

    Args:
        hand: sensors and body of the hand.
        readings: readings at rest.
        possible: poses of parts that the belief allows.
    """
    sensors = hand.rig.numbers(readings.sensors)
    reach = readings.ranges.only(~readings.is_free).filled(error_model(hand.rig).max_range[sensors])
    Ts = readings.Ts_world_hand[:]
    along = np.linspace(0.0, 1.0, _ALONG)[:, None] * np.minimum(reach, _FARTHEST)
    points = SE3.apply(Ts, hand.origins[sensors] + along[..., None] * hand.axes[sensors])
    told = np.isin(sensors, hand.frontal) | (possible.distances(points).min(axis=0) < OFF)
    return readings.take(np.flatnonzero(told)) if told.any() else None


def _readings(rows: list[tuple[str, Transforms, float | None, float | None]], name: str) -> Readings:
    """Return the readings of sensor, hand pose, range and standard deviation; a row without a range is a free ray."""
    sensors, Ts, ranges, sds = zip(*rows, strict=True)
    free = np.array([one is None for one in ranges])
    return Readings.from_columns(
        ids=[f"{name}.{k + 1}" for k in range(len(rows))],
        ranges=np.array(ranges, dtype=np.float64), sensors=sensors, Ts_world_hand=_rigid(np.array(Ts)),
        sds=np.array(sds, dtype=np.float64), is_free=free,
        source="sense part",
    )  # fmt: skip


def _rigid(Ts: Transforms) -> Transforms:
    """Return poses as a readings file stores them, with orthonormal rotations."""
    Ts[:, :3, :3] = SO3.from_quaternion(SO3.as_quaternion(Ts[:, :3, :3]))
    return Ts
