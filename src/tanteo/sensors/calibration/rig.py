"""Convert a calibration to a rig."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.sensors.calibration.geometry import widened
from tanteo.sensors.calibration.result import BeamFit, Calibration, DeviceFit
from tanteo.sensors.devices import Device
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
    by_distances = bool(found.log.readings.true_distances.given.any())
    if by_distances and rig is None:
        raise InputError(
            "rig: expected the rig of the sensor, as known distances do not determine where it is, got none. Name it "
            "with --rig."
        )
    fitted = dict[str, RigSensor]()
    for k, device in enumerate(found.devices):
        mine = found.good & (found.log.of == k)
        first = found.beams[int(np.argmax(found.log.device == k))]
        slanted = abs(first.slant) * math.sqrt(np.mean(np.tan(found.incidences[mine]) ** 4))
        if device.zones == 1:
            fitted[first.name] = _sensor(first, old.get(first.name), sensor, slanted)
        else:
            fitted |= {one.name: one for one in _zones(device, first, found, old, slanted)}
    if by_distances:  # the mounting is as uncertain as before, in the pose of the beam after its offset
        fitted = {name: _mounted(one, old[name]) for name, one in fitted.items()}
    return Rig(tuple(fitted.get(name) or old[name] for name in dict.fromkeys([*old, *fitted])), "calibration")


def _mounted(one: RigSensor, old: RigSensor) -> RigSensor:
    """Return a sensor with the mounting error of its rig, which acts at the place in the rig."""
    A = SE3.adjoint(SE3.inverse(one.T_hand_unit) @ old.T_hand_unit)
    return replace(one, cov_mount=one.cov_mount + A @ old.cov_mount @ A.T)


def _zones(
    device: DeviceFit, beam: BeamFit, found: Calibration, old: Mapping[str, RigSensor], slanted: float
) -> list[RigSensor]:
    """Return all zones of a device, with its pose, offset and scale; zones without readings have its offset."""
    log = found.log
    measured = dict(zip(log.beams, np.concatenate([d.zone_offsets for d in found.devices]), strict=True))
    zones = [one for one in old.values() if one.device == device.name]
    offset, scale, _, field = device.values
    nominal = np.array([SE3.inverse(one.T_hand_unit) @ one.T_hand_sensor for one in zones])
    Ts = device.T_hand_device @ widened(nominal, np.full(len(zones), field))
    law, cov_scale = beam.repeats.law, device.cov[:6, 7]
    out = []
    for one, T in zip(zones, Ts, strict=True):
        grid = one.grid
        if grid is not None:
            rows, columns, height, width = grid
            grid = (rows, columns, height * (1 + float(field)), width * (1 + float(field)))
        out.append(
            replace(
                one,
                T_hand_sensor=T,
                T_hand_unit=device.T_hand_device,
                grid=grid,
                sd=max(math.hypot(float(law.const), beam.place_sds[0]), _LEAST_SD),
                sd_prop=math.hypot(float(law.prop), float(beam.place_sds[1]), slanted),
                bias=float(offset + measured.get(one.name, 0.0)),
                bias_sd=float(math.sqrt(device.cov[6, 6])),
                scale=float(scale),
                scale_sd=float(math.sqrt(device.cov[7, 7])),
                cov_mount=device.cov[:6, :6],
                cov_scale=cov_scale,
            )
        )
    return out


def _sensor(beam: BeamFit, old: RigSensor | None, preset: SensorPreset | None, slanted: float) -> RigSensor:
    cov_mount = np.zeros((6, 6))
    cov_mount[:5, :5] = beam.cov[:5, :5]
    cov_scale = np.zeros(6)
    cov_scale[:5] = beam.cov[:5, 5]
    law = beam.repeats.law
    preset = preset if old is None else old.preset
    known = preset.max_range if preset is not None else math.nan
    half_angle = old.beam_half_angle if old is not None else 0.0 if preset is None else preset.beam_half_angle
    response = Device(beam.name, preset, old).response
    if response in ("", "ray") and not math.isnan(beam.place_sds[2]):  # a random ray; other responses scatter little
        half_angle = 2 * float(beam.place_sds[2])
    return RigSensor(
        name=beam.name,
        T_hand_sensor=beam.T_hand_beam,
        preset=preset,
        sd=max(math.hypot(float(law.const), beam.place_sds[0]), _LEAST_SD),
        beam_half_angle=half_angle,
        max_range=known if old is None else old.max_range,
        bias_sd=0.0,
        cov_mount=cov_mount,
        axis_cosine=1.0 if old is None else old.axis_cosine,
        sd_prop=math.hypot(float(law.prop), float(beam.place_sds[1]), slanted),
        scale=beam.scale,
        scale_sd=math.sqrt(beam.cov[5, 5]),
        cov_scale=cov_scale,
    )
