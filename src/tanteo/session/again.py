"""The reading that does not fit, once more: the sensor errs at random, an object that is not the part does not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.active import Candidates, SensingState
from tanteo.lie import SE3
from tanteo.session.values import Action, Step
from tanteo.special import entropy


def once_more(state: SensingState, steps: Sequence[Step]) -> Candidates:
    """The questions whose readings do not fit the likeliest hypothesis, where these were asked once and it is met.

    Args:
        state: what is known.
        steps: what each reading told.
    """
    if state.touches is None or not state.modes:
        return _candidates(state, [])
    asked = [s.action for s in steps if s.action is not None]
    aside = {i for i, on in zip(state.touches.ids, state.on_part(), strict=True) if not on}
    doubted = [s.action for s in steps if s.action is not None and aside.intersection(s.ids)]
    return _candidates(state, [a for a in doubted if sum(_is_like(a, b) for b in asked) == 1])


def information_of_repeat(state: SensingState) -> float:
    """What one more reading of a beam that did not fit tells about the unknown object [nats].

    Of the part it is off once more as often as any reading is an outlier, of another object as often as it is not.
    """
    c, u = state.start.priors.outlier_rate, state.unknown
    off = u * (1 - c) + (1 - u) * c
    return float(entropy(off) + entropy(1 - off) - entropy(c) - entropy(1 - c))


def _is_like(one: Action, other: Action) -> bool:
    return np.array_equal(one.origin, other.origin) and np.array_equal(one.direction, other.direction)


def _candidates(state: SensingState, actions: Sequence[Action]) -> Candidates:
    """The same beams as candidates on the likeliest hypothesis; without those that go past it."""
    origins = np.array([a.origin for a in actions]).reshape(-1, 3)
    directions = np.array([a.direction for a in actions]).reshape(-1, 3)
    if not len(actions):
        return Candidates(origins, directions, np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros(0))
    target, to_part = state.target(0), SE3.inverse(state.poses[0])
    met = target.surface.cast(SE3.apply(to_part, origins), directions @ to_part[:3, :3].T)
    faces = target.part.triangle_face[met.triangles]
    reached = met.distances < [a.max_range for a in actions]
    return Candidates(origins, directions, np.zeros(len(actions), dtype=int), faces, met.distances).take(reached)
