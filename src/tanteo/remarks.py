"""What is odd about readings beside the answer: paths through the part, repeats, a stuck sensor, another unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.answers import Answer
from tanteo.inference import gone_through, prepare_all
from tanteo.measurements import FreeRays
from tanteo.parts import Part
from tanteo.sensors import PointMeasurements, Readings, say_repeated, say_stuck

_PATHS = 3
"""Paths that a message names."""

_TOO_WIDE = 3.0
"""Times the width of the largest part beyond which readings are of another unit."""


def remarks(
    answer: Answer, readings: Readings, measured: PointMeasurements, free: FreeRays, parts: Sequence[Part]
) -> tuple[str, ...]:
    """Sentences on what is odd about the readings; empty ones where nothing is.

    Args:
        answer: what the readings are of.
        readings: what the devices said.
        measured: what was made of it.
        free: the paths on which nothing was met.
        parts: among which it was looked for, prepared or not.
    """
    gone = _gone_through(answer, free, measured.free.ids, parts)
    return gone, say_repeated(measured), say_stuck(readings), _too_wide(answer, measured, parts)


def _gone_through(answer: Answer, free: FreeRays, ids: Sequence[str], parts: Sequence[Part]) -> str:
    """A sentence on the paths on which nothing was met, though the best answer's part is surely in their way."""
    if not answer.hypotheses or not len(free):
        return ""
    best = answer.hypotheses[0]
    part = next(part for part in prepare_all("parts", parts) if part.part.name == best.part)
    short = gone_through(free, best.T_world_part, best.covariance, best.shared, part)
    rows = np.flatnonzero(short > 0)[np.argsort(-short[short > 0], kind="stable")]
    if not len(rows):
        return ""
    named = ", ".join(f"{ids[k]} (it ends {1e3 * short[k]:.2g} mm further)" for k in rows[:_PATHS])
    rest = f" and {len(rows) - _PATHS} more" if len(rows) > _PATHS else ""
    return f"{best.part} is in the way of {len(rows)} of {len(ids)} paths on which nothing was met: {named}{rest}."


def _too_wide(answer: Answer, measured: PointMeasurements, parts: Sequence[Part]) -> str:
    """That readings of no known part lie farther apart than any part is wide, as millimetres would."""
    if answer.status != "unknown" or not len(measured.points):
        return ""
    away = float(np.median(np.linalg.norm(measured.points - np.median(measured.points, axis=0), axis=1)))
    widest = max(2 * part.part.radius for part in prepare_all("parts", parts))
    if away <= _TOO_WIDE * widest:
        return ""
    return (
        f"Half of the readings are more than {away:.3g} m from their middle, and the largest part measures "
        f"{widest:.3g} m: lengths are in metres."
    )
