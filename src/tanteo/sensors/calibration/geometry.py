"""Predict the ranges from beams on the hand to planes, with derivatives, and define the prior of the beams.

``range = (1 + scale + slant tan^2(incidence)) d``, with ``d`` the distance along the beam from its origin to the plane.
An offset of the range is equivalent to a shift of the origin along the beam, so they are one parameter of a beam.
``slant`` is the effect of a cone on an oblique surface: negative if the nearer part of the spot has more weight.

A device has one mounting pose, offset, scale and slant, which all its beams share. The beams of a multi-zone device
also have a common error of the field of view, and an offset each, with a prior.

All readings of a log may be on one known target instead of planes (:mod:`tanteo.sensors.calibration.targets`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.limits import LARGEST
from tanteo.geometry.typing import FloatArray, IntArray, Transforms, Vectors
from tanteo.sensors.calibration.log import PlaneLog
from tanteo.sensors.calibration.targets import TARGET, Point, Surface, Target
from tanteo.sensors.presets import SensorPreset
from tanteo.sensors.rig import Rig, RigSensor

BEAM = ("x", "y", "z", "turn x", "turn y", "scale", "slant")
"""Parameters of a beam: origin across and along (with the offset), direction, scale and slant, in its own frame."""

DEVICE = ("x", "y", "z", "turn x", "turn y", "turn z", "offset", "scale", "slant", "field")
"""Parameters of a device: its pose in its own frame, offset, scale, slant, and relative error of its field of view."""

PLANE = ("tilt x", "tilt y", "shift")
"""Parameters of a plane in its own frame, whose z is the normal."""

_POSE_ROWS = [3, 4, 2]
"""Rows of the parameters of a plane in the body error of its pose; definition of :data:`PLANE`."""

_TURNED = np.diag([1.0, -1.0, -1.0, 1.0])

_GRAZING = 0.02
"""Smallest cosine of the incidence in a prediction."""


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """Parameters of all devices, zones and planes.

    Attributes:
        T_hand_devices: poses of the devices on the hand ``(u, 4, 4)`` [m].
        offsets: offsets of the devices ``(u,)`` [m].
        scales: scale errors of the devices ``(u,)``.
        slants: slant parameters of the devices ``(u,)``.
        fields: relative errors of the fields of view ``(u,)``.
        zone_offsets: offsets of the zones beside their device's ``(k,)`` [m]; 0 for a device of one beam.
        T_device_beams: nominal poses of the beams in their device ``(k, 4, 4)`` [m].
        device: device of each beam ``(k,)``.
        T_world_planes: poses of the planes, with z towards the sensors ``(p, 4, 4)`` [m]; that of the target if there
            is one.
        surface: surface of the target; None for planes.
    """

    T_hand_devices: Transforms
    offsets: FloatArray
    scales: FloatArray
    slants: FloatArray
    fields: FloatArray
    zone_offsets: FloatArray
    T_device_beams: Transforms
    device: IntArray
    T_world_planes: Transforms
    surface: Surface | None = None

    @classmethod
    def of_beams(
        cls, T_hand_beams: Transforms, device: IntArray, T_device_beams: Transforms, planes: Transforms
    ) -> Setup:
        """Return a start: devices where their first beam is, without other errors.

        Args:
            T_hand_beams: poses of the beams on the hand ``(k, 4, 4)`` [m].
            device: device of each beam ``(k,)``.
            T_device_beams: nominal poses of the beams in their device ``(k, 4, 4)`` [m].
            planes: poses of the planes ``(p, 4, 4)`` [m].
        """
        first = np.unique(device, return_index=True)[1]
        Ts = T_hand_beams[first] @ SE3.inverse(T_device_beams[first])
        zero = np.zeros(len(first))
        return cls(Ts, zero, zero, zero, zero, np.zeros(len(device)), T_device_beams, device, planes)

    @property
    def zones(self) -> IntArray:
        """Return the beams that belong to a device of several ``(z,)``."""
        return np.flatnonzero(np.bincount(self.device)[self.device] > 1)

    @property
    def parts(self) -> tuple[int, int, int]:
        """Return the numbers of parameters of devices, zones and planes, or the target."""
        own = PLANE if self.surface is None else TARGET
        return len(DEVICE) * len(self.offsets), len(self.zones), len(own) * len(self.T_world_planes)

    @property
    def size(self) -> int:
        """Return the number of parameters: ten a device, one a zone, three a plane or six of a target."""
        return sum(self.parts)

    @property
    def T_hand_beams(self) -> Transforms:
        """Return the poses of the beams on the hand, along +z, with the offset in the origin ``(k, 4, 4)`` [m]."""
        own = np.zeros((len(self.device), 6))
        own[:, 2] = -(self.offsets[self.device] + self.zone_offsets)
        beams = widened(self.T_device_beams, self.fields[self.device])
        return np.asarray(self.T_hand_devices[self.device] @ beams @ SE3.exp(own))

    @property
    def by_device(self) -> FloatArray:
        """Return the derivatives of the parameters of the beams by those of their device ``(k, 7, 10)``."""
        k = len(self.device)
        out = np.zeros((k, len(BEAM), len(DEVICE)))
        out[:, :5, :6] = SE3.adjoint(SE3.inverse(self.T_device_beams))[:, :5]
        out[:, 2, 6] = -1.0
        out[:, 5, 7] = out[:, 6, 8] = 1.0
        turned = np.einsum("kji,kj->ki", self.T_device_beams[:, :3, :3], _from_axis(self.T_device_beams))
        out[:, 3:5, 9] = turned[:, :2]
        return out

    @property
    def beams_by_all(self) -> FloatArray:
        """Return the derivatives of the parameters of beams and planes by all ``(7 k + 3 p, size)``."""
        k, (own, zones, planes) = len(self.device), self.parts
        out = np.zeros((len(BEAM) * k + planes, self.size))
        rows = np.arange(len(BEAM) * k).reshape(k, -1)
        columns = len(DEVICE) * self.device[:, None] + np.arange(len(DEVICE))
        out[rows[:, :, None], columns[:, None, :]] = self.by_device
        out[rows[self.zones, 2], own + np.arange(zones)] = -1.0
        out[len(BEAM) * k :, own + zones :] = np.eye(planes)
        return out

    def moved(self, step: FloatArray) -> Setup:
        """Return the setup after a step.

        Args:
            step: change of all parameters ``(size,)``.
        """
        own, zones, _ = self.parts
        devices = step[:own].reshape(-1, len(DEVICE))
        tilt = np.zeros((len(self.T_world_planes), 6))
        tilt[:, _POSE_ROWS if self.surface is None else slice(None)] = step[own + zones :].reshape(len(tilt), -1)
        zone_offsets = np.array(self.zone_offsets)
        zone_offsets[self.zones] += step[own : own + zones]
        return replace(
            self,
            T_hand_devices=self.T_hand_devices @ SE3.exp(devices[:, :6]),
            offsets=self.offsets + devices[:, 6],
            scales=self.scales + devices[:, 7],
            slants=self.slants + devices[:, 8],
            fields=self.fields + devices[:, 9],
            zone_offsets=zone_offsets,
            T_world_planes=self.T_world_planes @ SE3.exp(tilt),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Prediction of a setup for every station.

    Attributes:
        ranges: ranges ``(m,)`` [m].
        incidences: angles between beam and normal ``(m,)`` [rad].
        jacobian: derivatives of the ranges by all parameters ``(m, size)``.
        points: intersections of the beams with their planes ``(m, 3)``, world frame [m].
    """

    ranges: FloatArray
    incidences: FloatArray
    jacobian: FloatArray
    points: Vectors


