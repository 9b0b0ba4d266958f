"""Calibrate beams, noise and outliers from a log of planes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from tanteo.errors import InputError, ReadingsError
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray
from tanteo.sensors.calibration.diagnostics import (
    advice,
    is_lost,
    status_of,
    undetermined,
    undetermined_of_device,
    untold_tilts,
)
from tanteo.sensors.calibration.fit import Fit, best_fit
from tanteo.sensors.calibration.geometry import BEAM, DEVICE, PLANE, Prior, make_prior
from tanteo.sensors.calibration.initial import starts
from tanteo.sensors.calibration.log import PlaneLog, plane_log
from tanteo.sensors.calibration.noise import law_cov, place_basis, with_noise_uncertain
from tanteo.sensors.calibration.result import (
    BeamFit,
    Calibration,
    DeviceFit,
    PlaneFit,
    TargetFit,
    make_outliers,
    robot_tilt_cov,
)
from tanteo.sensors.calibration.targets import TARGET, Flat, Target
from tanteo.sensors.columns import Column
from tanteo.sensors.presets import RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.sensors.readings import Readings
from tanteo.sensors.rig import Rig
from tanteo.words.findings import Finding, ManyOutliers, NotPlanes, OffRig, PlacesScatter

_FEWEST_STATIONS = 4
"""Smallest number of stations: three stations on a plane cannot determine the parameters."""

_OBLIQUE = 1e-6
"""Definition: tangent of the incidence up to which all places of a device are square to its beam."""

_FEWEST_DISTANCES = 3
"""Smallest number of known distances: two determine offset and scale without a test; definition."""

_CEILING = 0.9
"""Fraction of a device's largest reading above which an outlier may be a beam without an echo."""

_POSE = 5
"""Number of pose parameters of a beam, which come first."""

_ROUGH, _UNLIKELY = 8.0, 1e-3
"""Limits of warnings: ratio of the scatter between places to that at one place, and p value of a beam's pose in the
rig."""

_UNTOLD = 5
"""Definition: number of undetermined combinations, the scale among them, of a log that only approaches a plane: one of
the six numbers of a beam remains, which the unknown tilt of the plane takes."""

_MOST_EXCLUDED = 0.25
"""Fraction of unexplained outliers above which the labels or the hand poses are probably wrong."""


def calibrate(
    readings: Readings,
    *,
    rig: Rig | None = None,
    sensor: SensorPreset | str | None = None,
    robot: RobotPreset | str | None = None,
    target: Target | None = None,
) -> Calibration:
    """Estimate beam poses, noise and outliers from ranges of planes, which are unknown, at known poses of the hand.

    All sensors and planes of the log are estimated together, with one beam for each sensor: use one log for each
    mounting. Noise, the outlier fraction and the geometry are estimated at once; nothing has to be chosen. What the
    log does not determine keeps its prior uncertainty and is named.

    Args:
        readings: ranges with sensor and hand pose; rows with one label of kind ``plane`` are on one plane, and all rows
            without a label on one plane.
        rig: nominal poses of the sensors, whose mounting errors are prior knowledge; None for a weak prior.
        sensor: preset, or its name, of the sensors that the rig does not contain: scale error and cone.
        robot: preset, or its name; its absolute error moves the planes, not the beams.
        target: target on which all readings are; None for unknown planes.

    Raises:
        ReadingsError: a reading is no range of a plane, or there are too few hand poses.
        InputError: the rig does not contain a sensor, a preset is unknown, or a target needs a rig.

    Example:
        >>> log, rig = tanteo.read_readings("readings/plane_log.csv"), tanteo.read_rig("readings/tof_rig.toml")
        >>> tanteo.calibrate(log, rig=rig).status
        'calibrated'
    """
    sensor = sensor_preset(sensor) if isinstance(sensor, str) else sensor
    robot = robot_preset(robot) if isinstance(robot, str) else robot
    if rig is not None:
        rig.numbers(readings.sensors)
    mounted = bool(readings.true_distances.given.any())
    if mounted:
        readings, target = _before_a_wall(readings, rig, sensor, target)
    log = plane_log(readings, rig)
    _check_log(log, rig, target, mounted=mounted)
    by_rig = None
    if rig is not None:
        poses = {s.name: s.T_hand_sensor for s in rig.sensors}
        by_rig = np.stack([poses[name] for name in log.beams])
    elif mounted:
        by_rig = np.tile(np.eye(4), (len(log.beams), 1, 1))
    setups = starts(log, by_rig, target)
    priors = [make_prior(log, rig, sensor, setup, target, mounted=mounted) for setup in setups]
    setups = [replace(setup, offsets=prior.expected.offsets) for setup, prior in zip(setups, priors, strict=True)]
    presets = [sensor] if rig is None else [s.preset for s in rig.sensors if s.name in log.beams]
    limits = [one.max_incidence for one in presets if one is not None]
    fit, prior = best_fit(log, setups, priors, max(limits, default=math.pi / 2))
    return _result(log, fit, prior, robot, rigged=rig is not None)


