"""Define columns of readings in which only some readings have numbers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tanteo.errors import ReadingsError
from tanteo.geometry.typing import BoolArray, FloatArray
from tanteo.values import Value


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Column(Value):
    """One quantity of ``n`` readings, of which only some readings have a number, a vector or a matrix.

    The column holds a mask and the numbers of the readings in the mask, without gaps. No number stands for "missing".
    ``np.asarray(column)`` and ``column[rows]`` return the numbers of readings that all have one, and refuse others.

    Attributes:
        given: mask of the readings that have the quantity ``(n,)``.
        values: quantity of the readings in the mask, in their order ``(m, ...)``.

    Example:
        >>> column = Column.from_rows(np.array([0.1, np.nan, 0.3]))
        >>> column.given.tolist(), column.values.tolist()
        ([True, False, True], [0.1, 0.3])
        >>> column.filled(0.0).tolist()
        [0.1, 0.0, 0.3]
    """

    given: BoolArray
    values: FloatArray

    def __post_init__(self) -> None:
        for name, dtype in (("given", np.bool_), ("values", np.float64)):
            array = np.asarray(getattr(self, name), dtype=dtype)
            if array.flags.writeable:
                array = array.copy()
                array.flags.writeable = False
            object.__setattr__(self, name, array)
        if self.given.ndim != 1 or len(self.values) != np.count_nonzero(self.given):
            raise ReadingsError(
                f"column: expected one row of values for each of {np.count_nonzero(self.given)} readings in the mask, "
                f"got {len(self.values)}. Use Column.from_rows."
            )

    @classmethod
    def from_rows(cls, rows: npt.ArrayLike, given: BoolArray | None = None) -> Column:
        """Return the column of an array with one row for each reading.

        Args:
            rows: quantity of every reading ``(n, ...)``; rows of other readings are ignored.
            given: mask of the readings that have the quantity ``(n,)``; None if rows of NaN, which tables have in empty
                cells, mark the readings without it.
        """
        array = np.asarray(rows, dtype=np.float64)
        if given is None:
            given = np.asarray(~np.isnan(array).all(axis=tuple(range(1, array.ndim))))
        return cls(given, array[given])

    @classmethod
    def empty(cls, n: int, shape: tuple[int, ...] = ()) -> Column:
        """Return the column of a quantity that no reading has.

        Args:
            n: number of readings.
            shape: shape of the quantity.
        """
        return cls(np.zeros(n, dtype=np.bool_), np.empty((0, *shape)))

    def __len__(self) -> int:
        return len(self.given)

    def __getitem__(self, rows: Any) -> FloatArray:
        """Return the quantity of readings that all have it.

        Args:
            rows: one row number, several, a slice or a mask.

        Raises:
            ReadingsError: one of the readings does not have the quantity.
        """
        if len(self.values) == len(self.given):
            return np.asarray(self.values[rows])[()]
        index = np.arange(len(self))[rows]
        if not np.all(self.given[index]):
            row = np.atleast_1d(index)[np.argmin(np.atleast_1d(self.given[index]))]
            raise ReadingsError(
                f"column: expected a value of every requested reading, got none of row {row + 1}. Select the rows in "
                "'given', or state a default with 'filled'."
            )
        return np.asarray(self.values[(np.cumsum(self.given) - 1)[index]])[()]

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> FloatArray:
        return np.array(self[:], dtype=dtype, copy=copy)

    def filled(self, default: npt.ArrayLike) -> FloatArray:
        """Return the quantity of all readings as a new array ``(n, ...)``, with a default for those without it.

        Args:
            default: value for the readings without the quantity, or one row for each reading ``(n, ...)``.
        """
        out = np.empty((len(self), *self.values.shape[1:]))
        out[...] = default
        out[self.given] = self.values
        return out

    def take(self, rows: Sequence[int] | np.ndarray) -> Column:
        """Return the column of some readings, in the order of the rows.

        Args:
            rows: row numbers, or mask ``(n,)``.
        """
        index = np.arange(len(self))[np.asarray(rows)]
        given = self.given[index]
        return Column(given, self.values[(np.cumsum(self.given) - 1)[index[given]]])

    def only(self, rows: BoolArray) -> Column:
        """Return the column without the quantity of the other readings.

        Args:
            rows: mask of the readings that keep it ``(n,)``.
        """
        return Column(self.given & rows, self.values[np.asarray(rows)[self.given]])

    def map(self, function: Callable[[FloatArray], FloatArray]) -> Column:
        """Return the column of a function of the quantity.

        Args:
            function: function of the values ``(m, ...)`` that returns one row for each.
        """
        return Column(self.given, function(self.values))

    def coalesce(self, other: Column) -> Column:
        """Return the column with the values of another where this column has none.

        Args:
            other: column of the same readings.
        """
        return Column.from_rows(self.filled(other.filled(np.nan)), self.given | other.given)


def column_of(name: str, value: Column | npt.ArrayLike | None, n: int, shape: tuple[int, ...]) -> Column:
    """Return a column for ``n`` readings from what a caller gives for it.

    Args:
        name: name of the column, for messages.
        value: column; array with one row for each reading, in which rows of NaN mark the readings without the
            quantity; or None if no reading has it.
        n: number of readings.
        shape: shape of the quantity.

    Raises:
        ReadingsError: the values are not real numbers, or the shape differs.
    """
    if value is None:
        return Column.empty(n, shape)
    if isinstance(value, Column):
        got = (len(value), *value.values.shape[1:])
    else:
        value = real_numbers(name, value)
        got = value.shape
    if got != (n, *shape):
        raise ReadingsError(f"{name}: expected shape {(n, *shape)}, got {got}. Give one row a reading.")
    return value if isinstance(value, Column) else Column.from_rows(value)


def real_numbers(name: str, value: npt.ArrayLike) -> FloatArray:
    """Return real numbers as float64; refuse masked and complex arrays, whose conversion would lose information.

    Args:
        name: name of the column, for messages.
        value: numbers.

    Raises:
        ReadingsError: the values are masked, complex, or no numbers.
    """
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


def unit_vectors(name: str, value: Column | npt.ArrayLike | None) -> Column | None:
    """Return vectors scaled to length one; None for None.

    Args:
        name: name of the column, for messages.
        value: vectors, one for each reading, or a column of them.

    Raises:
        ReadingsError: the shape is wrong, or a vector is zero or infinite.
    """
    if value is None:
        return None
    if not isinstance(value, Column):
        vectors = real_numbers(name, value)
        if vectors.ndim != 2 or vectors.shape[1] != 3:
            raise ReadingsError(f"{name}: expected shape (n, 3), got {vectors.shape}. Give one row a reading.")
        value = Column.from_rows(vectors)
    if np.isinf(value.values).any():
        raise ReadingsError(f"{name}: expected finite numbers, got infinity. Correct them.")
    norms = np.linalg.norm(value.values, axis=1)
    short = np.flatnonzero(value.given)[norms < 1e-9]
    if len(short):
        raise ReadingsError(f"{name}: expected a vector that is not zero, got zero in row {short[0] + 1}.")
    # the check of the readings reports vectors that are partly NaN
    return value.map(lambda vectors: vectors / np.where(np.isnan(norms), 1.0, norms)[:, None])


def joined(columns: Sequence[Column]) -> Column:
    """Return the columns of several sets of readings as one, in order.

    Args:
        columns: columns of one quantity.
    """
    return Column(np.concatenate([c.given for c in columns]), np.concatenate([c.values for c in columns]))
