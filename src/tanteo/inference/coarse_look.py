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
    costs, hints = np.full(len(rows), _MOST * len(look.at)), dict[int, Transforms]()
    best = _MOST * len(look.at)
    scores = np.full(len(rows), best)
    for start, table in candidates.tables:
        here = np.flatnonzero((rows >= start) & (rows < start + len(table["numbers"])))
        here = here[np.argsort(np.asarray(table["kind"])[rows[here] - start], kind="stable")]
        scores[here], own, Ts = look.at_parts(table, (rows[here] - start).astype(np.int32), best)
        costs[here], best = own[:, 0], min(best, float(scores[here].min(initial=best)))
        hints |= {int(rows[row]): poses for row, poses in zip(here, Ts, strict=True)}
    LAST["scores"] = scores
    return costs, hints


LAST = {}
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

    def at_parts(self, table: Mapping[str, Any], rows: Indices, best: float) -> tuple[FloatArray, FloatArray, Transforms]:
        """Nats and poses of parts ``(R, 4)``, best first."""
        numbers = np.asarray(table["numbers"])
        return _core.coarse(
            np.asarray(table["field"]), np.asarray(table["field_start"]), np.asarray(table["grid"]),
            np.sqrt(numbers[:, 0] / PLACES), np.ascontiguousarray(numbers[:, 5:8]),
            np.ascontiguousarray(numbers[:, 8:14]), float(LEVELS), rows,
            np.ascontiguousarray(np.asarray(table["kind"])[rows]), best, self.at, self.normals, self.sds, self.tilts,
            self.radii, _MOST, _KEPT,
        )  # fmt: skip
