"""Convert parsed documents (TOML, JSON) into the classes whose annotations they must match.

Documents written by users are :class:`~tanteo.io.documents.schema.Table` classes; records contain plain frozen data
classes.
Each error message names file, table, key and value, and for TOML the line.
"""

from __future__ import annotations

import math
import re
import tomllib
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, TypeVar, Union, cast, get_args, get_origin

import msgspec
import numpy as np
from msgspec import NODEFAULT, Meta

from tanteo.errors import InputError, UnitError, did_you_mean
from tanteo.geometry.typing import FloatArray
from tanteo.io.documents.schema import Numbers, Place, Table, fields_of, is_table, keys_of, numbers_of, show, unwrapped
from tanteo.parts import read_whole
from tanteo.sensors import Column

T = TypeVar("T")

_DEEP = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){50}""")
"""Pattern of dotted names with fifty parts, for which ``tomllib`` needs minutes."""

_TEXT_OR_COMMENT = re.compile(
    r'''(?s:"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\')|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*'''
)
"""Pattern of the texts and comments of TOML, in which dots separate no names."""

_NOT_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


def load_toml(path: Path, what: str, kind: type[T], text: str | None = None) -> T:
    """Read a TOML file into a document class.

    Args:
        path: file, also used in messages.
        what: kind of file, as text, for messages.
        kind: class of the document.
        text: content to parse instead of reading the file; None to read it.

    Raises:
        InputError: the file cannot be read, is not TOML, or does not match the class.
    """
    try:
        text = read_whole(path, f"a {what}").decode() if text is None else text
        if _DEEP.search(_TEXT_OR_COMMENT.sub(lambda match: '""' if match[0][0] != "#" else "", text)):
            raise InputError(f"{path}: expected a {what}, got a name in fifty others. Correct the file.")
        return table(kind, tomllib.loads(text), Place(str(path), text=text))
    except InputError:
        raise
    except ValueError as error:  # int() refuses thousands of digits, and tomllib does not convert that error
        raise InputError(f"{path}: expected TOML, got: {str(error)[:300].rstrip('.')}. Correct the file.") from None
    except RecursionError:
        raise InputError(f"{path}: expected a {what}, got tables in tables without end. Correct the file.") from None


def table(kind: type[T], raw: Any, place: Place, blank: Mapping[str, Any] = types.MappingProxyType({})) -> T:
    """Convert a parsed table to its :class:`Table` or data class.

    Args:
        kind: class that defines the fields.
        raw: parsed table.
        place: position of the table in the file, for messages.
        blank: values of fields that may be missing.

    Raises:
        InputError: ``raw`` is not a table, a key is unknown, missing or repeated, or a value does not match its field.
        UnitError: a unit is missing or unknown.
    """
    if not isinstance(raw, dict):
        advice = place.advice or "Write [name] and its keys below."
        expected = f"a table [{'.'.join(place.tables)}]" if place.text else "a table"
        raise InputError(f"{place}: expected {expected}, got {show(raw)}. {advice}")
    written: dict[str, str] = {}
    place = replace(place, table=raw, written=written)
    values: dict[str, Any] = {"at": place} if issubclass(kind, Table) else {}
    for key, item in raw.items():
        name, factor = _field(cast(Any, kind), key, place)
        if name in written:
            raise place.error(f"expected '{name}' once, got it in two units. Keep one.", key, UnitError)
        written[name] = key
        values[name] = value(fields_of(cast(Any, kind))[name][0], item, place, name, factor)
    for name, (annotation, default) in fields_of(cast(Any, kind)).items():
        if default is NODEFAULT and name not in values and name not in blank:
            raise place.error(f"expected {_wanted(name, annotation)}, got nothing. {place.advice or 'Add it.'}")
    return made(kind, {**blank, **values}, str(place))


def made(kind: Callable[..., T], values: Mapping[str, Any], place: str) -> T:
    """Call a function with keyword values, and prefix its error messages with the place.

    Args:
        kind: class or function to call.
        values: keyword arguments.
        place: position in the file, for messages.

    Raises:
        InputError: the function refuses the values.
    """
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def value(annotation: Any, raw: Any, place: Place, name: str, factor: float = 1.0) -> Any:
    """Convert a parsed value to its annotation: a table, a mapping, a sequence, an array, or a type of msgspec.

    Args:
        annotation: annotation of the field.
        raw: parsed value.
        place: position of the value's table, for messages.
        name: name of the field.
        factor: factor from the unit of the key to SI.

    Raises:
        InputError: the value does not match the annotation.
    """
    annotation, numbers, meta = unwrapped(annotation)
    origin = get_origin(annotation)
    kinds = get_args(annotation)
    if annotation is object:
        return raw
    if origin in (Union, types.UnionType):
        return _one_of(kinds, raw, place, name, factor)
    if annotation is Column:
        return Column.from_rows(_array(raw, np.float64, numbers, place, name, factor))
    if is_table(annotation):
        return table(annotation, raw, place.inside(name))
    if origin is Mapping:
        if not isinstance(raw, dict) or (not raw and meta is not None and meta.min_length):
            raise place.refused(name, _words(annotation, meta, name), "Write one for each.")
        title = (meta and meta.title) or ""
        inner = place.inside(name)
        return {k: table(kinds[1], v, inner.inside(k, title and f"{title} '{k}'")) for k, v in raw.items()}
    if origin is np.ndarray:
        return _array(raw, get_args(kinds[1])[0], numbers, place, name, factor)
    if origin in (tuple, Sequence):
        return _sequence(kinds, raw, place, name)
    if numbers is not None and not isinstance(raw, list):
        if not _is_number(raw):
            raise place.refused(name, "finite numbers")
        raw = raw * factor
    elif annotation is float and isinstance(raw, str):
        raw = _NOT_FINITE.get(raw, raw)
    try:
        return msgspec.convert(raw, Annotated[annotation, meta] if meta else annotation)
    except msgspec.ValidationError:
        advice = "Write it in quotes." if annotation is str else "Correct it."
        raise place.refused(name, _words(annotation, meta, name), advice) from None


def _field(kind: type, key: str, place: Place) -> tuple[str, float]:
    """Return the field name of a key, and the factor from its unit to SI."""
    if key in keys_of(kind):
        return keys_of(kind)[key]
    keys = {name: list(numbers_of(annotation).keys(name)) for name, (annotation, _) in fields_of(kind).items()}
    for name, own in sorted(keys.items(), reverse=True):
        if name not in own and (key == name or key.startswith(f"{name}_")):
            raise place.error(
                f"expected one of {', '.join(own)}, got '{show(key)}'. Write the unit in the name.", key, UnitError
            )
    known = [own[0] for own in keys.values()]
    annotation = did_you_mean(key, known) or " Correct the name."
    raise InputError(f"{place}: expected one of {', '.join(known)}, got '{show(key)}'.{annotation}{place.line(key)}")


def _wanted(name: str, annotation: Any) -> str:
    """Return the description of a missing field for messages."""
    bare, numbers, meta = unwrapped(annotation)
    if is_table(bare) or get_origin(bare) is Mapping:
        return _words(bare, meta, name)
    key = f"'{next(iter(numbers_of(annotation).keys(name)))}'"
    return f"{key} ({numbers.shapes[0][0]} numbers)" if numbers is not None and numbers.shapes[0] else key


def _words(annotation: Any, meta: Meta | None, name: str) -> str:
    """Return the description of an accepted value for messages."""
    if meta is not None and meta.description:
        return meta.description
    if is_table(annotation):
        return f"a table [{name}]"
    if get_origin(annotation) is Mapping:
        return f"tables [{name}.NAME]"
    kind = {float: "one number", str: "a text", int: "a whole number", bool: "true or false"}[annotation]
    if meta is None or meta.gt is meta.ge:
        return kind
    if meta.gt is not None:
        return "one positive number" if meta.gt == 0 else f"{kind} above {meta.gt:g}"
    return f"{kind} of {'zero' if meta.ge == 0 else f'{meta.ge:g}'} or more"


def _one_of(kinds: Sequence[Any], raw: Any, place: Place, name: str, factor: float) -> Any:
    if raw is None and type(None) in kinds:
        return None
    left = [kind for kind in kinds if kind is not type(None)]
    others = [kind for kind in left if kind is not str]
    return value(str if str in left and (isinstance(raw, str) or not others) else others[0], raw, place, name, factor)


def _sequence(kinds: tuple[Any, ...], raw: Any, place: Place, name: str) -> tuple[Any, ...]:
    if not isinstance(raw, list):
        raise place.refused(name, "a list")
    if len(kinds) == 1 or kinds[-1] is ...:
        kinds = kinds[:1] * len(raw)
    if len(raw) != len(kinds):
        raise place.refused(name, f"{len(kinds)} items")
    items = {f"{name}[{k}]": item for k, item in enumerate(raw)}
    inner = replace(place, table=items, written={})
    return tuple(value(kind, item, inner, key) for kind, (key, item) in zip(kinds, items.items(), strict=True))


def _is_number(cell: Any) -> bool:
    return isinstance(cell, int | float) and not isinstance(cell, bool) and abs(cell) < 1e300


def _array(raw: Any, dtype: type, numbers: Numbers | None, place: Place, name: str, factor: float) -> np.ndarray:
    """Return an array in SI units: finite numbers of an accepted shape, or any array that :func:`as_plain` wrote."""
    cells = np.array(raw, dtype=object)
    flat = cells.ravel().tolist()
    if dtype is np.float64:
        written = {} if numbers is not None else _NOT_FINITE
        good = all(_is_number(c) or (isinstance(c, str) and c in written) for c in flat)
        flat = [written.get(c, c) for c in flat] if good else flat
    else:
        whole = bool if dtype is np.bool_ else int
        good = all(type(c) is whole and abs(c) <= 2**62 for c in flat)
    if not good:
        words = {np.float64: "finite numbers" if numbers else "numbers", np.bool_: "true or false"}
        raise place.refused(name, words.get(dtype, "whole numbers"))
    values: np.ndarray = np.array(flat, dtype=dtype).reshape(cells.shape)
    return values if numbers is None else _checked(values * factor, numbers, place, name)


def _checked(values: FloatArray, numbers: Numbers, place: Place, name: str) -> FloatArray:
    if numbers.shapes and values.shape not in numbers.shapes:
        expected = " x ".join(map(str, numbers.shapes[0]))
        got = str(values.size) if expected else ""
        raise place.refused(name, f"{expected} numbers" if expected else numbers.words, got=got)
    made = values if numbers.rule is None else numbers.rule(values)
    if made is None:
        raise place.refused(name, numbers.words)
    return made
