"""What devices would say: readings with errors drawn from the very model that is assumed of them.

For simulators and tests. Truth comes in (ranges and incidences along true rays, from whoever knows the shapes), and
readings with a status go out. Nothing here is used to estimate anything.

One run, in the order of the calls::

    model = error_model(rig)                      # figures of all sensors, as arrays
    units = draw_units(rng, model)                # once: bias, scale, where the sensors truly sit
    aims = draw_aims(rng, model.beam_half_angle)  # every reading: where in the cone the echo comes from
    ...                                           # cast T_world_hand @ units.T_hand_sensors along the aims
    readings, statuses = emit(rng, model, units, ranges, incidences, aims)

and for the hand: ``base = draw_base(rng, robot)`` once, ``reported_poses(rng, robot, base, Ts_true)`` every reading.
The last axis is always the sensors of the model; all axes before it are batches (time, scenes, units).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from tanteo.errors import InputError
from tanteo.lie import SE3
from tanteo.sensors.figures import ErrorModel
from tanteo.sensors.presets import RobotPreset, SensorPreset
from tanteo.typing import FloatArray, IntArray, Tangents, Transforms, Vectors


class Status(IntEnum):
    """What a device makes of one reading."""

    OK = 0
    """A range."""
    NONE = 1
    """Nothing within range: the beam was free up to the farthest range."""
    NEAR = 2
    """Something nearer than the device can measure; no range, and the beam was not free."""
    OBLIQUE = 3
    """Met at a greater incidence than the device answers to; no range, and the beam was not free."""


@dataclass(frozen=True, slots=True, eq=False)
class UnitErrors:
    """One draw of everything that stays the same from reading to reading of a unit.

    Attributes:
        bias: Offset of the ranges [m], ``(*batch, k)``.
        scale: Scale error: the device reads ``1 + scale`` times the range, ``(*batch, k)``.
        T_hand_sensors: Where the sensors truly sit, ``(*batch, k, 4, 4)``.
    """

    bias: FloatArray
    scale: FloatArray
    T_hand_sensors: Transforms


def draw_units(rng: np.random.Generator, model: ErrorModel, batch: tuple[int, ...] = ()) -> UnitErrors:
    """One draw of bias, scale and mounting of every sensor, for every item of the batch."""
    shape = (*batch, len(model))
    values, vectors = np.linalg.eigh(model.cov_unit)
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    unit = np.einsum("kij,...kj->...ki", roots, rng.normal(size=(*shape, 7)))
    unit, bias = unit[..., model.unit, :], rng.normal(size=shape)[..., model.unit]
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
    """What the sensors report: ``cos(axis) ((1 + scale) d + bias + noise(d))``, and a :class:`Status` each.

    Limits are those of what is reported; a true range below the nearest is :attr:`Status.NEAR` whatever the noise.

    Args:
        rng: Source of chance; the same number of samples whatever the statuses.
        model: Error figures of the ``k`` sensors.
        units: Their errors that stay.
        ranges: True ranges along the rays [m], ``(*batch, k)``; infinite or NaN where a ray met nothing.
        incidences: True angles between ray and surface normal [rad], ``(*batch, k)``.
        aims: Directions of the rays in the sensors' frames, ``(*batch, k, 3)``, from :func:`draw_aims`. The point met
            is ``d`` along the beam and ``d eps`` across it (``math.md`` section 7), so that a ray's length counts along
            the beam only; without ``aims`` the ranges are along the beam already.

    Returns:
        The reported ranges [m], NaN where there is none, and the statuses, both ``(*batch, k)``.
    """
    ranges = np.asarray(ranges, dtype=np.float64)
    met = np.isfinite(ranges)
    d = np.where(met, ranges, 0.0)
    if aims is not None:
        d = d * aims[..., 2]
    noise = model.law.sigma(d) * rng.standard_normal(d.shape)
    reported = model.axis_cosine * (d + units.scale * d + units.bias + noise)
    least = np.minimum(reported, d * model.axis_cosine)
    # the last assignment wins: nothing met, then too near, then too oblique
    statuses = np.where(incidences > model.max_incidence, int(Status.OBLIQUE), int(Status.OK))
    statuses = np.where(least < model.min_range, int(Status.NEAR), statuses)
    statuses = np.where(~met | (reported > model.max_range), int(Status.NONE), statuses)
    return np.where(statuses == int(Status.OK), reported, np.nan), statuses


def draw_touch_bias(rng: np.random.Generator, preset: SensorPreset, batch: tuple[int, ...] = ()) -> FloatArray:
    """One draw of a touch probe's bias [m] along its motion, for every item of the batch."""
    return preset.bias_std * rng.normal(size=batch)


def emit_touches(
    rng: np.random.Generator,
    preset: SensorPreset,
    bias: FloatArray | float,
    points: Vectors,
    directions: Vectors,
    incidences: FloatArray | float = 0.0,
) -> tuple[Vectors, IntArray]:
    """Touched points as a probe reports them: isotropic noise, and its bias along the motion.

    Args:
        rng: Source of chance.
        preset: A probe (``is_contact``).
        bias: Of the unit [m], ``(*batch)``, from :func:`draw_touch_bias`.
        points: True points or ball centres at contact [m], ``(*batch, 3)``.
        directions: Unit directions of the motion, ``(*batch, 3)``.
        incidences: Angles between motion and inward normal [rad], ``(*batch)``: beyond the preset's limit the probe
            slips and there is no touch.

    Returns:
        The reported points, NaN where the probe slipped, ``(*batch, 3)``, and the statuses ``(*batch)``.

    Raises:
        InputError: The preset does not touch.
    """
    if not preset.is_contact:
        raise InputError(f"preset: expected a touch probe, got '{preset.name}', which gives ranges. Use emit.")
    points = np.asarray(points, dtype=np.float64)
    noise = preset.sigma_const * rng.normal(size=points.shape)
    reported = points + noise + np.asarray(bias)[..., None] * directions
    slips = np.broadcast_to(np.asarray(incidences) > preset.max_incidence, points.shape[:-1])
    return np.where(slips[..., None], np.nan, reported), np.where(slips, int(Status.OBLIQUE), int(Status.OK))


def draw_base(rng: np.random.Generator, robot: RobotPreset, batch: tuple[int, ...] = ()) -> Tangents:
    """One draw of a robot's absolute error: a left error of the world about its origin [m, rad], ``(*batch, 6)``."""
    return np.repeat([robot.pos_abs_std, robot.rot_abs_std], 3) * rng.normal(size=(*batch, 6))


def reported_poses(rng: np.random.Generator, robot: RobotPreset, base: Tangents, Ts_true: Transforms) -> Transforms:
    """Poses of the hand as the robot reports them: ``T_true = exp(base) T_reported exp(repeat)``.

    Args:
        rng: Source of chance, for the repeatability: one draw a pose.
        robot: The robot.
        base: Its absolute error, ``(*batch, 6)``, from :func:`draw_base`.
        Ts_true: Where the hand truly is, ``(*batch, 4, 4)``.
    """
    shape = np.broadcast_shapes(Ts_true.shape[:-2], base.shape[:-1])
    repeat = np.repeat([robot.pos_repeat_std, robot.rot_repeat_std], 3) * rng.normal(size=(*shape, 6))
    return np.asarray(SE3.inverse(SE3.exp(base)) @ Ts_true @ SE3.exp(-repeat))
