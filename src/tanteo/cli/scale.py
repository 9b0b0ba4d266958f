"""Are readings and parts of one size? If not, which unit was meant; and do the readings look into the material?"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from tanteo.cli.printing import complain
from tanteo.errors import ReadingsError

if TYPE_CHECKING:
    from tanteo.parts import Part
    from tanteo.sensors import Rig
    from tanteo.typing import Covariances, FloatArray, Vectors

_FEW = 3
"""Fewer readings than this say nothing about the size of what was sensed."""

_TOO_WIDE, _TOO_NARROW = 3.0, 0.01
"""Readings farther from their middle than this many diagonals, or all nearer, suggest a wrong unit."""

_FINEST, _COARSEST = 2e-7, 0.1
"""Standard deviations below the first [m], or above this share of the largest part, suggest a wrong unit."""

_OUTWARD = 0.2
"""Mean cosine between a direction and the way to the middle of the readings, below whose negative it looks reversed."""

_LIKELY = (0.25, 1.2)
"""Readings of one part span this share of its diagonal, as a rule."""

_HANDLED = (2e-3, 5.0)
"""Sizes of parts that are touched by robots [m]: a guess leads to one of these."""

_UNITS = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "in": 0.0254}
"""Units of columns, and of part files, in metres."""

_HEADER = re.compile(r"(?:^|,)\s*(?:x|range)_(mm|m|um|in)\s*(?:,|$)", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Scale:
    """Sizes on both sides, and the units that they were read with.

    Attributes:
        span: How far apart the readings are [m].
        sizes: Diagonals of the parts [m].
        column: Unit in the names of the readings' columns; empty if not known.
        option: Unit that the command gave the parts; empty if their files have one of their own.
    """

    span: float
    sizes: tuple[float, ...]
    column: str
    option: str


def scale_of(points: Vectors, parts: Sequence[Part], header: str, option: str | None) -> Scale:
    """Sizes and units of a run.

    Args:
        points: Of the readings ``(n, 3)`` [m].
        parts: The parts.
        header: Text of the readings' file, at least to the names of its columns.
        option: What ``--units`` said.
    """
    span = 2 * float(np.median(_away(points))) if len(points) >= _FEW else 0.0
    column = _HEADER.search(header)
    return Scale(span, tuple(p.diagonal for p in parts), column[1] if column else "", option or "")


def meant_units(scale: Scale) -> str:
    """A question that names the units which would make both sides fit; empty if they fit, or none would."""
    if not scale.span or _fits(scale.span, scale.sizes):
        return ""
    guesses = []
    for column, option in product(_others(scale.column), _others(scale.option)):
        span = scale.span * _UNITS.get(column, 1) / _UNITS.get(scale.column, 1)
        sizes = [size * _UNITS.get(option, 1) / _UNITS.get(scale.option, 1) for size in scale.sizes]
        changed = [f"--units {option}"] * (option != scale.option) + [f"columns in {column} (x_{column})"] * (
            column != scale.column
        )
        if len(changed) == 1 and _fits(span, sizes):
            guesses.append(changed[0])
    if not guesses:
        return ""
    widest = max(scale.sizes)
    return (
        f"The {'largest ' if len(scale.sizes) > 1 else ''}part is {_length(widest)} wide and the readings span about "
        f"{_length(scale.span)}: did you mean {' or '.join(guesses)}?"
    )


def check_scale(points: Vectors, scale: Scale) -> bool:
    """Refuse readings that cannot be of these parts, warn of those that hardly can; whether it warned.

    Raises:
        ReadingsError: The readings are far wider than any part.
    """
    if len(points) < _FEW:
        return False
    away = _away(points)
    largest, smallest = max(scale.sizes), min(scale.sizes)
    advice = "Check the units in the names of the columns and of the parts (--units)."
    advice = f"{advice} {meant_units(scale)}".rstrip()
    if np.median(away) > _TOO_WIDE * largest:
        raise ReadingsError(
            f"readings: expected points around a part of {largest * 1e3:.4g} mm or less, got half of them more than "
            f"{np.median(away) * 1e3:.4g} mm from their middle. {advice}"
        )
    if away.max() >= _TOO_NARROW * smallest:
        return False
    within, size = f"{away.max() * 1e3:.3g} mm", f"{smallest * 1e3:.4g} mm"
    complain("warning", f"all readings lie within {within}, and the smallest part measures {size}. {advice}")
    return True


def check_spread(covs: Covariances, scale: Scale) -> bool:
    """Warn of standard deviations that no sensor of such parts has; whether it warned.

    Args:
        covs: Of the readings ``(n, 3, 3)`` [m^2].
        scale: Sizes on both sides.
    """
    if not len(covs):
        return False
    sd = float(np.median(np.sqrt(np.trace(covs, axis1=1, axis2=2) / 3)))
    if _FINEST <= sd <= _COARSEST * max(scale.sizes):
        return False
    size = f"{sd / max(scale.sizes):.0%} of the largest part" if sd > _FINEST else "finer than any sensor"
    complain(
        "warning",
        f"one standard deviation of the readings is {1e3 * sd:.3g} mm, which is {size}. Is its unit right "
        "(column sd_mm, sd_m, sd_um; --sd)?",
    )
    return True


def meant_directions(points: Vectors, directions: Vectors) -> str:
    """A question where the directions of most readings lead away from their middle; empty where they do not.

    Args:
        points: Of the readings ``(n, 3)`` [m].
        directions: In which they looked or moved ``(n, 3)``; NaN rows where that is unknown.
    """
    known = np.isfinite(directions).all(axis=1)
    if known.sum() < _FEW:
        return ""
    inward = np.median(points[known], axis=0) - points[known]
    cosines = np.sum(inward * directions[known], axis=1) / np.linalg.norm(inward, axis=1).clip(1e-12)
    if cosines.mean() > -_OUTWARD:
        return ""
    return (
        f"The directions (dx, dy, dz) of {np.mean(cosines < 0):.0%} of the readings lead away from the middle of all: "
        "they are meant to point into the material, as the sensor looks or the tip moves. Did you mean the opposite?"
    )


def _away(points: Vectors) -> FloatArray:
    """Distances from the middle ``(n,)`` [m]."""
    return np.asarray(np.linalg.norm(points - np.median(points, axis=0), axis=1))


def _others(unit: str) -> tuple[str, ...]:
    """The unit itself and what else it might be; itself alone where it was not a choice."""
    return (unit, *(u for u in _UNITS if u != unit)) if unit else (unit,)


def _fits(span: float, sizes: Sequence[float]) -> bool:
    low, high = _LIKELY
    return any(low <= span / size <= high and _HANDLED[0] <= size <= _HANDLED[1] for size in sizes)


def _length(metres: float) -> str:
    return f"{metres:.3g} m" if metres >= 0.1 else f"{1e3 * metres:.3g} mm"


def asked_rig(path: str) -> Rig:
    """A rig from a file, with a question where its lengths may be in metres."""
    from tanteo.io import meant_metres, read_rig

    rig = read_rig(path)
    if question := meant_metres(rig):
        complain("warning", question)
    return rig
