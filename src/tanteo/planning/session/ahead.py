"""Prediction of the shared errors of candidates and of the hand's attitude, from the readings so far."""

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
from tanteo.posterior.answers import corner_sd, observed_covariance
from tanteo.posterior.dominant_error import dominant_shared_error, unstated_errors_limit
from tanteo.posterior.fit_at_mode import goodness_of_fit
from tanteo.posterior.sampling.covariances import unstated_moves
from tanteo.sensors import Column, PointMeasurements, Readings, concatenate
from tanteo.sensors.error_states import FaceOffset, UnstatedError
from tanteo.words.findings import SharedErrorLimits

_TURNED, _STILL = 0.3, 0.1
"""Smallest angle between two approaches for a conclusion [rad], and largest rotation, as a fraction of it, of a hand
whose attitude counts as constant."""

_ALONG = 1e-9
"""Sine of the angle below which two directions count as equal or opposite."""


def shared_of(sensing: Sensing, probe: Probe, readings: Readings | None, state: SensingState) -> SharedOf | None:
    """Return a function that predicts the shared errors of candidates, or None if the readings share no error.

    Each candidate is treated like a reading with the sensor and the hand of the earlier reading with the most similar
    approach.

    Args:
        sensing: noise model of the readings.
        probe: sensor model for planning.
        readings: all readings so far; None before the first.
        state: posterior given these readings.
    """
    if readings is None or not state.modes:
        return None
    measured = measured_by(sensing, probe, readings, state)
    if not measured.shared or not len(measured):
        return None
    columns, effect = _columns(measured), _effect(measured)

    def ahead(candidates: Candidates) -> SharedAhead | None:
        made = _as_readings(candidates, readings, measured, probe)
        try:
            joint = measured_by(sensing, probe, concatenate([readings, made]), state)
        except ReadingsError:  # the probe allows a range that the sensor does not
            return None
        whole, which = _effect(joint), np.full(sum(len(e.covariance) for e in joint.shared), -1)
        for name, own in _columns(joint).items():
            same = _same_columns(effect, whole[: len(measured), :, own])
            before = columns.get(name, same)
            which[own] = same if name == FaceOffset.name or len(before) != len(own) else before
        return SharedAhead.of(state, whole[len(measured) :], which)

    return ahead


def limits(sensing: Sensing, probe: Probe, readings: Readings | None, state: SensingState) -> SharedErrorLimits | None:
    """Return the shared error that contributes most to the uncertainty of the answer; None if it does not dominate.

    Args:
        sensing: noise model of the readings.
        probe: sensor model for planning.
        readings: all readings so far; None before the first.
        state: posterior given these readings.
    """
    if readings is None or not state.modes:
        return None
    measured = measured_by(sensing, probe, readings, state)
    if (unstated := _unstated_limit(state)) or not measured.shared:
        return unstated
    part = state.target(0).part
    reported = corner_sd(part, observed_covariance(part, state.covariances[0]))
    return dominant_shared_error(goodness_of_fit(state.modes[0]), measured.shared, reported)


def _unstated_limit(state: SensingState) -> SharedErrorLimits | None:
    """Return the assumed error that contributes most to the uncertainty of the answer; None if none dominates."""
    if not state.unstated or state.touches is None:
        return None
    part, best, covariance = state.target(0).part, goodness_of_fit(state.modes[0]), state.covariances[0]

    def sd(errors: tuple[UnstatedError, ...]) -> float:
        return corner_sd(part, observed_covariance(part, unstated_moves(touches, best, errors).widen(covariance)))

    touches, share = state.touches, best.mode.objective.problem.settings.checks.limiting_share
    return unstated_errors_limit(sd(state.unstated), sd(()), share, {one.name: sd((one,)) for one in state.unstated})


def measured_by(sensing: Sensing, probe: Probe, readings: Readings, state: SensingState) -> PointMeasurements:
    """Return readings as measurements in the world frame, with the beam width of the session's probe.

    Args:
        sensing: noise model of the readings.
        probe: sensor model for planning.
        readings: readings of the devices.
        state: posterior whose most probable pose assigns the readings to the faces of a made part.
    """
    return sensing.measured(readings, np.nan if probe.contact else probe.beam_half_angle, state)


