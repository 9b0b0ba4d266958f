"""Read lists of points: X Y Z, with vectors I J K or further columns of CloudCompare (``.asc``, ``.xyz``).

A comment above the rows may name the columns (``//X Y Z Nx Ny Nz``). Without it, the last three columns are vectors if
they have length one; other columns, such as colours, are ignored. Rows of six numbers whose last three are a unit
vector are X Y Z I J K of coordinate measuring machines, where I J K points out of the material.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log, unique
from tanteo.io.logs.numbers import NumberRows, all_rows, are_unit, first_rows

_NORMAL = (("nx", "ny", "nz"), ("i", "j", "k"))


def recognise_vectors(contents: Contents) -> bool:
    """Return whether rows have six numbers or more of which the fourth to sixth are a unit vector.

    Args:
        contents: file to test.
    """
    rows = first_rows(contents)
    if rows is None or "nx" in rows.names or rows.values.shape[1] < 6:
        return False
    return are_unit(rows.values[:, 3:6]) and (rows.values.shape[1] < 9 or not are_unit(rows.values[:, -3:]))


def read_vectors(contents: Contents) -> Log:
    """Return points with vectors out of the material.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed.
    """
    rows = all_rows(contents, "X Y Z I J K")
    values = rows.values[:, :6]
    if values.shape[1] != 6:
        contents.fail("six numbers a row (X Y Z I J K)", str(values.shape[1]), "Use another --format.")
    if not are_unit(values[:, 3:]):
        k = int(np.argmax(np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1)))
        contents.fail("I J K of length one in each row", f"{values[k, 3:]} in row {k + 1}", "Correct it.")
    return Log(points=values[:, :3], unit=rows.unit, outward=values[:, 3:], ids=_ids(rows), notes=_notes(rows, 6))


def recognise_points(contents: Contents) -> bool:
    """Return whether the file contains only rows of three numbers or more.

    Args:
        contents: file to test.
    """
    if contents.head.lstrip().startswith("%time,"):  # a table of rostopic echo -p
        return False
    rows = first_rows(contents)
    return rows is not None and rows.values.shape[1] >= 3


def read_points(contents: Contents) -> Log:
    """Return points, with normals if present.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed.
    """
    rows = all_rows(contents, "X Y Z")
    if rows.values.shape[1] < 3:
        contents.fail("three numbers a row or more", str(rows.values.shape[1]), "Use another --format.")
    columns = _normal_columns(rows)
    _refuse_pairs(contents, rows)
    normals = rows.values[:, columns] if columns else None
    return Log(
        points=rows.values[:, :3],
        unit=rows.unit,
        normals=normals,
        ids=_ids(rows),
        notes=_notes(rows, 3 + len(columns), columns),
    )


_PAIR = 0.02
"""Definition: largest distance of a measured from a nominal point, as a fraction of the extent of all points."""


def _refuse_pairs(contents: Contents, rows: NumberRows) -> None:
    """Refuse rows with two points, nominal and measured, in an order that the file does not state."""
    if rows.names or rows.values.shape[1] < 6 or len(rows.values) < 3:
        return
    first, second = rows.values[:, :3], rows.values[:, 3:6]
    away = np.linalg.norm(second - first, axis=1).max()
    if away < _PAIR * np.linalg.norm(np.ptp(first, axis=0)):
        contents.fail(
            "one point a row", "two that differ little: nominal and measured?",
            "Name the columns in a header: nominal_x,nominal_y,nominal_z,x,y,z if the measured point is second.",
        )  # fmt: skip


def _ids(rows: NumberRows) -> tuple[str, ...] | None:
    return unique(list(rows.labels)) if rows.labels else None


def _notes(rows: NumberRows, used: int, columns: Sequence[int] = ()) -> tuple[str, ...]:
    """Return a note on excluded columns of numbers and words."""
    count = rows.values.shape[1]
    names = [name for k, name in enumerate(rows.names[3:], start=3) if k not in columns]
    named = f" ({', '.join(names)})" if names else ""
    notes = [f"{count - used} of {count} columns were excluded{named}."] if count > used else []
    notes += ["The words after the numbers of each row were excluded."] if rows.others else []
    return tuple(notes)


def _normal_columns(rows: NumberRows) -> list[int]:
    """Return the column indices of the normal: by name, else the last three if they are unit vectors."""
    for names in _NORMAL:
        if set(names) <= set(rows.names):
            return [rows.names.index(name) for name in names]
    count = rows.values.shape[1]
    return list(range(count - 3, count)) if count >= 6 and not rows.names and are_unit(rows.values[:, -3:]) else []
