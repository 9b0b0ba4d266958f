"""Which question a reading answers: readings come late, twice, or without being asked for."""

from __future__ import annotations

import numpy as np

from tanteo.sensors import Readings
from tanteo.session.values import Action

_SAME = 1e-5
"""Starts [m] and unit directions that differ by less are one: what a file in millimetres rounds is far less."""


def is_same(one: Action | None, other: Action | None) -> bool:
    """Whether both are one question, also where one of them was written to a record and read again."""
    if one is None or other is None:
        return False
    places = (one.origin, one.direction), (other.origin, other.direction)
    return one is other or (one.number == other.number and np.array_equal(*places))


def answers(readings: Readings, action: Action) -> bool:
    """Whether some of the readings are what :meth:`Action.read` makes of an answer: by its beam, or by its name.

    Args:
        readings: as they were told.
        action: the question.
    """
    free = readings.is_free
    turned = np.linalg.norm(readings.directions - action.direction, axis=1)
    reach = np.where(free, 0.0, readings.ranges)
    away = readings.points - action.origin
    reach = np.where(np.isnan(reach), away @ action.direction, reach)  # of a touch that does not say how far it went
    off = np.linalg.norm(away - reach[:, None] * action.direction, axis=1)
    beam = (turned < _SAME) & (off < _SAME) & (free | (reach > 0))  # what is not known, NaN, is no beam
    return bool(beam.any()) or action.name in readings.ids
