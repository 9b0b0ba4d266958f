"""Predict the ranges from beams on the hand to planes, with derivatives, and define the prior of the beams.

``range = (1 + scale + slant tan^2(incidence)) d``, with ``d`` the distance along the beam from its origin to the plane.
An offset of the range is equivalent to a shift of the origin along the beam, so they are one parameter. ``slant`` is
the effect of a cone on an oblique surface: negative if the nearer part of the spot has more weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, IntArray, Transforms, Vectors
from tanteo.sensors.calibration.log import PlaneLog
from tanteo.sensors.presets import SensorPreset
from tanteo.sensors.rig import Rig

BEAM = ("x", "y", "z", "turn x", "turn y", "scale", "slant")
"""Parameters of a beam: origin across and along (with the offset), direction, scale and slant, in its own frame."""

PLANE = ("tilt x", "tilt y", "shift")
"""Parameters of a plane in its own frame, whose z is the normal."""

_TURNED = np.diag([1.0, -1.0, -1.0, 1.0])

_GRAZING = 0.02
"""Smallest cosine of the incidence in a prediction."""


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """Parameters of all beams and planes.

    Attributes:
        T_hand_beams: poses of the beams on the hand, along +z ``(k, 4, 4)`` [m].
        scales: scale errors of the beams ``(k,)``.
        slants: slant parameters of the beams ``(k,)``.
        T_world_planes: poses of the planes, with z towards the sensors ``(p, 4, 4)`` [m].
    """

    T_hand_beams: Transforms
    scales: FloatArray
    slants: FloatArray
    T_world_planes: Transforms

    @property
    def size(self) -> int:
        """Number of parameters: seven a beam, then three a plane."""
        return len(BEAM) * len(self.scales) + len(PLANE) * len(self.T_world_planes)

    def moved(self, step: FloatArray) -> Setup:
        """Return the setup after a step.

        Args:
            step: change of all parameters ``(size,)``.
        """
        k = len(self.scales)
        beams, planes = step[: len(BEAM) * k].reshape(k, -1), step[len(BEAM) * k :].reshape(-1, len(PLANE))
        twist = np.zeros((k, 6))
        twist[:, :5] = beams[:, :5]
        tilt = np.zeros((len(planes), 6))
        tilt[:, 3:5], tilt[:, 2] = planes[:, :2], planes[:, 2]
        return replace(
            self,
            T_hand_beams=self.T_hand_beams @ SE3.exp(twist),
            scales=self.scales + beams[:, 5],
            slants=self.slants + beams[:, 6],
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


def predict(setup: Setup, log: PlaneLog) -> Prediction:
    """Return the prediction of a setup for every station.

    Args:
        setup: beams and planes.
        log: stations.
    """
    T = log.Ts_world_hand @ setup.T_hand_beams[log.beam]
    R, c = T[:, :3, :3], T[:, :3, 3]
    P = setup.T_world_planes[log.plane]
    n = P[:, :3, 2]
    slope = np.sum(n * R[:, :, 2], axis=1)
    slope = np.where(slope < 0, -1.0, 1.0) * np.maximum(np.abs(slope), _GRAZING)
    d = np.sum(n * (P[:, :3, 3] - c), axis=1) / slope
    points = c + d[:, None] * R[:, :, 2]
    gain = 1 + setup.scales[log.beam] + setup.slants[log.beam] * (1 / slope**2 - 1)
    # a slope that grows lessens tan^2 of the incidence
    dgain = -2 * setup.slants[log.beam] / slope**3
    n_beam = np.einsum("mji,mj->mi", R, n)
    beam = np.zeros((len(d), len(BEAM)))
    beam[:, :3] = -(gain / slope)[:, None] * n_beam
    # turning about x moves the beam towards -y, about y towards +x
    for column, turned in ((3, -n_beam[:, 1]), (4, n_beam[:, 0])):
        beam[:, column] = (-gain * d / slope + d * dgain) * turned
    beam[:, 5], beam[:, 6] = d, d * (1 / slope**2 - 1)
    plane = np.zeros((len(d), len(PLANE)))
    local = np.einsum("mji,mj->mi", P[:, :3, :3], P[:, :3, 3] - points)
    aim = np.einsum("mji,mj->mi", P[:, :3, :3], R[:, :, 2])
    for column, axis, sign in ((0, 1, -1.0), (1, 0, 1.0)):
        plane[:, column] = sign * (gain * local[:, axis] / slope + d * dgain * aim[:, axis])
    plane[:, 2] = gain / slope
    J = _scattered(beam, log.beam, len(setup.scales), plane, log.plane, len(setup.T_world_planes))
    return Prediction(gain * d, np.arccos(np.minimum(np.abs(slope), 1.0)), J, points)


def facing(setup: Setup, log: PlaneLog) -> Setup:
    """Return the same setup with the z axis of every plane towards its sensors.

    Args:
        setup: beams and planes.
        log: stations.
    """
    aims = (log.Ts_world_hand @ setup.T_hand_beams[log.beam])[:, :3, 2]
    slopes = np.sum(aims * setup.T_world_planes[log.plane, :3, 2], axis=1)
    away = np.bincount(log.plane, weights=slopes, minlength=len(setup.T_world_planes)) > 0
    return replace(
        setup, T_world_planes=np.where(away[:, None, None], setup.T_world_planes @ _TURNED, setup.T_world_planes)
    )


def _scattered(beam: FloatArray, beams: IntArray, k: int, plane: FloatArray, planes: IntArray, p: int) -> FloatArray:
    """Return the Jacobian of all stations over all parameters, from the blocks of beams and planes."""
    rows = np.arange(len(beam))[:, None]
    J = np.zeros((len(beam), len(BEAM) * k + len(PLANE) * p))
    J[rows, len(BEAM) * beams[:, None] + np.arange(len(BEAM))] = beam
    J[rows, len(BEAM) * k + len(PLANE) * planes[:, None] + np.arange(len(PLANE))] = plane
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


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Normal prior of the parameters.

    Attributes:
        T_hand_beams: expected poses of the beams ``(k, 4, 4)`` [m].
        scales: expected scale errors ``(k,)``.
        covs: covariances of the parameters of each beam ``(k, 7, 7)``.
        precision: prior precision of all parameters ``(size, size)``.
        root: square root of the prior covariance, which is ``root root^T`` ``(size, size)``.
    """

    T_hand_beams: Transforms
    scales: FloatArray
    covs: FloatArray
    precision: FloatArray
    root: FloatArray

    def deviation(self, setup: Setup) -> FloatArray:
        """Return the deviation of a setup from the expected parameters ``(size,)``; zero for planes.

        Args:
            setup: beams and planes.
        """
        out = np.zeros(setup.size)
        beams = out[: len(BEAM) * len(self.scales)].reshape(len(self.scales), -1)
        beams[:, :5] = SE3.log(SE3.inverse(self.T_hand_beams) @ setup.T_hand_beams)[:, :5]
        beams[:, 5] = setup.scales - self.scales
        beams[:, 6] = setup.slants
        return out