def _before_a_wall(
    readings: Readings, rig: Rig | None, sensor: SensorPreset | None, target: Target | None
) -> tuple[Readings, Target]:
    """Return readings of known distances as readings of a plane, with poses of the hand at these distances."""
    hit = ~readings.is_free
    if target is not None or readings.Ts_world_hand.given.any() or not readings.true_distances.given[hit].all():
        raise ReadingsError(
            "true_distances: expected one for every range, without poses of the hand and without a target, got a "
            "mixture. Calibrate with known distances or with poses of the hand."
        )
    if rig is not None:
        known = {s.name: s.T_hand_unit for s in rig.sensors}
        only, number = rig.sensors[0].name, len(rig.sensors)
    else:
        only, number = ("sensor" if sensor is None else sensor.name), 1
    names = tuple(name or (only if number == 1 else "") for name in readings.sensors)
    units = [known.get(name, np.eye(4)) if rig is not None else np.eye(4) for name in names]
    Ts = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (len(names), 1, 1))  # the device faces the plane z = 0
    Ts[:, 2, 3] = readings.true_distances.filled(1.0)
    Ts = Ts @ SE3.inverse(np.array(units))
    placed = replace(readings, sensors=names, Ts_world_hand=Column(np.ones(len(names), dtype=bool), Ts))
    return placed, Target(Flat(), np.eye(4), np.zeros((6, 6)), "plane")


def _check_log(log: PlaneLog, rig: Rig | None, target: Target | None, *, mounted: bool) -> None:
    if len(log) < (_FEWEST_DISTANCES if mounted else _FEWEST_STATIONS):
        what = f"{_FEWEST_DISTANCES} known distances" if mounted else f"{_FEWEST_STATIONS} poses of the hand"
        how = "Measure some ten, near and far." if mounted else "Take some 30, turned and moved."
        raise ReadingsError(f"readings: expected ranges from {what} or more, got {len(log)}. {how}")
    if target is None:
        return
    if len(log.planes) > 1:
        raise ReadingsError(
            f"target: expected readings of it alone, got the labels {', '.join(log.planes)}. Keep one of them."
        )
    if rig is None and not mounted and not (isinstance(target.surface, Flat) and target.T_world_target is not None):
        raise InputError(
            f"target: expected a rig that states about where the sensor is, to start from the {target.name}, got none. "
            "Name it with --rig, with mount_sd_mm and mount_turn_sd_deg."
        )


def _result(log: PlaneLog, fit: Fit, prior: Prior, robot: RobotPreset | None, *, rigged: bool) -> Calibration:
    basis = place_basis(log.ranges, fit.prediction.incidences)
    about = (fit.law, log, 1 - fit.outlier, basis, fit.prediction.jacobian, fit.cov)
    squares = law_cov(*about)
    fit = replace(fit, cov=with_noise_uncertain(*about))
    B = fit.setup.beams_by_all
    cov = B @ fit.cov @ B.T
    beams = _beams(log, fit, cov, squares)
    devices = tuple(_device(log, fit, prior, k, cov) for k in range(len(log.devices)))
    directions = [one for device in devices for one in device.undetermined]
    lost = [is_lost(beams[int(np.argmax(log.device == k))].cov) or _is_untold(d) for k, d in enumerate(devices)]
    surface = fit.setup.surface
    tilts = untold_tilts(log.planes, fit.cov, prior.precision) if surface is None else []
    if tilts and len(tilts) == len(log.planes):  # a tilt changes the ranges of one direction as the scale does
        directions, lost = [*directions, *tilts], [True]
    by_distances = bool(log.readings.true_distances.given.any())
    status, verdict = status_of(log.devices, directions, lost, by_distances=by_distances)
    findings: tuple[Finding, ...] = (verdict,)
    if (unreliable := _unreliable(log, fit)) is not None:
        status, findings = "insufficient", (unreliable,)
    if status == "calibrated":
        findings = (*findings, *_doubts(beams, log, fit, prior, rigged=rigged))
    return Calibration(
        status=status,
        findings=findings,
        beams=beams,
        devices=devices,
        planes=tuple(_plane(log, fit, p, robot, cov) for p in range(len(log.planes))) if surface is None else (),
        target=None if surface is None else _target(log, fit, cov),
        outliers=make_outliers(log, fit),
        log=log,
        ranges=log.ranges,
        incidences=fit.prediction.incidences,
        residuals=fit.residuals,
        sds=np.sqrt(fit.variances),
        good=fit.outlier <= 0.5,
        cov=cov,
    )


