"""Readings of a hand at rest, and the separation of readings on known furniture from those on a part."""

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
"""Largest distance of a reading from furniture to which it may belong: a multiple of the standard deviation, plus a
form error [m]."""

_SURE, _SAMPLES = 0.9, 128
"""Probability of a part above which such a reading is attributed to the part, and number of posterior samples for that
probability."""


@dataclass(frozen=True, slots=True, eq=False)
class Furniture:
    """Known solids in the cell, such as a table, clamps or a fixture.

    Attributes:
        surface: joint surface of the solids, world frame.
    """

    surface: Surface

    def hit(
        self, readings: Readings, rig: Rig, robot: RobotPreset | None, state: SensingState | None = None
    ) -> BoolArray:
        """Return flags of the readings that hit furniture rather than a part ``(n,)``.

        A measured point lies on the axis of the beam, but any ray of its cone may have hit the surface. At grazing
        incidence the point may therefore lie before the furniture by the size of the spot. Such a reading is attributed
        to a part only if the posterior gives that a probability of 0.9. A false contact point excludes the true pose,
        while a dropped one costs little.

        Args:
            readings: readings, free ones included.
            rig: range sensors of the hand.
            robot: error model of the robot's reported poses; None for exact poses.
            state: posterior of the session; None if no part is expected.
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
        """Return whether each reading may have hit furniture ``(n,)``, and its density in that case ``(n,)`` [1/m]."""
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
    """Return the density of a part's surface at each range [1/m], and the probability of no part before it ``(n,)``."""
    samples, d = draw(state, _SAMPLES), measured.directions
    if not len(samples):
        return np.zeros(len(ranges)), np.ones(len(ranges))
    p = predict(samples, measured.points - ranges[:, None] * d, d)
    along = np.einsum("ni,nij,nj->n", d, measured.total_covs(), d)
    hit, cosines = p.hit, np.maximum(p.cosines, 0.1)
    variances = p.variances + along[:, None] + (0.5 * spots[:, None]) ** 2 * (1 / cosines**2 - 1)
    gaps = ranges[:, None] - np.where(hit, p.ranges, 0.0)
    density = np.where(hit, np.exp(-0.5 * gaps**2 / variances) / np.sqrt(2 * np.pi * variances), 0.0)
    known = 1 - state.unknown
    return known * (density @ samples.weights), state.unknown + known * ((gaps < 0) | ~hit) @ samples.weights


def beyond_furniture(readings: Readings, of_it: BoolArray, rig: Rig) -> Readings:
    """Replace the readings that hit furniture by free-space rays that end before it.

    Args:
        readings: readings of the hand.
        of_it: flags of the readings that hit furniture ``(n,)``.
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
"""Number of single readings that are kept in that case."""

_ALONG, _FARTHEST = 24, 0.3
"""Number of points along a beam that are checked for possible parts, and the largest checked range [m]."""


def rest(robot: Robot, count: int) -> list[HandReading]:
    """Read the sensors of a hand repeatedly while it does not move.

    Args:
        robot: robot that carries the hand.
        count: number of readings.
    """
    return [robot.step(np.zeros(6)) for _ in range(count)]


def as_readings(hand: Hand, log: Sequence[HandReading], name: str) -> Readings | None:
    """Return one averaged reading of each sensor of a hand at rest, or None if no sensor has a valid reading.

    If the readings of a sensor scatter beyond its noise, its beam covers an edge, and a few single readings are kept.
    Readings below the smallest range or without a state are dropped. A beam with an echo only sometimes is dropped,
    too: its cone passes an edge, and as a free-space ray it would contradict valid poses.

    Args:
        hand: sensors and body of the hand.
        log: readings at rest.
        name: prefix of the identifiers of the readings.
    """
    model, rows = error_model(hand.rig), list[tuple[str, Transforms, float | None, float | None]]()
    T = log[-1].T_world_hand
    for i in range(len(hand.rig.sensors)):
        hits = np.array([s.ranges[i] for s in log if s.states[i] == HIT])
        free = sum(bool(s.states[i] == FREE) for s in log)
        sensor = hand.rig.sensors[i].name
        if len(hits) and not free:
            sd = float(model.law.sigma(np.full(len(model), hits.mean()))[i])
            if np.ptp(hits) <= _SCATTER * sd:
                rows.append((sensor, T, float(hits.mean()), sd / np.sqrt(len(hits))))
            else:
                some = np.unique(np.linspace(0, len(hits) - 1, _ALONE).round().astype(np.int64))
                rows += [(sensor, T, float(r), None) for r in hits[some]]
        elif free and not len(hits):
            rows.append((sensor, T, None, None))
    return _readings(rows, name) if rows else None


def of_parts(hand: Hand, readings: Readings, possible: PossiblePoses) -> Readings | None:
    """Return the readings of the frontal sensors, and of other sensors whose beams pass a possible part.

    Only the frontal sensors were aimed. Beams of other sensors that pass no possible part may have hit other objects,
    and their free-space rays have no information.

    Args:
        hand: sensors and body of the hand.
        readings: readings at rest.
        possible: possible poses of the parts.

    Returns:
        Readings; None if there are none.
    """
    sensors = hand.rig.numbers(readings.sensors)
    reach = readings.ranges.only(~readings.is_free).filled(error_model(hand.rig).max_range[sensors])
    Ts = readings.Ts_world_hand[:]
    along = np.linspace(0.0, 1.0, _ALONG)[:, None] * np.minimum(reach, _FARTHEST)
    points = SE3.apply(Ts, hand.origins[sensors] + along[..., None] * hand.axes[sensors])
    relevant = np.isin(sensors, hand.frontal) | (possible.distances(points).min(axis=0) < OFF)
    return readings.take(np.flatnonzero(relevant)) if relevant.any() else None


def _readings(rows: list[tuple[str, Transforms, float | None, float | None]], name: str) -> Readings:
    """Return readings from rows of sensor, hand pose, range and standard deviation; no range means a free-space ray."""
    sensors, Ts, ranges, sds = zip(*rows, strict=True)
    free = np.array([one is None for one in ranges])
    return Readings.from_columns(
        ids=[f"{name}.{k + 1}" for k in range(len(rows))],
        ranges=np.array(ranges, dtype=np.float64), sensors=sensors, Ts_world_hand=_rigid(np.array(Ts)),
        sds=np.array(sds, dtype=np.float64), is_free=free,
        source="sense part",
    )  # fmt: skip


def _rigid(Ts: Transforms) -> Transforms:
    """Return poses with the orthonormal rotations that a readings file stores, as quaternions."""
    Ts[:, :3, :3] = SO3.from_quaternion(SO3.as_quaternion(Ts[:, :3, :3]))
    return Ts
