"""Read QIF documents (ISO 23952): measured points with their normals, and measured round features.

Points are ``PointFeatureMeasurement`` and ``EdgePointFeatureMeasurement`` of version 3, or the ``...Actual`` elements
of version 2, with ``Location`` and ``Normal``, and the ``Points`` of ``MeasuredPointSet``. Round features are ignored
if the document has point sets, because they were fitted to those points. The unit is that of ``FileUnits``; the
standard deviation of a point is ``combinedUncertainty`` of its ``Location``.

Round features of version 3 are ``CircleFeatureMeasurement`` (``Location``, ``Normal``, ``Diameter``),
``CircularArc...`` (``Radius``), ``Cylinder...`` (``Axis`` with a point and a direction), ``Sphere...`` and ``Cone...``
(``Axis`` towards the wide end, diameter at its point, ``HalfAngle`` or ``FullAngle``); version 2 has ``...Actual``
instead (Features.xsd of ``QualityInformationFramework/qif-community``). ``InternalExternal`` of the definition, found
through the feature's item and its nominal, states the material side.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from tanteo.features.kinds import CONE
from tanteo.geometry.typing import FloatArray
from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log, counted, unique

_FACTORS = {1.0: "m", 1e-3: "mm", 1e-6: "um", 0.0254: "in"}
_NAMES = {"mm": "mm", "millimeter": "mm", "millimetre": "mm", "m": "m", "meter": "m", "inch": "in", "in": "in"}
_ANGLES = {"degree": np.pi / 180, "deg": np.pi / 180, "radian": 1.0, "rad": 1.0}


def tag(element: Any) -> str:
    """Return the name of an element without its namespace.

    Args:
        element: XML element.
    """
    return str(element.tag).rpartition("}")[2]


def child(element: Any, *path: str) -> Any:
    """Return the descendant at a path of names, taking the first child of each name; None if there is none.

    Args:
        element: XML element; None is accepted.
        path: names of the children, outermost first.
    """
    for name in path:
        if element is None:
            return None
        element = next((one for one in element if tag(one) == name), None)
    return element


def xml_root(contents: Contents) -> Any:
    """Return the root element of an XML document.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the document has a DTD, or is not well-formed.
    """
    from lxml import etree

    if b"<!DOCTYPE" in contents.data or b"<!ENTITY" in contents.data:  # entities can expand exponentially
        contents.fail("an XML document without DTD", "one with", "Remove the DOCTYPE.")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        return etree.fromstring(contents.data, parser)
    except etree.XMLSyntaxError as error:
        contents.fail("well-formed XML", str(error.msg), "Export it again.")


class Document:
    """Parsed QIF document, with error messages that name file and line."""

    def __init__(self, contents: Contents) -> None:
        self._contents = contents
        self.root: Any = xml_root(contents)

    def fail(self, expected: str, got: str, do: str, element: Any = None) -> NoReturn:
        """Refuse the document.

        Args:
            expected: accepted content, as text.
            got: found content, as text.
            do: correction to suggest, as a sentence.
            element: element with the error; None for the document as a whole.

        Raises:
            ReadingsError: always.
        """
        self._contents.fail(expected, got, do, None if element is None else element.sourceline)

    def by_id(self, element: Any, name: str) -> Any:
        """Return the element that a child refers to; None if there is none.

        Args:
            element: parent element.
            name: name of the child that contains the identifier.
        """
        reference = child(element, name)
        return None if reference is None else self._numbered.get((reference.text or "").strip())

    @cached_property
    def _numbered(self) -> dict[str, Any]:
        return {element.get("id"): element for element in self.root.iter("{*}*") if element.get("id")}

    def number(self, element: Any, text: str | None, name: str) -> float:
        """Return a finite number of an element or of one of its attributes.

        Args:
            element: element, for the unit and the line number.
            text: text of the number.
            name: name of the number, for messages.

        Raises:
            ReadingsError: the text is not a finite number, or the element has another unit than the file.
        """
        self._check_unit(element)
        return float(self._contents.numbers([[(text or "").strip()]], [element.sourceline], name)[0, 0])

    def three(self, element: Any, name: str) -> FloatArray:
        """Return three numbers of a child, or of the ``XYZ`` in it, as ``(3,)``; NaN if the child is missing.

        Args:
            element: parent element.
            name: name of the child.

        Raises:
            ReadingsError: there are not three finite numbers.
        """
        one = child(element, name)
        if one is None:
            return np.full(3, np.nan)
        self._check_unit(one)
        inner = child(one, "XYZ")
        words = ((one if inner is None else inner).text or "").split()
        if len(words) != 3:
            self.fail(f"three numbers of {name}", f"'{' '.join(words)[:40]}'", "Correct it.", one)
        return self._contents.numbers([words], [one.sourceline], name)[0]

    def _check_unit(self, element: Any) -> None:
        """Refuse a value in another unit than that of the file."""
        word = element.get("linearUnit")
        if word is not None and _NAMES.get(word.strip().lower()) != self.unit():
            self.fail("lengths in the unit of the file", f"linearUnit '{word}'", "Export it in one unit.", element)

    def block(self, element: Any) -> list[FloatArray]:
        """Return the coordinates of the points in a point set, each ``(3,)`` [file units].

        Args:
            element: element of the set.

        Raises:
            ReadingsError: the numbers are not a multiple of three.
        """
        points = child(element, "Points")
        words = [] if points is None else (points.text or "").split()
        if len(words) % 3:
            self.fail("three numbers a point", str(len(words)), "Correct Points.", points)
        rows = [words[k : k + 3] for k in range(0, len(words), 3)]
        return list(self._contents.numbers(rows, [points.sourceline] * len(rows), "Points")) if rows else []

    def unit(self) -> str | None:
        """Return the length unit of the file; None if it is not stated.

        Raises:
            ReadingsError: the unit is unknown.
        """
        linear = child(self.root, "FileUnits", "PrimaryUnits", "LinearUnit")
        if linear is None:
            return None
        factor = child(linear, "UnitConversion", "Factor")
        if factor is not None:
            value = self.number(factor, factor.text, "Factor")
            known = next((unit for metres, unit in _FACTORS.items() if abs(value - metres) < 1e-9), None)
            if known:
                return known
        word = _word(child(linear, "UnitName"))
        if word not in _NAMES:
            self.fail("LinearUnit mm, m or inch", f"'{word}'", "Export it in millimetres.")
        return _NAMES[word]

    @cached_property
    def angle(self) -> float:
        """Radians per angle unit of the file; 1 if it is not stated."""
        angular = child(self.root, "FileUnits", "PrimaryUnits", "AngularUnit")
        factor = child(angular, "UnitConversion", "Factor")
        if factor is not None:
            return self.number(factor, factor.text, "Factor")
        word = _word(child(angular, "UnitName"))
        if word and word not in _ANGLES:
            self.fail("AngularUnit degree or radian", f"'{word}'", "Export it in degrees.")
        return _ANGLES.get(word, 1.0)


def _word(element: Any) -> str:
    return ((element.text if element is not None else "") or "").strip().lower()


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
    point, size = _LANDMARKS.get(kind, _centre)(document, element, point, axis, size)
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


def _centre(
    document: Document, element: Any, point: FloatArray, axis: FloatArray, radius: float
) -> tuple[FloatArray, float]:
    """Return centre and radius of a circle, cylinder or sphere."""
    if radius <= 0:
        document.fail("a positive diameter", f"{2 * radius:g}", "Correct it.", element)
    return point, radius


def _apex(
    document: Document, element: Any, point: FloatArray, axis: FloatArray, radius: float
) -> tuple[FloatArray, float]:
    """Return apex and half angle of a cone; the apex is ``radius / tan(half angle)`` before the axis point."""
    if radius < 0:
        document.fail("a positive diameter", f"{2 * radius:g}", "Correct it.", element)
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


_LANDMARKS = {CONE.name: _apex}
"""Functions that return landmark point and size of a round feature, for kinds whose landmark is not the centre."""


def _side(document: Document, item: Any) -> str:
    """Return the material side of the feature's definition; empty if it is not stated."""
    nominal = document.by_id(item, "FeatureNominalId")
    definition = document.by_id(nominal, "FeatureDefinitionId")
    side = child(definition, "InternalExternal")
    return _SIDES.get(((side.text if side is not None else "") or "").strip(), "")


