"""Which of very many parts are worth a search: by sizes, by labelled planes and sensed normals, by a coarse look.

Each stage says how many nats a part is behind at least, as far as it can tell, and costs less the more parts it sees.
What is nearly as good as the best is searched. What is left out counts: as much as it could explain at the most is
evidence for an object that was not searched (decision 76).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.catalogue import widths
from tanteo.inference.candidates import Candidates
from tanteo.inference.coarse_look import coarse_look
from tanteo.inference.outliers import so_many
from tanteo.inference.plane_votes import BEHIND as BEHIND_PLANES
from tanteo.inference.plane_votes import on_planes, sensed_planes, voted
from tanteo.inference.problem import Problem
from tanteo.measurements import ContactPoints
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms

FEW = 64
"""So many parts are searched without being narrowed: it would cost as much."""

BEHIND = 24.0
"""Nats behind the best, by a coarse look, up to which a part is in."""

_SEARCHED, _AT_LEAST, _REST = 1200, 200, 5e-3
"""Parts that are looked at in full, at most, and after a coarse look at least; fewer where all others together are less
probable than this share of the best, by what a stage can tell."""

_SURELY = 40.0
"""Nats behind the best, votes among them, at which no part is looked at."""

_PLANES_TELL, _LOOK_TELLS = 1.33, 0.5
"""Nats of log evidence for each nat of planes, where the noise is taken as larger than it is stated and an outlier as
cheaper; and of a coarse look, which is as uncertain as its field."""

_LEVEL = 1e-4
"""Probability of more outliers than are allowed for when sizes are compared."""

_SDS = 4.0

_ROUND_OFF = 1.02
"""Mean widths are of 256 directions: so much less may be meant."""


@dataclass(frozen=True, slots=True, eq=False)
class Narrowed:
    """What is left of the parts.

    Attributes:
        rows: of the parts that are searched ``(m,)``, the most promising first.
        hints: poses to begin with, by row; none where nothing proposed one.
        behind: nats that each is behind the best, as far as is known ``(m,)``.
        left_out: log of what the others could explain together, over what the best of these explains; -inf for nothing.
        others: rows of parts that were left out though their size fits.
        certain: whether the hints are all poses that planes allow.
    """

    rows: IntArray
    hints: dict[int, Transforms] = field(default_factory=dict)
    behind: FloatArray = field(default_factory=lambda: np.zeros(0))
    left_out: float = -np.inf
    others: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    certain: bool = False


def narrowed(problem: Problem, candidates: Candidates, odds: FloatArray | None = None) -> Narrowed:
    """The parts that are worth a search; all that are large enough where they are few.

    Args:
        problem: the question.
        candidates: all parts.
        odds: log odds of each by what was measured of the whole object ``(n,)``.
    """
    points = problem.points.take(problem.around.others)
    rows = np.flatnonzero(_large_enough(points, candidates))
    if len(rows) <= FEW or len(points) < 3:
        return Narrowed(rows, behind=np.zeros(len(rows)))
    rows = rows[_wide_enough(problem, points, candidates, rows)]
    if len(rows) <= FEW:
        return Narrowed(rows, behind=np.zeros(len(rows)))
    costs, hints, certain = _compared(problem, points, candidates, rows)
    if odds is not None:
        costs = costs - odds[rows]
    return _best(rows, costs, hints, certain=certain)


def _compared(
    problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray
) -> tuple[FloatArray, dict[int, Transforms], bool]:
    """Nats of each part and poses, by planes if three fix a pose, else by points; whether these are all poses."""
    sensed = sensed_planes(problem, points)
    if not len(sensed.triples):
        lacking = voted(sensed, candidates, rows)
        few = lacking < lacking.min() + BEHIND_PLANES
        looked, hints = coarse_look(problem, points, candidates, rows[few])
        lacking[few] = np.maximum(lacking[few], looked)
        lacking[~few] += looked.max(initial=0.0)
        return lacking, hints, False
    costs, hints = on_planes(sensed, candidates, rows)
    if sensed.certain and costs.min() < sensed.doubtful:  # else normals of curved faces are parallel by chance
        return costs, hints, True
    rough, others = coarse_look(problem, points, candidates, rows)  # they may be of faces that are not planes
    return np.minimum(costs, rough), others | hints, False


def _best(rows: IntArray, costs: FloatArray, hints: dict[int, Transforms], *, certain: bool) -> Narrowed:
    """Those that are little behind the best, and what the others could explain."""
    order = np.argsort(costs, kind="stable")
    behind = costs[order] - costs[order[0]]
    tells, out, least = (_PLANES_TELL, BEHIND_PLANES, 1) if certain else (_LOOK_TELLS, BEHIND, _AT_LEAST)
    rest = np.cumsum(np.exp(-tells * behind)[::-1])[::-1]  # of each and all behind it
    count = min(int(np.searchsorted(behind, out)), int(np.searchsorted(-rest, -_REST)), _SEARCHED)
    count = min(max(count, min(least, int(np.searchsorted(behind, _SURELY))), 1), len(rows))
    kept, left = rows[order[:count]], float(np.log(rest[count])) if count < len(rows) else -np.inf
    own = {int(row): hints[int(row)] for row in kept if int(row) in hints}
    return Narrowed(kept, own, behind[:count], left, rows[order[count:]], certain)


def _large_enough(points: ContactPoints, candidates: Candidates) -> BoolArray:
    """Whether each part is as large as the points' spread, a few outliers left aside ``(n,)``."""
    centre = np.median(points.points, axis=0)
    reach = np.sort(np.linalg.norm(points.points - centre, axis=1) - 4 * points.sd - points.radii)
    shared = 4 * np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1))
    return np.asarray(reach[int(0.75 * (len(reach) - 1))] - shared <= candidates.diagonals)


def _wide_enough(problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray) -> BoolArray:
    """Whether each part holds all points but those that may be outliers: its widths are no less ``(m,)``."""
    rate, n = problem.priors.outlier_rate, len(points)
    outliers = next(k for k in range(n + 1) if so_many(k + 1, n, rate) < _LEVEL)
    if n - outliers < 3:
        return np.ones(len(rows), dtype=bool)
    away = np.linalg.norm(points.points - np.median(points.points, axis=0), axis=1)
    some = np.sort(np.argsort(away, kind="stable")[: n - outliers])
    factor = float(np.exp(problem.scale_sd)) if problem.scale_sd else 1.0
    slack = 2 * float((_SDS * factor * points.sd + points.radii)[some].max())
    slack += 8 * float(np.sqrt(np.sum(points.shared_jacobian**2) / n))
    least = widths(points.points[some]) - slack
    diameters, means = np.concatenate([np.asarray(t["numbers"])[:, 3:5] for _, t in candidates.tables])[rows].T
    return np.asarray((diameters >= least[0]) & (_ROUND_OFF * means >= least[1]))
