"""Collect the error figures of sensors in arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import frozen_array
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.sensors.devices import Device
from tanteo.sensors.presets import NoiseLaw, SensorPreset
from tanteo.sensors.rig import Rig


@dataclass(frozen=True, slots=True, eq=False)
class ErrorModel:
    """Error figures of ``k`` sensors as arrays without NaN.

    Attributes:
        names: names of the sensors.
        law: noise laws along the beam.
        min_range: smallest reported ranges ``(k,)`` [m].
        max_range: largest reported ranges ``(k,)`` [m]; infinite if unknown.
        max_incidence: largest incidences with an echo ``(k,)`` [rad].
        beam_half_angle: half angles of the beams ``(k,)`` [rad].
        bias: known offsets of the ranges ``(k,)`` [m].
        bias_sd: standard deviations of the remaining offsets, one draw per unit ``(k,)`` [m].
        scale: known scale errors of the ranges ``(k,)``.
        axis_cosine: cosines between beam and optical axis ``(k,)``, for devices that report the distance along the
            axis.
        T_hand_sensors: poses of the sensors on the rig ``(k, 4, 4)`` [m]; identity for presets.
        cov_unit: covariances of mounting (body error at the device) and scale error, one draw per unit ``(k, 7, 7)``.
        T_hand_units: poses of the devices that the beams are part of ``(k, 4, 4)`` [m].
        unit: index of the first sensor of the same device ``(k,)``; such sensors share the draw.
    """

    names: tuple[str, ...]
    law: NoiseLaw
    min_range: FloatArray
    max_range: FloatArray
    max_incidence: FloatArray
    beam_half_angle: FloatArray
    bias: FloatArray
    bias_sd: FloatArray
    scale: FloatArray
    axis_cosine: FloatArray
    T_hand_sensors: Transforms
    cov_unit: Covariances
    T_hand_units: Transforms
    unit: IntArray

    def __post_init__(self) -> None:
        for name in self.__slots__:
            if name not in ("names", "law", "unit"):
                object.__setattr__(self, name, frozen_array(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.names)


def error_model(source: Rig | SensorPreset | Sequence[SensorPreset]) -> ErrorModel:
    """Return the error figures that :func:`measure` uses for a rig, a preset or several presets.

    Args:
        source: rig, preset, or presets.

    Raises:
        InputError: a preset is a touch probe, which has no range (see :func:`emit_touches`).
    """
    devices = _devices(source)

    def column(name: str) -> FloatArray:
        return np.array([getattr(d, name) for d in devices], dtype=np.float64)

    mounts = [d.mount for d in devices]
    # sensors of a rig may be beams of one device; presets are devices of their own, even if they are the same
    units = [d.unit if d.mount is not None else str(k) for k, d in enumerate(devices)]
    return ErrorModel(
        names=tuple(d.name for d in devices),
        law=NoiseLaw.stack([d.law for d in devices]),
        min_range=column("min_range"),
        max_range=np.nan_to_num(column("max_range"), nan=np.inf),
        max_incidence=column("max_incidence"),
        beam_half_angle=np.nan_to_num(column("beam_half_angle")),
        bias=np.array([m.bias if m else 0.0 for m in mounts]),
        bias_sd=column("bias_sd"),
        scale=np.array([m.scale if m else 0.0 for m in mounts]),
        axis_cosine=np.array([m.axis_cosine if m else 1.0 for m in mounts]),
        T_hand_sensors=np.stack([m.T_hand_sensor if m else np.eye(4) for m in mounts]),
        cov_unit=np.stack([d.cov_unit for d in devices]),
        T_hand_units=np.stack([m.T_hand_unit if m else np.eye(4) for m in mounts]),
        unit=np.array([units.index(unit) for unit in units], dtype=np.int64),
    )


def _devices(source: Rig | SensorPreset | Sequence[SensorPreset]) -> list[Device]:
    if isinstance(source, Rig):
        return [Device(s.name, s.preset, s) for s in source.sensors]
    presets = [source] if isinstance(source, SensorPreset) else list(source)
    touching = [p.name for p in presets if p.is_contact]
    if touching or not presets:
        got = f"'{touching[0]}', which touches" if touching else "none"
        raise InputError(f"source: expected sensors that give ranges, got {got}. Use emit_touches for touches.")
    return [Device(p.name, p, None) for p in presets]
