"""Convert readings to measurements: points in the world with covariance and shared errors.

``sd`` is one standard deviation along the beam or the normal. Across a beam with known range, the standard deviation is
that of its cone (half the half angle, ``math.md`` section 7). A contact reading, and a beam with unknown cone, have
``sd`` in every direction. The robot's repeatability is independent for each reading. Errors shared by the run are: the
robot's absolute error (a rigid left error of the world about its origin), the tip's offset (in the hand frame), and
each sensor's bias and scale (along its beam) and mounting.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError, check_kind
from tanteo.geometry.limits import LARGEST, LEAST_SD, check_length, check_number
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Vectors
from tanteo.sensors.columns import Column
from tanteo.sensors.devices import Device, Placed, find_devices, place
from tanteo.sensors.error_states import MOST_STATES, ErrorState, Fan, Offset, Sensed, unstated_errors
from tanteo.sensors.kinds import reading_kind
from tanteo.sensors.measurements import BeamCones, FreeBeams, PointMeasurements
from tanteo.sensors.noise import beam_cov
from tanteo.sensors.presets import RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.sensors.readings import Readings, check_readings_kind
from tanteo.sensors.rig import Rig
from tanteo.sensors.shared import SharedEffect, aims_of, base, of_devices, of_state, tip, unstated_angles

_ACROSS_FLOOR = 1e-2
"""Smallest standard deviation across a beam as a fraction of that along it, which keeps covariances invertible."""


_SIDES = {"hole": 1, "boss": -1, "": 0}

UNSTATED_SD = 1e-4
"""Standard deviation assumed for contact readings without one [m], between a touch probe and a hand-held tip."""


def measure(
    readings: Readings,
    *,
    sensor: SensorPreset | str | None = None,
    robot: RobotPreset | str | None = None,
    sd: float | None = None,
    tip_sd: npt.ArrayLike | None = None,
    bias_sd: float | None = None,
    shared_errors: Sequence[ErrorState] = (),
    rig: Rig | None = None,
    beam_half_angle: float = math.nan,
    angle_sd: float = 0.0,
) -> PointMeasurements:
    """Return points in the world with covariance and shared errors from device readings.

    A point is the sensed **surface** point where the contact normal is known (ball centre minus one radius along the
    normal). Otherwise it is the centre of the tip's ball, and the radius is kept. Free-space rays are kept as well.

    Args:
        readings: readings of the devices.
        sensor: preset, or its name, for readings whose sensor the rig does not contain.
        robot: preset, or its name, of the robot's errors; None to assume no errors.
        sd: standard deviation along the beam or normal [m], for rows without their own.
        tip_sd: standard deviations of the tip's offset in the hand frame ``(3,)`` [m], one draw for the run; zeros for
            an exact tip.
        bias_sd: standard deviation of an offset along the approach [m], one across and one along z of the world, such
            as of the trigger point; it adds to those of presets and rigs. Short for ``Offset(bias_sd)``.
        shared_errors: further errors that readings share, such as ``Scale(1e-4)``; see
            :mod:`tanteo.sensors.error_states`.
        rig: poses of the range sensors on the hand.
        beam_half_angle: half angle of beams whose sensor does not state one [rad]; if NaN, such readings have the same
            standard deviation across as along the beam.
        angle_sd: standard deviation of the angles of range sensors whose rig states no mounting error [rad]; a stated
            ``Fan`` replaces it.

    Raises:
        InputError: the standard deviation of a reading is unknown (no column, ``sd`` or preset, or a preset that needs
            the range), ``tip_sd`` is given without hand poses, a range has no rig, or a name is unknown.
        ReadingsError: a range is outside the limits of its device.
    """
    sensor, robot = _checked(readings, sensor, robot, rig)
    _check_sds(sd, bias_sd)
    devices, numbers = find_devices(readings, sensor, rig)
    placed = place(readings, devices, numbers)
    free = readings.is_free
    hit = ~free
    sds = _spreads(readings, placed, devices, numbers, sd)
    points, radii = _surface_points(readings, placed)
    half_angles = np.array([d.beam_half_angle for d in devices])[numbers]
    half_angles = np.where(np.isnan(half_angles), beam_half_angle, half_angles)
    covs = _independent(readings, placed, half_angles, sds, radii)
    aims = aims_of(readings, placed)
    shared = list[SharedEffect]()
    if robot is not None:
        covs = covs + _repeatability(readings, points, robot)
        shared.append(base(points, placed, robot))
    if tip_sd is not None and not (np.shape(tip_sd) == (3,) and not np.any(tip_sd)):
        shared.append(tip(readings, placed, tip_sd))
    covs = covs + _unaimed(aims, np.array([d.bias_sd for d in devices])[numbers])
    shared += of_devices(placed, aims, devices, numbers, free)
    errors = (*(() if bias_sd is None else (Offset(bias_sd),)), *shared_errors)
    units = np.unique([device.unit for device in devices], return_inverse=True)[1][numbers]
    sensed = Sensed(
        points, aims, hit, placed.directions, readings.groups, readings.features, placed.T_world_units, units, sds,
        np.array([k == "point" or reading_kind(k).is_of_one_face for k in readings.kinds], dtype=np.bool_),
        readings.Ts_world_hand,
    )  # fmt: skip
    noise = float(np.sqrt(np.median(np.trace(covs[hit], axis1=1, axis2=2)) / 3)) if hit.any() else 0.0
    unstated = unstated_errors(sensed, noise, errors, machine=robot is not None)
    if angle_sd > 0 and not any(isinstance(error, Fan) for error in errors):
        shared += unstated_angles(sensed, devices, numbers, angle_sd)
    for error in errors:
        columns = error.columns(sensed)
        points = points + error.center * error.sd * columns.points.sum(axis=2)
        covs = covs if columns.covs is None else covs + columns.covs
        covs = covs + _unaimed(aims, error.spread * error.sd) if error.along_aim else covs
        shared.append(of_state(error, columns))
    _check_states(shared)
    sizes = readings.hole_radii.coalesce(readings.half_angles)
    return PointMeasurements(
        ids=tuple(np.array(readings.ids, dtype=object)[hit]),
        points=points[hit],
        covs=covs[hit],
        radii=radii[hit],
        directions=placed.directions.filled(np.nan)[hit],
        normals=readings.normals.filled(np.nan)[hit],
        normal_sds=readings.normal_sds.filled(np.nan)[hit],
        features=tuple(np.array(readings.features, dtype=object)[hit]),
        kinds=tuple(np.array(readings.kinds, dtype=object)[hit]),
        shared=tuple(one.error for one in shared),
        jacobians=tuple(one.points[hit] for one in shared),
        rows=np.flatnonzero(hit),
        free=_free_beams(readings, placed, devices, numbers, shared),
        cones=BeamCones(
            ranges=placed.ranges.filled(np.nan)[hit],
            half_angles=half_angles[hit],
            half_axes=placed.half_axes.filled(np.nan)[hit],
            max_incidences=np.array([d.max_incidence for d in devices])[numbers][hit],
            responses=tuple(devices[k].response for k in numbers[hit]),
            turns=tuple(one.turns[hit] for one in shared),
        ),
        subtracted_radii=(readings.radii - radii)[hit],
        sizes=tuple(float(sizes[k]) if sizes.given[k] else None for k in np.flatnonzero(hit)),
        material_sides=tuple(_SIDES[readings.material_sides[k]] for k in np.flatnonzero(hit)),
        rounding=readings.step / math.sqrt(12),  # uniform over a step
        unstated=unstated,
    )


def _check_sds(sd: float | None, bias_sd: float | None) -> None:
    """Check that stated standard deviations are in the accepted range."""
    if sd is not None:
        check_number("sd", sd, "m")
    if sd is not None and not LEAST_SD <= sd <= LARGEST:
        raise InputError(f"sd: expected one standard deviation from {LEAST_SD:g} to {LARGEST:g} m, got {sd:g}.")
    if bias_sd is not None:
        check_length("bias_sd", bias_sd, LEAST_SD)


def _check_states(shared: Sequence[SharedEffect]) -> None:
    """Check that the core accepts the number of shared errors."""
    counts = {one.error.name: len(one.error.covariance) for one in shared}
    if sum(counts.values()) > MOST_STATES:
        listed = ", ".join(f"{count} of {name}" for name, count in counts.items())
        raise InputError(
            f"shared_errors: expected at most {MOST_STATES} states, got {listed}. Omit an error, or use fewer groups."
        )


def _unaimed(aims: Column, sds: FloatArray | float) -> Covariances:
    """Return the covariance ``(n, 3, 3)`` of a bias in unknown direction, which is treated as independent."""
    return np.asarray(np.where(aims.given, 0.0, np.square(sds))[:, None, None] * np.eye(3))


def unstated_sd(
    readings: Readings, *, sensor: SensorPreset | str | None = None, sd: float | None = None, rig: Rig | None = None
) -> float | None:
    """Return the standard deviation assumed for readings without a stated one [m].

    None if one is stated or from a preset.

    It is only a start value: the scatter of the readings corrects it within a factor of about twenty.

    Args:
        readings: readings of the devices.
        sensor: preset, or its name; None if not stated.
        sd: standard deviation [m]; None if not stated.
        rig: rig of the sensors; None if not stated.
    """
    check_readings_kind("readings", readings)
    stated = sd is not None or sensor is not None or rig is not None or bool(readings.sds.given.any())
    return None if stated or bool(readings.ranges.given.any()) else UNSTATED_SD


def _checked(
    readings: Readings, sensor: SensorPreset | str | None, robot: RobotPreset | str | None, rig: Rig | None
) -> tuple[SensorPreset | None, RobotPreset | None]:
    """Return the presets of the names; refuse arguments of the wrong type."""
    check_readings_kind("readings", readings)
    if rig is not None:
        check_kind("rig", rig, Rig, "Read its file first: tanteo.io.read_rig(path).")
    if sensor is not None:
        check_kind("sensor", sensor, (SensorPreset, str), "Name one of tanteo.sensors.presets.sensor_presets().")
    if robot is not None:
        check_kind("robot", robot, (RobotPreset, str), "Name one of tanteo.sensors.presets.robot_presets().")
    return (
        sensor_preset(sensor) if isinstance(sensor, str) else sensor,
        robot_preset(robot) if isinstance(robot, str) else robot,
    )


def _spreads(
    readings: Readings, placed: Placed, devices: tuple[Device, ...], numbers: IntArray, sd: float | None
) -> FloatArray:
    """Return the standard deviation along the beam or normal [m]: from the column, else ``sd``, else the device."""
    sds = readings.sds
    if sd is not None:
        sds = sds.coalesce(Column.from_rows(np.full(len(readings), sd)))
    ranges = placed.ranges.filled(np.nan)  # a noise law that depends on the range returns NaN for NaN
    by_law = np.full(len(readings), np.nan)
    for k, device in enumerate(devices):
        rows = ~sds.given & (numbers == k)
        by_law[rows] = device.law.sigma(ranges[rows])
    sds = sds.coalesce(Column.from_rows(by_law))
    unknown = np.flatnonzero(~sds.given & ~readings.is_free)
    if len(unknown):
        device = devices[numbers[unknown[0]]]
        why = (
            f"the noise of '{device.name}' depends on the range and there is none"
            if device.preset is not None
            else "no column sd, no --sd and no sensor preset"
        )
        raise InputError(
            f"sd of reading '{readings.ids[unknown[0]]}': expected one standard deviation, got none ({why}). "
            "Add the column sd_mm, or --sd 0.3mm, or --sensor with ranges; in Python sd=0.3e-3 or sds, in a session "
            "Sensing(sd=0.3e-3)."
        )
    return sds.only(~readings.is_free).filled(1.0)


def _surface_points(readings: Readings, placed: Placed) -> tuple[Vectors, FloatArray]:
    """Return points, moved to the surface where the normal is known, and the remaining tip radii."""
    known = readings.normals.given & (readings.radii > 0)
    shift = readings.radii[:, None] * readings.normals.only(known).filled(0.0)
    return placed.points - shift, np.where(known, 0.0, readings.radii)


def _independent(
    readings: Readings, placed: Placed, half_angles: FloatArray, sds: FloatArray, radii: FloatArray
) -> Covariances:
    """Return independent covariances.

    Along and across a beam, or isotropic, plus the tilt of the normal at the tip's radius.
    """
    aimed = placed.directions.given
    is_beam = aimed & placed.ranges.given & ~np.isnan(half_angles)
    cone = 0.5 * placed.ranges.only(is_beam).filled(0.0) * half_angles
    across = np.where(is_beam, np.maximum(cone, _ACROSS_FLOOR * sds), sds)
    across = readings.across_sds.only(aimed).filled(across)
    is_beam |= aimed & readings.across_sds.given
    axis = placed.directions.only(is_beam).filled([0.0, 0.0, 1.0])
    covs = beam_cov(axis, sds**2, across**2)
    tilted = (radii < readings.radii) & readings.normal_sds.given
    if tilted.any():
        slip = (readings.radii[tilted] * readings.normal_sds[tilted]) ** 2
        covs[tilted] += beam_cov(readings.normals[tilted], np.zeros_like(slip), slip)
    return covs


def _repeatability(readings: Readings, points: Vectors, robot: RobotPreset) -> Covariances:
    """Return the covariance of the hand's repeatability.

    Position, plus rotation times the lever arm if the hand is known.
    """
    hands = readings.Ts_world_hand
    arms = np.where(hands.given[:, None], points - hands.filled(0.0)[:, :3, 3], 0.0)
    squares = np.sum(arms**2, axis=-1)[:, None, None]
    turned = squares * np.eye(3) - arms[:, :, None] * arms[:, None, :]
    return np.asarray(robot.pos_repeat_std**2 * np.eye(3) + robot.rot_repeat_std**2 * turned)


def _free_beams(
    readings: Readings, placed: Placed, devices: tuple[Device, ...], numbers: IntArray, shared: Sequence[SharedEffect]
) -> FreeBeams:
    free = readings.is_free
    half_angles = np.array([d.beam_half_angle for d in devices])[numbers]
    touches = [d.preset is not None and d.preset.is_contact for d in devices]  # a surface stops a tip at any incidence
    limits = np.where(touches, np.pi / 2, [d.max_incidence for d in devices])[numbers]
    return FreeBeams(
        ids=tuple(np.array(readings.ids, dtype=object)[free]),
        origins=placed.points[free],
        directions=placed.directions[free],
        lengths=placed.lengths[free],
        half_angles=np.nan_to_num(half_angles[free]),
        max_incidences=limits[free],
        jacobians=tuple(one.points[free] for one in shared),
        turns=tuple(one.turns[free] for one in shared),
    )
