"""Features as candidates: this face, this edge, this corner, each as the few readings that acquire it.

The paper chooses among features, not among single readings. A face needs three readings that are far apart, an edge two
on either side of it, a corner one on each of its faces. What they tell together is more than what one of them tells and
less than their sum: the determinant of their joint covariance says how much.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tanteo.active.candidates import Candidates
from tanteo.active.context import DecisionContext
from tanteo.active.samples import Predictions, Samples, beams
from tanteo.active.state import SensingState
from tanteo.active.utility import about_mode
from tanteo.lie import SE3
from tanteo.parts import Part
from tanteo.typing import FloatArray, IntArray, Vectors

_MODES = 3
"""Modes, the likeliest, whose features are looked at."""

_FACE, _SIDE = 3, 2
"""Readings of a face, and of each side of an edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """A face, an edge or a corner of a part at one mode of the belief.

    Attributes:
        kind: what it is.
        mode: of the belief.
        faces: indices of the part's faces that meet there.
        name: in words.
        rows: the candidates that acquire it, in the order of their readings.
    """

    kind: Literal["face", "edge", "corner"]
    mode: int
    faces: tuple[int, ...]
    name: str
    rows: IntArray


def features(state: SensingState, candidates: Candidates) -> tuple[Feature, ...]:
    """The faces, edges and corners that the candidates can acquire; single places where they can acquire none.

    Args:
        state: what is known.
        candidates: readings that can be made.
    """
    modes = np.unique(candidates.mode)
    modes = modes[np.argsort(-state.weights[modes], kind="stable")][:_MODES]
    found = [feature for mode in modes for feature in _of_mode(state, candidates, int(mode))]
    if found:
        return tuple(found)
    part = state.target(int(candidates.mode[0])).part
    return tuple(
        Feature("face", int(m), (int(f),), f"{part.faces[f].name} of {part.name}", np.array([k]))
        for k, (m, f) in enumerate(zip(candidates.mode, candidates.face, strict=True))
    )


def _of_mode(state: SensingState, c: Candidates, mode: int) -> Iterable[Feature]:
    """The features of one mode, faces first."""
    part = state.target(mode).part
    own = np.flatnonzero(c.mode == mode)
    local = SE3.apply(SE3.inverse(state.poses[mode]), c.aims[own])
    on = {int(f): own[c.face[own] == f] for f in np.unique(c.face[own])}
    place = dict(zip(own.tolist(), local, strict=True))

    def made(kind: Literal["face", "edge", "corner"], faces: Sequence[int], rows: list[IntArray]) -> Feature:
        names = [part.faces[f].name for f in faces]
        words = names[0] if kind == "face" else f"the {kind} of {', '.join(names[:-1])} and {names[-1]}"
        return Feature(kind, mode, tuple(faces), f"{words} of {part.name}", np.concatenate(rows))

    for face, rows in on.items():
        if len(rows) >= _FACE:
            yield made("face", [face], [_apart(rows, place, _FACE)])
    for k in range(len(part.edges)):
        sides = [int(f) for f in part.edges.faces[k]]
        if all(len(on.get(f, ())) >= _SIDE for f in sides):
            yield made("edge", sides, [_along(on[f], place, part.edges.ends[k]) for f in sides])
    for k, point in enumerate(part.corners.points):
        sides = _faces_at(part, k)
        if len(sides) > 2 and all(f in on for f in sides):
            yield made("corner", sides, [_nearest(on[f], place, point) for f in sides])


def _faces_at(part: Part, corner: int) -> list[int]:
    """The faces that meet at a corner."""
    start = part.corners.edges_start
    edges = part.corners.edges[start[corner] : start[corner + 1]]
    return sorted({int(f) for f in part.edges.faces[edges].ravel()})


def _apart(rows: IntArray, place: dict[int, Vectors], count: int) -> IntArray:
    """So many of the candidates, far from each other: each as far as possible from those before it."""
    x = np.stack([place[int(k)] for k in rows])
    chosen = [int(np.argmax(np.linalg.norm(x - x.mean(axis=0), axis=1)))]
    while len(chosen) < count:
        gaps = np.linalg.norm(x[:, None] - x[chosen], axis=-1).min(axis=1)
        chosen.append(int(np.argmax(gaps)))
    return rows[chosen]


def _along(rows: IntArray, place: dict[int, Vectors], ends: Vectors) -> IntArray:
    """Two candidates beside an edge, far apart along it."""
    x, u = np.stack([place[int(k)] for k in rows]), ends[1] - ends[0]
    t = (x - ends[0]) @ u / (u @ u)
    away = np.linalg.norm(x - ends[0] - np.clip(t, 0, 1)[:, None] * u, axis=1)
    near = np.argsort(away, kind="stable")[: max(_SIDE, len(rows) // 2)]
    return rows[near[[np.argmin(t[near]), np.argmax(t[near])]]] if np.ptp(t[near]) > 0 else rows[near[:_SIDE]]


def _nearest(rows: IntArray, place: dict[int, Vectors], point: Vectors) -> IntArray:
    away = [float(np.linalg.norm(place[int(k)] - point)) for k in rows]
    return rows[[int(np.argmin(away))]]


def joint_information(
    found: Sequence[Feature], samples: Samples, predicted: Predictions, context: DecisionContext
) -> FloatArray:
    """What the readings of each feature are expected to tell together about part and pose ``(F,)`` [nats].

    About the pose by the determinants, as far as it matters for the tolerance, if the feature's mode is true; about the
    mode what the best of its readings tells, which is the least that all of them do.

    Args:
        found: the features.
        samples: of the belief.
        predicted: what each candidate would read under them.
        context: belief, candidates and probe.
    """
    s, c = context, context.candidates
    apart, pose = about_mode(samples, predicted, s.probe), np.zeros(len(found))
    shared = None if s.shared is None else s.shared(c)
    for mode in {feature.mode for feature in found}:
        target, T = s.state.target(mode), s.state.poses[mode]
        ranges, cosine, _, moves = beams(target, T[None], c.origins, c.directions)
        d, cosines, g = ranges[:, 0], cosine[:, 0], moves[:, 0]
        answers = np.isfinite(d) & s.probe.answers(d, cosines)
        R = s.probe.variance(np.where(answers, d, 1.0), np.where(answers, cosines, 1.0))
        row = int(np.flatnonzero(samples.mode == mode)[0])
        S = np.diag(R)
        if shared is not None:
            own = s.probe.own_variance(np.where(answers, d, 1.0), np.where(answers, cosines, 1.0))
            g, S = shared.together(mode, T, g, own)
        for k, feature in enumerate(found):
            if feature.mode == mode:
                used = feature.rows[answers[feature.rows]]
                share = samples.weights[samples.mode == mode].sum()
                pose[k] = share * _shrunk(g[used], S[np.ix_(used, used)], samples.whole[row], samples.useful[row])
    return pose + np.array([apart[feature.rows].max() for feature in found])


def _shrunk(G: FloatArray, R: FloatArray, whole: FloatArray, useful: FloatArray) -> float:
    """Half the log of the ratio of determinants of the readings with and without what is useful of the pose."""
    if not len(G):
        return 0.0
    S = G @ whole @ G.T + R
    without = S - G @ useful @ G.T
    return 0.5 * float(np.linalg.slogdet(S)[1] - np.linalg.slogdet(without)[1])
