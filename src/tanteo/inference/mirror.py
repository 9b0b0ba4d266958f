"""Are the readings of a part in a mirror: two axes exchanged, or one reversed? The search is asked again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tanteo.answers import Answer, Finding
from tanteo.errors import TanteoError
from tanteo.parts import Part, mirror_part
from tanteo.sensors import Readings

_ASK = "Are two of the columns x, y, z exchanged, or is one reversed? tanteo takes right-handed frames."

_SURE = 0.95
"""Probability of a mirror image from which it makes a question."""

_MIRROR = np.array([1.0, 1.0, -1.0])
"""One mirror stands for all: whichever axes are exchanged or reversed, the rest is a turn, which is searched."""

Ask = Callable[[Readings, Sequence[Part]], Answer]
"""Which of the parts readings are of."""


def about_mirror(answer: Answer, readings: Readings, parts: Sequence[Part], ask: Ask) -> Finding | None:
    """Whether a mirror explains readings that fit no part, or outliers of the best one.

    Args:
        answer: what the readings are of.
        readings: the readings; those of a hand cannot be mirrored and find nothing.
        parts: the candidates.
        ask: to ask again, as the answer was asked for. Where something is known of the place, a mirror does not
            leave the rest as it is: do not call this then.
    """
    if np.isfinite(readings.Ts_world_hand).any():
        return None
    if answer.status == "unknown":
        return of_mirrored(readings, parts, ask)
    if answer.best is None or not answer.best.outliers:
        return None
    part = next((part for part in parts if part.name == answer.best.part), None)
    return None if part is None else of_image(readings, part, ask)


def of_image(readings: Readings, part: Part, ask: Ask) -> Finding | None:
    """Readings, some of which do not fit a part, that all fit its mirror image."""
    image = mirror_part(part)
    try:
        best = ask(readings, [part, image]).best
    except TanteoError:  # a question that cannot be asked takes nothing from the answer
        return None
    if best is None or best.part != image.name or best.outliers or best.probability < _SURE:
        return None
    message = f"The mirror image of {part.name} fits better (P = {best.probability:.3f}), with no reading left aside."
    return Finding("mirror", f"{message} {_ASK}")


def of_mirrored(readings: Readings, parts: Sequence[Part], ask: Ask) -> Finding | None:
    """Readings of no known part that are surely of one in a mirror."""
    turned = {name: getattr(readings, name) * _MIRROR for name in ("points", "directions", "normals")}
    try:
        answer = ask(replace(readings, **turned), parts)
    except TanteoError:
        return None
    if answer.status != "recognized":
        return None
    return Finding("mirror", f"In a mirror the readings are of {answer.hypotheses[0].part}. {_ASK}")
