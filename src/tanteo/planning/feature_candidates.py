"""Features as candidates: face, edge, corner, or wall of a bore, each with the few readings that acquire it.

The paper chooses among features, not among single readings. A face needs three readings that are far apart, an edge two
on either side, a corner one on each of its faces, and the wall of a bore or boss five. Their joint information is more
than that of one reading and less than the sum. It follows from the determinant of their joint covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.parts import Part, round_features
from tanteo.planning.candidates import Candidates
from tanteo.planning.context import DecisionContext
from tanteo.planning.predictions import Predictions, beams
from tanteo.planning.samples import Samples
from tanteo.planning.state import SensingState
from tanteo.planning.utility import about_mode

_MODES = 3
"""Number of the most probable modes whose features are candidates."""

_FACE, _SIDE, _WALL = 3, 2, 5
"""Numbers of readings of a face, of each side of an edge, and of the wall of a bore or boss."""

Kind: TypeAlias = Literal["face", "edge", "corner", "wall"]


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """Face, edge, corner, or wall of a bore or boss, of a part at one mode.

    Attributes:
        kind: kind of the feature.
        mode: index of the posterior mode whose part has the feature.
        faces: indices of the part's faces that form the feature.
        name: name of the feature for messages.
        rows: indices of the candidates that acquire the feature, in order.
    """

    kind: Kind
    mode: int
    faces: tuple[int, ...]
    name: str
    rows: IntArray


def features(state: SensingState, candidates: Candidates) -> tuple[Feature, ...]:
    """Return the features that the candidates can acquire.

    If they can acquire none, each candidate alone counts as a feature.

    Args:
        state: posterior of the session.
        candidates: candidate readings.
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
    """Yield the features of one mode, faces first."""
    part = state.target(mode).part
    own = np.flatnonzero(c.mode == mode)
    local = SE3.apply(SE3.inverse(state.poses[mode]), c.aims[own])
    on = _On(part, {int(f): own[c.face[own] == f] for f in np.unique(c.face[own])}, dict(zip(own, local, strict=True)))
    for kind, find in _FINDERS.items():
        for faces, words, rows in find(on):
            yield Feature(kind, mode, tuple(faces), f"{words} of {part.name}", rows)


@dataclass(frozen=True, slots=True, eq=False)
class _On:
    """Candidates of one mode by face: indices on each face, and point of every candidate in the part frame."""

    part: Part
    rows: dict[int, IntArray]
    place: dict[int, Vectors]

    def name(self, faces: Sequence[int]) -> str:
        """Return the names of one or several faces as text."""
        *others, last = (self.part.faces[f].name for f in faces)
        return f"{', '.join(others)} and {last}" if others else last


_Found: TypeAlias = Iterator[tuple[Sequence[int], str, IntArray]]
"""Faces, name and candidates of each feature."""


def _faces(on: _On) -> _Found:
    round_ones = {face for one in round_features(on.part) for face in one.faces}
    for face, rows in on.rows.items():
        if len(rows) >= _FACE and face not in round_ones:
            yield [face], on.name([face]), _apart(rows, on.place, _FACE)


def _edges(on: _On) -> _Found:
    edges = on.part.edges
    for sides, ends in zip(edges.faces.tolist(), edges.ends, strict=True):
        if all(len(on.rows.get(f, ())) >= _SIDE for f in sides):
            rows = np.concatenate([_along(on.rows[f], on.place, ends) for f in sides])
            yield sides, f"the edge of {on.name(sides)}", rows


def _corners(on: _On) -> _Found:
    for k, point in enumerate(on.part.corners.points):
        sides = _faces_at(on.part, k)
        if len(sides) > 2 and all(f in on.rows for f in sides):
            rows = np.concatenate([_nearest(on.rows[f], on.place, point) for f in sides])
            yield sides, f"the corner of {on.name(sides)}", rows


def _walls(on: _On) -> _Found:
    for one in round_features(on.part):
        none = np.zeros(0, dtype=np.int64)
        rows = np.concatenate([none, *(on.rows.get(f, none) for f in one.faces)])
        if len(rows) >= _WALL:
            yield one.faces, f"the wall of {one.name} ({on.name(one.faces)})", _apart(rows, on.place, _WALL)


_FINDERS: dict[Kind, Callable[[_On], _Found]] = {
    "face": _faces, "edge": _edges, "corner": _corners, "wall": _walls,
}  # fmt: skip
"""Functions that find the features of each kind among candidates."""


def _faces_at(part: Part, corner: int) -> list[int]:
    """Return the faces that meet at a corner."""
    start = part.corners.edges_start
    edges = part.corners.edges[start[corner] : start[corner + 1]]
    return sorted({int(f) for f in part.edges.faces[edges].ravel()})


def _apart(rows: IntArray, place: dict[int, Vectors], count: int) -> IntArray:
    """Return ``count`` candidates far from each other, by farthest-point sampling."""
    x = np.stack([place[int(k)] for k in rows])
    chosen = [int(np.argmax(np.linalg.norm(x - x.mean(axis=0), axis=1)))]
    while len(chosen) < count:
        gaps = np.linalg.norm(x[:, None] - x[chosen], axis=-1).min(axis=1)
        chosen.append(int(np.argmax(gaps)))
    return rows[chosen]


def _along(rows: IntArray, place: dict[int, Vectors], ends: Vectors) -> IntArray:
    """Return two candidates near an edge that are far apart along it."""
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
    """Return the joint information of the readings of each feature about part and pose ``(F,)`` [nats].

    The information about the pose, given the feature's mode, is that part of the decrease of entropy that matters for
    the tolerance (:func:`shrunk`). The information about the mode is that of the best single reading, a lower bound.

    Args:
        found: features of the candidates.
        samples: samples of the posterior.
        predicted: predicted readings for the samples.
        context: input of the policy.
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
                pose[k] = share * shrunk(g[used], S[np.ix_(used, used)], samples.whole[row], samples.useful[row])
    return pose + np.array([apart[feature.rows].max() for feature in found])


def shrunk(G: FloatArray, R: FloatArray, whole: FloatArray, useful: FloatArray) -> float:
    """Return the useful information of several readings about the pose [nats].

    It is half the log of the ratio of the determinants of their predictive covariances, with the complete covariance of
    the pose and without its useful part.

    Args:
        G: Jacobian of the readings over the pose ``(n, 6)``.
        R: covariance of the readings given the pose ``(n, n)``.
        whole: covariance of the pose ``(6, 6)``.
        useful: part of that covariance whose removal has a value for the goal ``(6, 6)``.
    """
    if not len(G):
        return 0.0
    S = G @ whole @ G.T + R
    without = S - G @ useful @ G.T
    return 0.5 * float(np.linalg.slogdet(S)[1] - np.linalg.slogdet(without)[1])
