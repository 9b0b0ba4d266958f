"""Define the result of a calibration: beams, noise, planes and outliers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SO3, freeze
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms
from tanteo.sensors.calibration.fit import Fit
from tanteo.sensors.calibration.log import PlaneLog, Repeats
from tanteo.values import Value, lock
from tanteo.words import message_of
from tanteo.words.findings import Finding, Undetermined


@dataclass(frozen=True, slots=True, eq=False)
class BeamFit:
    """One beam: a sensor, or a zone of a multi-zone device.

    Attributes:
        name: name of the sensor.
        T_hand_beam: pose of the beam on the hand, along +z ``(4, 4)`` [m]. The origin contains the offset of the
            ranges, which is equivalent to a shift along the beam.
        scale: scale error: the sensor reports ``1 + scale`` times the range.
        slant: relative error ``slant tan^2(incidence)`` of the range on an oblique surface.
        cov: covariance of ``x y z``, rotations about x and y (body error at the beam [m, rad]), scale and slant
            ``(7, 7)``.
        repeats: repeatability at one place.
        place_sds: standard deviations between places: floor [m], per range, and across the beam per range ``(3,)``; the
            last is NaN if all places are square to the beam.
        place_cov: covariance of the squares of ``place_sds`` ``(3, 3)``.
    """

    name: str
    T_hand_beam: Transforms
    scale: float
    slant: float
    cov: Covariances
    repeats: Repeats
    place_sds: FloatArray
    place_cov: FloatArray

    def __post_init__(self) -> None:
        freeze(self, "T_hand_beam", "cov", "place_sds", "place_cov")


@dataclass(frozen=True, slots=True, eq=False)
class DeviceFit:
    """One device with its beams.

    Attributes:
        name: name of the device.
        zones: number of its beams.
        T_hand_device: pose of the device on the hand ``(4, 4)`` [m].
        values: offset [m], scale, slant, and relative error of the field of view ``(4,)``.
        cov: covariance of its pose (body error [m, rad]) and ``values`` ``(10, 10)``.
        prior: covariance before the log ``(10, 10)``.
        zone_offsets: offsets of its zones beside the device's ``(zones,)`` [m].
        undetermined: combinations of parameters that the log does not determine.
        advice: next pose of the hand that would determine most; empty if all is determined.
    """

    name: str
    zones: int
    T_hand_device: Transforms
    values: FloatArray
    cov: Covariances
    prior: Covariances
    zone_offsets: FloatArray
    undetermined: tuple[Undetermined, ...]
    advice: str

    def __post_init__(self) -> None:
        freeze(self, "T_hand_device", "values", "cov", "prior", "zone_offsets")


@dataclass(frozen=True, slots=True, eq=False)
class PlaneFit:
    """Fitted plane.

    Attributes:
        name: label of the plane.
        T_world_plane: frame on the plane with z along the normal, towards the sensors ``(4, 4)`` [m].
        cov: covariance of tilts about x and y and shift along z, including the robot's error ``(3, 3)`` [rad, m].
        rms: root mean square distance of the stations that are no outliers [m].
        stations: number of these stations.
    """

    name: str
    T_world_plane: Transforms
    cov: Covariances
    rms: float
    stations: int


@dataclass(frozen=True, slots=True, eq=False)
class TargetFit:
    """Known target after the fit.

    Attributes:
        T_world_target: pose of the target ``(4, 4)`` [m].
        cov: covariance of the body error of this pose ``(6, 6)`` [m, rad].
        rms: root mean square residual of the ranges of the stations that are no outliers [m].
        stations: number of these stations.
    """

    T_world_target: Transforms
    cov: Covariances
    rms: float
    stations: int

    def __post_init__(self) -> None:
        freeze(self, "T_world_target", "cov")


@dataclass(frozen=True, slots=True)
class Outlier:
    """Readings that contradict the calibration or their repeats.

    Attributes:
        ids: names of the readings, all at one place.
        sensor: name of their sensor.
        plane: label of their plane.
        reading: mean range [m].
        expected: range that the calibration, or the other readings at the place, predict [m].
        reason: ``saturated``, ``outlier`` or ``unlike its repeats``.
    """

    ids: tuple[str, ...]
    sensor: str
    plane: str
    reading: float
    expected: float
    reason: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Calibration(Value):
    """Result of a calibration.

    Attributes:
        status: ``calibrated``; ``insufficient`` if neither log nor rig determines the pose of a beam, if the log
            determines nothing of a device, or a quarter of the places contradict the rest.
        findings: reasons for the status, the verdict first.
        beams: calibrated beams: sensors, or zones of multi-zone devices.
        devices: devices of the beams.
        planes: fitted planes; none for a known target.
        outliers: excluded readings.
        log: stations.
        ranges: ranges of the stations ``(m,)`` [m].
        incidences: angles of incidence of the stations ``(m,)`` [rad].
        residuals: measured minus predicted ranges ``(m,)`` [m].
        sds: standard deviations of the residuals ``(m,)`` [m].
        good: mask of the stations that are no outliers ``(m,)``.
        cov: covariance of all parameters (7 for each beam, then 3 for each plane or 6 of the target), without the
            robot's absolute error.
        target: known target after the fit; None for planes.
    """

    status: str
    findings: tuple[Finding, ...]
    beams: tuple[BeamFit, ...]
    devices: tuple[DeviceFit, ...]
    planes: tuple[PlaneFit, ...]
    outliers: tuple[Outlier, ...]
    log: PlaneLog
    ranges: FloatArray
    incidences: FloatArray
    residuals: FloatArray
    sds: FloatArray
    good: BoolArray
    cov: Covariances
    target: TargetFit | None = None

    def __post_init__(self) -> None:
        freeze(self, "ranges", "incidences", "residuals", "sds", "cov")
        lock(self)

    @property
    def message(self) -> str:
        """Findings as text."""
        return message_of(self.findings)

    def number_of(self, plane: str) -> int:
        """Return the index of a plane.

        Args:
            plane: label of the plane.

        Raises:
            InputError: there is no such plane.
        """
        names = [p.name for p in self.planes]
        if plane not in names:
            raise InputError(f"plane: expected one of {', '.join(names)}, got '{plane}'. Name a label of the log.")
        return names.index(plane)


def plane_angle(a: Calibration, plane_a: str, b: Calibration, plane_b: str) -> tuple[float, float]:
    """Return the angle between two planes, from 0 to 90 degrees [rad], and its standard deviation.

    Planes of one calibration share beams and robot, so most of their errors cancel. Planes of two calibrations are
    independent, each with the robot's error of its own run.

    Args:
        a: calibration of the first plane.
        plane_a: label of the first plane.
        b: calibration of the second plane; it may be the same.
        plane_b: label of the second plane.

    Raises:
        InputError: there is no such plane.
    """
    i, j = a.number_of(plane_a), b.number_of(plane_b)
    Ra, Rb = a.planes[i].T_world_plane[:3, :3], b.planes[j].T_world_plane[:3, :3]
    cosine = float(Ra[:, 2] @ Rb[:, 2])
    # tilting about x moves the normal towards -y, about y towards +x
    ga = np.array([-Ra[:, 1] @ Rb[:, 2], Ra[:, 0] @ Rb[:, 2]])
    gb = np.array([-Rb[:, 1] @ Ra[:, 2], Rb[:, 0] @ Ra[:, 2]])
    if a is b:
        at = [7 * len(a.beams) + 3 * k for k in (i, j)]
        rows = np.r_[at[0], at[0] + 1, at[1], at[1] + 1]
        g = np.r_[ga, gb]
        variance = g @ a.cov[np.ix_(rows, rows)] @ g
    else:
        variance = ga @ a.planes[i].cov[:2, :2] @ ga + gb @ b.planes[j].cov[:2, :2] @ gb
    sine = math.sqrt(max(1 - cosine**2, 0.0))
    angle = math.atan2(sine, abs(cosine))
    # for parallel planes the angle is the length of a tilt, so its standard deviation is that of the tilt
    return angle, math.sqrt(variance) / sine if sine > 1e-6 else math.sqrt(variance + np.trace(a.planes[i].cov[:2, :2]))


def make_outliers(log: PlaneLog, fit: Fit) -> tuple[Outlier, ...]:
    """Return the stations that contradict their plane and the readings that contradict their station, with reasons.

    Args:
        log: stations.
        fit: fit of the calibration.
    """
    out = []
    ids = np.array(log.readings.ids, dtype=object)
    for s in np.flatnonzero(fit.outlier > 0.5).tolist():
        reading, expected, ceiling = log.ranges[s], fit.prediction.ranges[s], log.largest[log.of[s]]
        # a saturated device reports its largest range where a larger one is expected
        saturated = expected - ceiling > ceiling - reading
        rows = (log.station == s) & ~log.is_outlier
        reason = "saturated" if saturated else "outlier"
        out.append(_stray(log, s, tuple(ids[rows]), float(reading), float(expected), reason))
    for row in np.flatnonzero(log.is_outlier).tolist():
        s = int(log.station[row])
        here = float(log.values[row])
        out.append(_stray(log, s, (ids[row],), here, float(log.ranges[s]), "unlike its repeats"))
    return tuple(out)


def _stray(log: PlaneLog, s: int, ids: tuple[str, ...], reading: float, expected: float, reason: str) -> Outlier:
    return Outlier(ids, log.beams[log.beam[s]], log.planes[log.plane[s]], reading, expected, reason)


def robot_tilt_cov(T_world_plane: Transforms, pos_sd: float, rot_sd: float) -> FloatArray:
    """Return the covariance of a plane's tilts and shift by the robot's absolute error ``(3, 3)`` [rad, m].

    The error moves the world about its origin (``math.md`` section 6), and the plane with it.

    Args:
        T_world_plane: frame on the plane ``(4, 4)`` [m].
        pos_sd: standard deviation of the position [m].
        rot_sd: standard deviation of the rotation [rad].
    """
    R, p = T_world_plane[:3, :3], T_world_plane[:3, 3]
    J = np.zeros((3, 6))
    J[:2, 3:] = R.T[:2]
    J[2, :3] = R[:, 2]
    J[2, 3:] = R[:, 2] @ -SO3.hat(p)
    return np.asarray(J @ np.diag(np.repeat([pos_sd**2, rot_sd**2], 3)) @ J.T)
