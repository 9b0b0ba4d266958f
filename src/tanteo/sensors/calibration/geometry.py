"""What a beam on the hand reads of a plane, how that moves with both, and what is known of the beams beforehand.

``range = (1 + scale + slant tan^2(incidence)) d``, with ``d`` the distance along the beam from its origin to the
plane. An offset of the range and a shift of the origin along the beam are one and the same; they are one number here.
``slant`` is what a cone makes of an oblique surface: negative where the nearer part of the spot counts more.
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
"""Least cosine of the incidence: beyond it a beam hardly meets the plane."""


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """Where beams and planes are.

    Attributes:
        T_hand_beams: Beams along +z, ``(k, 4, 4)``.
        scales: ``(k,)``.
        slants: ``(k,)``.
        T_world_planes: Planes with z towards the sensors, ``(p, 4, 4)``.
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
        """The setup after a step in all parameters."""
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
    """What a setup predicts for every station.

    Attributes:
        ranges: [m], ``(m,)``.
        incidences: Angle between beam and normal [rad], ``(m,)``.
        jacobian: Of the ranges over all parameters, ``(m, size)``.
        points: Where the beams meet their planes, world [m], ``(m, 3)``.
    """

    ranges: FloatArray
    incidences: FloatArray
    jacobian: FloatArray
    points: Vectors


def predict(setup: Setup, log: PlaneLog) -> Prediction:
    """Ranges, incidences and the Jacobian over the parameters, at every station."""
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
    """The same setup with every plane's z towards the sensors that looked at it."""
    aims = (log.Ts_world_hand @ setup.T_hand_beams[log.beam])[:, :3, 2]
    slopes = np.sum(aims * setup.T_world_planes[log.plane, :3, 2], axis=1)
    away = np.bincount(log.plane, weights=slopes, minlength=len(setup.T_world_planes)) > 0
    return replace(
        setup, T_world_planes=np.where(away[:, None, None], setup.T_world_planes @ _TURNED, setup.T_world_planes)
    )


def _scattered(beam: FloatArray, beams: IntArray, k: int, plane: FloatArray, planes: IntArray, p: int) -> FloatArray:
    """The Jacobian of every station put at the columns of its beam and of its plane."""
    rows = np.arange(len(beam))[:, None]
    J = np.zeros((len(beam), len(BEAM) * k + len(PLANE) * p))
    J[rows, len(BEAM) * beams[:, None] + np.arange(len(BEAM))] = beam
    J[rows, len(BEAM) * k + len(PLANE) * planes[:, None] + np.arange(len(PLANE))] = plane
    return J


def plane_frame(normal: Vectors, point: Vectors) -> Transforms:
    """A frame with its origin at a point of the plane and z along the normal."""
    return SE3.from_parts(SO3.frame_from_axis(normal, 2), point)


WEAK = {"x": 0.3, "y": 0.3, "z": 0.3, "turn x": 1.0, "turn y": 1.0, "scale": 0.02, "slant": 0.01}
"""Standard deviations [m, rad] where nobody said anything: a sensor is on the hand, and its scale is not far off."""

_PLANE_SD = 1.0
"""Of tilts and shifts of the planes around where the search begins [rad, m]: they are not known at all."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """A normal prior on the parameters of the beams.

    Attributes:
        T_hand_beams: Where the beams are expected, ``(k, 4, 4)``.
        scales: Scale errors that are expected, ``(k,)``.
        covs: Of the parameters of every beam, ``(k, 7, 7)``.
        precision: Of all parameters of the setup.
        root: A square root of its inverse: ``root root^T`` is the prior covariance.
    """

    T_hand_beams: Transforms
    scales: FloatArray
    covs: FloatArray
    precision: FloatArray
    root: FloatArray

    def deviation(self, setup: Setup) -> FloatArray:
        """Of a setup from what is expected, over all its parameters; planes are not judged."""
        out = np.zeros(setup.size)
        beams = out[: len(BEAM) * len(self.scales)].reshape(len(self.scales), -1)
        beams[:, :5] = SE3.log(SE3.inverse(self.T_hand_beams) @ setup.T_hand_beams)[:, :5]
        beams[:, 5] = setup.scales - self.scales
        beams[:, 6] = setup.slants
        return out


def make_prior(
    beams: tuple[str, ...], n_planes: int, rig: Rig | None, preset: SensorPreset | None, start: Setup
) -> Prior:
    """The prior of a rig where it says something, weak elsewhere, about where the search begins."""
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
