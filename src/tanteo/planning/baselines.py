"""Simple policies for comparison: random, nearest, largest face, and the 3-2-1 rule."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.planning.context import Choice, DecisionContext
from tanteo.words.findings import DrawnAtRandom, LargestFaceLeast, NearestPlace, Rule321


@dataclass(frozen=True, slots=True)
class Random:
    """Policy that draws a candidate at random."""

    name: str = "random"

    def choose(self, context: DecisionContext) -> Choice:
        """Return a random candidate, which depends only on the session's seed and the number of readings."""
        rng = np.random.default_rng((1991, context.seed, context.count))
        return Choice(int(rng.integers(len(context.candidates))), np.nan, DrawnAtRandom())


@dataclass(frozen=True, slots=True)
class Nearest:
    """Policy that chooses the candidate with the shortest travel among those far from all readings so far.

    Attributes:
        apart: smallest distance to earlier readings, as a fraction of the part's diagonal.
        name: name of the policy.
    """

    apart: float = 0.1
    name: str = "nearest"

    def choose(self, context: DecisionContext) -> Choice:
        """Return the candidate with the shortest travel that is far enough from all readings.

        If no candidate is far enough, the one farthest from the readings is returned.
        """
        s = context
        away = _from_readings(s) - self.apart * s.state.target(0).part.diagonal
        travel = s.travel()
        k = int(np.lexsort((travel, np.minimum(away, 0.0) * -1.0))[0])
        return Choice(k, np.nan, NearestPlace())


@dataclass(frozen=True, slots=True)
class LargestFace:
    """Policy that chooses the face with the largest area per reading, at a place far from earlier readings."""

    name: str = "largest-face"

    def choose(self, context: DecisionContext) -> Choice:
        """Return the candidate, farthest from all readings, on the face with the largest area per reading."""
        s = context
        counts = _sensed_faces(s)
        on_best = np.flatnonzero(s.candidates.mode == 0)
        pool = on_best if len(on_best) else np.arange(len(s.candidates))
        part = s.state.target(int(s.candidates.mode[pool[0]])).part
        areas = np.array([part.faces[f].area for f in s.candidates.face[pool]])
        readings = np.array([counts.get(int(f), 0) for f in s.candidates.face[pool]])
        worth = areas / (1 + readings)
        best = pool[worth >= worth.max() * (1 - 1e-9)]
        k = _spread_out(s, best)
        return Choice(k, np.nan, LargestFaceLeast(part.faces[s.candidates.face[k]].name))


@dataclass(frozen=True, slots=True)
class Scripted321:
    """Policy that repeats the 3-2-1 rule: three readings on the largest plane, two on a second, one on a third."""

    name: str = "3-2-1"

    def choose(self, context: DecisionContext) -> Choice:
        """Return the candidate farthest from all readings on the plane that is next in the rule."""
        s = context
        on_best = np.flatnonzero(s.candidates.mode == 0)
        pool = on_best if len(on_best) else np.arange(len(s.candidates))
        script = _script(s, pool)
        turn = s.count % 6
        which = script[0 if turn < 3 else 1 if turn < 5 else 2] if len(script) == 3 else -1
        on_face = pool[s.candidates.face[pool] == which]
        k = _spread_out(s, on_face if len(on_face) else pool)
        return Choice(k, np.nan, Rule321(turn + 1))


def _script(s: DecisionContext, pool: IntArray) -> list[int]:
    """Return the faces of the 3-2-1 rule: up to three large reachable planes that are about perpendicular."""
    part = s.state.target(int(s.candidates.mode[pool[0]])).part
    reachable = set(s.candidates.face[pool].tolist())
    planes = part.planes
    order = [k for k in np.argsort(-planes.areas) if int(planes.faces[k]) in reachable]
    chosen: list[int] = []
    for k in order:
        n = planes.normals[k]
        if all(abs(float(n @ planes.normals[c])) < 0.3 for c in chosen):
            chosen.append(int(k))
    return [int(planes.faces[k]) for k in chosen[:3]]


def _sensed_faces(s: DecisionContext) -> dict[int, int]:
    """Return the number of readings on each face of the most probable mode."""
    if s.state.touches is None or not len(s.state.touches) or not len(s.state.weights):
        return {}
    target = s.state.target(0)
    local = SE3.apply(SE3.inverse(s.state.poses[0]), s.state.touches.points)
    faces = target.part.triangle_face[target.surface.closest(local).triangles]
    names, counts = np.unique(faces, return_counts=True)
    return dict(zip(names.tolist(), counts.tolist(), strict=True))


def _from_readings(s: DecisionContext) -> FloatArray:
    """Return the distance of the point at which each candidate aims from the nearest reading ``(C,)`` [m].

    It is infinite before the first reading.
    """
    if s.state.touches is None or not len(s.state.touches):
        return np.full(len(s.candidates), np.inf)
    gaps = s.aims()[:, None] - s.state.touches.points
    return np.asarray(np.linalg.norm(gaps, axis=-1).min(axis=1))


def _spread_out(s: DecisionContext, pool: IntArray) -> int:
    """Return the candidate farthest from all readings; before the first, the one nearest to the middle."""
    away = _from_readings(s)[pool]
    if np.isinf(away).all():
        aims = s.aims()[pool]
        return int(pool[np.argmin(np.linalg.norm(aims - aims.mean(axis=0), axis=1))])
    return int(pool[np.argmax(away)])
