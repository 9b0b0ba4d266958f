"""Quantities as people write them: a number and its unit, which is required. Out come metres and radians."""

from __future__ import annotations

import math
import re

from tanteo.errors import UnitError, did_you_mean

_SHORT = 2
"""Letters of a unit that is as likely another unit as a slip of the pen."""

LENGTH_UNITS = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "in": 0.0254}
"""Metres per unit."""

ANGLE_UNITS = {"deg": math.pi / 180, "rad": 1.0}
"""Radians per unit."""

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WRITTEN = {"µm": "um", "μm": "um", "°": "deg", '"': "in"}


def parse_length(text: str, name: str = "length") -> float:
    """``'0.3mm'``, ``'200um'``, ``'0.01in'`` -> metres.

    Args:
        text: Number and unit, with or without a space between.
        name: What it is called in messages.

    Raises:
        UnitError: No number, no unit, an unknown unit or more than one number.
    """
    values = parse_lengths(text, name)
    if len(values) != 1:
        raise UnitError(f"{name}: expected one length such as 0.3mm, got '{text}'. Give one number.")
    return values[0]


def parse_lengths(text: str, name: str = "lengths") -> tuple[float, ...]:
    """``'1.5,1.5,0.3mm'`` -> metres; the unit after the last number holds for all that have none.

    Raises:
        UnitError: As for :func:`parse_length`.
    """
    return parse_quantities(text, name, LENGTH_UNITS, "0.3mm")


def parse_angle(text: str, name: str = "angle") -> float:
    """``'2deg'``, ``'0.01 rad'`` -> radians.

    Raises:
        UnitError: As for :func:`parse_length`.
    """
    values = parse_quantities(text, name, ANGLE_UNITS, "2deg")
    if len(values) != 1:
        raise UnitError(f"{name}: expected one angle such as 2deg, got '{text}'. Give one number.")
    return values[0]


def parse_lengths_angles(text: str, name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """``'400,200,0mm 0,0,90deg'`` -> metres and radians; a unit holds for the numbers before it that have none.

    Raises:
        UnitError: No numbers, a unit missing or unknown, or an angle before a length.
    """
    example = "5mm 3deg"
    pairs = [_split(part, text, name, example) for part in re.split(r"[\s,]+(?=[+\-.\d])", text.strip())]
    values: tuple[list[float], list[float]] = ([], [])
    unit = pairs[-1][1]
    if not unit:
        raise UnitError(f"{name}: expected a unit behind the numbers as in {example}, got '{text}'. Say which it is.")
    for number, own in reversed(pairs):
        unit = own or unit
        angle = _WRITTEN.get(unit, unit) in ANGLE_UNITS
        if angle and values[0]:
            raise UnitError(f"{name}: expected lengths before angles as in {example}, got '{text}'. Change the order.")
        values[angle].insert(0, number * _factor(unit, name, {**LENGTH_UNITS, **ANGLE_UNITS}))
    return tuple(values[0]), tuple(values[1])


def length_unit(unit: str, name: str) -> float:
    """Metres per unit.

    Raises:
        UnitError: Not one of mm, m, um, in.
    """
    return _factor(unit, name, LENGTH_UNITS)


def angle_unit(unit: str, name: str) -> float:
    """Radians per unit.

    Raises:
        UnitError: Not one of deg, rad.
    """
    return _factor(unit, name, ANGLE_UNITS)


def parse_quantities(text: str, name: str, units: dict[str, float], example: str) -> tuple[float, ...]:
    """Numbers with one of some units; that after the last number holds for all that have none."""
    pairs = [_split(part, text, name, example) for part in text.split(",")]
    last = pairs[-1][1]
    if not last:
        listed = ", ".join(units)
        raise UnitError(f"{name}: expected a unit ({listed}) as in {example}, got '{text}'. Say which unit it is.")
    return tuple(number * _factor(unit or last, name, units) for number, unit in pairs)


def _split(part: str, text: str, name: str, example: str) -> tuple[float, str]:
    if ";" in text:
        raise UnitError(f"{name}: expected commas between the numbers, got '{text}'. Write a comma for each semicolon.")
    part = part.strip()
    match = _NUMBER.match(part)
    if match is None:
        raise UnitError(f"{name}: expected a number and its unit such as {example}, got '{text}'. Write it so.")
    value = float(match[0])
    if not math.isfinite(value):
        raise UnitError(f"{name}: expected a finite number, got '{text}'. Write a smaller one.")
    return value, part[match.end() :].strip()


def _factor(unit: str, name: str, units: dict[str, float]) -> float:
    unit = _WRITTEN.get(unit, unit)
    if unit not in units:
        alike = len(unit) > _SHORT or unit.lower() in units  # a cm is no m
        hint = did_you_mean(unit, units) if alike else ""
        raise UnitError(f"{name}: expected a unit of {', '.join(units)}, got '{unit}'.{hint}")
    return units[unit]
