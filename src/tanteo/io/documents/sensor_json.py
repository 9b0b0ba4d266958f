"""Write calibrations and rigs as JSON documents in metres and radians (``docs/formats_json.md``)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tanteo.io.documents.result_json import strict
from tanteo.words.sentences import parameter_words

if TYPE_CHECKING:
    from tanteo.sensors import Rig, RigSensor
    from tanteo.sensors.calibration import BeamFit, Calibration, DeviceFit


def calibration_document(found: Calibration) -> dict[str, Any]:
    """Return the document ``tanteo.calibration/1``: beams, noise, planes, coverage and outliers.

    Args:
        found: result of a calibration.
    """
    log = found.log
    places = [
        {
            "sensor": log.beams[log.beam[i]], "plane": log.planes[log.plane[i]], "range_m": found.ranges[i],
            "incidence_rad": found.incidences[i], "readings": log.counts[i], "residual_m": found.residuals[i],
            "sd_m": found.sds[i], "used": found.good[i],
        }
        for i in range(len(log))
    ]  # fmt: skip
    planes = [
        {
            "plane": plane.name, "frame": "world", "matrix": plane.T_world_plane,
            "covariance": {"order": "rx ry z", "frame": "plane", "matrix": plane.cov},
            "rms_m": plane.rms, "places": plane.stations,
        }
        for plane in found.planes
    ]  # fmt: skip
    outliers = [
        {
            "readings": s.ids, "sensor": s.sensor, "plane": s.plane, "reason": s.reason, "range_m": s.reading,
            "expected_m": s.expected,
        }
        for s in found.outliers
    ]  # fmt: skip
    target = found.target and {
        "frame": "world", "matrix": found.target.T_world_target, "rms_m": found.target.rms,
        "covariance": {"order": "x y z rx ry rz", "frame": "target", "matrix": found.target.cov},
        "places": found.target.stations,
    }  # fmt: skip
    return dict(strict({
        "schema": "tanteo.calibration/1", "status": found.status, "message": found.message,
        "devices": [_device(d) for d in found.devices],
        "beams": [_beam(b) for b in found.beams], "planes": planes, "target": target, "places": places,
        "outliers": outliers,
    }))  # fmt: skip


def _device(device: DeviceFit) -> dict[str, Any]:
    offset, scale, slant, field = device.values
    return {
        "device": device.name, "zones": device.zones, "frame": "hand", "matrix": device.T_hand_device,
        "offset_m": offset, "scale": scale, "slant": slant, "field_error": field,
        "covariance": {"order": "x y z rx ry rz offset scale slant field", "frame": "device", "matrix": device.cov},
        "prior_covariance": device.prior, "zone_offsets_m": device.zone_offsets,
        "undetermined": [parameter_words(one) for one in device.undetermined], "next_pose": device.advice,
    }  # fmt: skip


def _beam(beam: BeamFit) -> dict[str, Any]:
    law, (const, prop, across) = beam.repeats.law, beam.place_sds
    return {
        "sensor": beam.name, "frame": "hand", "matrix": beam.T_hand_beam, "scale": beam.scale, "slant": beam.slant,
        "covariance": {"order": "x y z rx ry scale slant", "frame": "beam", "matrix": beam.cov},
        "noise_of_repeats": {
            "const_m": float(law.const), "per_range": float(law.prop), "degrees_of_freedom": beam.repeats.dof,
            "covariance_of_squares": beam.repeats.cov,
        },
        "noise_of_places": {
            "const_m": float(const), "per_range": float(prop), "across_rad": float(across),
            "covariance_of_squares": beam.place_cov,
        },
    }  # fmt: skip


def rig_document(rig: Rig) -> dict[str, Any]:
    """Return the document ``tanteo.rig/1`` in metres and radians, with NaN for unknown values.

    Args:
        rig: rig to write.
    """
    return {"schema": "tanteo.rig/1", "frame": "hand", "sensors": [_rig_sensor(s) for s in rig.sensors]}


def _rig_sensor(sensor: RigSensor) -> dict[str, Any]:
    from tanteo.sensors import Device

    device = Device(sensor.name, sensor.preset, sensor)
    return {
        "name": sensor.name,
        "preset": None if sensor.preset is None else sensor.preset.name,
        "matrix": sensor.T_hand_sensor.tolist(),
        "noise": {name: float(getattr(device.law, name)) for name in ("const", "prop", "quad", "exp_d0", "exp_k")},
        "beam_half_angle_rad": sensor.beam_half_angle,
        "half_axes": None if sensor.half_axes is None else sensor.half_axes.tolist(),
        "range_m": [device.min_range, device.max_range],
        "axis_cosine": sensor.axis_cosine,
        "bias_m": sensor.bias,
        "bias_sd_m": device.bias_sd,
        "scale": sensor.scale,
        "covariance": {"order": "x y z rx ry rz scale", "frame": "sensor", "matrix": device.cov_unit.tolist()},
    }