_ROOT = re.compile(r"<(?:\w+:)?QIFDocument\b")
_ENDS = ("PointFeatureMeasurement", "PointFeatureActual")
_OTHER = ("FeatureMeasurement", "FeatureActual")


def recognise(contents: Contents) -> bool:
    """Return whether the file contains the QIF root element.

    Args:
        contents: file to test.
    """
    return _ROOT.search(contents.head) is not None


def read(contents: Contents) -> Log:
    """Return the measured points and round features of all results in the document.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file has no measured points, or is malformed.
    """
    document = Document(contents)
    rows = list[RoundRow]()
    points = list[RoundRow]()
    in_sets = list[RoundRow]()
    others = 0
    for element in document.root.iter("{*}*"):
        name = tag(element)
        kind = round_kind(element)
        if name.endswith(_ENDS):
            points.append(_point(document, element))
            rows.append(points[-1])
        elif kind is not None and (row := round_row(document, element, kind)) is not None:
            rows.append(row)
        elif name.endswith(_OTHER):
            others += 1
        elif name == "MeasuredPointSet":
            in_sets += [
                RoundRow(f"{element.get('id') or 'set'}.{k}", "point", point, *_NOTHING)
                for k, point in enumerate(document.block(element), start=1)
            ]
    fitted = len(rows) - len(points) if in_sets else 0
    taken = points + in_sets if in_sets else rows
    located = [row for row in taken if np.isfinite(row.point).all()]
    if not located:
        got = f"{counted(others, 'feature')} of other kinds" if others else "none"
        contents.fail("measured points (PointFeatureMeasurement with a Location)", got, "Export the points as well.")
    return _log(document, located, _left_out(others, len(taken) - len(located), fitted))