def _columns(measured: PointMeasurements) -> dict[str, IntArray]:
    """Return the columns of the posterior's shared errors by name."""
    ends = np.cumsum([0, *(len(error.covariance) for error in measured.shared)])
    return {e.name: np.arange(a, b) for e, a, b in zip(measured.shared, ends[:-1], ends[1:], strict=True)}


def _effect(measured: PointMeasurements) -> FloatArray:
    """Return the derivative of all points by the whitened shared errors ``(n, 3, D)`` [m]."""
    return measured.stacked()[0] @ shared_root(measured.shared)


def _same_columns(before: FloatArray, now: FloatArray) -> IntArray:
    """Return the column of ``before`` that equals each column of ``now``; -1 for errors without earlier readings."""
    matching = np.all(np.abs(now[..., None] - before[:, :, None, :]) < 1e-12, axis=(0, 1))
    return np.where(matching.any(axis=1) & now.any(axis=(0, 1)), matching.argmax(axis=1), -1)


def _as_readings(c: Candidates, readings: Readings, measured: PointMeasurements, probe: Probe) -> Readings:
    """Return the candidates as readings with the hand of the most similar earlier contact reading."""
    directions = np.where(np.isnan(measured.directions), -measured.normals, measured.directions)
    directions = np.where(np.isnan(directions), 0.0, directions)
    near = np.argmax(c.directions @ directions.T, axis=1)
    rows = measured.rows[near]
    hands = readings.Ts_world_hand.take(rows)
    if hands.given.any():
        known = readings.Ts_world_hand.given[measured.rows] & directions.any(axis=1)
        still = _is_still(directions[known], readings.Ts_world_hand[measured.rows[known]][:, :3, :3])
        hands = _moved_hands(hands, measured.points[near], directions[near], c, still=still)
    return Readings.from_columns(
        c.aims, directions=c.directions, sds=readings.sds.take(rows), radii=np.full(len(c), probe.radius),
        ranges=Column.from_rows(c.ranges).only(readings.ranges.given[rows]), Ts_world_hand=hands,
        sensors=[readings.sensors[k] for k in rows],
    )  # fmt: skip


def _is_still(directions: Vectors, Rs: Rotations) -> bool:
    """Return whether the hand had the same attitude although the approaches differ."""
    if len(directions) < 2:
        return False
    apart = np.arccos(np.clip(directions @ directions.T, -1, 1).min())
    turned = np.arccos(np.clip(0.5 * (np.einsum("aij,bij->ab", Rs, Rs) - 1), -1, 1).min())
    return bool(apart > _TURNED and turned < _STILL * apart)


def _moved_hands(hands: Column, points: Vectors, directions: Vectors, c: Candidates, *, still: bool) -> Column:
    """Return hand poses at the candidates' aims, rotated with the approach unless the attitude is constant."""
    has_hand, Ts = hands.given, hands.values
    turn = (np.tile(np.eye(3), (len(c), 1, 1)) if still else _turns(directions, c.directions))[has_hand]
    arms = Ts[:, :3, 3] - points[has_hand]
    moved = SE3.from_parts(turn @ Ts[:, :3, :3], c.aims[has_hand] + np.einsum("nij,nj->ni", turn, arms))
    return Column(has_hand, moved)


def _turns(source: Vectors, target: Vectors) -> Rotations:
    """Return the smallest rotations that map each source direction to its target ``(n, 3, 3)``."""
    axis, cosine = np.cross(source, target), np.sum(source * target, axis=1)
    sine = np.linalg.norm(axis, axis=1)
    plain = SO3.exp(axis / np.maximum(sine, _ALONG)[:, None] * np.arctan2(sine, cosine)[:, None])
    opposite: BoolArray = (sine < _ALONG) & (cosine < 0)
    frames: FloatArray = SO3.frame_from_axis(target, 2) @ np.swapaxes(SO3.frame_from_axis(_unit(source), 2), 1, 2)
    return np.where(opposite[:, None, None], frames, plain)


def _unit(directions: Vectors) -> Vectors:
    """Return the directions with zero vectors, which stand for missing ones, replaced by z."""
    return np.where(directions.any(axis=1, keepdims=True), directions, [0.0, 0.0, 1.0])
