"""What lengths and their spreads can be: within these bounds no square overflows and nothing is known to rounding."""

from __future__ import annotations

import numpy as np

from tanteo.defaults import SIGNIFICANCE
from tanteo.errors import InputError
from tanteo.geometry.typing import Covariances, FloatArray

LEAST_SD, LARGEST = 1e-9, 1e6
"""Smallest accepted standard deviation, and largest accepted length or distance [m]."""

LEAST_TILT_SD, LARGEST_TILT_SD = 1e-6, np.pi / 3
"""Smallest and largest accepted standard deviation of a sensed normal [rad]; a larger one carries no information."""

NOTABLE = 0.05
"""Level below which a finding is reported, and probability from which an alternative is: the convention of Fisher
(1925), not a tuned number. Reported regions have one minus this probability, 95 %."""

SUSPECT = 1e-3
"""Fits with a smaller p-value have a wrong reading, more than one surface, or too small a standard deviation."""


def check_number(name: str, value: object, unit: str = "") -> None:
    """Check that a value is one real number; a text with a unit is refused.

    Args:
        name: name of the value, for the message.
        value: value to check.
        unit: unit that the message names; empty for none.

    Raises:
        InputError: the value is not one real number; the message quotes it.
    """
    if _kind(value) in ("f", "i", "u"):
        return
    metres = " 0.3 mm is 0.3e-3." if unit == "m" else ""
    raise InputError(f"{name}: expected one number{f' [{unit}]' if unit else ''}, got {value!r}.{metres}")


def check_significance(value: object) -> None:
    """Check that a significance level is a number between 0 and 1.

    Args:
        value: significance level.

    Raises:
        InputError: the value is no such number.
    """
    check_number("significance", value)
    if not 0 < value < 1:  # type: ignore[operator]
        raise InputError(
            f"significance: expected a probability between 0 and 1, got {value}. Give for example {SIGNIFICANCE:g}."
        )


def _kind(value: object) -> str:
    """NumPy's letter for what one number is; of anything else another."""
    if isinstance(value, (list, tuple)) or np.ndim(value) > 0:  # type: ignore[arg-type]
        return "O"
    return np.asarray(value).dtype.kind


def check_count(name: str, value: object, least: int) -> None:
    """Check that a value is a whole number of at least ``least``.

    Args:
        name: name of the value, for the message.
        value: value to check.
        least: smallest accepted number.

    Raises:
        InputError: the value is no whole number or is too small; the message quotes it.
    """
    if _kind(value) not in ("i", "u"):
        raise InputError(f"{name}: expected a whole number, got {value!r}.")
    if value < least:  # type: ignore[operator]
        raise InputError(f"{name}: expected {least} or more, got {value}.")


def check_length(name: str, value: float, least: float = 0.0) -> None:
    """Check that a value is a length from ``least`` to :data:`LARGEST`.

    Args:
        name: name of the value, for the message.
        value: length [m].
        least: smallest accepted length [m].

    Raises:
        InputError: the value is no number or outside these limits; the message quotes it.
    """
    check_number(name, value, "m")
    if not least <= value <= LARGEST:
        zero = " Leave it out for 0." if least == 0 else " Check its unit."
        raise InputError(f"{name}: expected a length from {least:g} to {LARGEST:g} m, got {value:g} m.{zero}")


def check_places(name: str, points: FloatArray) -> None:
    """Check that all coordinates are numbers of at most :data:`LARGEST` in size.

    Args:
        name: name of the coordinates, for the message.
        points: coordinates of any shape [m].

    Raises:
        InputError: a coordinate is no number or too large; the message quotes the largest.
    """
    worst = float(np.abs(points).max(initial=0.0))
    if not worst <= LARGEST:
        raise InputError(f"{name}: expected coordinates up to {LARGEST:g} m, got {worst:g} m. Check their unit.")


def check_spreads(name: str, C: Covariances) -> None:
    """Check that the standard deviations of poses are between :data:`LEAST_SD` and :data:`LARGEST`.

    Args:
        name: name of the pose, for the message.
        C: covariances of poses ``(*batch, 6, 6)``, [m] and [rad].

    Raises:
        InputError: a standard deviation is outside these limits; the message quotes it.
    """
    sd = np.sqrt(np.diagonal(C, axis1=-2, axis2=-1))
    wrong = sd[~((sd >= LEAST_SD * (1 - 1e-9)) & (sd <= LARGEST * (1 + 1e-9)))]  # squared and rooted
    if len(wrong):
        raise InputError(
            f"{name}: expected standard deviations from {LEAST_SD:g} to {LARGEST:g} (m or rad), got {wrong[0]:g}. "
            "Check their units."
        )
