"""Length units at the border: names that files and callers may use, and metres."""

from __future__ import annotations

from tanteo.errors import PartError, UnitError

METRES: dict[str, float] = {
    "um": 1e-6,
    "mm": 1e-3,
    "cm": 1e-2,
    "m": 1.0,
    "in": 0.0254,
    "ft": 0.3048,
}
"""Metres in one unit."""

_SPELLINGS: dict[str, str] = {
    "micron": "um",
    "micrometre": "um",
    "micrometer": "um",
    "millimetre": "mm",
    "millimeter": "mm",
    "centimetre": "cm",
    "centimeter": "cm",
    "metre": "m",
    "meter": "m",
    "inch": "in",
    "inche": "in",
    "foot": "ft",
    "feet": "ft",
}

SMALLEST_DIAGONAL = 5e-4
"""Bounding-box diagonal below which a part was probably read in too small a unit [m]."""

LARGEST_DIAGONAL = 50.0
"""Bounding-box diagonal above which a part was probably read in too large a unit [m]."""


def unit_name(text: str) -> str:
    """Return the short name of a length unit (``"Millimetres"`` gives ``"mm"``).

    Raises:
        UnitError: the text names no known length unit.
    """
    plain = str(text).strip().lower()
    short = _SPELLINGS.get(plain, _SPELLINGS.get(plain.removesuffix("s"), plain))
    if short not in METRES:
        raise UnitError(f"unit: expected one of {', '.join(METRES)}, got {text!r}. Name the unit of the file.")
    return short


def check_size(diagonal: float, unit: str, label: str, *, stated: bool) -> None:
    """Refuse a part whose size says that it was read in the wrong unit.

    Args:
        diagonal: of the bounding box [m].
        unit: short name of the unit the part was read in.
        label: how messages name the file.
        stated: whether the file itself says its unit, which nobody else can then.

    Raises:
        PartError: the diagonal is outside 0.5 mm to 50 m; the message names the units that would fit.
    """
    if SMALLEST_DIAGONAL <= diagonal <= LARGEST_DIAGONAL:
        return
    plausible = [name for name, metres in METRES.items() if 5e-3 <= diagonal / METRES[unit] * metres <= 5.0]
    size = "too large" if diagonal > LARGEST_DIAGONAL else "too small"
    hint = f"Did you mean {' or '.join(f'unit={name!r}' for name in plausible)}?" if plausible else "Check it."
    if stated and plausible:
        hint = f"The unit is the file's own: export the part again, in {' or '.join(plausible)}."
    raise PartError(
        f"{label}: expected a part of {SMALLEST_DIAGONAL * 1e3:g} mm to {LARGEST_DIAGONAL:g} m, got a diagonal of "
        f"{diagonal:.4g} m in unit {unit!r}, which is {size}. {hint}"
    )
