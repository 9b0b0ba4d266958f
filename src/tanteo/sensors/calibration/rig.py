"""Convert a calibration to a rig."""

from __future__ import annotations

import math

import numpy as np

from tanteo.errors import InputError
from tanteo.sensors.calibration.result import BeamFit, Calibration
from tanteo.sensors.presets import SensorPreset
from tanteo.sensors.rig import Rig, RigSensor

_LEAST_SD = 1e-7
"""Smallest standard deviation of a calibrated sensor [m]."""


def calibrated_rig(found: Calibration, *, rig: Rig | None = None, sensor: SensorPreset | None = None) -> Rig:
    """Return the rig of a calibration, with the covariances of mounting and scale.

    The noise is that of single readings at different places, both kinds together. The standard deviation across the
    beam is stored as the half angle of an equivalent cone. The effect of a slant cannot be corrected while the
    incidence is unknown, so its mean square over the log is added to the noise. Limits are those of the rig or the
    preset.

    Args:
        found: calibration.
        rig: rig at the start of the calibration; its sensors without readings are unchanged.
        sensor: preset of sensors that the rig does not contain.

    Raises:
        InputError: the log does not determine the pose of a beam.
    """
    if found.status != "calibrated":
        raise InputError(f"found: expected a calibration that determines the beams, got this. {found.message}")
    old = {} if rig is None else {s.name: s for s in rig.sensors}
    fitted = {}
    for k, beam in enumerate(found.beams):
        mine = found.good & (found.log.beam == k)
        slanted = abs(beam.slant) * math.sqrt(np.mean(np.tan(found.incidences[mine]) ** 4))
        fitted[beam.name] = _sensor(beam, old.get(beam.name), sensor, slanted)
    return Rig(tuple(fitted.get(name) or old[name] for name in dict.fromkeys([*old, *fitted])), "calibration")


def _sensor(beam: BeamFit, old: RigSensor | None, preset: SensorPreset | None, slanted: float) -> RigSensor:
    cov_mount = np.zeros((6, 6))
    cov_mount[:5, :5] = beam.cov[:5, :5]
    cov_scale = np.zeros(6)
    cov_scale[:5] = beam.cov[:5, 5]
    law = beam.repeats.law
    preset = preset if old is None else old.preset
    known = preset.max_range if preset is not None else math.nan
    return RigSensor(
        name=beam.name,
        T_hand_sensor=beam.T_hand_beam,
        preset=preset,
        sd=max(math.hypot(float(law.const), beam.place_sds[0]), _LEAST_SD),
        beam_half_angle=2 * float(beam.place_sds[2]),
        max_range=known if old is None else old.max_range,
        bias_sd=0.0,
        cov_mount=cov_mount,
        axis_cosine=1.0 if old is None else old.axis_cosine,
        sd_prop=math.hypot(float(law.prop), float(beam.place_sds[1]), slanted),
        scale=beam.scale,
        scale_sd=math.sqrt(beam.cov[5, 5]),
        cov_scale=cov_scale,
    )
