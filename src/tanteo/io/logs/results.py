"""Read probe results files that Haas, FANUC and other machines write for Fusion between START and END.

``G800`` states the nominal position of a point and its normal I J K out of the material. ``G801`` with the same ``N``
states the measured centre of the stylus and its radius R (Autodesk post library, "Results file generator for probing
and inspect surface").
"""

from __future__ import annotations

import re

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.ends import EndMark
from tanteo.io.logs.log import Log, counted, unique

_LINE = re.compile(r"^[ \t]*G80[01](?!\d)", re.MULTILINE)
_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+(?:\.\d*)?|\.\d+))")
ENDS = (EndMark(r"^[ \t]*START\b", r"^[ \t]*END\b", "END"),)
"""Statements that end a file."""

_FRAME = ("G330", "G331")


def recognise(contents: Contents) -> bool:
    """Return whether a line starts with G800 or G801.

    Args:
        contents: file to test.
    """
    return _LINE.search(contents.head) is not None


def read(contents: Contents) -> Log:
    """Return the measured centres with their nominal normals.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: there is no measured point.
    """
    nominal: dict[str, dict[str, str]] = {}
    found: list[tuple[int, dict[str, str], dict[str, str]]] = []
    nominal_count = 0
    turned = False
    for k, line in enumerate(contents.lines, start=1):
        words = dict(_WORD.findall(line))
        code = "G" + words.get("G", "")
        if line.startswith(("START", "TOOLPATH")):
            nominal = {}
        elif code == "G800":
            nominal[words.get("N", "")] = words
            nominal_count += 1
        elif code == "G801":
            found.append((k, words, nominal.get(words.get("N", ""), {})))
        elif code in _FRAME:
            turned |= any(float(words.get(axis, 0)) for axis in "ABC")
    if not found:
        contents.fail(
            "measured points (G801)", f"{counted(nominal_count, 'nominal point')} (G800) and no measured one",
            "Export the results of the measurement, not the program.",
        )  # fmt: skip
    lines = [k for k, _, _ in found]
    points = contents.numbers([[w.get(a, "") for a in "XYZ"] for _, w, _ in found], lines, "G801 (X Y Z)")
    missed = nominal_count - sum(1 for _, _, at in found if at)
    notes = [f"{counted(missed, 'nominal point')} without a measured one excluded."] if missed > 0 else []
    if turned:
        notes.append("The probing planes are rotated (A, B, C of G330 or G331). The points are used as written.")
    ids = unique([w.get("N", str(k)) for k, w, _ in found])
    return Log(points=points, centres=True, radii=_radii(found), outward=_vectors(found), ids=ids, notes=tuple(notes))


def _radii(found: list[tuple[int, dict[str, str], dict[str, str]]]) -> np.ndarray | None:
    """Return the stylus radii if each measured point has a positive one; None otherwise."""
    values = np.array([float(words.get("R", 0)) for _, words, _ in found])
    return values if np.all(values > 0) else None


def _vectors(found: list[tuple[int, dict[str, str], dict[str, str]]]) -> np.ndarray | None:
    """Return the nominal normals, NaN where a point has none; None if no point has one."""
    vectors = np.array([[float(at.get(a, "nan")) for a in "IJK"] for _, _, at in found])
    vectors[np.linalg.norm(vectors, axis=1) < 0.5] = np.nan
    return None if np.isnan(vectors).all() else vectors
