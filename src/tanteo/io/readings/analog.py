"""Convert columns of volts or milliamperes to ranges by a scale of two points, as of laser displacement sensors."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tanteo.errors import InputError, ReadingsError
from tanteo.io.readings.headers import canonical
from tanteo.io.readings.units import parse_length

_UNITS = {"v": 1.0, "mv": 1e-3, "ma": 1.0, "a": 1e3}
"""Volts, or milliamperes, per unit."""
_VOLTS = ("v", "mv")
_NAMES = re.compile(
    r"(?:(?P<stem>range|analog|analogue|signal|out|output|sensor_out|ai\d*|ain\d*|voltage|current|volts?)_?)"
    r"(?P<unit>v|mv|ma|a)?"
)
_POINT = re.compile(r"\s*(-?\d+(?:\.\d+)?)\s*(mV|V|mA|A)\s*=\s*(.+?)\s*")
_BEYOND = 0.02
"""Fraction of the scale by which a signal may lie outside of it; NAMUR NE 43 reports faults beyond 2.5 %."""


@dataclass(frozen=True, slots=True)
class OutputRange:
    """Range of an analog output: two points of a line.

    Attributes:
        low: first signal [V or mA].
        high: second signal [V or mA].
        near: range at the first signal [m].
        far: range at the second signal [m].
        volts: whether the signal is a voltage; otherwise a current.
    """

    low: float
    high: float
    near: float
    far: float
    volts: bool

    def millimetres(self, signal: float) -> float | None:
        """Return the range of a signal [mm]; None outside of the scale.

        Args:
            signal: signal [V or mA].
        """
        share = (signal - self.low) / (self.high - self.low)
        return 1e3 * (self.near + share * (self.far - self.near)) if -_BEYOND <= share <= 1 + _BEYOND else None


def parse_scale(text: str, name: str = "analog") -> OutputRange:
    """Return the scale of a text such as ``0V=160mm,10V=450mm`` or ``4mA=20mm,20mA=70mm``.

    Args:
        text: two points: signal and range.
        name: name of the input, for messages.

    Raises:
        InputError: the text is something else.
        UnitError: the unit of a range is missing or unknown.
    """
    points = [_POINT.fullmatch(part) for part in text.split(",")]
    found = [
        (float(m[1]) * _UNITS[m[2].lower()], parse_length(m[3], name), m[2].lower() in _VOLTS) for m in points if m
    ]
    if len(points) != 2 or len(found) != 2 or found[0][2] != found[1][2] or found[0][0] == found[1][0]:
        raise InputError(f"{name}: expected two points such as 0V=160mm,10V=450mm, got '{text}'. Name both.")
    (low, near, volts), (high, far, _) = sorted(found)
    return OutputRange(low, high, near, far, volts)


@dataclass(frozen=True, slots=True)
class AnalogColumn:
    """Column of an analog signal in a table.

    Attributes:
        index: index of the column.
        factor: volts or milliamperes per unit of the column.
        scale: range of the signal.
    """

    index: int
    factor: float
    scale: OutputRange

    def rows(self, rows: Iterator[list[str]]) -> Iterator[list[str]]:
        """Yield rows with the signal as a range [mm]; outside of the scale it is ``nan``, which is no measurement.

        Args:
            rows: rows of the file.
        """
        for row in rows:
            cell = row[self.index].strip() if self.index < len(row) else ""
            try:
                signal = float(cell)
            except ValueError:
                yield row
                continue
            distance = self.scale.millimetres(signal * self.factor)
            yield [*row[: self.index], "nan" if distance is None else f"{distance:.9g}", *row[self.index + 1 :]]


def find_analog(header: Sequence[str], place: str, scale: OutputRange | None) -> AnalogColumn | None:
    """Return the column of an analog signal; None if the header has none.

    Args:
        header: cells of the header.
        place: file and line for messages.
        scale: stated scale; None if not stated.

    Raises:
        ReadingsError: there is a signal without a scale, a scale without a signal, or their kinds differ.
    """
    names = [canonical(cell) for cell in header]
    found = [(k, m) for k, name in enumerate(names) if (m := _NAMES.fullmatch(name)) and (m["unit"] or _implied(m))]
    if scale is None:
        if found and not any(name.startswith("range") and name.endswith(("mm", "_m", "um", "in")) for name in names):
            raise ReadingsError(
                f"{place}: expected --analog for the signal '{header[found[0][0]]}', got none. State the scale of the "
                "output, as --analog 0V=160mm,10V=450mm."
            )
        return None
    if len(found) != 1:
        have = ", ".join(header[k] for k, _ in found) or "none"
        raise ReadingsError(f"{place}: expected one column such as range_v or current_ma for --analog, got {have}.")
    k, match = found[0]
    unit = match["unit"] or _implied(match)
    if (unit in _VOLTS) != scale.volts:
        raise ReadingsError(f"{place}: expected --analog in the unit of '{header[k]}', got another. Correct it.")
    return AnalogColumn(k, _UNITS[unit], scale)


def _implied(match: re.Match[str]) -> str:
    stem = match["stem"]
    return "v" if stem in ("voltage", "volt", "volts") else "ma" if stem == "current" else ""
