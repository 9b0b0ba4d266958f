"""Lists of points: X Y Z, with vectors I J K, or with what CloudCompare writes beside them (``.asc``, ``.xyz``).

Columns are known by a comment above them (``//X Y Z Nx Ny Nz``), else by what they hold: the last three of length one
are vectors; what else there is, as colours, is left out. Six numbers whose last three are a unit vector are X Y Z I J K
as coordinate measuring machines write them: I J K points out of the material.
"""

from __future__ import annotations

import numpy as np

from tanteo.logs.contents import Contents
from tanteo.logs.log import Log
from tanteo.logs.numbers import NumberRows, all_rows, are_unit, first_rows

_NORMAL = (("nx", "ny", "nz"), ("i", "j", "k"))


def recognise_vectors(contents: Contents) -> bool:
    """Six numbers a row, the last three a unit vector."""
    rows = first_rows(contents)
    return rows is not None and rows.values.shape[1] == 6 and are_unit(rows.values[:, 3:]) and "nx" not in rows.names


def read_vectors(contents: Contents) -> Log:
    """Points with vectors out of the material."""
    values = all_rows(contents, "X Y Z I J K").values
    if values.shape[1] != 6:
        contents.fail("six numbers a row (X Y Z I J K)", str(values.shape[1]), "Say another --format.")
    if not are_unit(values[:, 3:]):
        k = int(np.argmax(np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1)))
        contents.fail("I J K of length one in each row", f"{values[k, 3:]} in row {k + 1}", "Correct it.")
    return Log(points=values[:, :3], outward=values[:, 3:])


def recognise_points(contents: Contents) -> bool:
    """Three numbers a row or more, and nothing else."""
    rows = first_rows(contents)
    return rows is not None and rows.values.shape[1] >= 3


def read_points(contents: Contents) -> Log:
    """Points, and the normals that stand beside them."""
    rows = all_rows(contents, "X Y Z")
    if rows.values.shape[1] < 3:
        contents.fail("three numbers a row or more", str(rows.values.shape[1]), "Say another --format.")
    columns = _normal_columns(rows)
    others = rows.values.shape[1] - 3 - len(columns)
    names = [name for k, name in enumerate(rows.names[3:], start=3) if k not in columns]
    what = f" ({', '.join(names)})" if names else ""
    notes = (f"{others} of {rows.values.shape[1]} columns were left out{what}.",) if others else ()
    return Log(points=rows.values[:, :3], normals=rows.values[:, columns] if columns else None, notes=notes)


def _normal_columns(rows: NumberRows) -> list[int]:
    """Which columns are a normal: by name, else the last three behind X Y Z if they are unit vectors."""
    for names in _NORMAL:
        if set(names) <= set(rows.names):
            return [rows.names.index(name) for name in names]
    count = rows.values.shape[1]
    return list(range(count - 3, count)) if count >= 6 and not rows.names and are_unit(rows.values[:, -3:]) else []
