"""Simulate devices: readings with errors drawn from the error model that the estimation assumes.

For simulators and tests only. Input are true ranges and incidences along rays, from a caller with the geometry;
output are readings with a status.

One run, in the order of the calls::

    model = error_model(rig)                      # figures of all sensors, as arrays
    units = draw_units(rng, model)                # once: bias, scale, true mounting of the sensors
    aims = draw_aims(rng, model.beam_half_angle)  # every reading: direction of the echo in the cone
    ...                                           # cast T_world_hand @ units.T_hand_sensors along the aims
    readings, statuses = emit(rng, model, units, ranges, incidences, aims)

For the hand, call ``base = draw_base(rng, robot)`` once, and ``reported_poses(rng, robot, base, Ts_true)`` for every
reading. The last axis always counts the sensors of the model; all axes before it are batches (time, scenes, units).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, IntArray, Tangents, Transforms, Vectors
from tanteo.sensors.figures import ErrorModel
from tanteo.sensors.presets import RobotPreset, SensorPreset


class Status(IntEnum):
    """Outcome of one reading."""

    OK = 0
    """A range was measured."""
    NONE = 1
    """Nothing within range: the beam was free up to the largest range."""
    NEAR = 2
    """Target below the smallest range: no range, and the beam was not free."""
    OBLIQUE = 3
    """Target beyond the largest incidence: no range, and the beam was not free."""


@dataclass(frozen=True, slots=True, eq=False)
class UnitErrors:
    """Errors that are constant for a unit, in one draw.

    Attributes:
        bias: offset of the ranges ``(*batch, k)`` [m].
        scale: scale error ``(*batch, k)``; the device reports ``1 + scale`` times the range.
        T_hand_sensors: true poses of the sensors on the hand ``(*batch, k, 4, 4)`` [m].
    """

    bias: FloatArray
    scale: FloatArray
    T_hand_sensors: Transforms


def draw_units(rng: np.random.Generator, model: ErrorModel, batch: tuple[int, ...] = ()) -> UnitErrors:
    """Draw bias, scale and mounting error of every sensor for every item of the batch.

    Args:
        rng: random number generator.
        model: error figures of the ``k`` sensors.
        batch: leading axes of the result.
    """
    shape = (*batch, len(model))
    values, vectors = np.linalg.eigh(model.cov_unit)
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    unit = np.einsum("kij,...kj->...ki", roots, rng.normal(size=(*shape, 7)))
    unit = unit[..., model.unit, :]
    bias = rng.normal(size=shape)[..., model.unit]
    T_unit_sensors = SE3.inverse(model.T_hand_units) @ model.T_hand_sensors
    return UnitErrors(
        bias=model.bias + model.bias_sd * bias,
        scale=model.scale + unit[..., 6],
        T_hand_sensors=model.T_hand_units @ SE3.exp(unit[..., :6]) @ T_unit_sensors,
    )


def emit(
    rng: np.random.Generator,
    model: ErrorModel,
    units: UnitErrors,
    ranges: FloatArray,
    incidences: FloatArray | float = 0.0,
    aims: Vectors | None = None,
) -> tuple[FloatArray, IntArray]:
    """Return the reported ranges ``cos(axis) ((1 + scale) d + bias + noise(d))`` with a :class:`Status` each.

    The limits apply to the reported range. A true range below the smallest one is :attr:`Status.NEAR` for any noise.

    Args:
        rng: random number generator; the number of samples does not depend on the statuses.
        model: error figures of the ``k`` sensors.
        units: constant errors of the sensors.
        ranges: true ranges along the rays ``(*batch, k)`` [m]; infinite or NaN where a ray hits nothing.
        incidences: true angles between ray and surface normal ``(*batch, k)`` [rad].
        aims: directions of the rays in the sensors' frames ``(*batch, k, 3)``, from :func:`draw_aims`. The hit point is
            ``d`` along the beam and ``d eps`` across it (``math.md`` section 7), so only the component along the beam
            is reported. None if the ranges are along the beam already.

    Returns:
        Reported ranges ``(*batch, k)`` [m], NaN where there is none, and statuses ``(*batch, k)``.
    """
    ranges = np.asarray(ranges, dtype=np.float64)
    echo = np.isfinite(ranges)
    d = np.where(echo, ranges, 0.0)
    if aims is not None:
        d = d * aims[..., 2]
    noise = model.law.sigma(d) * rng.standard_normal(d.shape)
    reported = model.axis_cosine * (d + units.scale * d + units.bias + noise)
    least = np.minimum(reported, d * model.axis_cosine)
    # the last assignment has priority: no target, then too near, then too oblique
    statuses = np.where(incidences > model.max_incidence, int(Status.OBLIQUE), int(Status.OK))
    statuses = np.where(least < model.min_range, int(Status.NEAR), statuses)
    statuses = np.where(~echo | (reported > model.max_range), int(Status.NONE), statuses)
    return np.where(statuses == int(Status.OK), reported, np.nan), statuses


def draw_touch_bias(rng: np.random.Generator, preset: SensorPreset, batch: tuple[int, ...] = ()) -> FloatArray:
    """Draw a touch probe's bias along its motion for every item of the batch [m].

    Args:
        rng: random number generator.
        preset: touch probe.
        batch: shape of the result.
    """
    return preset.bias_std * rng.normal(size=batch)


def emit_touches(
    rng: np.random.Generator,
    preset: SensorPreset,
    bias: FloatArray | float,
    points: Vectors,
    directions: Vectors,
    incidences: FloatArray | float = 0.0,
) -> tuple[Vectors, IntArray]:
    """Return touched points as a probe reports them, with isotropic noise and a bias along the motion.

    Args:
        rng: random number generator.
        preset: touch probe (``is_contact``).
        bias: bias of the unit ``(*batch)`` [m], from :func:`draw_touch_bias`.
        points: true points or ball centres at contact ``(*batch, 3)`` [m].
        directions: unit directions of the motion ``(*batch, 3)``.
        incidences: angles between motion and inward normal ``(*batch)`` [rad]; beyond the preset's limit the probe
            slips and reports no contact.

    Returns:
        Reported points ``(*batch, 3)`` [m], NaN where the probe slipped, and statuses ``(*batch)``.

    Raises:
        InputError: the preset is not a touch probe.
    """
    if not preset.is_contact:
        raise InputError(f"preset: expected a touch probe, got '{preset.name}', which gives ranges. Use emit.")
    points = np.asarray(points, dtype=np.float64)
    noise = preset.sigma_const * rng.normal(size=points.shape)
    reported = points + noise + np.asarray(bias)[..., None] * directions
    slips = np.broadcast_to(np.asarray(incidences) > preset.max_incidence, points.shape[:-1])
    return np.where(slips[..., None], np.nan, reported), np.where(slips, int(Status.OBLIQUE), int(Status.OK))


def draw_base(rng: np.random.Generator, robot: RobotPreset, batch: tuple[int, ...] = ()) -> Tangents:
    """Draw a robot's absolute error, a left error of the world about its origin ``(*batch, 6)`` [m, rad].

    Args:
        rng: random number generator.
        robot: error figures of the robot.
        batch: leading axes of the result.
    """
    return np.repeat([robot.pos_abs_std, robot.rot_abs_std], 3) * rng.normal(size=(*batch, 6))


def reported_poses(rng: np.random.Generator, robot: RobotPreset, base: Tangents, Ts_true: Transforms) -> Transforms:
    """Return the hand's poses as the robot reports them: ``T_true = exp(base) T_reported exp(repeat)``.

    Args:
        rng: random number generator for the repeatability, one draw per pose.
        robot: error figures of the robot.
        base: absolute error of the robot ``(*batch, 6)`` [m, rad], from :func:`draw_base`.
        Ts_true: true poses of the hand in the world ``(*batch, 4, 4)`` [m].
    """
    shape = np.broadcast_shapes(Ts_true.shape[:-2], base.shape[:-1])
    repeat = np.repeat([robot.pos_repeat_std, robot.rot_repeat_std], 3) * rng.normal(size=(*shape, 6))
    return np.asarray(SE3.inverse(SE3.exp(base)) @ Ts_true @ SE3.exp(-repeat))
