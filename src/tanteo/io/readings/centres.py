"""Identify table rows that state the centre of a circle, cylinder, sphere or cone, not a contact on its wall."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.geometry.typing import BoolArray, Vectors
from tanteo.sensors import reading_kind
from tanteo.sensors.kinds import SIZES, ReadingKind, centre_notes

_AXIS_SD = np.radians(1.0)
"""Standard deviation assumed for an axis without a stated one [rad]."""


def find_centres(
    columns: dict[str, Any], n: int, outward: Vectors | None, source: str, notes: list[str]
) -> tuple[BoolArray, Vectors | None]:
    """Convert rows that state the centre of a round feature to the kind of that centre, and add notes about them.

    Such a row has kind circle, cylinder, sphere or cone, and is the only one with its label or states the radius or the
    material side of the hole or boss. Several rows with one label are contacts on its wall.

    Args:
        columns: columns of :meth:`Readings.from_columns`, in SI units; None where the file has no such column. The
            kinds and normals are replaced.
        n: number of rows.
        outward: vectors I, J, K ``(n, 3)`` of the file; for centres they are axes. None if absent.
        source: file name for messages.
        notes: notes collected so far; extended in place.

    Returns:
        Mask of the rows that state centres ``(n,)``, and the vectors of the other rows; None if there are none.

    Raises:
        ReadingsError: centres have a tip radius although no other row has one.
    """
    kinds = [reading_kind(kind or "point") for kind in columns["kinds"] or ()]
    if not any(kind.centre for kind in kinds):
        return np.zeros(n, dtype=np.bool_), outward
    rows = _rows(columns, kinds)
    columns["kinds"] = [
        kind.centre if row else name for row, kind, name in zip(rows, kinds, columns["kinds"], strict=True)
    ]
    if not rows.any():
        return rows, outward
    _without_ball(columns, rows, source)
    notes += _centre_notes(columns, rows)
    if outward is None:
        return rows, None
    own = columns["normals"]
    if own is None:
        columns["normals"] = np.where(rows[:, None], outward, np.nan)
    return rows, None if rows.all() else np.where(rows[:, None], np.nan, outward)


def _rows(columns: dict[str, Any], kinds: list[ReadingKind]) -> BoolArray:
    """Return which rows give centres ``(n,)``."""
    labels = columns["features"] or [""] * len(kinds)
    counts = Counter(labels)
    sure = np.array([not label or counts[label] == 1 for label in labels])
    sure |= np.array([bool(side) for side in columns.get("material_sides") or [""] * len(kinds)])
    for column in SIZES.values():
        if columns.get(column) is not None:
            sure |= ~np.isnan(columns[column])
    return np.array([kind.is_centre or bool(kind.centre and one) for kind, one in zip(kinds, sure, strict=True)])


def _centre_notes(columns: dict[str, Any], rows: BoolArray) -> list[str]:
    """Return a note for each sort of centre that rows were read as."""
    own, notes = [reading_kind(kind or "point").note for kind in columns["kinds"]], []
    for what in centre_notes():
        some = rows & np.array([note == what for note in own])
        if some.any():
            alone = f"{some.sum()} rows give" if some.sum() > 1 else "One row gives"
            notes.append(f"{alone} {what.format(_named(columns, some))}")
    return notes


def _without_ball(columns: dict[str, Any], rows: BoolArray, source: str) -> None:
    """Set the tip radius of centre rows to zero; refuse one stated with centres alone, where the hole's was meant."""
    radii = columns["radii"]
    if radii is None:
        return
    own = radii[rows]
    others = radii[~rows]
    if np.any(own > 0) and not np.any(others > 0):
        raise ReadingsError(
            f"{source}: expected no radius of a tip's ball (radius_mm, --radius) beside centres of circles alone, got "
            f"{1e3 * np.nanmax(own):g} mm. Name the radius of holes and bosses hole_radius_mm."
        )
    columns["radii"] = np.where(rows, 0.0, radii)


def _named(columns: dict[str, Any], rows: BoolArray) -> str:
    labels = columns["features"]
    ids = columns["ids"]
    names = [(labels[k] if labels is not None else "") or str(ids[k] if ids is not None else k + 1)
             for k in np.flatnonzero(rows)]  # fmt: skip
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def set_axis_sds(columns: dict[str, Any], rows: BoolArray, notes: list[str]) -> None:
    """Set the standard deviation of axes that have none to one degree, and add a note.

    Args:
        columns: columns of :meth:`Readings.from_columns`; ``normal_sds`` is replaced.
        rows: mask of the rows that state centres ``(n,)``.
        notes: notes collected so far; extended in place.
    """
    if columns["normals"] is None or not rows.any():
        return
    given = rows & ~np.isnan(columns["normals"]).any(axis=1)
    sds = np.full(len(rows), np.nan) if columns["normal_sds"] is None else np.array(columns["normal_sds"])
    unknown = given & np.isnan(sds)
    if unknown.any():
        columns["normal_sds"] = np.where(unknown, _AXIS_SD, sds)
        notes.append("Axes of holes and bosses are taken as known to 1 degree; normal_sd_deg sets another value.")
