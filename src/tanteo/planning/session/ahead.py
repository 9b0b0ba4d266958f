"""What candidates would have in common with the readings so far: their shared errors, and how the hand will be held."""

from __future__ import annotations

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.features import shared_root
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Rotations, Vectors
from tanteo.planning.candidates import Candidates
from tanteo.planning.context import SharedOf
from tanteo.planning.probe import Probe
from tanteo.planning.session.values import Sensing
from tanteo.planning.shared import SharedAhead
from tanteo.planning.state import SensingState
from tanteo.posterior import goodness_of_fit, what_limits
from tanteo.sensors import Column, PointMeasurements, Readings
from tanteo.words.findings import SharedErrorLimits

_TURNED, _STILL = 0.3, 0.1
"""Where directions differ by so much [rad] and hands by such a share of it, the hand is not turned to the approach."""

_ALONG = 1e-9
"""Sine of the angle below which two directions are one, or opposite."""


def shared_of(sensing: Sensing, probe: Probe, readings: Readings | None, state: SensingState) -> SharedOf | None:
    """The shared errors of candidates as the readings so far have them; None where these share nothing.

    Each candidate is taken as a reading by the sensor and the hand of the reading whose approach is nearest to its own.

    Args:
        sensing: how readings are made into measurements.
        probe: what senses.
        readings: all so far.
        state: what is known by them.
    """
    if readings is None or not state.modes:
        return None
    measured = measured_by(sensing, probe, readings)
    if not measured.shared or not len(measured):
        return None
    columns = _columns(measured)

    def ahead(candidates: Candidates) -> SharedAhead | None:
        made = _as_readings(candidates, readings, measured, probe)
        try:
            as_made = measured_by(sensing, probe, made)
        except ReadingsError:  # ranges that the probe has and the sensor has not
            return None
        which = np.concatenate([columns.get(e.name, np.full(len(e.covariance), -1)) for e in as_made.shared])
        return SharedAhead.of(state, as_made.stacked()[0] @ shared_root(as_made.shared), which.astype(np.int64))

    return ahead


def limits(sensing: Sensing, probe: Probe, readings: Readings | None, state: SensingState) -> SharedErrorLimits | None:
    """Return the shared error that limits the answer, or None."""
    if readings is None or not state.modes:
        return None
    measured = measured_by(sensing, probe, readings)
    return what_limits(goodness_of_fit(state.modes[0]), measured.shared) if measured.shared else None


def measured_by(sensing: Sensing, probe: Probe, readings: Readings) -> PointMeasurements:
    """Measurements as a session makes them: a beam is as wide as that of the probe."""
    return sensing.measured(readings, np.nan if probe.contact else probe.beam_half_angle)


def _columns(measured: PointMeasurements) -> dict[str, IntArray]:
    """Which columns of the belief's shared errors are those of each name."""
    ends = np.cumsum([0, *(len(error.covariance) for error in measured.shared)])
    return {e.name: np.arange(a, b) for e, a, b in zip(measured.shared, ends[:-1], ends[1:], strict=True)}


def _as_readings(c: Candidates, readings: Readings, measured: PointMeasurements, probe: Probe) -> Readings:
    """The candidates as readings of the hand that made those that met something."""
    ways = np.where(np.isnan(measured.directions), -measured.normals, measured.directions)
    ways = np.where(np.isnan(ways), 0.0, ways)
    near = np.argmax(c.directions @ ways.T, axis=1)
    rows = measured.rows[near]
    hands = readings.Ts_world_hand.take(rows)
    if hands.given.any():
        known = readings.Ts_world_hand.given[measured.rows] & ways.any(axis=1)
        still = _is_still(ways[known], readings.Ts_world_hand[measured.rows[known]][:, :3, :3])
        hands = _brought(hands, measured.points[near], ways[near], c, still=still)
    return Readings.from_columns(
        c.aims, directions=c.directions, sds=readings.sds.take(rows), radii=np.full(len(c), probe.radius),
        ranges=Column.from_rows(c.ranges).only(readings.ranges.given[rows]), Ts_world_hand=hands,
        sensors=[readings.sensors[k] for k in rows],
    )  # fmt: skip


def _is_still(ways: Vectors, Rs: Rotations) -> bool:
    """Whether the hand was held alike for all approaches, however these differ."""
    if len(ways) < 2:
        return False
    apart = np.arccos(np.clip(ways @ ways.T, -1, 1).min())
    turned = np.arccos(np.clip(0.5 * (np.einsum("aij,bij->ab", Rs, Rs) - 1), -1, 1).min())
    return bool(apart > _TURNED and turned < _STILL * apart)


def _brought(hands: Column, points: Vectors, ways: Vectors, c: Candidates, *, still: bool) -> Column:
    """Hands moved to the candidates' aims with what they met, turned with the approach unless they are held alike."""
    held, Ts = hands.given, hands.values
    turn = (np.tile(np.eye(3), (len(c), 1, 1)) if still else _turns(ways, c.directions))[held]
    arms = Ts[:, :3, 3] - points[held]
    moved = SE3.from_parts(turn @ Ts[:, :3, :3], c.aims[held] + np.einsum("nij,nj->ni", turn, arms))
    return Column(held, moved)


def _turns(source: Vectors, target: Vectors) -> Rotations:
    """The least turns that bring unit vectors to others ``(n, 3, 3)``."""
    axis, cosine = np.cross(source, target), np.sum(source * target, axis=1)
    sine = np.linalg.norm(axis, axis=1)
    plain = SO3.exp(axis / np.maximum(sine, _ALONG)[:, None] * np.arctan2(sine, cosine)[:, None])
    opposite: BoolArray = (sine < _ALONG) & (cosine < 0)
    frames: FloatArray = SO3.frame_from_axis(target, 2) @ np.swapaxes(SO3.frame_from_axis(_unit(source), 2), 1, 2)
    return np.where(opposite[:, None, None], frames, plain)


def _unit(ways: Vectors) -> Vectors:
    """The same, and some direction where there is none."""
    return np.where(ways.any(axis=1, keepdims=True), ways, [0.0, 0.0, 1.0])
