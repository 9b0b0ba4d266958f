"""What a session makes of readings: how far across the beam they may be off, and what a free beam says."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.active import Probe
from tanteo.sensors import Readings
from tanteo.session.values import Sensing
from tanteo.surface_search import FreePaths, Target, Touches
from tanteo.typing import FloatArray

_BROAD = 0.01
"""Noise of more than this share of the smallest part is broad beside its faces."""


def sensed(readings: Readings, sensing: Sensing, probe: Probe, targets: Sequence[Target]) -> tuple[Touches, FreePaths]:
    """Readings of a probe as touches and free paths in the world.

    Args:
        readings: what was told.
        sensing: how readings are made into measurements.
        probe: what senses; no echo says nothing of a surface that lies beyond the incidence to which it answers.
        targets: the parts that it may be.
    """
    touches, free = sensing.touches(readings, half_angles(readings, sensing, probe, targets))
    return touches, free if probe.contact else free.up_to(probe.max_incidence)


def half_angles(readings: Readings, sensing: Sensing, probe: Probe, targets: Sequence[Target]) -> FloatArray | None:
    """Half angles of the beams of readings whose sensor says none ``(n,)`` [rad]; NaN: as far off across as along.

    A thin beam tells where an edge is. But readings are compared with the nearest face, and where noise is broad beside
    the faces that is often not the one that was met: a thin beam would rule it out (decision 54).

    Args:
        readings: what was told.
        sensing: how readings are made into measurements.
        probe: what senses.
        targets: the parts that it may be.
    """
    if probe.contact:
        return None
    smallest = min(target.part.diagonal for target in targets)
    sds = np.where(np.isnan(readings.sds), sensing.sd or 0.0, readings.sds)
    return np.where(sds > _BROAD * smallest, np.nan, probe.beam_half_angle)
