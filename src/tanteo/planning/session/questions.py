"""Creation and comparison of a session's actions, and matching of readings to actions.

Readings may arrive late, twice, or unrequested.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tanteo.geometry import SE3
from tanteo.planning.candidates import Candidates
from tanteo.planning.context import Choice, DecisionContext
from tanteo.planning.predictions import beams
from tanteo.planning.session.action import Action
from tanteo.planning.state import SensingState
from tanteo.planning.whole import WholeFeature
from tanteo.sensors import Column, Readings
from tanteo.words import Finding
from tanteo.words.findings import MostInformation, RepeatedNames

_ACTION_NAME = re.compile(r"a\d+")
"""Pattern of the names of readings that result from actions."""

_SIMILAR = 0.15
"""Largest angle [rad], and largest distance as a fraction of the stand-off, between similar readings."""


def action_of(context: DecisionContext, choice: Choice, number: int) -> Action:
    """Return the action that makes the chosen reading.

    Args:
        context: input of the policy.
        choice: choice of the policy.
        number: number of the action.
    """
    k, c, state = choice.index, context.candidates, context.state
    mode, reach, face = _most_probable(context, k)
    part, expected = state.target(mode).part, reach - _short(context, k, mode)
    return Action(
        number, c.origins[k], c.directions[k], context.probe.max_range, expected, part.name, part.faces[face].name,
        choice.gain, choice.reason, context.probe.radius, unlikely=bool(state.weights[mode] < state.weights.max()),
    )  # fmt: skip


def _most_probable(context: DecisionContext, k: int) -> tuple[int, float, int]:
    """Return the most probable mode that a candidate reaches, with the range and the face there.

    A candidate may aim at the face of an improbable mode. If the most probable one expects no contact, it is this mode.
    """
    c, state, limit = context.candidates, context.state, context.probe.max_range
    best, own = int(np.argmax(state.weights)), int(c.mode[k])
    if best != own:
        ranges, _, faces, _ = beams(state.target(best), state.poses[best][None], c.origins[[k]], c.directions[[k]])
        if ranges[0, 0] <= limit:
            return best, float(ranges[0, 0]), int(faces[0, 0])
    return own, float(c.ranges[k]), int(c.face[k])


def whole_action(state: SensingState, one: WholeFeature, gain: float, number: int) -> Action:
    """Return the action that acquires a complete feature.

    Args:
        state: posterior of the session.
        one: feature to acquire.
        gain: expected information [nats].
        number: number of the action.
    """
    down = -one.T_world_feature[:3, 2]
    expected = float((one.T_world_feature[:3, 3] - one.origin) @ down)
    return Action(
        number, one.origin, down, 2 * expected, expected, state.target(one.mode).part.name, one.name, gain,
        MostInformation(gain), acquires=one.kind,
    )  # fmt: skip


def _short(context: DecisionContext, k: int, mode: int) -> float:
    """Return the distance from the centre of the stopped ball to the surface, along a candidate's direction [m]."""
    if context.probe.radius == 0:
        return 0.0
    c = context.candidates
    target, to_part = context.state.target(mode), SE3.inverse(context.state.poses[mode])
    d = to_part[:3, :3] @ c.directions[k]
    hit = target.surface.cast(SE3.apply(to_part, c.origins[k])[None], d[None])
    return float(context.probe.short(np.abs(target.surface.normals[hit.triangles] @ d))[0])


def unlike(candidates: Candidates, refused: Sequence[Action]) -> Candidates:
    """Return the candidates that are not similar to any refused action.

    What prevents one reading of a face often prevents its neighbours. The excluded distance therefore doubles with each
    refused action of the same face and direction, so that few of them exclude a face that cannot be reached.

    Args:
        candidates: candidate readings.
        refused: refused actions, in order.
    """
    tried = list[Action]()
    for action in (a for a in refused if not a.acquires):
        place = action.part, action.face
        near = [
            a for a in tried if (a.part, a.face) == place and np.linalg.norm(a.direction - action.direction) <= _SIMILAR
        ]
        reach = _SIMILAR * action.expected * 2 ** len(near)
        away = np.linalg.norm(candidates.origins - action.origin, axis=1)
        turned = np.linalg.norm(candidates.directions - action.direction, axis=1)
        candidates = candidates.take((away > reach) | (turned > _SIMILAR))
        tried.append(action)
    return candidates