def _from_axis(T_device_beams: Transforms) -> Vectors:
    """Return the rotation vector from the device's axis to each beam, in the device's frame ``(k, 3)`` [rad]."""
    b = T_device_beams[:, :3, 2]
    across = np.cross([0.0, 0.0, 1.0], b)
    sine = np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(across / np.maximum(sine, 1e-12) * np.arctan2(sine, b[:, 2:]))


def widened(T_device_beams: Transforms, fields: FloatArray) -> Transforms:
    """Return the beams of devices whose field of view is wider, about the axis of the device ``(k, 4, 4)`` [m].

    Args:
        T_device_beams: nominal poses of the beams in their device ``(k, 4, 4)`` [m].
        fields: relative error of the field of view of each ``(k,)``.
    """
    R = SO3.exp(fields[:, None] * _from_axis(T_device_beams)) @ T_device_beams[:, :3, :3]
    return SE3.from_parts(R, T_device_beams[:, :3, 3])


def predict(setup: Setup, log: PlaneLog) -> Prediction:
    """Return the prediction of a setup for every station.

    Args:
        setup: beams and planes.
        log: stations.
    """
    T = log.Ts_world_hand @ setup.T_hand_beams[log.beam]
    scales, slants = setup.scales[setup.device], setup.slants[setup.device]
    R, c = T[:, :3, :3], T[:, :3, 3]
    P = setup.T_world_planes[log.plane]
    passes = np.zeros(len(c), dtype=bool)
    if setup.surface is None:
        n = P[:, :3, 2]
    else:
        into = np.swapaxes(P[:, :3, :3], 1, 2)
        origins, aims = (np.einsum("mij,mj->mi", into, v) for v in (c - P[:, :3, 3], R[:, :, 2]))
        hit, n = setup.surface.cast(origins, aims)
        n, passes = np.einsum("mij,mj->mi", P[:, :3, :3], n), ~np.isfinite(hit)
    slope = np.sum(n * R[:, :, 2], axis=1)
    slope = np.where(slope < 0, -1.0, 1.0) * np.maximum(np.abs(slope), _GRAZING)
    flat = np.sum(n * (P[:, :3, 3] - c), axis=1) / slope
    d = flat if setup.surface is None else np.where(passes, LARGEST, hit)
    points = c + d[:, None] * R[:, :, 2]
    gain = 1 + scales[log.beam] + slants[log.beam] * (1 / slope**2 - 1)
    # a slope that grows lessens tan^2 of the incidence
    dgain = -2 * slants[log.beam] / slope**3
    n_beam = np.einsum("mji,mj->mi", R, n)
    beam = np.zeros((len(d), len(BEAM)))
    beam[:, :3] = -(gain / slope)[:, None] * n_beam
    # turning about x moves the beam towards -y, about y towards +x
    for column, turned in ((3, -n_beam[:, 1]), (4, n_beam[:, 0])):
        beam[:, column] = (-gain * d / slope + d * dgain) * turned
    beam[:, 5], beam[:, 6] = d, d * (1 / slope**2 - 1)
    local = np.einsum("mji,mj->mi", P[:, :3, :3], P[:, :3, 3] - points)
    if setup.surface is None:
        plane = np.zeros((len(d), len(PLANE)))
        aim = np.einsum("mji,mj->mi", P[:, :3, :3], R[:, :, 2])
        for column, axis, sign in ((0, 1, -1.0), (1, 0, 1.0)):
            plane[:, column] = sign * (gain * local[:, axis] / slope + d * dgain * aim[:, axis])
        plane[:, 2] = gain / slope
    else:
        n_target = np.einsum("mji,mj->mi", P[:, :3, :3], n)
        plane = (gain / slope)[:, None] * np.concatenate([n_target, np.cross(-local, n_target)], axis=1)
    J = _scattered(beam, plane, setup, log)
    J[passes] = 0.0
    return Prediction(gain * d, np.arccos(np.minimum(np.abs(slope), 1.0)), J, points)


