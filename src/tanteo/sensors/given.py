"""What is given as the columns of readings, in whatever form, as arrays and names that stay."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.typing import BoolArray, FloatArray, Vectors


def frozen(name: str, value: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """A read-only float64 copy of the right shape; broadcast columns of NaN stay one number in memory."""
    array = _numbers(name, value)
    if array.shape != shape:
        raise ReadingsError(f"{name}: expected shape {shape}, got {array.shape}. Give one row a reading.")
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


def _numbers(name: str, value: FloatArray) -> FloatArray:
    """Real numbers as float64: of masked or complex ones a part would go unsaid."""
    if "numpy.ma" in sys.modules and np.ma.is_masked(value):  # asking for it would import it
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
    """Names as text; None and NaN, which tables have in empty cells, are none."""
    return tuple("" if v is None or v != v else str(v) for v in values)


def flags_of(value: BoolArray) -> BoolArray:
    """A copy; words would all be true."""
    flags = np.array(value)
    if flags.dtype.kind not in "bui" and flags.size:
        raise ReadingsError(f"is_free: expected true or false, got '{flags.flat[0]}'. Compare the words first.")
    return flags.astype(bool)


def frozen_flags(value: BoolArray, n: int) -> BoolArray:
    """The same, read-only, one a reading."""
    flags = flags_of(value)
    if flags.shape != (n,):
        raise ReadingsError(f"is_free: expected shape {(n,)}, got {flags.shape}. Give one flag a reading.")
    flags.flags.writeable = False
    return flags


def filled_kinds(kinds: Sequence[str] | None, free: BoolArray, n: int) -> tuple[str, ...]:
    """A kind for every reading; what is said to be free of either is marked in both."""
    if kinds is None:
        return tuple("free" if f else "point" for f in free) if free.any() else ("point",) * n
    if len(kinds) != n:
        raise ReadingsError(f"kinds: expected {n} entries, one a reading, got {len(kinds)}.")
    free |= np.fromiter((k == "free" for k in kinds), dtype=bool, count=n)
    return tuple("free" if f else (k or "point") for f, k in zip(free, kinds, strict=True))


def units_of(name: str, vectors: Vectors | None) -> Vectors | None:
    """Vectors scaled to length one; NaN rows stay."""
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
    # a row that is partly NaN stays as it is, for the check of numbers to name
    return np.asarray(vectors / np.where(np.isnan(norms), 1.0, norms)[:, None])
