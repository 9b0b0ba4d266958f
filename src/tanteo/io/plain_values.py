"""Frozen values as plain JSON and back, by the types of their fields: nothing is lost, nothing unknown is taken.

Numbers keep all their digits; those that JSON does not have are the texts ``nan``, ``inf`` and ``-inf``.
"""

from __future__ import annotations

import math
import types
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from tanteo.errors import InputError, did_you_mean

_NOT_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


def as_plain(value: Any) -> Any:
    """Dictionaries, lists, texts and numbers of a value: arrays, sequences and data classes by their fields."""
    if is_dataclass(value):
        return {f.name: as_plain(getattr(value, f.name)) for f in fields(value) if f.init}
    if isinstance(value, np.ndarray | np.generic):
        return as_plain(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [as_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value


def from_plain(kind: Any, plain: Any, place: str) -> Any:
    """The value of a type from what :func:`as_plain` made of one.

    Args:
        kind: data class, float, int, bool, str, an array's type, a sequence of one of these, or a union of them;
            what is an ``object`` is taken as it is.
        plain: as read.
        place: file and key, for messages.

    Raises:
        InputError: it is not of that type; the message begins with the place.
    """
    kind = _without_alias(kind)
    if kind is object:
        return plain
    if get_origin(kind) in (Union, types.UnionType):
        return _one_of(get_args(kind), plain, place)
    if is_dataclass(kind):
        return made(kind, table(plain, hints(kind), place), place)
    if get_origin(kind) is np.ndarray:
        return _array(get_args(get_args(kind)[1])[0], plain, place)
    if get_origin(kind) in (tuple, Sequence):
        return _sequence(get_args(kind), plain, place)
    if kind is float:
        return _number(plain, place)
    if type(plain) is not kind:
        raise refused(place, {str: "a text", int: "a whole number", bool: "true or false"}[kind], plain)
    return plain


def _without_alias(kind: Any) -> Any:
    """What a generic alias of the ``type`` statement stands for: NumPy's ``NDArray`` is one from 2.5 on."""
    value = getattr(get_origin(kind), "__value__", None)
    return kind if value is None else value[get_args(kind)]


def hints(kind: Any) -> dict[str, Any]:
    """Types of the fields with which a data class is made."""
    types_of = get_type_hints(kind)
    return {f.name: types_of[f.name] for f in fields(kind) if f.init}


def table(plain: Any, kinds: Mapping[str, Any], place: str) -> dict[str, Any]:
    """The values of a table that has exactly these keys.

    Raises:
        InputError: it is no table, or a key is unknown or missing.
    """
    if not isinstance(plain, dict):
        raise refused(place, "a table", plain)
    for key in plain:
        if key not in kinds:
            hint = did_you_mean(key, kinds)
            raise InputError(f"{place}: expected one of {', '.join(kinds)}, got '{shown(key)}'.{hint}")
    for key in kinds:
        if key not in plain:
            raise InputError(f"{place}: expected '{key}', got nothing. Take the record as it was written.")
    return {key: from_plain(kind, plain[key], f"{place}, {key}") for key, kind in kinds.items()}


def made(kind: Any, values: Mapping[str, Any], place: str) -> Any:
    """The data class of these values.

    Raises:
        InputError: it refuses them; the message begins with the place.
    """
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def refused(place: str, expected: str, got: Any) -> InputError:
    """The error that says what was expected instead."""
    return InputError(f"{place}: expected {expected}, got {shown(got)}. Take the record as it was written.")


def shown(value: Any) -> str:
    """A value in a message: its beginning."""
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _one_of(kinds: Sequence[Any], plain: Any, place: str) -> Any:
    if plain is None and type(None) in kinds:
        return None
    left = [kind for kind in kinds if kind is not type(None)]
    others = [kind for kind in left if kind is not str]
    if str in left and (isinstance(plain, str) or not others):
        return from_plain(str, plain, place)
    return from_plain(others[0], plain, place)


def _sequence(kinds: tuple[Any, ...], plain: Any, place: str) -> tuple[Any, ...]:
    if not isinstance(plain, list):
        raise refused(place, "a list", plain)
    if len(kinds) == 1 or kinds[-1] is ...:
        kinds = kinds[:1] * len(plain)
    if len(plain) != len(kinds):
        raise refused(place, f"{len(kinds)} items", plain)
    return tuple(from_plain(kind, p, f"{place}[{k}]") for k, (kind, p) in enumerate(zip(kinds, plain, strict=True)))


def _number(plain: Any, place: str) -> float:
    if isinstance(plain, str) and plain in _NOT_FINITE:
        return _NOT_FINITE[plain]
    if isinstance(plain, bool) or not isinstance(plain, int | float) or abs(plain) > 1e300:
        raise refused(place, "a number", plain)
    return float(plain)


def _array(dtype: type, plain: Any, place: str) -> np.ndarray:
    flat: list[Any] = []
    shape = _shape(plain, flat, place)
    if dtype is np.float64:
        flat = [_number(value, place) for value in flat]
    elif any(type(value) is not (bool if dtype is np.bool_ else int) or abs(value) > 2**62 for value in flat):
        raise refused(place, "true or false" if dtype is np.bool_ else "whole numbers", plain)
    return np.array(flat, dtype=dtype).reshape(shape)


def _shape(plain: Any, flat: list[Any], place: str) -> tuple[int, ...]:
    """Shape of a nested list, whose items are appended to ``flat``."""
    if not isinstance(plain, list):
        flat.append(plain)
        return ()
    shapes = {_shape(item, flat, place) for item in plain}
    if len(shapes) > 1:
        raise refused(place, "rows of one length", plain)
    return (len(plain), *(shapes.pop() if shapes else ()))