def aimed(setup: Setup, log: PlaneLog) -> tuple[FloatArray, FloatArray]:
    """Return how far the beams pass a point at which they are aimed, over the standard deviation of aiming.

    Args:
        setup: beams and target.
        log: stations.

    Returns:
        Distances along both axes across the beam ``(2 m,)``, two rows a station, and their derivatives by all
        parameters ``(2 m, size)``; no rows if the target is no point.
    """
    if not isinstance(setup.surface, Point):
        return np.zeros(0), np.zeros((0, setup.size))
    T = log.Ts_world_hand @ setup.T_hand_beams[log.beam]
    P = setup.T_world_planes[log.plane]
    y = np.einsum("mji,mj->mi", T[:, :3, :3], P[:, :3, 3] - T[:, :3, 3])
    turned = np.einsum("mji,mjk->mik", T[:, :3, :3], P[:, :3, :3])
    rows, per = [], 1 / setup.surface.aim_sd
    for axis in range(2):
        beam = np.zeros((len(y), len(BEAM)))
        beam[:, axis] = -1.0
        beam[:, 4 - axis] = (y[:, 2], -y[:, 2])[1 - axis]
        target = np.concatenate([turned[:, axis], np.zeros((len(y), 3))], axis=1)
        rows.append(per * _scattered(beam, target, setup, log))
    return per * y[:, :2].ravel(), np.stack(rows, axis=1).reshape(2 * len(y), -1)


def facing(setup: Setup, log: PlaneLog) -> Setup:
    """Return the same setup with the z axis of every plane towards its sensors.

    Args:
        setup: beams and planes.
        log: stations.
    """
    aims = (log.Ts_world_hand @ setup.T_hand_beams[log.beam])[:, :3, 2]
    if setup.surface is not None:
        return setup
    slopes = np.sum(aims * setup.T_world_planes[log.plane, :3, 2], axis=1)
    away = np.bincount(log.plane, weights=slopes, minlength=len(setup.T_world_planes)) > 0
    return replace(
        setup, T_world_planes=np.where(away[:, None, None], setup.T_world_planes @ _TURNED, setup.T_world_planes)
    )


