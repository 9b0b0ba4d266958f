"""Parse global properties of the object that a user types: mass, material density, sides of the bounding box."""

from __future__ import annotations

from tanteo.errors import InputError
from tanteo.io.poses.prior_text import value_and_sd
from tanteo.io.readings.units import parse_lengths, parse_quantities

_MASS_UNITS = {"g": 1e-3, "kg": 1.0, "mg": 1e-6, "lb": 0.45359237, "oz": 0.028349523125}
_DENSITY_UNITS = {"g/cm3": 1e3, "kg/m3": 1.0, "kg/dm3": 1e3}
_MASS, _DENSITY, _SIZE = "340g+-2g", "7.85g/cm3+-1%", "120,80,50mm+-1mm"


def parse_mass(text: str, name: str = "mass") -> tuple[float, float]:
    """Return a mass and its standard deviation [kg] from a text such as ``'340g+-2g'`` or ``'0.34kg+-1%'``.

    Args:
        text: mass and standard deviation, separated by ``+-``.
        name: name of the input, for messages.

    Raises:
        InputError: the standard deviation is missing, or a number is not positive.
        UnitError: the unit is missing or unknown.

    Example:
        >>> from tanteo.io.documents.whole_text import parse_mass
        >>> parse_mass("2kg+-5%")
        (2.0, 0.1)
    """
    return _with_sd(text, name, _MASS_UNITS, _MASS)


def parse_density(text: str, name: str = "density") -> tuple[float, float]:
    """Return a density and its standard deviation [kg/m^3] from a text such as ``'7.85g/cm3+-1%'``.

    Args:
        text: density and standard deviation, separated by ``+-``.
        name: name of the input, for messages.

    Raises:
        InputError: the standard deviation is missing, or a number is not positive.
        UnitError: the unit is missing or unknown.

    Example:
        >>> from tanteo.io.documents.whole_text import parse_density
        >>> parse_density("8g/cm3+-1%")
        (8000.0, 80.0)
    """
    return _with_sd(text, name, _DENSITY_UNITS, _DENSITY)


def parse_size(text: str, name: str = "size") -> tuple[tuple[float, float, float], float]:
    """Return the sides of an object's smallest box and their standard deviation [m], from ``'120,80,50mm+-1mm'``.

    Args:
        text: three sides and one standard deviation, separated by ``+-``.
        name: name of the input, for messages.

    Raises:
        InputError: there are not three sides, the standard deviation is missing, or a number is not positive.
        UnitError: the unit is missing or unknown.

    Example:
        >>> from tanteo.io.documents.whole_text import parse_size
        >>> parse_size("2,1,1m+-1mm")
        ((2.0, 1.0, 1.0), 0.001)
    """
    lengths, spread = value_and_sd(text, name, _SIZE)
    sides = parse_lengths(lengths, name)
    sds = parse_lengths(spread, name)
    if len(sides) != 3 or len(sds) != 1 or min(*sides, *sds) <= 0:
        raise InputError(f"{name}: expected three positive sides and one sd, got '{text}'. Write it as {_SIZE}.")
    return (sides[0], sides[1], sides[2]), sds[0]


def _with_sd(text: str, name: str, units: dict[str, float], example: str) -> tuple[float, float]:
    value_text, spread = value_and_sd(text, name, example)
    values = parse_quantities(value_text, name, units, example)
    if spread.endswith("%"):
        share = parse_quantities(f"{spread[:-1]}%", name, {"%": 0.01}, example)
        sds = tuple(one * values[0] for one in share)
    else:
        sds = parse_quantities(spread, name, units, example)
    if len(values) != 1 or len(sds) != 1 or values[0] <= 0 or sds[0] <= 0:
        raise InputError(f"{name}: expected a positive value and its sd, got '{text}'. Write it as {example}.")
    return values[0], sds[0]
