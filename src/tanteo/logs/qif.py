"""QIF documents (ISO 23952): measured points with their normals, and measured round features.

``PointFeatureMeasurement`` and ``EdgePointFeatureMeasurement`` of version 3, the same as ``...Actual`` of version 2,
with ``Location`` and ``Normal``, and the ``Points`` of ``MeasuredPointSet``; circles, cylinders, spheres and cones as
``qif_features`` reads them. Where there are point sets, those are not read: they were fitted to the points. The unit is
that of ``FileUnits``, the standard deviation of a point ``combinedUncertainty`` of its ``Location``.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from tanteo.logs.contents import Contents
from tanteo.logs.log import Log, counted, unique
from tanteo.logs.qif_elements import Document, child, tag
from tanteo.logs.qif_features import RoundRow, round_kind, round_row, uncertainty

_ROOT = re.compile(r"<(?:\w+:)?QIFDocument\b")
_ENDS = ("PointFeatureMeasurement", "PointFeatureActual")
_OTHER = ("FeatureMeasurement", "FeatureActual")


def recognise(contents: Contents) -> bool:
    """The root element."""
    return _ROOT.search(contents.head) is not None


def read(contents: Contents) -> Log:
    """Measured points and round features of all results in the document."""
    document = Document(contents)
    rows, points, in_sets, others = list[RoundRow](), list[RoundRow](), list[RoundRow](), 0
    for element in document.root.iter("{*}*"):
        name, kind = tag(element), round_kind(element)
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
    point, normal = document.three(element, "Location"), document.three(element, "Normal")
    return RoundRow(name, "point", point, normal, float("nan"), "", sd)


def _left_out(others: int, nowhere: int, fitted: int) -> tuple[str, ...]:
    notes = []
    if others:
        notes.append(
            f"{counted(others, 'feature')} of other kinds than points and round ones, or not measured, left out."
        )
    if nowhere:
        notes.append(f"{counted(nowhere, 'point')} without a measured place left out.")
    if fitted:
        notes.append(f"{counted(fitted, 'round feature')} left out: the points of the file are taken instead.")
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