def is_same(one: Action | None, other: Action | None) -> bool:
    """Return whether two actions are the same, as when one was restored from a record.

    Args:
        one: an action or None.
        other: another action or None; two missing actions are not the same.
    """
    if one is None or other is None:
        return False
    places = (one.origin, one.direction), (other.origin, other.direction)
    return one is other or (one.number == other.number and np.array_equal(*places))


def answers(readings: Readings, action: Action) -> bool:
    """Return whether one of the readings results from an action, by its name or its beam.

    A robot reaches its target only approximately, and a touch may have no direction. A reading therefore matches if it
    is similar to the action. A reading with the name of another action does not match.

    Args:
        readings: readings to match.
        action: action of the session.
    """
    if action.name in readings.ids:
        return True
    far = action.expected if 0 < action.expected < np.inf else action.max_range  # the expected range may be infinite
    near, away = _SIMILAR * far, readings.points.filled(action.origin) - action.origin
    along = away @ action.direction
    beside = np.linalg.norm(away - along[:, None] * action.direction, axis=1)
    turned = np.linalg.norm(readings.directions.filled(action.direction) - action.direction, axis=1)
    there = readings.points.given & np.where(
        readings.is_free, np.linalg.norm(away, axis=1) <= near, (beside <= near) & (along > 0)
    )
    others = np.array([_ACTION_NAME.fullmatch(name) is not None for name in readings.ids], dtype=bool)
    return bool(np.any(there & (turned <= _SIMILAR) & ~others))  # a reading without direction counts as along the beam


def new_readings(before: Sequence[Readings], readings: Readings) -> tuple[Readings | None, tuple[Finding, ...]]:
    """Return the readings that are new, with unique names, and a remark on repeated names.

    Args:
        before: earlier readings.
        readings: readings that arrived.

    Returns:
        New readings, or None without any, and findings for the user.
    """
    known = {name: (r, k) for r in before for k, name in enumerate(r.ids)}
    taken = {*known, *readings.ids}
    keep, names = list[int](), list[str]()
    again, corrected, renamed = list[str](), list[str](), list[str]()
    for k, name in enumerate(readings.ids):
        new, earlier = name, _earlier_with_name(known, name)
        if same_place := [one for one in earlier if _equal(_WHERE, readings, k, *one)]:
            same = any(_equal(_HOW_WELL, readings, k, *one) for one in same_place)
            (again if same else corrected).append(name)
            continue
        if earlier:
            new = next(f"{name} ({n})" for n in range(2, 10**6) if f"{name} ({n})" not in taken)
            taken.add(new)
            renamed.append(new)
        keep.append(k)
        names.append(new)
    some = again or corrected or renamed
    remarks = (RepeatedNames(tuple(again), tuple(corrected), tuple(renamed)),) if some else ()
    if not keep:
        return None, remarks
    fresh = readings if len(keep) == len(readings) else readings.take(np.array(keep))
    return fresh if not renamed else replace(fresh, ids=tuple(names)), remarks


_WHERE = "points", "directions", "ranges", "Ts_world_hand", "max_ranges", "is_free"
_HOW_WELL = "sds", "across_sds", "radii", "normals", "normal_sds"


def _earlier_with_name(known: dict[str, tuple[Readings, int]], name: str) -> list[tuple[Readings, int]]:
    """Return the earlier readings that arrived with a name, renamed ones included, each as readings and row."""
    out = [known[name]] if name in known else []
    n = 2
    while (again := f"{name} ({n})") in known:
        out.append(known[again])
        n += 1
    return out


def _equal(columns: Sequence[str], a: Readings, i: int, b: Readings, j: int) -> bool:
    """Return whether two readings have the same sensor, and equal values in some columns."""
    return a.sensors[i] == b.sensors[j] and all(
        np.array_equal(_cell(a, name, i), _cell(b, name, j)) for name in columns
    )


def _cell(readings: Readings, name: str, row: int) -> npt.ArrayLike:
    """Return the value of one reading in a column; an empty array if it has none."""
    column = getattr(readings, name)
    return column.take([row]).values if isinstance(column, Column) else column[row]