def _scattered(beam: FloatArray, plane: FloatArray, setup: Setup, log: PlaneLog) -> FloatArray:
    """Return the Jacobian of all stations over all parameters, from the blocks of beams and planes."""
    rows, (own, zones, _) = np.arange(len(beam))[:, None], setup.parts
    J = np.zeros((len(beam), setup.size))
    columns = len(DEVICE) * setup.device[log.beam, None] + np.arange(len(DEVICE))
    J[rows, columns] = np.einsum("mb,mbd->md", beam, setup.by_device[log.beam])
    number = np.full(len(setup.device), -1)
    number[setup.zones] = np.arange(zones)
    of_zone = np.flatnonzero(number[log.beam] >= 0)
    J[of_zone, own + number[log.beam[of_zone]]] = -beam[of_zone, 2]
    width = plane.shape[1]
    J[rows, own + zones + width * log.plane[:, None] + np.arange(width)] = plane
    return J


def plane_frame(normal: Vectors, point: Vectors) -> Transforms:
    """Return a frame with its origin at a point of a plane and z along the normal.

    Args:
        normal: unit normal ``(*batch, 3)``.
        point: point of the plane ``(*batch, 3)`` [m].
    """
    return SE3.from_parts(SO3.frame_from_axis(normal, 2), point)


WEAK = {"x": 0.3, "y": 0.3, "z": 0.3, "turn x": 1.0, "turn y": 1.0, "scale": 0.02, "slant": 0.01}
"""Standard deviations of the default prior [m, rad]: the sensor is somewhere on the hand, with a scale near one."""

_PLANE_SD = 1.0
"""Standard deviation of the prior of tilts and shifts of the planes [rad, m], which are practically unknown."""

FIXED = 1e-8
"""Standard deviation of a parameter that has no effect of its own, such as the rotation of one beam about itself."""

_FIELD_SD = 0.03
"""Relative standard deviation of the field of view of a multi-zone device (assumed; ST and ams state 63 and 65 deg
diagonals for parts of one type)."""

_ZONE_SHARE = 0.3
"""Standard deviation of the offset of a zone over that of its device (assumed: no data sheet states it)."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Normal prior of the parameters.

    Attributes:
        expected: expected parameters.
        covs: covariances of the parameters of each beam ``(k, 7, 7)``.
        device_covs: covariances of the parameters of each device ``(u, 10, 10)``.
        precision: prior precision of all parameters ``(size, size)``.
        root: square root of the prior covariance, which is ``root root^T`` ``(size, size)``.
    """

    expected: Setup
    covs: FloatArray
    device_covs: FloatArray
    precision: FloatArray
    root: FloatArray

    def deviation(self, setup: Setup) -> FloatArray:
        """Return the deviation of a setup from the expected parameters ``(size,)``.

        Args:
            setup: parameters.
        """
        out, mean, (own, zones, _) = np.zeros(setup.size), self.expected, setup.parts
        devices, planes = out[:own].reshape(-1, len(DEVICE)), out[own + zones :].reshape(len(mean.T_world_planes), -1)
        devices[:, :6] = SE3.log(SE3.inverse(mean.T_hand_devices) @ setup.T_hand_devices)
        for column, name in ((6, "offsets"), (7, "scales"), (8, "slants"), (9, "fields")):
            devices[:, column] = getattr(setup, name) - getattr(mean, name)
        out[own : own + zones] = setup.zone_offsets[setup.zones]
        off = SE3.log(SE3.inverse(mean.T_world_planes) @ setup.T_world_planes)
        planes[:] = off[:, _POSE_ROWS if mean.surface is None else slice(None)]
        return out


