"""Points against coarse fields of very many parts: scores of all, then steps on those that are worth it.

A part is tried at turns that are even over all attitudes, and wherever its box holds the points after a turn. Parts of
a kind have nearly the same box: they share the best few hundred of these, and each takes its own best of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.catalogue import LEVELS
from tanteo.inference.candidates import Candidates
from tanteo.inference.problem import Problem
from tanteo.inference.proposals import spread_rows
from tanteo.measurements import ContactPoints
from tanteo.typing import FloatArray, Indices, IntArray, Transforms

_POINTS = 24
"""Points that are looked at, far from each other."""

_AREAS = 64
"""Equal areas of a part's surface: the distance between their middles is what poses are tried by."""

_MOST = 8.0
"""Nats that a point costs at most."""

_STEPPED, _FEWEST, _MANIEST = 576, 16, 64
"""Points that first steps place on a part, about, and poses from which these are made: few points tell poses less well
apart, so that more of them are tried, at the same cost."""

_THOROUGH = 16
"""Times as many poses where parts are few. Of touches of a real block, nearly a cube with steps, these had its pose
in 13 of 30 attitudes, in 1.6 times the time; without, in none."""

_KEPT = 4

_BEHIND = 12.0
"""Nats of the best score of a part behind that of all from which no steps are made on it. A score is blurred by half a
cell of what it tries: at the right pose it was up to 5 nats behind in the scenes looked at."""


def coarse_look(
    problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray, *, thorough: bool = False
) -> tuple[FloatArray, dict[int, Transforms]]:
    """Nats that points cost on each part, roughly ``(m,)``, and poses of those that are worth it, by row.

    Args:
        problem: the question.
        points: those that are looked at.
        candidates: all parts.
        rows: of those that are compared ``(m,)``.
        thorough: more poses are tried, and there are some of every part.
    """
    look = _Look(problem, points, thorough=thorough)
    best = _MOST * len(look.at)
    costs, hints = np.full(len(rows), best), dict[int, Transforms]()
    for start, table in candidates.fields:
        here = np.flatnonzero((rows >= start) & (rows < start + len(table["numbers"])))
        here = here[np.argsort(np.asarray(table["kind"])[rows[here] - start], kind="stable")]
        scores, found, Ts = look.at_parts(table, (rows[here] - start).astype(np.int32), best)
        best = min(best, float(scores.min(initial=best)))
        costs[here] = found[:, 0]
        hints |= {int(rows[here[k]]): Ts[k] for k in np.flatnonzero(scores <= best + look.behind)}
    return costs, hints


class _Look:
    """Some of the points, in the order in which they tell most."""

    def __init__(self, problem: Problem, points: ContactPoints, *, thorough: bool) -> None:
        factor = float(np.exp(problem.scale_sd)) if problem.scale_sd else 1.0
        usable = np.flatnonzero(~points.centres)
        spread = usable[spread_rows(points.take(usable), min(_POINTS, len(usable)))]
        shared = float(np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1)))
        self.at = np.ascontiguousarray(points.points[spread])
        self.normals = np.ascontiguousarray(np.where(points.oriented[spread, None], points.normals[spread], 0.0))
        self.sds = np.hypot(factor * points.sd[spread], shared)
        self.tilts = np.where(points.oriented[spread], points.normal_sds[spread], 1.0)
        self.radii = np.ascontiguousarray(points.radii[spread])
        self.behind = np.inf if thorough else _BEHIND
        self.stepped = int(np.clip(_STEPPED / len(spread), _FEWEST, _MANIEST)) * (_THOROUGH if thorough else 1)

    def at_parts(
        self, table: Mapping[str, Any], rows: Indices, best: float
    ) -> tuple[FloatArray, FloatArray, Transforms]:
        """Scores of parts ``(R,)``, and the nats and poses that steps lead to ``(R, 4)``, the best first.

        Args:
            table: of a catalogue.
            rows: of the parts in it, those of a kind one after another.
            best: score so far; of parts that are far behind there are no poses, and the nats are the most there can be.
        """
        numbers, kinds = np.asarray(table["numbers"]), np.asarray(table["kind"])
        return _core.coarse(
            np.asarray(table["field"]), np.asarray(table["field_start"]), np.asarray(table["grid"]),
            np.sqrt(numbers[:, 0] / _AREAS), np.ascontiguousarray(numbers[:, 5:8]),
            np.ascontiguousarray(numbers[:, 8:14]), float(LEVELS), rows, np.ascontiguousarray(kinds[rows]), best,
            self.behind, self.at, self.normals, self.sds, self.tilts, self.radii, _MOST, self.stepped, _KEPT,
        )  # fmt: skip
