"""Read measured circles, cylinders, spheres and cones of QIF documents as their centres and apexes.

Elements of version 3 are ``CircleFeatureMeasurement`` (``Location``, ``Normal``, ``Diameter``), ``CircularArc...``
(``Radius``), ``Cylinder...`` (``Axis`` with a point and a direction), ``Sphere...`` and ``Cone...`` (``Axis`` towards
the wide end, diameter at its point, ``HalfAngle`` or ``FullAngle``); version 2 has ``...Actual`` instead (Features.xsd
of ``QualityInformationFramework/qif-community``). ``InternalExternal`` of the definition, found through the feature's
item and its nominal, states the material side. ``combinedUncertainty`` is a standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo.logs.qif_elements import Document, child, tag
from tanteo.typing import FloatArray

_KINDS = {"Circle": "circle", "CircularArc": "circle", "Cylinder": "cylinder", "Sphere": "sphere", "Cone": "cone"}
_ENDINGS = ("FeatureMeasurement", "FeatureActual")
_SIDES = {"INTERNAL": "hole", "EXTERNAL": "boss"}
_SHARPEST = 1e-6
"""Smallest accepted half angle of a cone [rad]; the apex of a sharper one is not determined."""


@dataclass(frozen=True, slots=True, eq=False)
class RoundRow:
    """Measured point or round feature.

    Attributes:
        name: name of the feature.
        kind: ``point``, ``circle``, ``cylinder``, ``sphere`` or ``cone``.
        point: centre, any point of a cylinder's axis, or apex ``(3,)`` [file units]; NaN if not measured.
        axis: direction of the axis or normal ``(3,)``; NaN if there is none.
        size: radius [file units], or half angle of a cone [rad]; NaN if not measured.
        side: ``hole``, ``boss`` or empty.
        sd: standard deviation of the point [file units]; NaN if unknown.
    """

    name: str
    kind: str
    point: FloatArray
    axis: FloatArray
    size: float
    side: str
    sd: float


def round_kind(element: Any) -> str | None:
    """Return the kind of round feature that an element measures; None for other elements.

    Args:
        element: XML element.
    """
    name = tag(element)
    ending = next((end for end in _ENDINGS if name.endswith(end)), None)
    return None if ending is None else _KINDS.get(name.removesuffix(ending))


def round_row(document: Document, element: Any, kind: str) -> RoundRow | None:
    """Return a measured round feature; None if the feature was set instead of measured.

    Args:
        document: parsed document.
        element: element of the feature.
        kind: kind of the feature, see :func:`round_kind`.

    Raises:
        ReadingsError: a number is malformed, or the diameter is not positive.
    """
    item = document.by_id(element, "FeatureItemId")
    mode = child(item, "DeterminationMode")
    if mode is not None and child(mode, "Set") is not None:
        return None
    point, axis, sd = _placed(document, element)
    size = _radius(document, element)
    if size < 0 or (size == 0 and kind != "cone"):
        document.fail("a positive diameter", f"{2 * size:g}", "Correct it.", element)
    if kind == "cone":
        point, size = _cone(document, element, point, axis, size)
    name = child(item, "FeatureName")
    called = ((name.text if name is not None else "") or "").strip() or element.get("label") or element.get("id") or ""
    return RoundRow(called, kind, point, axis, size, _side(document, item), sd)


def _placed(document: Document, element: Any) -> tuple[FloatArray, FloatArray, float]:
    """Return the centre or a point of the axis, the axis, and the standard deviation of the point."""
    axis = child(element, "Axis")
    holder, names = (element, ("Location", "Normal")) if axis is None else (axis, ("AxisPoint", "Direction"))
    point, direction = (document.three(holder, name) for name in names)
    if np.linalg.norm(direction) < 0.5:
        direction = np.full(3, np.nan)
    place = child(holder, names[0])
    return point, direction, float("nan") if place is None else uncertainty(document, place)


def uncertainty(document: Document, place: Any) -> float:
    """Return the standard deviation of a measured point per direction from its attributes; NaN if there is none.

    Args:
        document: parsed document.
        place: element of the point.
    """
    whole = ("combinedUncertainty", "xCombinedUncertainty", "yCombinedUncertainty", "zCombinedUncertainty")
    values = [document.number(place, place.get(name), name) for name in whole if place.get(name) is not None]
    values = [value for value in (values[1:] if len(values) == 4 else values) if value > 0]
    return float(np.sqrt(np.mean(np.square(values)))) if values else float("nan")


def _radius(document: Document, element: Any) -> float:
    for name, share in (("Diameter", 0.5), ("Radius", 1.0)):
        size = child(element, name)
        if size is not None:
            return share * document.number(size, size.text, name)
    return float("nan")


def _cone(
    document: Document, element: Any, point: FloatArray, axis: FloatArray, radius: float
) -> tuple[FloatArray, float]:
    """Return apex and half angle: the apex is ``radius / tan(half angle)`` behind the axis point."""
    for name, share in (("HalfAngle", 1.0), ("FullAngle", 0.5)):
        angle = child(element, name)
        if angle is not None:
            half = share * document.angle * document.number(angle, angle.text, name)
            if not _SHARPEST < half < np.pi / 2:
                document.fail(f"a {name} of a cone", f"{(angle.text or '').strip()}", "Correct it.", angle)
            unit = axis / np.linalg.norm(axis)
            return point - np.nan_to_num(radius) / np.tan(half) * unit, half
    if radius == 0:  # at the apex
        return point, float("nan")
    return np.full(3, np.nan), float("nan")


def _side(document: Document, item: Any) -> str:
    """Return the material side of the feature's definition; empty if it is not stated."""
    nominal = document.by_id(item, "FeatureNominalId")
    definition = document.by_id(nominal, "FeatureDefinitionId")
    side = child(definition, "InternalExternal")
    return _SIDES.get(((side.text if side is not None else "") or "").strip(), "")
