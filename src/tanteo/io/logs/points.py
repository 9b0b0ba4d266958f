"""Read lists of points: X Y Z, with vectors I J K or further columns of CloudCompare (``.asc``, ``.xyz``).

A comment above the rows may name the columns (``//X Y Z Nx Ny Nz``). Without it, the last three columns are vectors if
they have length one; other columns, such as colours, are ignored. Rows of six numbers whose last three are a unit
vector are X Y Z I J K of coordinate measuring machines, where I J K points out of the material.
"""

from __future__ import annotations

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log
from tanteo.io.logs.numbers import NumberRows, all_rows, are_unit, first_rows

_NORMAL = (("nx", "ny", "nz"), ("i", "j", "k"))


def recognise_vectors(contents: Contents) -> bool:
    """Return whether rows have six numbers of which the last three are a unit vector.

    Args:
        contents: file to test.
    """
    rows = first_rows(contents)
    return rows is not None and rows.values.shape[1] == 6 and are_unit(rows.values[:, 3:]) and "nx" not in rows.names


def read_vectors(contents: Contents) -> Log:
    """Return points with vectors out of the material.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed.
    """
    values = all_rows(contents, "X Y Z I J K").values
    if values.shape[1] != 6:
        contents.fail("six numbers a row (X Y Z I J K)", str(values.shape[1]), "Use another --format.")
    if not are_unit(values[:, 3:]):
        k = int(np.argmax(np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1)))
        contents.fail("I J K of length one in each row", f"{values[k, 3:]} in row {k + 1}", "Correct it.")
    return Log(points=values[:, :3], outward=values[:, 3:])


def recognise_points(contents: Contents) -> bool:
    """Return whether the file contains only rows of three numbers or more.

    Args:
        contents: file to test.
    """
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
    others = rows.values.shape[1] - 3 - len(columns)
    names = [name for k, name in enumerate(rows.names[3:], start=3) if k not in columns]
    what = f" ({', '.join(names)})" if names else ""
    notes = (f"{others} of {rows.values.shape[1]} columns were excluded{what}.",) if others else ()
    return Log(points=rows.values[:, :3], normals=rows.values[:, columns] if columns else None, notes=notes)


def _normal_columns(rows: NumberRows) -> list[int]:
    """Return the column indices of the normal: by name, else the last three if they are unit vectors."""
    for names in _NORMAL:
        if set(names) <= set(rows.names):
            return [rows.names.index(name) for name in names]
    count = rows.values.shape[1]
    return list(range(count - 3, count)) if count >= 6 and not rows.names and are_unit(rows.values[:, -3:]) else []
