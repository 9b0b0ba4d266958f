"""A rig as a JSON document (schema ``tanteo.rig/1``)."""

from __future__ import annotations

from typing import Any

from tanteo.sensors import Device, Rig, RigSensor


def rig_document(rig: Rig) -> dict[str, Any]:
    """Where the sensors sit and their figures, in metres and radians; NaN where nothing is known."""
    return {"schema": "tanteo.rig/1", "frame": "hand", "sensors": [_sensor(s) for s in rig.sensors]}


def _sensor(sensor: RigSensor) -> dict[str, Any]:
    device = Device(sensor.name, sensor.preset, sensor)
    law = device.law
    return {
        "name": sensor.name,
        "preset": None if sensor.preset is None else sensor.preset.name,
        "matrix": sensor.T_hand_sensor.tolist(),
        "noise": {name: float(getattr(law, name)) for name in ("const", "prop", "quad", "exp_d0", "exp_k")},
        "beam_half_angle_rad": sensor.beam_half_angle,
        "range_m": [device.min_range, device.max_range],
        "axis_cosine": sensor.axis_cosine,
        "bias_m": sensor.bias,
        "bias_sd_m": device.bias_sd,
        "scale": sensor.scale,
        "covariance": {"order": "x y z rx ry rz scale", "frame": "sensor", "matrix": device.cov_unit.tolist()},
    }
