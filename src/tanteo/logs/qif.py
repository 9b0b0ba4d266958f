"""QIF documents (ISO 23952): measured points with their normals.

``PointFeatureMeasurement`` and ``EdgePointFeatureMeasurement`` of version 3, the same as ``...Actual`` of version 2,
with ``Location`` and ``Normal``, and the ``Points`` of ``MeasuredPointSet``. The unit is that of ``FileUnits``.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from tanteo.logs.contents import Contents
from tanteo.logs.log import Log, counted, unique

_ROOT = re.compile(r"<(?:\w+:)?QIFDocument\b")
_ENDS = ("PointFeatureMeasurement", "PointFeatureActual")
_OTHER = ("FeatureMeasurement", "FeatureActual")
_FACTORS = {1.0: "m", 1e-3: "mm", 1e-6: "um", 0.0254: "in"}
_NAMES = {"mm": "mm", "millimeter": "mm", "millimetre": "mm", "m": "m", "meter": "m", "inch": "in", "in": "in"}


def recognise(contents: Contents) -> bool:
    """The root element."""
    return _ROOT.search(contents.head) is not None


def read(contents: Contents) -> Log:
    """Measured points of all results in the document."""
    root = _parsed(contents)
    points, normals, others = list[np.ndarray](), list[np.ndarray](), 0
    names: list[str] = []
    for element in root.iter("{*}*"):
        tag = _tag(element)
        if tag.endswith(_ENDS):
            points.append(_three(contents, element, "Location"))
            normals.append(_three(contents, element, "Normal"))
            names.append(element.get("label") or element.get("id") or str(len(names) + 1))
        elif tag.endswith(_OTHER):
            others += 1
        elif tag == "MeasuredPointSet":
            block = _block(contents, element)
            points += block
            normals += [np.full(3, np.nan)] * len(block)
            names += [f"{element.get('id') or 'set'}.{k}" for k in range(1, len(block) + 1)]
    located = [k for k, point in enumerate(points) if np.isfinite(point).all()]
    if not located:
        got = f"{counted(others, 'feature')} of other kinds" if others else "none"
        contents.fail("measured points (PointFeatureMeasurement with a Location)", got, "Export the points as well.")
    notes = [f"{counted(others, 'feature')} of other kinds than points left out."] if others else []
    if len(located) < len(points):
        notes.append(f"{counted(len(points) - len(located), 'point')} without a measured place left out.")
    vectors = np.array(normals)[located]
    return Log(
        points=np.array(points)[located],
        unit=_unit(contents, root),
        outward=None if np.isnan(vectors).all() else vectors,
        ids=unique([names[k] for k in located]),
        notes=tuple(notes),
    )


def _parsed(contents: Contents) -> Any:
    """The document; entities, which can make a small file large, are refused."""
    from lxml import etree

    if b"<!DOCTYPE" in contents.data or b"<!ENTITY" in contents.data:
        contents.fail("a QIF document without DTD", "one with", "Remove the DOCTYPE.")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        return etree.fromstring(contents.data, parser)
    except etree.XMLSyntaxError as error:
        contents.fail("well-formed XML", str(error.msg), "Export it again.")


def _tag(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]


def _child(element: Any, *path: str) -> Any:
    for name in path:
        element = next((child for child in element if _tag(child) == name), None)
        if element is None:
            return None
    return element


def _three(contents: Contents, element: Any, name: str) -> np.ndarray:
    """Three numbers of a child, or of the XYZ in it; NaN without one."""
    child = _child(element, name)
    if child is None:
        return np.full(3, np.nan)
    inner = _child(child, "XYZ")
    words = ((child if inner is None else inner).text or "").split()
    if len(words) != 3:
        contents.fail(f"three numbers of {name}", f"'{' '.join(words)[:40]}'", "Correct it.", child.sourceline)
    return contents.numbers([words], [child.sourceline], name)[0]


def _block(contents: Contents, element: Any) -> list[np.ndarray]:
    child = _child(element, "Points")
    words = [] if child is None else (child.text or "").split()
    if not words:
        return []
    if len(words) % 3:
        contents.fail("three numbers a point", str(len(words)), "Correct Points.", child.sourceline)
    rows = [words[k : k + 3] for k in range(0, len(words), 3)]
    return list(contents.numbers(rows, [child.sourceline] * len(rows), "Points"))


def _unit(contents: Contents, root: Any) -> str | None:
    """The length unit of the file, if it says one that is known."""
    linear = _child(root, "FileUnits", "PrimaryUnits", "LinearUnit")
    if linear is None:
        return None
    factor = _child(linear, "UnitConversion", "Factor")
    name = _child(linear, "UnitName")
    if factor is not None:
        value = float(contents.numbers([[(factor.text or "").strip()]], [factor.sourceline], "Factor")[0, 0])
        known = next((unit for metres, unit in _FACTORS.items() if abs(value - metres) < 1e-9), None)
        if known:
            return known
    word = ((name.text if name is not None else "") or "").strip().lower()
    if word not in _NAMES:
        contents.fail("LinearUnit mm, m or inch", f"'{word}'", "Export it in millimetres.")
    return _NAMES[word]