def _beams(log: PlaneLog, fit: Fit, cov: FloatArray, squares: FloatArray) -> tuple[BeamFit, ...]:
    """Return the beams, from the covariances of all beams and of the noise laws."""
    Ts, setup = fit.setup.T_hand_beams, fit.setup
    oblique = [np.tan(fit.prediction.incidences[log.of == k]).max() > _OBLIQUE for k in range(len(log.devices))]
    place_sds = np.where(np.array(oblique)[:, None] | (np.arange(3) < 2), np.sqrt(fit.law.squares), np.nan)
    return tuple(
        BeamFit(
            name=name,
            T_hand_beam=Ts[k],
            scale=float(setup.scales[setup.device[k]]),
            slant=float(setup.slants[setup.device[k]]),
            cov=cov[_of_beam(k), _of_beam(k)],
            repeats=log.repeats[setup.device[k]],
            place_sds=place_sds[setup.device[k]],
            place_cov=squares[setup.device[k]],
        )
        for k, name in enumerate(log.beams)
    )


def _device(log: PlaneLog, fit: Fit, prior: Prior, k: int, cov: FloatArray) -> DeviceFit:
    setup, name = fit.setup, log.devices[k]
    block, mine = slice(len(DEVICE) * k, len(DEVICE) * (k + 1)), setup.device == k
    values = [getattr(setup, what)[k] for what in ("offsets", "scales", "slants", "fields")]
    if mine.sum() == 1:  # offset and origin along the beam are one parameter
        beam = int(np.argmax(mine))
        found = undetermined(name, cov[_of_beam(beam), _of_beam(beam)], prior.covs[beam])
    else:
        found = undetermined_of_device(name, fit.cov[block, block], prior.device_covs[k])
    return DeviceFit(
        name=name,
        zones=int(mine.sum()),
        T_hand_device=setup.T_hand_devices[k],
        values=np.array(values),
        cov=fit.cov[block, block],
        prior=prior.device_covs[k],
        zone_offsets=setup.zone_offsets[mine],
        undetermined=found,
        advice=advice(fit, log, k) if found else "",
    )


def _is_untold(device: DeviceFit) -> bool:
    """Return whether a log determines nothing of a device."""
    names = {name for one in device.undetermined for name in one.parameters}
    calibrated_before = bool(device.prior[7, :6].any())
    return len(device.undetermined) >= _UNTOLD and "scale" in names and not calibrated_before


def _of_beam(k: int) -> slice:
    """Return the slice of a beam's parameters among those of all beams and planes."""
    return slice(len(BEAM) * k, len(BEAM) * (k + 1))


def _unreliable(log: PlaneLog, fit: Fit) -> NotPlanes | ManyOutliers | None:
    """Return why the whole result is not reliable, or None."""
    if not fit.explains:
        return NotPlanes()
    inexplicable = (fit.outlier > 0.5) & (log.ranges < _CEILING * np.asarray(log.largest)[log.of])
    if np.mean(inexplicable) > _MOST_EXCLUDED:
        return ManyOutliers(int(np.sum(inexplicable)), len(inexplicable))
    return None


def _doubts(beams: Sequence[BeamFit], log: PlaneLog, fit: Fit, prior: Prior, *, rigged: bool) -> list[Finding]:
    """Return what contradicts a successful calibration: scatter between places, and beams that are not on the rig."""
    found = list[Finding]()
    off = prior.deviation(fit.setup)
    for k, name in enumerate(log.devices):
        first = int(np.argmax(log.device == k))
        beam = beams[first]
        within = float(beam.repeats.law.sigma(float(np.median(log.ranges[log.of == k]))))
        if beam.repeats.dof and beam.place_sds[0] > _ROUGH * within:
            found.append(PlacesScatter(name, float(beam.place_sds[0] / within)))
        d = fit.setup.by_device[first, :_POSE] @ off[len(DEVICE) * k : len(DEVICE) * (k + 1)]
        C = prior.covs[first][:_POSE, :_POSE]
        p = float(chdtrc(_POSE, d @ np.linalg.solve(C, d)))
        if rigged and p < _UNLIKELY:
            found.append(OffRig(name, float(np.linalg.norm(d[:3])), float(np.linalg.norm(d[3:])), p))
    return found


def _plane(log: PlaneLog, fit: Fit, p: int, robot: RobotPreset | None, all_cov: FloatArray) -> PlaneFit:
    good = (log.plane == p) & (fit.outlier <= 0.5)
    distances = fit.residuals[good] * np.cos(fit.prediction.incidences[good])
    at = len(BEAM) * len(log.beams) + len(PLANE) * p
    T, cov = fit.setup.T_world_planes[p], all_cov[at : at + 3, at : at + 3]
    if robot is not None:
        cov = cov + robot_tilt_cov(T, robot.pos_abs_std, robot.rot_abs_std)
    rms = float(np.sqrt(np.mean(distances**2))) if good.any() else float("nan")
    return PlaneFit(log.planes[p], T, cov, rms, int(good.sum()))


def _target(log: PlaneLog, fit: Fit, all_cov: FloatArray) -> TargetFit:
    at = len(BEAM) * len(log.beams)
    good = fit.outlier <= 0.5
    rms = float(np.sqrt(np.mean(fit.residuals[good] ** 2))) if good.any() else float("nan")
    cov = all_cov[at : at + len(TARGET), at : at + len(TARGET)]
    return TargetFit(fit.setup.T_world_planes[0], cov, rms, int(good.sum()))
