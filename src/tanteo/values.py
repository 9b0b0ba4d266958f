"""Represent values for readers: a short ``repr`` and a table for notebooks; and make their arrays read-only."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from html import escape
from typing import Any

import numpy as np

MOST = 300
"""Largest number of characters of a representation; one line of a wide terminal or three of a narrow one."""

FEW = 6
"""Largest number of numbers that a representation lists: a position with its direction."""


class Value:
    """Base of frozen data classes with read-only arrays and a short representation.

    A subclass with a ``__post_init__`` of its own calls :func:`lock` there.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True, slots=True, eq=False, repr=False)
        ... class Place(Value):
        ...     name: str
        ...     position: np.ndarray
        >>> place = Place("table", np.array([0.1, 0.2, 0.0]))
        >>> place
        Place(name='table', position=[0.1, 0.2, 0])
        >>> place.position.flags.writeable
        False
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        lock(self)

    def __repr__(self) -> str:
        return brief(self)


def lock(value: Any) -> None:
    """Replace every writable array of a frozen data class by a read-only view.

    Args:
        value: data class.
    """
    for field in fields(value):
        array = getattr(value, field.name, None)
        if isinstance(array, np.ndarray) and array.flags.writeable:
            view = array.view()
            view.flags.writeable = False
            object.__setattr__(value, field.name, view)


def brief(value: Any) -> str:
    """Return a data class as one short line: numbers, names, and the shapes of large arrays.

    Fields with their default value and private fields are excluded.

    Args:
        value: data class.
    """
    shown = []
    for field in fields(value):
        one = getattr(value, field.name, None)
        if (
            field.name.startswith("_")
            or not field.repr
            or (not isinstance(one, np.ndarray) and _is_default(field, one))
        ):
            continue
        shown.append(f"{field.name}={_short(one)}")
    kept, length = [], len(type(value).__name__) + 2
    for text in shown:
        length += len(text) + 2
        if length > MOST:
            kept.append("...")
            break
        kept.append(text)
    return f"{type(value).__name__}({', '.join(kept)})"


def html_table(title: str, headers: Sequence[str], rows: Iterable[Sequence[str]], note: str = "") -> str:
    """Return a table for a notebook.

    Args:
        title: heading.
        headers: heading of each column.
        rows: text of the cells.
        note: paragraph below the table.
    """
    head = "".join(f"<th>{escape(text)}</th>" for text in headers)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>" if body else ""
    below = f"<p>{escape(note)}</p>" if note else ""
    return f"<div><p><b>{escape(title)}</b></p>{table}{below}</div>"


def _is_default(field: Any, value: Any) -> bool:
    if field.default is not MISSING:
        return value is field.default or (type(value) is type(field.default) and repr(value) == repr(field.default))
    return field.default_factory is not MISSING and isinstance(value, (dict, list, tuple)) and not value


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return _numbers(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, str):
        return repr(value if len(value) <= 60 else f"{value[:57]}...")
    if isinstance(value, Mapping):
        return f"<{len(value)} entries>"
    if isinstance(value, (tuple, list)):
        few = [_short(one) for one in value[:FEW]] if len(value) <= FEW else []
        text = ", ".join(few)
        return f"({text})" if (few and len(text) <= 80) or not value else f"<{len(value)} of {type(value[0]).__name__}>"
    if is_dataclass(value) and not isinstance(value, type):
        name = getattr(value, "name", None)
        return f"{type(value).__name__}({name!r})" if isinstance(name, str) else f"{type(value).__name__}(...)"
    text = repr(value)
    return text if len(text) <= 60 else f"<{type(value).__name__}>"


def _numbers(array: np.ndarray) -> str:
    if array.ndim == 0:
        return f"{array[()]:.4g}" if array.dtype.kind == "f" else str(array[()])
    if array.ndim == 1 and len(array) <= FEW:
        return "[" + ", ".join(f"{one:.4g}" if array.dtype.kind == "f" else str(one) for one in array.tolist()) + "]"
    return f"<{array.dtype} {' x '.join(map(str, array.shape))}>"