def make_prior(
    beams: tuple[str, ...], n_planes: int, rig: Rig | None, preset: SensorPreset | None, start: Setup
) -> Prior:
    """Return the prior of the parameters: from the rig where it states them, weak elsewhere.

    Args:
        beams: names of the sensors.
        n_planes: number of planes.
        rig: nominal poses of the sensors; None if unknown.
        preset: preset of the sensors that the rig does not contain; None if unknown.
        start: start of the search, which is the mean where the rig states nothing.
    """
    k = len(beams)
    Ts, scales, covs = np.array(start.T_hand_beams), np.zeros(k), np.zeros((k, 7, 7))
    known = {} if rig is None else {s.name: s for s in rig.sensors}
    for i, name in enumerate(beams):
        sensor = known.get(name)
        own = preset if sensor is None else sensor.preset
        sds = np.array([WEAK[term] for term in BEAM])
        half_angle = np.nan if own is None else own.beam_half_angle
        scale_sd, bias_sd = (0.0, 0.0) if own is None else (own.bias_prop_std, own.bias_std)
        cov = np.diag(sds**2)
        if sensor is not None:
            Ts[i] = sensor.T_hand_sensor @ SE3.exp(np.array([0, 0, -sensor.bias, 0, 0, 0.0]))
            half_angle, bias_sd, scales[i] = sensor.beam_half_angle, sensor.bias_sd, sensor.scale
            scale_sd = scale_sd if np.isnan(sensor.scale_sd) else sensor.scale_sd
            stated = np.diag(sensor.cov_mount)[:5] > 0
            cov[:5, :5][np.ix_(stated, stated)] = sensor.cov_mount[:5, :5][np.ix_(stated, stated)]
            cov[2, 2] += bias_sd**2 if stated[2] else 0.0
        cov[5, 5] = scale_sd**2 if scale_sd > 0 else cov[5, 5]
        cov[6, 6] = (half_angle**2 / 4) ** 2 if half_angle > 0 else cov[6, 6]
        covs[i] = cov
    precision = np.eye(7 * k + 3 * n_planes) / _PLANE_SD**2
    for i in range(k):
        precision[7 * i : 7 * i + 7, 7 * i : 7 * i + 7] = np.linalg.inv(covs[i])
    root = np.linalg.inv(np.linalg.cholesky(precision)).T
    return Prior(Ts, scales, covs, precision, root)