_NOTHING = np.full(3, np.nan), float("nan"), "", float("nan")


def _point(document: Document, element: Any) -> RoundRow:
    place = child(element, "Location")
    sd = float("nan") if place is None else uncertainty(document, place)
    name = element.get("label") or element.get("id") or ""
    point = document.three(element, "Location")
    normal = document.three(element, "Normal")
    return RoundRow(name, "point", point, normal, float("nan"), "", sd)


def _left_out(others: int, nowhere: int, fitted: int) -> tuple[str, ...]:
    notes = []
    if others:
        notes.append(
            f"{counted(others, 'feature')} of other kinds than points and round ones, or not measured, excluded."
        )
    if nowhere:
        notes.append(f"{counted(nowhere, 'point')} without a measured place excluded.")
    if fitted:
        notes.append(f"{counted(fitted, 'round feature')} excluded: the points of the file are taken instead.")
    return tuple(notes)


def _log(document: Document, rows: list[RoundRow], notes: tuple[str, ...]) -> Log:
    axes, sizes, sds = (np.array([getattr(row, name) for row in rows]) for name in ("axis", "size", "sd"))
    return Log(
        points=np.array([row.point for row in rows]),
        unit=document.unit(),
        outward=None if np.isnan(axes).all() else axes,
        kinds=tuple(row.kind for row in rows),
        sizes=sizes if np.isfinite(sizes).any() else None,
        sides=tuple(row.side for row in rows),
        sds=None if np.isnan(sds).all() else sds,
        ids=unique([row.name or str(k) for k, row in enumerate(rows, start=1)]),
        notes=notes,
    )
