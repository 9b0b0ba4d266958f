"""What may be wrong with readings of no known part: units, directions, or that they are of a part in a mirror."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tanteo.cli.scale import meant_directions, meant_units

if TYPE_CHECKING:
    from tanteo.cli.scale import Scale
    from tanteo.matching import Recognition
    from tanteo.sensors import PointMeasurements, Readings

_MIRROR = np.array([1.0, 1.0, -1.0])
"""One mirror stands for all: whichever axes are exchanged or reversed, the rest is a turn, which is searched."""


def meant(
    scale: Scale,
    measured: PointMeasurements,
    readings: Readings,
    ask: Callable[[Readings], Recognition] | None,
) -> str:
    """A question where units, directions or axes may be others than was said; empty where none would help.

    Args:
        scale: Sizes on both sides.
        measured: What was measured.
        readings: Of no known part.
        ask: Which part readings are of; None where a mirror does not leave the rest as it is: the place is known.
    """
    question = meant_units(scale) or meant_directions(measured.points, measured.directions)
    return question or (meant_mirrored(readings, ask) if ask else "")


def meant_mirrored(readings: Readings, ask: Callable[[Readings], Recognition]) -> str:
    """A question where the mirrored readings are surely of a part; empty where they are not, or cannot be mirrored.

    Args:
        readings: Of no known part. Those that depend on the pose of a hand cannot be mirrored.
        ask: Which part readings are of.
    """
    if np.isfinite(readings.Ts_world_hand).any():
        return ""
    turned = {name: getattr(readings, name) * _MIRROR for name in ("points", "directions", "normals")}
    answer = ask(replace(readings, **turned))
    if answer.status != "recognized":
        return ""
    return (
        f"In a mirror the readings are of {answer.hypotheses[0].part}. Are two of the columns x, y, z exchanged, or is "
        "one reversed? tanteo takes right-handed frames."
    )
