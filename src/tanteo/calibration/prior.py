"""What is known of the beams before the log: from the rig and the preset, or hardly anything."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.calibration.geometry import BEAM, Setup
from tanteo.lie import SE3
from tanteo.sensors import Rig, SensorPreset
from tanteo.typing import FloatArray, Transforms

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
    """The prior of a rig where it says something, weak elsewhere.

    Args:
        beams: Names of the sensors.
        n_planes: Number of planes.
        rig: Where the sensors are and how well that is known.
        preset: Errors of sensors that the rig does not have.
        start: Where beams without a rig are expected: where the search begins.
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
