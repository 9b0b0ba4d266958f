"""Build the log of measured points and round features, as reports of coordinate measuring machines list them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log, unique

_LONGEST, _SLACK = 1.5, 1e-3
"""Numerical: length above which three numbers are no direction but may be its angles [deg], and the largest deviation
of the length of their cosines from one."""


@dataclass(frozen=True, slots=True)
class Feature:
    """Measured feature with its values as words.

    Attributes:
        line: line of its values.
        name: name of the feature.
        shape: kind of reading as in :class:`Log`; None for a point of a surface.
        side: ``hole``, ``boss`` or empty if unknown.
        place: three coordinates.
        vector: vector I, J, K; empty if there is none.
        diameter: diameter of a round feature; empty if unknown.
    """

    line: int
    name: str
    shape: str | None
    side: str
    place: list[str]
    vector: list[str]
    diameter: str = ""


def log_of(contents: Contents, features: list[Feature], unit: str | None, notes: list[str], scale: float = 1.0) -> Log:
    """Return the log of measured features.

    Args:
        contents: file, for messages.
        features: features in order, at least one.
        unit: length unit of the file; None if it states none.
        notes: notes collected so far.
        scale: number of units of a length of 1 in the file.

    Raises:
        ReadingsError: a value is not a number, or a diameter is not positive.
    """
    lines = [one.line for one in features]
    points = contents.numbers([(one.place + [""] * 3)[:3] for one in features], lines, "a point") * scale
    vectors = None
    if all(len(one.vector) == 3 for one in features):
        vectors = contents.numbers([one.vector for one in features], lines, "a normal")
        cosines = np.cos(np.radians(vectors))
        angles = (np.linalg.norm(vectors, axis=1) > _LONGEST) & (np.abs(np.linalg.norm(cosines, axis=1) - 1) < _SLACK)
        vectors = np.where(angles[:, None], cosines, vectors)  # direction angles, as GEOPAK of Mitutoyo writes them
        vectors[np.linalg.norm(vectors, axis=1) < 0.5] = np.nan
        vectors = None if np.isnan(vectors).all() else vectors
    ids = unique([one.name or str(one.line) for one in features])
    if not any(one.shape for one in features):
        return Log(points=points, unit=unit, outward=vectors, ids=ids, notes=tuple(notes))
    known = np.array([bool(one.diameter) for one in features])
    sizes = contents.numbers([[one.diameter or "1"] for one in features], lines, "a diameter")[:, 0] * scale
    if not np.all(sizes > 0):
        contents.fail("a positive diameter", f"{sizes.min():g}", "Correct it.", lines[int(np.argmin(sizes))])
    return Log(
        points=points, unit=unit, outward=vectors, kinds=tuple(one.shape or "point" for one in features),
        sizes=np.where(known, sizes / 2, np.nan), sides=tuple(one.side for one in features), ids=ids,
        notes=tuple(notes),
    )  # fmt: skip
