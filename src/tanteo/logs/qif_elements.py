"""Access elements of a QIF document by name and by identifier, with their numbers and units."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from tanteo.logs.contents import Contents
from tanteo.typing import FloatArray

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


class Document:
    """Parsed QIF document, with error messages that name file and line."""

    def __init__(self, contents: Contents) -> None:
        from lxml import etree

        if b"<!DOCTYPE" in contents.data or b"<!ENTITY" in contents.data:  # entities can expand exponentially
            contents.fail("a QIF document without DTD", "one with", "Remove the DOCTYPE.")
        parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
        self._contents = contents
        try:
            self.root: Any = etree.fromstring(contents.data, parser)
        except etree.XMLSyntaxError as error:
            contents.fail("well-formed XML", str(error.msg), "Export it again.")

    def fail(self, expected: str, got: str, do: str, element: Any = None) -> NoReturn:
        """Refuse the document.

        Args:
            expected: accepted content, in words.
            got: found content, in words.
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
        """Return the points of a point set.

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