def make_prior(
    log: PlaneLog, rig: Rig | None, preset: SensorPreset | None, start: Setup, target: Target | None = None,
    *, mounted: bool = False,
) -> Prior:  # fmt: skip
    """Return the prior of the parameters: from the rig where it states them, weak elsewhere.

    Args:
        log: stations.
        rig: nominal poses of the sensors; None if unknown.
        preset: preset of the sensors that the rig does not contain; None if unknown.
        start: start of the search, which is the mean where the rig states nothing.
        target: known target of all readings; None for unknown planes.
        mounted: whether the readings do not depend on the mounting, so that it is fixed and the offsets are unknown.
    """
    u = len(start.offsets)
    Ts, offsets, scales = np.array(start.T_hand_devices), np.zeros(u), np.zeros(u)
    covs, zone_sds = np.zeros((u, len(DEVICE), len(DEVICE))), np.zeros(len(start.device))
    known = {} if rig is None else {s.name: s for s in rig.sensors}
    for i in range(u):
        beams = np.flatnonzero(start.device == i)
        sensor = known.get(log.beams[beams[0]])
        own = preset if sensor is None else sensor.preset
        half_angle = np.nan if own is None else own.beam_half_angle
        scale_sd, bias_sd = (0.0, 0.0) if own is None else (own.bias_prop_std, own.bias_std)
        sds = np.r_[[WEAK[term] for term in BEAM[:5]], FIXED]
        cov = np.diag(sds**2)
        if sensor is not None:
            Ts[i], offsets[i], scales[i] = sensor.T_hand_unit, sensor.bias, sensor.scale
            half_angle, bias_sd = sensor.beam_half_angle, sensor.bias_sd
            scale_sd = scale_sd if np.isnan(sensor.scale_sd) else sensor.scale_sd
            covs[i, 7, :6] = covs[i, :6, 7] = sensor.cov_scale
            stated = np.diag(sensor.cov_mount) > 0
            cov[np.ix_(stated, stated)] = sensor.cov_mount[np.ix_(stated, stated)]
        several = len(beams) > 1
        if several and cov[5, 5] <= FIXED**2:
            cov[5, 5] = WEAK["turn x"] ** 2
        covs[i, :6, :6] = FIXED**2 * np.eye(6) if mounted else cov
        stands = sensor is not None and sensor.cov_mount[2, 2] > 0
        offset_sd = WEAK["z"] if mounted else bias_sd if several or stands else 0.0
        covs[i, 6, 6] = max(offset_sd, FIXED) ** 2
        if mounted:
            covs[i, 7, :6] = covs[i, :6, 7] = 0.0
        covs[i, 7, 7] = scale_sd**2 if scale_sd > 0 else WEAK["scale"] ** 2
        covs[i, 8, 8] = (half_angle**2 / 4) ** 2 if half_angle > 0 else WEAK["slant"] ** 2
        covs[i, 9, 9] = _FIELD_SD**2 if several else FIXED**2
        zone_sds[beams] = max(_ZONE_SHARE * bias_sd, FIXED)
    presets = _presets(log, known, preset)
    limit = max(np.pi / 2 if one is None else one.max_incidence for one in presets)
    if target is not None:
        planes = start.T_world_planes
        plane_sds = np.sqrt(np.diag(target.cov))
    else:  # a device answers up to an incidence, so that planes face its beams
        planes = facing_planes(log, Ts[start.device] @ start.T_device_beams)
        plane_sds = np.array([0.5 * limit, 0.5 * limit, _PLANE_SD])
    expected = replace(
        start, T_hand_devices=Ts, offsets=offsets, scales=scales, slants=np.zeros(u), fields=np.zeros(u),
        zone_offsets=np.zeros(len(start.device)), T_world_planes=planes,
    )  # fmt: skip
    first, zones, _ = start.parts
    precision = np.eye(start.size) / _PLANE_SD**2
    for i in range(u):
        block = slice(len(DEVICE) * i, len(DEVICE) * (i + 1))
        precision[block, block] = np.linalg.inv(covs[i])
    precision[first : first + zones, first : first + zones] = np.diag(1 / zone_sds[start.zones] ** 2)
    precision[first + zones :, first + zones :] = np.diag(
        1 / np.maximum(np.tile(plane_sds, len(log.planes)), FIXED) ** 2
    )
    root = np.linalg.inv(np.linalg.cholesky(precision)).T
    B = expected.by_device
    own_covs = B @ covs[start.device] @ np.swapaxes(B, 1, 2)
    own_covs[start.zones, 2, 2] += zone_sds[start.zones] ** 2
    return Prior(expected, own_covs, covs, precision, root)


def _presets(log: PlaneLog, known: Mapping[str, RigSensor], preset: SensorPreset | None) -> list[SensorPreset | None]:
    """Return the preset of each beam."""
    return [known[name].preset if name in known else preset for name in log.beams]


def facing_planes(log: PlaneLog, T_hand_beams: Transforms) -> Transforms:
    """Return planes through the middle of the measured points, perpendicular to the mean beam.

    Args:
        log: stations.
        T_hand_beams: poses of the beams on the hand ``(k, 4, 4)`` [m].
    """
    T = log.Ts_world_hand @ T_hand_beams[log.beam]
    points = T[:, :3, 3] + log.ranges[:, None] * T[:, :3, 2]
    mine = [log.plane == p for p in range(len(log.planes))]
    aims = [T[rows, :3, 2].mean(axis=0) for rows in mine]
    return np.stack(
        [plane_frame(-a / np.linalg.norm(a), points[rows].mean(axis=0)) for a, rows in zip(aims, mine, strict=True)]
    )
