"""Which of very many parts are worth a search: by sizes, by labelled planes, normals and centres, by a coarse look.

Each stage says how many nats a part is behind at least, as far as it can tell, and costs less the more parts it sees.
What is nearly as good as the best is searched. What is left out counts: as much as it could explain at the most is
evidence for an object that was not searched (decision 76).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.catalogue import widths
from tanteo.inference.candidates import Candidates
from tanteo.inference.centre_votes import lacking, on_axes, sensed_centres
from tanteo.inference.coarse_look import coarse_look
from tanteo.inference.outliers import so_many
from tanteo.inference.plane_votes import BEHIND as BEHIND_PLANES
from tanteo.inference.plane_votes import on_planes, voted
from tanteo.inference.problem import Problem
from tanteo.inference.sensed_planes import SensedPlanes, sensed_planes
from tanteo.measurements import ContactPoints
from tanteo.special import log_sum, softmax
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms

FEW = 64
"""So many parts are searched without being narrowed: it would cost as much."""

BEHIND = 24.0
"""Nats behind the best, by a coarse look, up to which a part is in."""

_SEARCHED, _AT_LEAST, _REST = 1200, 200, 5e-3
"""Parts that are looked at in full, at most, and after a coarse look at least; fewer where all others together are less
probable than this share of the best, by what a stage can tell."""

_LOOKED = 5
"""Points on the surface from which a coarse look tells anything; fewer fit any part."""

_SURELY = 40.0
"""Nats behind the best, votes among them, at which no part is looked at."""

_NAMED = 16
"""Parts that are searched where planes and centres fix no pose and very many have them: it will not be known which."""

_PLANES_TELL, _LOOK_TELLS = 1.33, 0.5
"""Nats of log evidence for each nat of planes, where the noise is taken as larger than it is stated and an outlier as
cheaper; and of a coarse look, which is as uncertain as its field."""

_ASIDE, _CLEARLY = 0.06, 4.0
"""Parts that are out of a coarse look by what was measured of the whole object: together they have no more than this
share of probability, and each is so many nats behind the best. Where nothing else explains the points, they are in."""

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
        certain: whether the hints are all poses that planes and centres allow.
        aside: how many of the others were not looked at, by what was measured of the whole object.
        discount: log odds of the others by that, on average, over those of the less promising half of the rows.
        bound: whether parts are behind by so much at least; a coarse look estimates it.
    """

    rows: IntArray
    hints: dict[int, Transforms] = field(default_factory=dict)
    behind: FloatArray = field(default_factory=lambda: np.zeros(0))
    left_out: float = -np.inf
    others: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    certain: bool = False
    aside: int = 0
    discount: float = 0.0
    bound: bool = False


