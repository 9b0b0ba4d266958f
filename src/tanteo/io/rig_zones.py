"""Multi-zone sensors in rig files: one table that stands for many beams of one device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.lie import SE3, SO3
from tanteo.sensors import RigSensor
from tanteo.typing import FloatArray

_MOST = 4096


def zones_of(device: RigSensor, values: Mapping[str, Any], place: str) -> tuple[RigSensor, ...]:
    """The beams of a multi-zone device: ``NAME.row.column`` from 1, rows along its y, columns along its x.

    The zones share the device's bias, scale and mounting. Their directions are even in angle over the field; a device
    that reports the distance along its optical axis (``range_kind`` perpendicular) does so in every zone.

    Args:
        device: The whole device, its optical axis along +z.
        values: ``zones`` (rows, columns) and ``field`` (height, width [rad], or one for both) of its table.
        place: File and sensor, for messages.

    Raises:
        InputError: Zones or field that cannot be, or keys that zones leave no room for.
    """
    rows, columns, height, width = _grid(values, place)
    if "axis" in values or "unit" in values or "quaternion_wxyz" not in values:
        raise InputError(
            f"{place}: expected quaternion_wxyz beside zones (which way are the rows?), and neither axis nor unit, "
            "which zones imply. Correct the keys."
        )
    perpendicular = device.preset is not None and device.preset.range_kind == "perpendicular"
    out = []
    for r, c in np.ndindex(rows, columns):
        across = np.tan([width * ((c + 0.5) / columns - 0.5), height * ((r + 0.5) / rows - 0.5)])
        turned = SO3.frame_from_axis(np.append(across, 1.0), 2)
        out.append(
            replace(
                device,
                name=f"{device.name}.{r + 1}.{c + 1}",
                T_hand_sensor=device.T_hand_sensor @ SE3.from_parts(turned, np.zeros(3)),
                axis_cosine=float(turned[2, 2]) if perpendicular else 1.0,
                unit=device.name,
                T_hand_unit=device.T_hand_sensor,
            )
        )
    return tuple(out)


def _grid(values: Mapping[str, Any], place: str) -> tuple[int, int, float, float]:
    counts, field = _numbers(values.get("zones")), _numbers(values.get("field"))
    whole = counts.shape == (2,) and (counts == np.round(counts)).all() and (counts >= 1).all()
    if not whole or counts.prod() > _MOST:
        raise InputError(f"{place}, zones: expected [rows, columns], got {values.get('zones')}. Write zones = [8, 8].")
    if field.shape not in ((), (1,), (2,)) or not ((field > 0) & (field < np.pi)).all():
        raise InputError(
            f"{place}, field: expected field_deg = [height, width] below 180, got {np.degrees(field).tolist()} "
            "degrees. Write field_deg = 45, or both."
        )
    height, width = np.broadcast_to(field, (2,)).tolist()
    return int(counts[0]), int(counts[1]), height, width


def _numbers(value: Any) -> FloatArray:
    """Numbers as they are, NaN for anything else."""
    try:
        return np.asarray(np.nan if value is None else value, dtype=np.float64)
    except (TypeError, ValueError):
        return np.asarray(np.nan)
