"""Interpret range values that are no distances: codes of devices, infinity, words, and the largest range itself.

A value has the meaning that the user states, else that of the device (``tanteo.sensors.presets``), else that of ROS
REP 117: plus infinity means that nothing was in range, minus infinity too near, NaN no valid measurement. Nothing in
range becomes a free-space ray; too near and no measurement exclude the row. A value that no device would measure is
refused where its meaning is unknown.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo.errors import InputError, ReadingsError
from tanteo.geometry.typing import BoolArray, FloatArray
from tanteo.io.logs.log import counted
from tanteo.io.readings.units import LENGTH_UNITS
from tanteo.sensors.presets import codes_of, known_codes, sensor_presets

if TYPE_CHECKING:
    from tanteo.io.readings.stated import Stated

_REP_117 = {
    "inf": "none", "+inf": "none", "infinity": "none", "+infinity": "none", "-inf": "invalid", "-infinity": "invalid",
    "nan": "invalid", "+nan": "invalid", "-nan": "invalid",
}  # fmt: skip
_MARK = {"none": "none", "near": "invalid", "error": "invalid"}
_FAR = 4_000.0
"""Smallest code that is suspected of a device without known codes [mm]; no shipped preset has a larger range."""
_BEYOND = 100.0
"""Largest distance [m]; a larger number of a few readings is a code."""
_CLOSE = 1e-9
"""Relative difference within which two numbers of a file are the same."""
_FEW = 0.2
"""Largest fraction of ranges outside the limits of the device that are excluded; more suggest a wrong unit."""
_HEAP = 3
"""Number of equal largest ranges from which they are a heap, if no other range occurs half as often, and number of
other distinct ranges that are needed to see it."""


@dataclass(frozen=True, slots=True)
class Special:
    """Value that the user states to be no distance.

    Attributes:
        text: value as typed.
        number: number in the file's unit, or in metres where ``is_metres``; NaN for a word.
        is_metres: whether the value was typed with a unit.
        mark: ``none`` where nothing was in range, ``invalid`` where the row is excluded.
    """

    text: str
    number: float
    is_metres: bool
    mark: str


def parse_special(texts: Sequence[str] | str | None, name: str, mark: str) -> tuple[Special, ...]:
    """Return the special values of a text such as ``8190``, ``65535,-1``, ``1200mm`` or ``OL``.

    Args:
        texts: values, separated by commas.
        name: name of the option, for messages.
        mark: ``none`` or ``invalid``.

    Raises:
        InputError: a value is empty.
    """
    given = [texts] if isinstance(texts, str) else list(texts or ())
    out = []
    for word in (part.strip() for text in given for part in text.split(",")):
        if not word:
            raise InputError(f"{name}: expected values such as 8190, 0 or OL, got '{','.join(given)}'. Name them.")
        unit = next((u for u in LENGTH_UNITS if word.endswith(u) and _number(word[: -len(u)]) is not None), "")
        number = _number(word.removesuffix(unit)) if unit else _number(word)
        factor = LENGTH_UNITS[unit] if unit else 1.0
        out.append(Special(word.lower(), math.nan if number is None else number * factor, bool(unit), mark))
    return tuple(out)


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """Range cells with their special values separated.

    Attributes:
        cells: cells, empty where the value is no distance.
        marks: ``none``, ``invalid`` or empty for each cell.
        words: special values with their marks, for notes.
        strange: index of the first cell whose meaning is unknown; None if there is none.
        why: sentence on the strange cell.
    """

    cells: list[str]
    marks: list[str]
    words: tuple[tuple[str, str], ...]
    strange: int | None
    why: str


def decode(cells: Sequence[str], sensors: Sequence[str] | None, metre: float, stated: Stated) -> Decoded:
    """Return range cells with the special values of their devices separated from the distances.

    Args:
        cells: cells of the range column.
        sensors: sensor of each cell; None if the file has no such column.
        metre: metres per unit of the column.
        stated: options of the user, with the rig and the preset of the sensors.
    """
    bare = [cell.strip() for cell in cells]
    values = np.array([math.nan if (number := _number(cell)) is None else number for cell in bare])
    marks = np.full(len(bare), "", dtype="U7")
    for special in stated.special:
        hit = np.array([cell.lower() == special.text for cell in bare], dtype=bool)
        scale = metre if special.is_metres else 1.0
        hit |= np.isclose(values * scale, special.number, rtol=_CLOSE, atol=0.0)
        marks[hit & (marks == "")] = special.mark
    presets = np.array([preset_of(name, stated) for name in (sensors or [""] * len(bare))], dtype=object)
    for preset in dict.fromkeys(presets.tolist()):
        for value, meaning in codes_of(preset).items():
            hit = (presets == preset) & _equal(values, value, metre)
            marks[hit & (marks == "")] = _MARK[meaning]
    for k, cell in enumerate(bare):
        if not marks[k] and cell.lower() in _REP_117:
            marks[k] = _REP_117[cell.lower()]
    strange, why = _strange(bare, values, marks, presets, metre)
    words = tuple(dict.fromkeys((bare[k], str(marks[k])) for k in np.flatnonzero(marks != "")))
    return Decoded(["" if m else c for c, m in zip(bare, marks, strict=True)], marks.tolist(), words, strange, why)


def _strange(
    bare: list[str], values: FloatArray, marks: np.ndarray, presets: np.ndarray, metre: float
) -> tuple[int | None, str]:
    """Return the first cell that is no distance of unknown meaning, and a sentence on it."""
    unmarked = marks == ""
    below = np.flatnonzero(unmarked & ((values <= 0) | (values * metre > _BEYOND)))
    lettered = np.flatnonzero(unmarked & np.isnan(values) & np.array([bool(cell) for cell in bare], dtype=bool))
    codes = {value: names for value, names in known_codes().items() if value >= _FAR}
    far = [
        (int(rows[0]), names)
        for value, names in codes.items()
        if len(rows := np.flatnonzero(unmarked & (presets == "") & _equal(values, value, metre))) > 1
    ]
    first = sorted([(int(rows[0]), ()) for rows in (below, lettered) if len(rows)] + far)
    if not first:
        return None, ""
    k, names = first[0]
    known = names or known_codes().get(float(values[k]) if np.isfinite(values[k]) else math.nan, ())
    like = f", as {' and '.join(known[:3])} write{'s' if len(known) == 1 else ''} it" if known else ""
    typed = shlex.quote(bare[k][:30])
    return k, (
        f"a distance, got '{bare[k][:30]}', probably a code for no measurement{like}. State what it means: "
        f"--no-target {typed} if nothing was in range (or status none in the row), --invalid {typed} "
        "to exclude the row, or name the sensor's preset in the rig or with --sensor"
    )


def preset_of(name: str, stated: Stated) -> str:
    """Return the preset of a sensor: that of the rig, its own name, or the stated one; empty if unknown.

    Args:
        name: name in the sensor column; empty if the row names none.
        stated: options of the user.
    """
    mounted = {} if stated.rig is None else {s.name: s.preset for s in stated.rig.sensors}
    if name in mounted:
        preset = mounted[name]
        return "" if preset is None else preset.name
    return name if name in sensor_presets() else (stated.sensor or "")


def mark_reach(columns: dict[str, Any], n: int, stated: Stated, notes: list[str]) -> None:
    """Turn ranges of exactly the largest range into free-space rays, and note a heap of equal largest ranges.

    Devices and drivers write their largest range where nothing is in range. A ray that is free up to the largest range
    is what such a value states in either case.

    Args:
        columns: columns of a file in SI units; ranges, reaches and masks are replaced.
        n: number of rows.
        stated: options of the user.
        notes: notes, which are extended.
    """
    ranges = columns.get("ranges")
    if ranges is None:
        return
    ranges = np.array(ranges, dtype=np.float64)
    free = np.zeros(n, dtype=bool) if columns.get("is_free") is None else np.array(columns["is_free"], dtype=bool)
    reach = _reach(columns, n, stated)
    clipped = ~free & np.isclose(ranges, reach, rtol=_CLOSE, atol=0.0)
    if clipped.any():
        lengths = ", ".join(f"{1e3 * value:g} mm" for value in sorted(set(ranges[clipped].tolist())))
        notes.append(
            f"{counted(int(clipped.sum()), 'range')} of exactly the sensor's reach ({lengths}) mean that nothing was "
            "in range: they are read as free-space rays. Give a larger max_mm if these are distances."
        )
        own = columns.get("max_ranges")
        own = np.full(n, np.nan) if own is None else np.array(own, dtype=np.float64)
        columns["max_ranges"] = np.where(clipped, ranges, own)
        columns["ranges"], columns["is_free"] = np.where(clipped, np.nan, ranges), free | clipped
    else:
        _note_heap(ranges[~free & np.isfinite(ranges)], notes)


def _reach(columns: dict[str, Any], n: int, stated: Stated) -> FloatArray:
    """Return the largest range of each row's sensor [m]; NaN if unknown."""
    names = columns.get("sensors")
    mounted = {} if stated.rig is None else {s.name: s for s in stated.rig.sensors}
    reaches: dict[str, float] = {}
    for name in set(names or [""]):
        sensor = mounted.get(name)
        own = math.nan if sensor is None else sensor.max_range
        preset = sensor_presets().get(preset_of(name, stated))
        reaches[name] = own if not math.isnan(own) else (preset.max_range if preset is not None else math.nan)
    out = np.array([reaches[name] for name in names]) if names else np.full(n, reaches.get("", math.nan))
    own_max = columns.get("max_ranges")
    return out if own_max is None else np.where(np.isnan(own_max), out, own_max)


