"""Calibrate beams, noise and outliers from a log of planes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from tanteo.errors import ReadingsError
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
from tanteo.sensors.calibration.geometry import BEAM, DEVICE, PLANE, PlaneTarget, Prior, make_prior
from tanteo.sensors.calibration.initial import starts
from tanteo.sensors.calibration.log import PlaneLog, plane_log
from tanteo.sensors.calibration.noise import law_cov, place_basis, with_noise_uncertain
from tanteo.sensors.calibration.result import BeamFit, Calibration, DeviceFit, PlaneFit, make_outliers, robot_tilt_cov
from tanteo.sensors.presets import RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.sensors.readings import Readings
from tanteo.sensors.rig import Rig
from tanteo.words.findings import Finding, ManyOutliers, NotPlanes, OffRig, PlacesScatter

_FEWEST_STATIONS = 4
"""Smallest number of stations: three stations on a plane cannot determine the parameters."""

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
    target: PlaneTarget | None = None,
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
        target: known pose of the plane on which all readings are; None if unknown.

    Raises:
        ReadingsError: a reading is no range of a plane, or there are too few hand poses.
        InputError: the rig does not contain a sensor, or a preset is unknown.

    Example:
        >>> log, rig = tanteo.read_readings("readings/plane_log.csv"), tanteo.read_rig("readings/tof_rig.toml")
        >>> tanteo.calibrate(log, rig=rig).status
        'calibrated'
    """
    sensor = sensor_preset(sensor) if isinstance(sensor, str) else sensor
    robot = robot_preset(robot) if isinstance(robot, str) else robot
    if rig is not None:
        rig.numbers(readings.sensors)
    log = plane_log(readings, rig)
    if len(log) < _FEWEST_STATIONS:
        raise ReadingsError(
            f"readings: expected ranges from {_FEWEST_STATIONS} poses of the hand or more, got {len(log)}. Take some "
            "30, turned and moved."
        )
    by_rig = None
    if rig is not None:
        poses = {s.name: s.T_hand_sensor for s in rig.sensors}
        by_rig = np.stack([poses[name] for name in log.beams])
    setups = starts(log, by_rig, target)
    priors = [make_prior(log, rig, sensor, setup, target) for setup in setups]
    setups = [replace(setup, offsets=prior.expected.offsets) for setup, prior in zip(setups, priors, strict=True)]
    presets = [sensor] if rig is None else [s.preset for s in rig.sensors if s.name in log.beams]
    limits = [one.max_incidence for one in presets if one is not None]
    fit, prior = best_fit(log, setups, priors, max(limits, default=math.pi / 2))
    return _result(log, fit, prior, robot, rigged=rig is not None)


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
    tilts = untold_tilts(log.planes, fit.cov, prior.precision)
    if len(tilts) == len(log.planes):  # a tilt changes the ranges of one direction as the scale does
        directions, lost = [*directions, *tilts], [True]
    status, verdict = status_of(log.devices, directions, lost)
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
        planes=tuple(_plane(log, fit, p, robot, cov) for p in range(len(log.planes))),
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
    return tuple(
        BeamFit(
            name=name,
            T_hand_beam=Ts[k],
            scale=float(setup.scales[setup.device[k]]),
            slant=float(setup.slants[setup.device[k]]),
            cov=cov[_of_beam(k), _of_beam(k)],
            repeats=log.repeats[setup.device[k]],
            place_sds=np.sqrt(fit.law.squares[setup.device[k]]),
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
