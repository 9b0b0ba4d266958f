"""Parse quantities that users type: a number with a required unit, converted to metres or radians."""

from __future__ import annotations

import math
import re

from tanteo.errors import UnitError, did_you_mean

_SHORT = 2
"""Largest number of letters of a unit for which a similar name is another unit rather than a typing error."""

LENGTH_UNITS = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "in": 0.0254}
"""Metres per unit of length."""

ANGLE_UNITS = {"deg": math.pi / 180, "rad": 1.0}
"""Radians per unit of angle."""

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WRITTEN = {"µm": "um", "μm": "um", "°": "deg", '"': "in"}


def parse_length(text: str, name: str = "length") -> float:
    """Return a length in metres from a text such as ``'0.3mm'``, ``'200um'`` or ``'0.01in'``.

    Args:
        text: number and unit, with or without a space between them.
        name: name of the input, for messages.

    Raises:
        UnitError: the number or the unit is missing, the unit is unknown, or there is more than one number.
    """
    values = parse_lengths(text, name)
    if len(values) != 1:
        raise UnitError(f"{name}: expected one length such as 0.3mm, got '{text}'. Give one number.")
    return values[0]


def parse_lengths(text: str, name: str = "lengths") -> tuple[float, ...]:
    """Return lengths in metres from a text such as ``'1.5,1.5,0.3mm'``, where the last unit applies to all without one.

    Args:
        text: numbers with units, separated by commas.
        name: name of the input, for messages.

    Raises:
        UnitError: a number or the unit is missing, or a unit is unknown.
    """
    return parse_quantities(text, name, LENGTH_UNITS, "0.3mm")


def parse_angle(text: str, name: str = "angle") -> float:
    """Return an angle in radians from a text such as ``'2deg'`` or ``'0.01 rad'``.

    Args:
        text: number and unit.
        name: name of the input, for messages.

    Raises:
        UnitError: the number or the unit is missing, the unit is unknown, or there is more than one number.
    """
    values = parse_quantities(text, name, ANGLE_UNITS, "2deg")
    if len(values) != 1:
        raise UnitError(f"{name}: expected one angle such as 2deg, got '{text}'. Give one number.")
    return values[0]


def parse_lengths_angles(text: str, name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return lengths in metres and angles in radians from a text such as ``'400,200,0mm 0,0,90deg'``.

    A unit applies to itself and to the numbers before it that have none.

    Args:
        text: lengths, then angles.
        name: name of the input, for messages.

    Raises:
        UnitError: there are no numbers, a unit is missing or unknown, or an angle stands before a length.
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
    """Return the metres per length unit.

    Args:
        unit: name of the unit.
        name: name of the input, for messages.

    Raises:
        UnitError: the unit is not mm, m, um or in.
    """
    return _factor(unit, name, LENGTH_UNITS)


def angle_unit(unit: str, name: str) -> float:
    """Return the radians per angle unit.

    Args:
        unit: name of the unit.
        name: name of the input, for messages.

    Raises:
        UnitError: the unit is not deg or rad.
    """
    return _factor(unit, name, ANGLE_UNITS)


def parse_quantities(text: str, name: str, units: dict[str, float], example: str) -> tuple[float, ...]:
    """Return quantities in the base unit from a text, in which the last unit applies to all numbers without one.

    Args:
        text: numbers with units, separated by commas.
        name: name of the input, for messages.
        units: factor from each accepted unit to the base unit.
        example: correct form, for messages.

    Raises:
        UnitError: a number or the unit is missing, or a unit is unknown.
    """
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
        likely_typo = len(unit) > _SHORT or unit.lower() in units  # cm is not a misspelt m
        suggestion = did_you_mean(unit, units) if likely_typo else ""
        raise UnitError(f"{name}: expected a unit of {', '.join(units)}, got '{unit}'.{suggestion}")
    return units[unit]
