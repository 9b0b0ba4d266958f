"""Define tables of documents, whose annotations state keys, units, ranges and defaults, and their positions."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cache
from typing import Annotated, Any, cast, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from msgspec import NODEFAULT, Meta

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.io.readings.units import ANGLE_UNITS, LENGTH_UNITS
from tanteo.sensors import Column

_UNITS: Mapping[str, Mapping[str, float]] = {
    "length": LENGTH_UNITS, "angle": ANGLE_UNITS, "time": {"ms": 1e-3, "s": 1.0}, "rate": {"hz": 1.0},
    "speed": {f"{unit}_s": factor for unit, factor in LENGTH_UNITS.items()},
    "turn": {f"{unit}_s": factor for unit, factor in ANGLE_UNITS.items()}, "plain": {"": 1.0},
}  # fmt: skip
_HEAD, _KEY = re.compile(r"\s*\[+([^\[\],]+)\]+\s*(#.*)?$"), re.compile(r"\s*([\w-]+)\s*=")


@dataclass(frozen=True, slots=True)
class Numbers:
    """Annotation of a numeric field; its numbers must be finite.

    Attributes:
        of: quantity: length, angle, time, speed, turn, rate (the key ends in a unit) or plain.
        shapes: accepted array shapes; empty to accept any.
        rule: function that converts an accepted array, or returns None to refuse it.
        words: description of accepted values, besides the shape.
        digits: number of significant digits to write.
        others: further keys of the same field, without unit.
    """

    of: str = "plain"
    shapes: tuple[tuple[int, ...], ...] = ((),)
    rule: Callable[[FloatArray], FloatArray | None] | None = None
    words: str = ""
    digits: int = 6
    others: tuple[str, ...] = ()

    def keys(self, name: str) -> dict[str, float]:
        """Return the keys of a field with their factors to SI.

        Args:
            name: name of the field.
        """
        ends = {f"{name}_{unit}" if unit else name: factor for unit, factor in _UNITS[self.of].items()}
        return {**ends, **dict.fromkeys(self.others, 1.0)}


def _direction(d: FloatArray) -> FloatArray | None:
    length = np.linalg.norm(d)
    return None if length < 1e-9 else np.asarray(d / length)


Number = Annotated[float, Numbers()]
Length = Annotated[float, Numbers("length")]
Point = Annotated[FloatArray, Numbers("length", ((3,),), digits=10)]
Angles = Annotated[FloatArray, Numbers("angle", ((3,),))]
Direction = Annotated[FloatArray, Numbers("plain", ((3,),), _direction, "a direction that is not zero", 17)]
Quaternion = Annotated[
    FloatArray,
    Numbers("plain", ((4,),), lambda q: q if abs(np.linalg.norm(q) - 1) < 1e-3 else None, "unit length", 12),
]
Covariance = Annotated[FloatArray, Numbers("plain", ((6, 6), (36,)), lambda C: C.reshape(6, 6), digits=17)]


@dataclass(frozen=True, slots=True)
class Place:
    """Position of a table in a file, for error messages.

    Attributes:
        file: path of the file.
        advice: advice for all messages; empty for the default of each message.
        text: content of a TOML file, to find line numbers.
        tables: names of the table, outermost first.
        shown: name of the table for messages.
        table: parsed keys and values.
        written: key as written for each given field.
    """

    file: str
    advice: str = ""
    text: str = ""
    tables: tuple[str, ...] = ()
    shown: str = ""
    table: Mapping[str, Any] = field(default_factory=dict)
    written: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.file}, {self.shown}" if self.shown else self.file

    def inside(self, name: str, title: str = "") -> Place:
        """Return the position of a nested table.

        Args:
            name: name of the nested table.
            title: name for messages; empty for the dotted name.
        """
        shown = title or (f"{self.shown}.{show(name)}" if self.shown else show(name))
        return replace(self, tables=(*self.tables, name), shown=shown, table={}, written={})

    def has(self, *names: str) -> list[str]:
        """Return the names of the given fields among those passed.

        Args:
            names: names of fields.
        """
        return [name for name in names if name in self.written]

    def refused(self, name: str, expected: str, advice: str = "Correct it.", got: str = "") -> InputError:
        """Return the error for an invalid value of a field.

        Args:
            name: name of the field.
            expected: accepted values, as text.
            advice: correction to suggest.
            got: found value, as text; empty for the value as written.
        """
        key = self.written.get(name, name)
        got = got or show(repr(self.table.get(key)))
        more = f"{self.advice or advice}{self.line(key)}"
        return InputError(f"{self}, {show(key)}: expected {expected}, got {got}. {more}")

    def error(self, message: str, key: str = "", kind: type[InputError] = InputError) -> InputError:
        """Return an error for the table, or for one of its keys.

        Args:
            message: text of the error.
            key: key as written; empty for the table as a whole.
            kind: class of the error.
        """
        return kind(f"{self}{f', {show(key)}' if key in self.table else ''}: {message}{self.line(key)}")

    def line(self, key: str) -> str:
        """Return the line number of a key or nested table as a sentence; empty if it is not found.

        Args:
            key: key as written.
        """
        inside = ""
        for number, line in enumerate(self.text.splitlines(), 1):
            if head := _HEAD.match(line):
                inside = head[1].replace('"', "").strip()
            pair = _KEY.match(line) if inside == ".".join(self.tables) else None
            if (pair and pair[1] == key) or (head and key and inside == ".".join((*self.tables, key))):
                return f" See line {number}."
        return ""


class Table(msgspec.Struct, frozen=True, kw_only=True, eq=False):
    """Table of a document written by users; its fields are the keys without units.

    Attributes:
        at: position in the file.
    """

    at: Place

    def values(self) -> dict[str, Any]:
        """Return all fields by name, without the position."""
        return {name: getattr(self, name) for name in self.__struct_fields__ if name != "at"}


class Posed(Table, frozen=True, kw_only=True, eq=False):
    """Table with a pose; missing components are zero."""

    position: Point | None = None
    quaternion_wxyz: Quaternion | None = None
    turn: Angles | None = None

    def pose(self) -> Transforms:
        """Return the pose ``(4, 4)`` [m] from a quaternion or from roll, pitch and yaw."""
        if self.turn is not None and self.quaternion_wxyz is not None:
            raise self.at.error("expected turn_deg or quaternion_wxyz, got both. Give one.")
        if self.quaternion_wxyz is not None:
            R = SO3.from_quaternion(self.quaternion_wxyz)
        else:
            roll, pitch, yaw = (0.0, 0.0, 0.0) if self.turn is None else self.turn
            R = SO3.axis_rotation(2, yaw) @ SO3.axis_rotation(1, pitch) @ SO3.axis_rotation(0, roll)
        return SE3.from_parts(R, np.zeros(3) if self.position is None else self.position)


def show(value: Any, most: int = 60) -> str:
    """Return a value for a message, cut to a number of characters.

    Args:
        value: value as read.
        most: largest number of characters.
    """
    text = value if isinstance(value, str) else _bounded_repr(value)
    return text if len(text) <= most else f"{text[: most - 3]}..."


def _bounded_repr(value: Any) -> str:
    try:
        return repr(value)
    except ValueError:  # a whole number with more digits than Python converts
        return f"a number of about {int(math.log10(2) * value.bit_length())} digits"


@cache
def fields_of(kind: type) -> dict[str, tuple[Any, Any]]:
    """Return annotation and default of each field; fields of data classes have no default.

    Args:
        kind: table or data class.
    """
    annotations = get_type_hints(kind, include_extras=True)
    if issubclass(kind, Table):
        return {f.name: (annotations[f.name], f.default) for f in msgspec.structs.fields(kind) if f.name != "at"}
    return {f.name: (annotations[f.name], NODEFAULT) for f in fields(cast(Any, kind)) if f.init}


def unwrapped(annotation: Any) -> tuple[Any, Numbers | None, Meta | None]:
    """Return type, numeric annotation and constraints of a annotation.

    Args:
        annotation: annotation of a field.
    """
    numbers = None
    meta = None
    if get_origin(annotation) is Annotated:
        annotation, *more = get_args(annotation)
        numbers = next((m for m in more if isinstance(m, Numbers)), None)
        meta = next((m for m in more if isinstance(m, Meta)), None)
    # NumPy's NDArray is an alias of the type statement from 2.5 on
    alias = getattr(get_origin(annotation), "__value__", None)
    return annotation if alias is None else alias[get_args(annotation)], numbers, meta


def numbers_of(annotation: Any) -> Numbers:
    """Return the numeric annotation of a annotation, or of its alternatives.

    Args:
        annotation: annotation of a field.
    """
    return next((n for h in (annotation, *get_args(annotation)) if (n := unwrapped(h)[1]) is not None), Numbers())


@cache
def keys_of(kind: type) -> dict[str, tuple[str, float]]:
    """Return field name and factor to SI for each accepted key of a table.

    Args:
        kind: table or data class.
    """
    numbers = {name: numbers_of(annotation) for name, (annotation, _) in fields_of(kind).items()}
    return {key: (name, factor) for name, one in numbers.items() for key, factor in one.keys(name).items()}


def is_table(kind: Any) -> bool:
    """Return whether values of a type are written as tables.

    Args:
        kind: type of a field.
    """
    return isinstance(kind, type) and (issubclass(kind, Table) or is_dataclass(kind))


def as_plain(value: Any) -> Any:
    """Return a value as dictionaries, lists, strings and numbers, without loss of digits, for :func:`value` to read.

    Args:
        value: table, data class, array or plain value.
    """
    if isinstance(value, Column):
        return as_plain(value.filled(np.nan))
    if is_dataclass(value) or isinstance(value, Table):
        return {name: as_plain(getattr(value, name)) for name in fields_of(cast(Any, type(value)))}
    if isinstance(value, np.ndarray | np.generic):
        return as_plain(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [as_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {key: as_plain(item) for key, item in value.items()}
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def toml_lines(one: Table) -> list[str]:
    """Return the TOML lines of a table: all fields that are not None, in class order, in the first unit of each.

    Args:
        one: table to write.
    """
    lines = []
    for name, (annotation, _) in fields_of(type(one)).items():
        got = getattr(one, name)
        if isinstance(got, str):
            lines.append(f"{name} = {msgspec.json.encode(got).decode()}")
        elif isinstance(got, list):
            lines.append(f"{name} = {got}")
        elif got is not None:
            numbers = numbers_of(annotation)
            key, factor = next(iter(numbers.keys(name).items()))
            lines.append(f"{key} = {_written(np.asarray(got) / factor, numbers.digits)}")
    return lines


def _written(values: FloatArray, digits: int) -> str:
    if values.ndim == 2:
        return "[\n" + "".join(f"  {_written(row, digits)},\n" for row in values) + "]"
    if values.ndim == 1:
        return f"[{', '.join(_written(v, digits) for v in values)}]"
    return f"{float(values):.{digits}g}" if values else "0"