def mark_outside(columns: dict[str, Any], n: int, stated: Stated, notes: list[str]) -> list[int]:
    """Return the rows to keep: without ranges outside the limits of their device, if these are few.

    A range below the smallest one is no measurement (REP 117). If most ranges are outside, the unit or the device is
    wrong, which is refused later.

    Args:
        columns: columns of a file in SI units.
        n: number of rows.
        stated: options of the user.
        notes: notes, which are extended.
    """
    ranges = columns.get("ranges")
    if ranges is None:
        return list(range(n))
    names = columns.get("sensors") or [""] * n
    nearest = {name: _nearest(name, stated) for name in set(names)}
    given = np.array(ranges, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        near = given < np.array([nearest[name] for name in names])
        far = given > _reach(columns, n, stated)
    outside = near | far
    if not outside.any() or outside.sum() > _FEW * np.isfinite(given).sum():
        return list(range(n))
    parts = [
        f"{counted(int(mask.sum()), 'range')} {words}"
        for mask, words in ((near, "below the smallest one"), (far, "beyond the largest one"))
        if mask.any()
    ]
    notes.append(f"{' and '.join(parts)} of the device were excluded.")
    return np.flatnonzero(~outside).tolist()


def _nearest(name: str, stated: Stated) -> float:
    preset = sensor_presets().get(preset_of(name, stated))
    return 0.0 if preset is None or preset.is_contact else preset.min_range


def _note_heap(ranges: FloatArray, notes: list[str]) -> None:
    if len(ranges) <= _HEAP:
        return
    values, counts = np.unique(ranges, return_counts=True)
    others = int(counts[:-1].max(initial=0))
    if counts[-1] >= _HEAP and len(values) > _HEAP and counts[-1] >= 2 * others:
        notes.append(
            f"{counts[-1]} of {len(ranges)} ranges are exactly the largest one, {1e3 * values[-1]:.6g} mm. If the "
            f"device writes it where nothing is in range, use --no-target {1e3 * values[-1]:.6g}mm."
        )


def is_code(cell: str) -> bool:
    """Return whether a cell cannot be a distance: a word, zero or a negative number.

    Args:
        cell: cell of a range column.
    """
    number = _number(cell)
    return number is None or number <= 0


def _equal(values: FloatArray, code: float, metre: float) -> BoolArray:
    """Return where values of a column are a code, converted to the column's unit or as the device writes it."""
    hit = np.isclose(values * metre, 1e-3 * code, rtol=_CLOSE, atol=0.0)
    return np.asarray(hit | (values == code) if code <= 0 else hit)


def _number(word: str) -> float | None:
    try:
        number = float(word) if word.isascii() and "_" not in word else math.nan
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def refuse_strange(place: str, decoded: Decoded) -> None:
    """Refuse a cell whose meaning is unknown.

    Args:
        place: file, line and column for messages.
        decoded: decoded cells.

    Raises:
        ReadingsError: there is a strange cell.
    """
    if decoded.strange is not None:
        raise ReadingsError(f"{place}: expected {decoded.why}.")


def note_on_codes(words: Sequence[tuple[str, str]], marks: Sequence[str]) -> str:
    """Return a sentence on special values; empty if there were none.

    Args:
        words: special values with their marks.
        marks: marks of all rows.
    """
    parts = []
    for mark, meant in (
        ("none", "mean that nothing was in range"),
        ("invalid", "are no measurements and were excluded"),
    ):
        count = sum(one == mark for one in marks)
        listed = ", ".join(dict.fromkeys(word for word, its in words if its == mark))
        if count and listed:
            parts.append(f"{counted(count, 'range')} ({listed}) {meant}")
    return f"{'; '.join(parts)}." if parts else ""
