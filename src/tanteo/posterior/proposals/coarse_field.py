"""Coarse evaluation of points on distance fields of parts: scores of all, then refined poses of the best.

Each part is evaluated at uniform attitudes, at all positions at which its box contains the points. Parts of similar
boxes share the best few hundred of these poses, and each refines its own best of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.catalogue.signatures import LEVELS
from tanteo.factors import ContactPoints
from tanteo.geometry.typing import FloatArray, Indices, IntArray, Transforms
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.problem import Problem
from tanteo.posterior.sampling.peaks import spread_rows


def evaluate_fields(
    problem: Problem,
    points: ContactPoints,
    candidates: Candidates,
    rows: IntArray,
    *,
    thorough: bool = False,
    offset: float = 0.0,
    offset_sd: float = 0.0,
) -> tuple[FloatArray, dict[int, Transforms]]:
    """Return the rough cost of the points on each part [nats] ``(m,)``, and poses of promising parts by row.

    Args:
        problem: measurements and priors.
        points: points that are evaluated.
        candidates: all parts.
        rows: rows of the parts that are evaluated ``(m,)``.
        thorough: whether to refine more poses, and to return some of every part.
        offset: distance of all points outward from the surface that is assumed [m].
        offset_sd: its standard deviation [m].
    """
    evaluation = _Evaluation(problem, points, thorough=thorough, offset=offset, offset_sd=offset_sd)
    best = evaluation.own.cost_point * len(evaluation.at)
    costs, poses = np.full(len(rows), best), dict[int, Transforms]()
    for start, table in candidates.fields:
        here = np.flatnonzero((rows >= start) & (rows < start + len(table["numbers"])))
        here = here[np.argsort(np.asarray(table["kind"])[rows[here] - start], kind="stable")]
        scores, found, Ts = evaluation.at_parts(table, (rows[here] - start).astype(np.int32), best)
        best = min(best, float(scores.min(initial=best)))
        costs[here] = found[:, 0]
        poses |= {int(rows[here[k]]): Ts[k] for k in np.flatnonzero(scores <= best + evaluation.gap)}
    return costs, poses


class _Evaluation:
    """Some of the points, far from each other, as the core evaluates them."""

    def __init__(
        self, problem: Problem, points: ContactPoints, *, thorough: bool, offset: float, offset_sd: float
    ) -> None:
        own = self.own = problem.settings.search
        factor = float(np.exp(problem.scale_sd)) if problem.scale_sd else 1.0
        usable = np.flatnonzero(~points.centres)
        spread = usable[spread_rows(points.take(usable), min(own.few_points, len(usable)))]
        shared = float(np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1)))
        self.at = np.ascontiguousarray(points.points[spread])
        self.normals = np.ascontiguousarray(np.where(points.oriented[spread, None], points.normals[spread], 0.0))
        self.sds = np.hypot(factor * points.sd[spread], np.hypot(shared, offset_sd))
        self.tilts = np.where(points.oriented[spread], points.normal_sds[spread], 1.0)
        self.radii = np.ascontiguousarray(points.radii[spread] + offset)
        self.gap = np.inf if thorough else own.negligible
        more = own.few_points / len(spread)  # few points discriminate poses less well
        self.stepped = int(min(more, 3.0) * own.few_points) * (own.thorough if thorough else 1)

    def at_parts(
        self, table: Mapping[str, Any], rows: Indices, best: float
    ) -> tuple[FloatArray, FloatArray, Transforms]:
        """Return scores of parts ``(R,)``, and costs and poses after refinement ``(R, 4)``, best first.

        Args:
            table: arrays of a catalogue.
            rows: rows of parts in it; parts of similar boxes follow one another.
            best: best score so far; parts with far worse scores get no poses and the largest cost.
        """
        numbers, kinds = np.asarray(table["numbers"]), np.asarray(table["kind"])
        return _core.coarse(
            np.asarray(table["field"]), np.asarray(table["field_start"]), np.asarray(table["grid"]),
            np.sqrt(numbers[:, 0] / self.own.coarse_areas), np.ascontiguousarray(numbers[:, 5:8]),
            np.ascontiguousarray(numbers[:, 8:14]), float(LEVELS), rows, np.ascontiguousarray(kinds[rows]), best,
            self.gap, self.at, self.normals, self.sds, self.tilts, self.radii, self.own.cost_point, self.stepped,
            self.own.kept // 2,
        )  # fmt: skip
