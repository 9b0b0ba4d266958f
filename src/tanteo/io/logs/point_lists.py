"""Read lists of points in JSON and XML documents, as programs of measuring devices and scripts export them.

A point is an object with ``x``, ``y`` and ``z`` (as keys, elements or attributes, in any case), three numbers in a
list, or an object whose ``measured``, ``actual``, ``point``, ``position``, ``location`` or ``coordinates`` is one.
Measured values win over nominal ones, which are excluded. ``nx ny nz`` and ``normal`` are normals of the surface,
``i j k`` and ``vector`` vectors out of the material. An object with a diameter, or a name such as ``circle`` or
``hole``, is the centre of a round feature. The unit is that of ``unit``, ``units`` or a name such as ``x_mm``.

Sources: the XML lists of SpatialAnalyzer (``POINT`` with ``NOMINAL`` and ``ACTUAL``, from its manual). The others are
common forms of JSON and XML; the tags of the GOM Inspection Exchange Format were not at hand.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log, counted
from tanteo.io.logs.qif import tag, xml_root
from tanteo.io.logs.round_features import Feature, log_of

_JSON = re.compile(r"\A\s*(?:\{\s*\"|\[\s*[\[{](?!\s*[-+.\d][-+.\deE]*[ \t]+[-+.\d]))")
_XML = re.compile(r"\A\s*<(?:\?xml\b|!DOCTYPE\b|[A-Za-z_][\w.:-]*[\s>/])")
_WEB = re.compile(r"\A\s*<(?:!doctype html|html|table)\b", re.IGNORECASE)

_MEASURED = ("measured", "actual", "meas", "act", "ist", "measurement", "measuredpoint", "actualpoint")
_NOMINAL = ("nominal", "nom", "theoretical", "theo", "soll", "reference", "expected", "target", "cad")
_PLACES = ("point", "position", "location", "coordinates", "coordinate", "coords", "coord", "xyz", "pos", "center",
           "centre", "p")  # fmt: skip
_NORMALS, _VECTORS = ("normal", "n"), ("vector", "ijk", "direction")
_NAMES = ("name", "id", "label", "nr", "no", "number", "feature", "pointname", "elementname")
_UNIT_KEYS = ("unit", "units", "lengthunit", "linearunit", "lengthunits")
_UNITS = {
    "mm": "mm", "millimeter": "mm", "millimetre": "mm", "millimeters": "mm", "millimetres": "mm", "m": "m",
    "meter": "m", "metre": "m", "meters": "m", "metres": "m", "um": "um", "micron": "um", "in": "in", "inch": "in",
    "inches": "in",
}  # fmt: skip
_CENTRES = ("circle", "hole", "bore", "kreis")
_OTHERS = ("sphere", "cylinder", "cone", "line", "plane", "slot", "ellipse")
_KEY = re.compile(r"[^a-z0-9]+")
_WITH_UNIT = re.compile(r"(.+?)[ _\[(]+(mm|um|m|in)[\])]?")


@dataclass(frozen=True, slots=True)
class _Point:
    """Point of a document: coordinates, vector and diameter as words, and where it stands."""

    path: tuple[str, ...]
    name: str
    place: list[str]
    vector: list[str]
    is_normal: bool
    diameter: str
    unit: str
    nominal: bool
    measured: bool


class _RepeatedNameError(Exception):
    """Name that an object of a document has twice."""


def recognise_json(contents: Contents) -> bool:
    """Return whether the file starts like a JSON object or a list of lists or objects.

    Args:
        contents: file to test.
    """
    return _JSON.match(contents.head) is not None


def recognise_xml(contents: Contents) -> bool:
    """Return whether the file starts like an XML document that is no web page.

    Args:
        contents: file to test.
    """
    return _XML.match(contents.head) is not None and _WEB.match(contents.head) is None


def read_json(contents: Contents) -> Log:
    """Return the points of a JSON document, or of one JSON object per line.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed, or has no list of points, or several of different form.
    """
    text = contents.text
    try:
        return _log(contents, _parsed(text), "a JSON document")
    except json.JSONDecodeError as error:
        contents.fail("well-formed JSON", f"'{error.msg}'", "Export it again.", error.lineno)
    except RecursionError:
        contents.fail("a JSON document of points", "very many brackets in each other", "Write the points as a table.")
    except _RepeatedNameError as error:
        contents.fail("each name once in an object", f"'{error}' twice"[:80], "Remove one of the values.")


def _parsed(text: str) -> Any:
    """Return a JSON document, or the list of the objects on its lines."""
    try:
        return _loaded(text)
    except json.JSONDecodeError as error:
        if not error.msg.startswith("Extra data"):
            raise
    return [_loaded(line) for line in text.splitlines() if line.strip()]


def _loaded(text: str) -> Any:
    """Return a JSON document with whole numbers as words, since Python limits the digits of integers."""
    return json.loads(text, parse_int=str, object_pairs_hook=_named_once)


def _named_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    out = dict(pairs)
    if len(out) < len(pairs):
        raise _RepeatedNameError(next(name for name, n in Counter(name for name, _ in pairs).items() if n > 1))
    return out


def read_xml(contents: Contents) -> Log:
    """Return the points of an XML document.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed, or has no list of points, or several of different form.
    """
    root = xml_root(contents)
    try:
        return _log(contents, {tag(root): _as_object(root)}, "an XML document")
    except _RepeatedNameError as error:
        contents.fail("each name once in an element", f"'{error}' twice"[:80], "Remove one of the values.")


def _as_object(element: Any) -> Any:
    """Return an element as nested objects and lists, as JSON has them: text, or attributes and children by name."""
    children: dict[str, list[Any]] = {}
    for one in element:
        children.setdefault(tag(one), []).append(_as_object(one))
    text = (element.text or "").strip()
    if not children and not element.attrib:
        return text
    out: dict[str, Any] = {str(name).rpartition("}")[2]: value for name, value in element.attrib.items()}
    if both := out.keys() & children.keys():
        raise _RepeatedNameError(min(both))
    out |= {name: some[0] if len(some) == 1 else some for name, some in children.items()}
    return out | ({"value": text} if text and "value" not in out else {})


def _log(contents: Contents, document: Any, words: str) -> Log:
    found: list[_Point] = []
    _collect(document, (), {}, found)
    all_measured = [one for one in found if one.measured] or [one for one in found if not one.nominal]
    measured = [one for one in all_measured if all(one.place)]
    if not measured:
        got = f"{words} with nominal points only" if found else f"{words} without any"
        contents.fail(
            "points with x, y and z",
            got,
            "Write the measured points as a table with x_mm,y_mm,z_mm (docs/formats_readings.md).",
        )
    forms = Counter((one.path[-1] if one.path else "", bool(one.diameter)) for one in measured)
    if len(forms) > 1:
        names = ", ".join(f"{counted(n, 'point')} in {name or 'a list'}" for (name, _), n in forms.items())
        contents.fail("one list of points", f"{words} with several ({names})", "Keep the measured one only.")
    units = {one.unit for one in measured}
    if len(units) > 1:
        contents.fail("points in one unit", ", ".join(sorted(one or "none" for one in units)), "Export them in one.")
    for k, one in enumerate(measured, start=1):
        if not all(map(_is_number, one.place)):
            contents.fail(f"three numbers of point {one.name or k}", f"'{', '.join(one.place)}'"[:80], "Correct it.")
    notes = []
    for count, kind in (
        (len(found) - len(all_measured), "nominal point"), (len(all_measured) - len(measured), "point without values"),
    ):  # fmt: skip
        if count:
            notes.append(f"{counted(count, kind)} excluded.")
    is_normal = all(one.is_normal for one in measured)
    if not is_normal and any(one.is_normal for one in measured):
        contents.fail("vectors of one kind", "normals and vectors I J K", "Keep one of them.")
    shape = "circle" if measured[0].diameter or _kind_of(measured[0].path) in _CENTRES else None
    features = [
        Feature(
            k, one.name, shape, "", _with_points(one.place), _with_points(one.vector), *_with_points([one.diameter])
        )
        for k, one in enumerate(measured, start=1)
    ]
    log = log_of(contents, features, units.pop() or None, notes)
    if not is_normal or log.outward is None or shape:
        return log
    known = np.isfinite(log.outward).all(axis=1)
    return replace(log, outward=None, normals=log.outward if known.all() else None)


def _collect(node: Any, path: tuple[str, ...], about: dict[str, str], found: list[_Point]) -> None:
    """Append the points in a node of a document; ``about`` is what the objects around it state for all of them."""
    if isinstance(node, list):
        if len(node) > 0 and all(isinstance(row, list) and len(row) >= 3 and all(map(_is_number, row)) for row in node):
            found += [_of_row(row, path, about) for row in node]
            return
        for one in node:
            _collect(one, path, about, found)
        return
    if not isinstance(node, dict):
        return
    values = {_key(name): value for name, value in node.items()}
    unit = next((_UNITS[word] for key in _UNIT_KEYS if (word := str(values.get(key, "")).lower()) in _UNITS), "")
    about = {**about, **({"unit": unit} if unit else {})}
    point = _of_object(node, values, path, about)
    if point is not None:
        found.append(point)
        return
    for name, value in node.items():
        _collect(value, (*path, _key(name)), about, found)


def _of_row(row: list[Any], path: tuple[str, ...], about: dict[str, str]) -> _Point:
    words = [str(one) for one in row]
    vector = (
        words[3:6]
        if len(row) >= 6 and abs(np.linalg.norm([float(w) for w in _with_points(words[3:6])]) - 1) < 1e-3
        else []
    )
    return _Point(path, "", words[:3], vector, False, "", about.get("unit", ""), *_side(path))


def _of_object(
    node: dict[str, Any], values: dict[str, Any], path: tuple[str, ...], about: dict[str, str]
) -> _Point | None:
    """Return the point that an object is; None if it is none."""
    nominal, measured = _side(path)
    inner: dict[str, Any] = {}
    place, unit = _three(node)
    for key in () if place else (*_MEASURED, *_NOMINAL, *_PLACES):
        if key not in values or (isinstance(values[key], list) and not all(map(_is_number, values[key]))):
            continue
        inner = values[key] if isinstance(values[key], dict) else {}
        place, unit = _three(values[key])
        if not place and inner:
            deeper = {_key(name): value for name, value in inner.items()}
            place, unit = next((three for at in _PLACES if at in deeper and (three := _three(deeper[at]))[0]), ([], ""))
        if place:
            nominal, measured = nominal or key in _NOMINAL, measured or key in _MEASURED
            break
    if not place or _kind_of(path) in _OTHERS:
        return None
    own = {_key(name): value for name, value in inner.items()}
    vector, is_normal = _vector({**values, **own})
    diameter = next((str(some["diameter"]) for some in (own, values) if _is_number(some.get("diameter"))), "")
    name = next((str(values[key]) for key in _NAMES if isinstance(values.get(key), str | int)), "")
    return _Point(path, name, place, vector, is_normal, diameter, unit or about.get("unit", ""), nominal, measured)


def _vector(values: dict[str, Any]) -> tuple[list[str], bool]:
    """Return the words of the vector of a point, and whether it is a normal of the surface."""
    for names, is_normal in ((("nx", "ny", "nz"), True), (("i", "j", "k"), False)):
        if all(_is_number(values.get(name)) for name in names):
            return [str(values[name]) for name in names], is_normal
    for keys, is_normal in ((_NORMALS, True), (_VECTORS, False)):
        for key in keys:
            if key in values and (three := _three(values[key])[0]):
                return three, is_normal
    return [], False


def _three(node: Any) -> tuple[list[str], str]:
    """Return three coordinates as words, empty for a missing value, and their unit; no words if there are no three."""
    if isinstance(node, list) and len(node) == 3 and all(map(_is_number, node)):
        return [str(one) for one in node], ""
    if isinstance(node, str):
        words = re.split(r"[\s;]+", node.strip()) if re.search(r"[\s;]", node.strip()) else node.split(",")
        return (words, "") if len(words) == 3 and all(map(_is_number, words)) else ([], "")
    if not isinstance(node, dict):
        return [], ""
    found, units = {}, set()
    for name, value in node.items():
        text = str(name).strip().lower()
        with_unit = _WITH_UNIT.fullmatch(text)
        axis, unit = (with_unit[1], with_unit[2]) if with_unit else (text, "")
        if axis in ("x", "y", "z") and not isinstance(value, dict | list):
            found[axis] = "" if value is None or value != value else str(value).strip()
            units.add(unit)
    return ([found[axis] for axis in "xyz"], units.pop()) if len(found) == 3 and len(units) == 1 else ([], "")


def _is_number(value: Any) -> bool:
    """Return whether a value is a number, or a text that is one with a point or a comma."""
    if isinstance(value, str):
        return re.fullmatch(r"\s*[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?\s*", value, re.ASCII) is not None
    return isinstance(value, int | float) and not isinstance(value, bool)


def _with_points(words: list[str]) -> list[str]:
    """Return numbers with decimal points instead of commas."""
    return [word.replace(",", ".") for word in words]


def _key(name: str) -> str:
    return _KEY.sub("", str(name).lower())


def _side(path: tuple[str, ...]) -> tuple[bool, bool]:
    """Return whether names on the path state nominal or measured values."""
    return (
        any(name.removesuffix("points").removesuffix("s") in _NOMINAL for name in path),
        any(name.removesuffix("points").removesuffix("s") in _MEASURED for name in path),
    )


def _kind_of(path: tuple[str, ...]) -> str:
    """Return the kind of feature that the innermost name states."""
    return path[-1].removesuffix("s") if path else ""
