"""Points against coarse fields of very many parts: parts of a kind share their poses.

First the first part of each kind is looked at from pairs of places that are as far apart as two points; then, kind by
kind, the best first, the poses that were found are tried on the other parts of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.catalogue import LEVELS, PLACES
from tanteo.inference.candidates import Candidates
from tanteo.inference.problem import Problem
from tanteo.inference.proposals import spread_rows
from tanteo.measurements import ContactPoints
from tanteo.typing import FloatArray, Indices, IntArray, Transforms

_POINTS, _FAR = 24, 8
"""Points that are looked at, and those of them, far from each other, of which pairs are made."""

_PAIRS = 2
"""Pairs of points."""

_EACH = 300
"""Pairs of places for each pair of points, about."""

_MOST = 8.0
"""Nats that a point costs at most."""

_KEPT = 4

_MEMBERS = 30_000
"""Parts of which the poses of their kind's first part are tried, at most: those of the best kinds."""

_BEHIND = 30.0
"""Nats of a kind's first part behind the best of all beyond which its others are not looked at."""


def coarse_look(
    problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray
) -> tuple[FloatArray, dict[int, Transforms]]:
    """Nats that points cost on each part, roughly ``(m,)``, and poses, by row."""
    look = _Look(problem, points)
    costs, hints, kinds = np.full(len(rows), _MOST * len(look.at)), dict[int, Transforms](), list[Any]()
    for start, table in candidates.tables:
        here = np.flatnonzero((rows >= start) & (rows < start + len(table["numbers"])))
        local = rows[here] - start
        first, which = np.unique(np.asarray(table["kind"])[local], return_inverse=True)
        found, Ts = look.at_parts(table, first.astype(np.int32), np.zeros((0, 4, 4)))
        for k in range(len(first)):
            kinds.append((found[k, 0], table, here[which == k], local[which == k], Ts[k]))
    done, best = 0, min((kind[0] for kind in kinds), default=0.0)
    for cost, table, here, local, Ts in sorted(kinds, key=lambda kind: float(kind[0])):
        costs[here] = cost
        if done > _MEMBERS or cost > best + _BEHIND:
            continue
        own, poses = look.at_parts(table, local.astype(np.int32), Ts)
        costs[here], done = own[:, 0], done + len(here)
        for k, row in enumerate(here):
            hints[int(rows[row])] = poses[k]
    return costs, hints


class _Look:
    """Some of the points, in the order in which they tell most."""

    def __init__(self, problem: Problem, points: ContactPoints) -> None:
        factor = float(np.exp(problem.scale_sd)) if problem.scale_sd else 1.0
        usable = np.flatnonzero(~points.centres)
        spread = usable[spread_rows(points.take(usable), min(_POINTS, len(usable)))]
        shared = float(np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1)))
        self.at = np.ascontiguousarray(points.points[spread])
        self.normals = np.ascontiguousarray(np.where(points.oriented[spread, None], points.normals[spread], 0.0))
        self.sds = np.hypot(factor * points.sd[spread], shared)
        self.tilts = np.where(points.oriented[spread], points.normal_sds[spread], 1.0)
        self.radii = np.ascontiguousarray(points.radii[spread])
        self.pairs = _pairs(self.at[:_FAR])

    def at_parts(self, table: Mapping[str, Any], rows: Indices, starts: Transforms) -> tuple[FloatArray, Transforms]:
        """Nats and poses of parts ``(R, 4)``, best first; from some poses, if there are any."""
        numbers = table["numbers"]
        return _core.coarse(
            np.asarray(table["places"]).reshape(-1, 6), np.asarray(table["places_start"]), np.asarray(table["field"]),
            np.asarray(table["field_start"]), np.asarray(table["grid"]), np.sqrt(numbers[:, 0] / PLACES),
            np.ascontiguousarray(numbers[:, 5:8]), float(LEVELS), rows, self.at, self.normals, self.sds, self.tilts,
            self.radii, self.pairs, np.ascontiguousarray(starts), _MOST, _EACH, _KEPT,
        )  # fmt: skip


def _pairs(p: FloatArray) -> Indices:
    """Pairs of points that are far apart, none of them in two."""
    first, second = np.triu_indices(len(p), 1)
    gaps = np.linalg.norm(p[first] - p[second], axis=1)
    chosen, used = list[int](), set[int]()
    for k in np.argsort(-gaps, kind="stable"):
        if used.isdisjoint((int(first[k]), int(second[k]))) and len(chosen) < 2 * _PAIRS:
            chosen += [int(first[k]), int(second[k])]
            used.update(chosen)
    return np.array(chosen, dtype=np.int32)
