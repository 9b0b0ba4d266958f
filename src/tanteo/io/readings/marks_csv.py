"""Read marks from CSV: points with known positions in the world and in the image (``docs/vision.md``)."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.io.documents.schema import show
from tanteo.io.readings.units import LENGTH_UNITS
from tanteo.parts import read_whole

_FORM = "Write u_px,v_px,x_mm,y_mm and, off the table, z_mm."


def read_marks(path: str | Path) -> tuple[FloatArray, Vectors]:
    """Read marks from a CSV file; lines that start with ``#`` are comments.

    The columns are ``u_px``, ``v_px`` and ``x``, ``y``, ``z`` with their unit in the name, such as ``x_mm``.

    Args:
        path: CSV file.

    Returns:
        Pixels ``(n, 2)`` and points in the world ``(n, 3)`` [m]; z is 0, the table's height, where the column is
        missing.

    Raises:
        InputError: the file cannot be read, a column is missing or unknown, or a cell is not a number; the message
            names file, line, column and value.
    """
    path = Path(path)
    try:
        lines = read_whole(path, "a file of marks").decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected a file of marks, got: {error}. Save it as UTF-8.") from None
    try:
        rows = [(k, row) for k, row in enumerate(csv.reader(lines), start=1) if row and not row[0].startswith("#")]
    except csv.Error as error:
        raise InputError(f"{path}: expected comma-separated cells, got: {error}. {_FORM}") from None
    if not rows:
        raise InputError(f"{path}: expected a header and marks, got an empty file. {_FORM}")
    scales = [_scale(name.strip(), path) for name in rows[0][1]]
    at = {name: k for k, (name, _) in enumerate(scales)}
    missing = [name for name in ("u", "v", "x", "y") if name not in at]
    if missing or len(at) != len(scales):
        raise InputError(f"{path}: expected columns u, v, x, y once each, got {show(', '.join(rows[0][1]))}. {_FORM}")
    values = np.array([_numbers(row, k, scales, path) for k, row in rows[1:]]).reshape(-1, len(scales))
    z = values[:, at["z"]] if "z" in at else np.zeros(len(values))
    return values[:, [at["u"], at["v"]]], np.stack([values[:, at["x"]], values[:, at["y"]], z], axis=1)


def _scale(name: str, path: Path) -> tuple[str, float]:
    base, _, unit = name.partition("_")
    if base in ("u", "v") and unit == "px":
        return base, 1.0
    if base in ("x", "y", "z") and unit in LENGTH_UNITS:
        return base, LENGTH_UNITS[unit]
    raise InputError(f"{path}: expected u_px, v_px, x_mm, y_mm or z_mm (or _m, _um, _in), got '{show(name)}'. {_FORM}")


def _numbers(row: list[str], line: int, scales: list[tuple[str, float]], path: Path) -> list[float]:
    if len(row) != len(scales):
        raise InputError(f"{path}, line {line}: expected {len(scales)} cells, got {len(row)}. Correct the row.")
    out = []
    for cell, (name, scale) in zip(row, scales, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise InputError(f"{path}, line {line}, {name}: expected a number, got '{show(cell)}'. Correct the cell.")
        out.append(value * scale)
    return out
