"""Convert columns of readings from any accepted form to read-only arrays and names."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.typing import BoolArray, FloatArray, Vectors


def frozen(name: str, value: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return a read-only float64 copy with the required shape; broadcast columns of NaN are not expanded in memory.

    Args:
        name: name of the column, for messages.
        value: numbers of the column.
        shape: required shape.

    Raises:
        ReadingsError: the values are not real numbers, or the shape differs.
    """
    array = _numbers(name, value)
    if array.shape != shape:
        raise ReadingsError(f"{name}: expected shape {shape}, got {array.shape}. Give one row a reading.")
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


def _numbers(name: str, value: FloatArray) -> FloatArray:
    """Return real numbers as float64; refuse masked and complex arrays, whose conversion would lose information."""
    if "numpy.ma" in sys.modules and np.ma.is_masked(value):  # the attribute access alone would import numpy.ma
        raise ReadingsError(f"{name}: expected numbers, got a masked array. Fill it with NaN, or leave the rows out.")
    try:
        if np.iscomplexobj(value):
            raise ReadingsError(f"{name}: expected real numbers, got complex ones. Give their real parts.")
        return np.asarray(value, dtype=np.float64)
    except (ValueError, TypeError) as error:
        if isinstance(error, ReadingsError):
            raise
        raise ReadingsError(f"{name}: expected numbers, one row a reading, got others ({error}).") from None


def names_of(values: Sequence[object]) -> tuple[str, ...]:
    """Return names as text; None and NaN, which tables have in empty cells, become empty.

    Args:
        values: names of any type.
    """
    return tuple("" if v is None or v != v else str(v) for v in values)


def flags_of(value: BoolArray) -> BoolArray:
    """Return a boolean copy; refuse words, which would all be true.

    Args:
        value: flags as booleans or integers.

    Raises:
        ReadingsError: the values are neither booleans nor integers.
    """
    flags = np.array(value)
    if flags.dtype.kind not in "bui" and flags.size:
        raise ReadingsError(f"is_free: expected true or false, got '{flags.flat[0]}'. Compare the words first.")
    return flags.astype(bool)


def frozen_flags(value: BoolArray, n: int) -> BoolArray:
    """Return a read-only boolean copy with one flag per reading.

    Args:
        value: flags as booleans or integers.
        n: number of readings.

    Raises:
        ReadingsError: the values are not flags, or their number differs.
    """
    flags = flags_of(value)
    if flags.shape != (n,):
        raise ReadingsError(f"is_free: expected shape {(n,)}, got {flags.shape}. Give one flag a reading.")
    flags.flags.writeable = False
    return flags


def filled_kinds(kinds: Sequence[str] | None, free: BoolArray, n: int) -> tuple[str, ...]:
    """Return a kind for every reading, and mark rows of kind ``free`` in ``free``.

    Args:
        kinds: kinds of the readings; None for the default.
        free: mask of free-space rays ``(n,)``; updated in place.
        n: number of readings.

    Raises:
        ReadingsError: the number of kinds differs.
    """
    if kinds is None:
        return tuple("free" if f else "point" for f in free) if free.any() else ("point",) * n
    if len(kinds) != n:
        raise ReadingsError(f"kinds: expected {n} entries, one a reading, got {len(kinds)}.")
    free |= np.fromiter((k == "free" for k in kinds), dtype=bool, count=n)
    return tuple("free" if f else (k or "point") for f, k in zip(free, kinds, strict=True))


def units_of(name: str, vectors: Vectors | None) -> Vectors | None:
    """Return vectors scaled to length one, with NaN rows unchanged; None for None.

    Args:
        name: name of the column, for messages.
        vectors: vectors ``(n, 3)``.

    Raises:
        ReadingsError: the shape is wrong, or a vector is zero or infinite.
    """
    if vectors is None:
        return None
    vectors = _numbers(name, vectors)
    if vectors.ndim != 2 or vectors.shape[1] != 3:
        raise ReadingsError(f"{name}: expected shape (n, 3), got {vectors.shape}. Give one row a reading.")
    if np.isinf(vectors).any():
        raise ReadingsError(f"{name}: expected finite numbers, got infinity. Correct them.")
    norms = np.linalg.norm(vectors, axis=1)
    short = np.flatnonzero(norms < 1e-9)
    if len(short):
        raise ReadingsError(f"{name}: expected a vector that is not zero, got zero in row {short[0] + 1}.")
    # the check of numbers reports rows that are partly NaN
    return np.asarray(vectors / np.where(np.isnan(norms), 1.0, norms)[:, None])
