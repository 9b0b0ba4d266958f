"""What may be wrong with readings that do not fit: units, directions, or that they are of a part in a mirror."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tanteo.cli.scale import meant_directions, meant_units
from tanteo.errors import TanteoError

if TYPE_CHECKING:
    from tanteo.answers import Answer
    from tanteo.cli.scale import Scale
    from tanteo.parts import Part
    from tanteo.sensors import PointMeasurements, Readings
    from tanteo.typing import Vectors

_ASK = "Are two of the columns x, y, z exchanged, or is one reversed? tanteo takes right-handed frames."

_SURE, _MOST, _FEW = 0.95, 0.8, 3
"""Probability of a mirror image, and share of readings, so many at least, that make a question."""

_MIRROR = np.array([1.0, 1.0, -1.0])
"""One mirror stands for all: whichever axes are exchanged or reversed, the rest is a turn, which is searched."""


Ask = Callable[["Readings", "Sequence[Part]"], "Answer"]
"""Which of the parts readings are of."""


def meant(
    answer: Answer,
    scale: Scale,
    measured: PointMeasurements,
    readings: Readings,
    parts: Sequence[Part],
    ask: Ask | None,
) -> str:
    """A question where units, directions or axes may be others than was said; empty where none would help.

    Args:
        answer: What the readings are of.
        scale: Sizes on both sides.
        measured: What was measured.
        readings: The readings.
        parts: Among which it was looked for.
        ask: To ask again; None where a mirror does not leave the rest as it is: the place is known.
    """
    mirrored = ask is not None and not np.isfinite(readings.Ts_world_hand).any()
    if answer.status == "unknown":
        question = meant_units(scale) or meant_directions(measured.points, measured.directions)
        question = question or meant_normals(measured.normals, measured.directions)
        return question or (meant_mirrored(readings, parts, ask) if mirrored and ask else "")
    if mirrored and ask and answer.hypotheses and answer.hypotheses[0].outliers:
        best = next((part for part in parts if part.name == answer.hypotheses[0].part), None)
        return "" if best is None else meant_image(readings, best, ask)
    return ""


def meant_normals(normals: Vectors, directions: Vectors) -> str:
    """A question where sensed normals point as the sensor looks: into the material."""
    cosines = np.sum(normals * directions, axis=1)
    known = cosines[np.isfinite(cosines)]
    if len(known) < _FEW or np.mean(known > 0) <= _MOST:
        return ""
    return (
        f"The normals (nx, ny, nz) of {np.mean(known > 0):.0%} of the readings point as the sensor looks (dx, dy, dz): "
        "normals are meant to point out of the material. Did you mean the opposite?"
    )


def meant_image(readings: Readings, part: Part, ask: Ask) -> str:
    """A question where readings, some of which do not fit a part, all fit its mirror image; empty where they do not."""
    from tanteo.parts import mirror_part

    image = mirror_part(part)
    try:
        answer = ask(readings, [part, image])
    except TanteoError:  # a question that cannot be asked takes nothing from the answer
        return ""
    best = answer.hypotheses[0] if answer.hypotheses else None
    if best is None or best.part != image.name or best.outliers or best.probability < _SURE:
        return ""
    return (
        f"The mirror image of {part.name} fits better (P = {best.probability:.3f}), with no reading left aside. {_ASK}"
    )


def meant_mirrored(readings: Readings, parts: Sequence[Part], ask: Ask) -> str:
    """A question where the mirrored readings are surely of a part; empty where they are not, or cannot be mirrored.

    Args:
        readings: Of no known part, from no hand: a rig cannot be mirrored with them.
        parts: Among which it is looked for.
        ask: Which of them readings are of.
    """
    turned = {name: getattr(readings, name) * _MIRROR for name in ("points", "directions", "normals")}
    try:
        answer = ask(replace(readings, **turned), parts)
    except TanteoError:
        return ""
    if answer.status != "recognized":
        return ""
    return f"In a mirror the readings are of {answer.hypotheses[0].part}. {_ASK}"
