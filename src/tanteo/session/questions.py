"""Questions: from a choice to one, which are like it, and which one a reading answers.

Readings come late, twice, or without being asked for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.active import Candidates, Choice, Situation
from tanteo.sensors import Readings
from tanteo.session.values import Action

_SAME = 1e-5
"""Starts [m] and unit directions that differ by less are one: what a file in millimetres rounds is far less."""

_LIKE = 0.15
"""A reading is like a refused one within this angle [rad], and a place of this share of the stand-off."""


def action_of(situation: Situation, choice: Choice, number: int) -> Action:
    """The question of that number that makes the chosen reading."""
    k, c = choice.index, situation.candidates
    part = situation.belief.target(int(c.mode[k])).part
    return Action(
        number, c.origins[k], c.directions[k], situation.probe.max_range, float(c.ranges[k]), part.name,
        part.faces[c.face[k]].name, choice.gain, choice.why,
    )  # fmt: skip


def unlike(candidates: Candidates, refused: Sequence[Action]) -> Candidates:
    """The candidates that are not like a question that was refused."""
    for action in refused:
        away = np.linalg.norm(candidates.origins - action.origin, axis=1)
        turned = np.linalg.norm(candidates.directions - action.direction, axis=1)
        candidates = candidates.take((away > _LIKE * action.expected) | (turned > _LIKE))
    return candidates


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
