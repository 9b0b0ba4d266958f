"""What a beam on the hand reads of a plane, and how that moves with both: the model of the calibration.

``range = (1 + scale + slant tan^2(incidence)) d``, with ``d`` the distance along the beam from its origin to the
plane. An offset of the range and a shift of the origin along the beam are one and the same; they are one number here.
``slant`` is what a cone makes of an oblique surface: negative where the nearer part of the spot counts more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.calibration.log import PlaneLog
from tanteo.lie import SE3, SO3
from tanteo.typing import FloatArray, IntArray, Transforms, Vectors

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