def narrowed(
    problem: Problem, candidates: Candidates, odds: FloatArray | None = None, *, every: bool = False
) -> Narrowed:
    """The parts that are worth a search; all that are large enough where they are few.

    Args:
        problem: the question.
        candidates: all parts.
        odds: log odds of each by what was measured of the whole object ``(n,)``.
        every: none is left aside by that.
    """
    points = problem.points.take(problem.around.others)
    rows = np.flatnonzero(_large_enough(points, candidates))
    if len(rows) <= FEW or (len(points) < 3 and not points.centres.any()):
        return _all_of(problem, points, candidates, rows)
    rows = rows[_wide_enough(problem, points, candidates, rows)]
    if len(rows) <= FEW:
        return _all_of(problem, points, candidates, rows)
    own = np.zeros(len(rows)) if odds is None else odds[rows]
    in_it = np.ones(len(rows), dtype=bool) if every else _promising(own)
    compared = _compared(problem, points, candidates, rows, in_it)
    compared.costs = compared.costs - own
    found = _best(rows, compared)
    if found.bound or odds is None or not len(found.others):
        return found
    half = found.rows[len(found.rows) // 2 :]
    discount = float(log_sum(odds[found.others]) - log_sum(odds[half]) + np.log(len(half) / len(found.others)))
    return replace(found, aside=int(np.count_nonzero(~in_it)), discount=discount)


def _all_of(problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray) -> Narrowed:
    """So few parts that all are searched, from where a coarse look has the points."""
    hints = dict[int, Transforms]()
    if np.count_nonzero(~points.centres) >= _LOOKED and len(rows):
        _, hints = coarse_look(problem, points, candidates, rows, thorough=True)
    return Narrowed(rows, hints, np.zeros(len(rows)))


def _promising(odds: FloatArray) -> BoolArray:
    """Which parts are looked at, by their log odds ``(m,)``."""
    order = np.argsort(odds, kind="stable")
    out = np.ones(len(odds), dtype=bool)
    out[order[np.cumsum(softmax(odds)[order]) <= _ASIDE]] = False
    return out | (odds > odds.max() - _CLEARLY)


@dataclass(slots=True, eq=False)
class _Compared:
    """Nats of parts, and poses by their rows; whether these are all, and whether the nats are bounds."""

    costs: FloatArray
    hints: dict[int, Transforms]
    certain: bool
    bound: bool


def _compared(
    problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray, in_it: BoolArray
) -> _Compared:
    """Nats of each part and poses, by planes and centres, and by points where these do not fix a pose.

    Points are compared with those parts only that are ``in_it``.
    """
    planes = sensed_planes(problem, points)
    found = _Compared(np.zeros(0), {}, certain=False, bound=True)
    if len(planes.triples):
        far = max(BEHIND_PLANES, float(np.log(len(rows) / _REST)) / _PLANES_TELL)  # what is beyond is no more than that
        found.costs, found.hints = on_planes(planes, candidates, rows, far)
        found.certain = bool(found.costs.min() < planes.believed)
    else:
        found.costs = voted(planes, candidates, rows)
    if points.centres.any():
        _by_centres(problem, points, planes, candidates, rows, found)
    few_points = np.count_nonzero(~points.centres) < _LOOKED and not len(planes.triples)
    if found.certain or few_points:
        return found
    found.bound = False
    if len(planes.triples):
        rough, others = coarse_look(problem, points, candidates, rows)  # they may be of faces that are not planes
        found.costs, found.hints = np.minimum(found.costs, rough), others | found.hints
        return found
    few = in_it & (found.costs < found.costs[in_it].min() + BEHIND_PLANES)
    looked, hints = coarse_look(problem, points, candidates, rows[few])
    found.costs[few] = np.maximum(found.costs[few], looked)
    found.costs[~few] += looked.max(initial=0.0)
    found.hints = hints | found.hints
    return found


def _by_centres(
    problem: Problem, points: ContactPoints, planes: SensedPlanes, candidates: Candidates, rows: IntArray,
    found: _Compared,
) -> None:  # fmt: skip
    """Nats of centres beside those of planes, and poses by both."""
    centres = sensed_centres(problem, points, planes)
    found.costs += lacking(centres, candidates, rows)
    if len(centres.seeds):
        on_axes(centres, candidates, rows, found.costs, found.hints)
        found.certain |= centres.certain and float(found.costs.min()) < centres.hopeless


def _best(rows: IntArray, found: _Compared) -> Narrowed:
    """Those that are little behind the best, and what the others could explain."""
    order = np.argsort(found.costs, kind="stable")
    behind = found.costs[order] - found.costs[order[0]]
    tells, out, least = (_PLANES_TELL, BEHIND_PLANES, 1) if found.bound else (_LOOK_TELLS, BEHIND, _AT_LEAST)
    rest = np.cumsum(np.exp(-tells * behind)[::-1])[::-1]  # of each and all behind it
    count = min(int(np.searchsorted(behind, out)), int(np.searchsorted(-rest, -_REST)))
    if found.bound and not found.certain:
        count = count if count <= FEW else _NAMED
    elif count > _SEARCHED:
        count = _AT_LEAST if found.bound and rest[_SEARCHED] > 1 else _SEARCHED
    count = min(max(count, min(least, int(np.searchsorted(behind, _SURELY))), 1), len(rows))
    kept, left = rows[order[:count]], float(np.log(rest[count])) if count < len(rows) else -np.inf
    own = {int(row): found.hints[int(row)] for row in kept if int(row) in found.hints}
    others = rows[order[count:]]
    return Narrowed(kept, own, behind[:count], left, others, certain=found.certain, bound=found.bound)


def _large_enough(points: ContactPoints, candidates: Candidates) -> BoolArray:
    """Whether each part is as large as the points' spread, a few outliers left aside ``(n,)``."""
    centre = np.median(points.points, axis=0)
    reach = np.sort(np.linalg.norm(points.points - centre, axis=1) - 4 * points.sd - points.radii)
    shared = 4 * np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1))
    return np.asarray(reach[int(0.75 * (len(reach) - 1))] - shared <= candidates.diagonals)


def _wide_enough(problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray) -> BoolArray:
    """Whether each part holds all points but those that may be outliers: its widths are no less ``(m,)``.

    A centre may be beyond the end of its hole.
    """
    points = points.take(np.flatnonzero(~points.centres))
    rate, n = problem.priors.outlier_rate, len(points)
    if n < 3:
        return np.ones(len(rows), dtype=bool)
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
