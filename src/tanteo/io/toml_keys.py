"""Tables of a TOML file whose keys carry their unit: values come out in metres, seconds and radians, checked."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import InputError, UnitError, did_you_mean
from tanteo.io.units import ANGLE_UNITS, LENGTH_UNITS
from tanteo.lie import SE3, SO3
from tanteo.typing import FloatArray, Transforms

_TIMES = {"ms": 1e-3, "s": 1.0}
_SPEEDS = {f"{unit}_s": factor for unit, factor in LENGTH_UNITS.items()}
_TURNS = {f"{unit}_s": factor for unit, factor in ANGLE_UNITS.items()}
_UNITS: Mapping[str, Mapping[str, float]] = {
    "length": LENGTH_UNITS, "angle": ANGLE_UNITS, "time": _TIMES, "speed": _SPEEDS, "turn": _TURNS,
    "rate": {"hz": 1.0}, "plain": {"": 1.0},
}  # fmt: skip

POSE = {"position": "length", "quaternion_wxyz": "plain", "turn": "angle"}
"""Quantities of a pose; see :func:`pose_of`."""


def load_toml(path: Path, what: str) -> dict[str, Any]:
    """The document.

    Raises:
        InputError: It cannot be read or is not TOML; the message names the file.
    """
    try:
        return tomllib.loads(path.read_bytes().decode())
    except OSError as error:
        why = error.strerror or str(error)
        raise InputError(f"{path}: expected a {what}, got: {why}. Check the path.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: expected TOML, got: {error}. Correct the file.") from None


class Keys:
    """One table: what is asked for by name is checked and converted; what nobody knows is refused.

    Args:
        table: As read.
        place: File and table, for messages.
        quantities: Names without unit, and of what they are: length, angle, time, speed, turn, rate or plain.
        words: Names whose values are texts.

    Raises:
        InputError: Not a table, or a key that is not known, with the nearest name.
        UnitError: A unit is missing or unknown.
    """

    def __init__(self, table: Any, place: str, quantities: Mapping[str, str], words: Sequence[str] = ()) -> None:
        if not isinstance(table, dict):
            raise InputError(f"{place}: expected a table, got {table!r}. Write [name] and its keys below.")
        self.place, self._quantities = place, quantities
        self._values: dict[str, FloatArray] = {}
        self._written: dict[str, tuple[str, Any]] = {}
        self._words: dict[str, str] = {}
        for key, value in table.items():
            if key in words:
                if not isinstance(value, str):
                    raise InputError(f"{place}, {key}: expected a text, got {value!r}. Write it in quotes.")
                self._words[key] = value
            else:
                self._take(key, value, list(words))

    def _take(self, key: str, value: Any, words: list[str]) -> None:
        for name, what in self._quantities.items():
            unit = key.removeprefix(name).removeprefix("_") if key.startswith(name) else None
            if unit is not None and unit in _UNITS[what] and key == (f"{name}_{unit}" if unit else name):
                if name in self._values:
                    raise UnitError(f"{self.place}, {key}: expected '{name}' once, got it in two units. Keep one.")
                self._values[name] = self._numbers(key, value) * _UNITS[what][unit]
                self._written[name] = key, value
                return
        for name, what in self._quantities.items():
            if key == name or (key.startswith(f"{name}_") and what != "plain"):
                listed = ", ".join(f"{name}_{unit}" for unit in _UNITS[what])
                raise UnitError(
                    f"{self.place}, {key}: expected one of {listed}, got '{key}'. Say the unit in the name."
                )
        known = [*words, *(self._shown(name) for name in self._quantities)]
        raise InputError(f"{self.place}: expected one of {', '.join(known)}, got '{key}'.{did_you_mean(key, known)}")

    def _shown(self, name: str) -> str:
        unit = next(iter(_UNITS[self._quantities[name]]))
        return f"{name}_{unit}" if unit else name

    def _numbers(self, key: str, value: Any) -> FloatArray:
        items = value if isinstance(value, list) else [value]
        good = all(isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in items)
        if not good or not items:
            raise InputError(f"{self.place}, {key}: expected finite numbers, got {value!r}. Correct it.")
        return np.asarray(value, dtype=np.float64)

    def __contains__(self, name: str) -> bool:
        return name in self._values or name in self._words

    def size(self, name: str) -> int:
        """How many numbers a quantity has; none if it is not given."""
        return self._values[name].size if name in self._values else 0

    def word(self, name: str, default: str | None = None) -> str:
        """A text; required without a default."""
        if name not in self._words:
            if default is None:
                raise InputError(f"{self.place}: expected '{name}', got nothing. Add it.")
            return default
        return self._words[name]

    def number(self, name: str, default: float | None = None, *, least: float = -math.inf) -> float:
        """One number, at least ``least``; required without a default."""
        if name not in self._values:
            if default is None:
                raise InputError(f"{self.place}: expected '{self._shown(name)}', got nothing. Add it.")
            return default
        value = self._values[name]
        if value.ndim or not value >= least:
            raise self.refused(name, "one number" if least == -math.inf else f"one number of {least:g} or more")
        return float(value)

    def vector(self, name: str, default: Sequence[float] | None = None, *, n: int = 3) -> FloatArray:
        """``n`` numbers; required without a default."""
        if name not in self._values:
            if default is None:
                raise InputError(f"{self.place}: expected '{self._shown(name)}' ({n} numbers), got nothing. Add it.")
            return np.asarray(default, dtype=np.float64)
        value = self._values[name]
        if value.shape != (n,):
            key = self._written[name][0]
            raise InputError(f"{self.place}, {key}: expected {n} numbers, got {value.size}. Correct it.")
        return value

    def refused(self, name: str, expected: str, advice: str = "Correct it.") -> InputError:
        """What is wrong with a quantity that was given, by its key and value as they are written."""
        key, value = self._written[name]
        return InputError(f"{self.place}, {key}: expected {expected}, got {value!r}. {advice}")


def pose_of(keys: Keys) -> Transforms:
    """The pose of a table with the keys :data:`POSE` ``(4, 4)``; what is not given is zero.

    Raises:
        InputError: The attitude is given twice, or a quaternion is not of unit length.
    """
    if "turn" in keys and "quaternion_wxyz" in keys:
        raise InputError(f"{keys.place}: expected turn_deg or quaternion_wxyz, got both. Give one.")
    if "quaternion_wxyz" in keys:
        q = keys.vector("quaternion_wxyz", n=4)
        if abs(np.linalg.norm(q) - 1) > 1e-3:
            raise InputError(f"{keys.place}, quaternion_wxyz: expected unit length, got {np.linalg.norm(q):.6g}.")
        R = SO3.from_quaternion(q)
    else:
        roll, pitch, yaw = keys.vector("turn", (0.0, 0.0, 0.0))
        R = SO3.axis_rotation(2, yaw) @ SO3.axis_rotation(1, pitch) @ SO3.axis_rotation(0, roll)
    return SE3.from_parts(R, keys.vector("position", (0.0, 0.0, 0.0)))
