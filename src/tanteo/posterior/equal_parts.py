"""Several equal parts in one set of readings: the pose of each, and the readings that are on it.

The readings are separated by clusters in the world, or one part is found after the other with an outlier rate of one
half, each among the readings that are on none so far. Each part is then located by its own readings alone. Several
parts are the answer only if the readings of each fit it, nearly all readings are on one of them, and no two overlap:
readings of one bent or misread part fit two poses that do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from tanteo.errors import TanteoError
from tanteo.geometry import SE3
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.typing import BoolArray
from tanteo.parts import Part, part_named
from tanteo.posterior.answers.results import Answer, Hypothesis
from tanteo.posterior.convention_checks import Query
from tanteo.posterior.prepared import PreparedPart, prepare
from tanteo.posterior.settings import DEFAULTS, Settings
from tanteo.sensors import Readings
from tanteo.words.findings import SeveralEqual

FEWEST = 7
"""Definition: smallest number of readings of a part: six fit any pose."""

MOST = 8
"""Definition: largest number of equal parts."""

_HALF = 0.5
"""Definition: outlier rate with which one part is found among readings of several."""

_LEFT = 0.1
"""Numerical: largest fraction of the readings, and of those of each part, that are on none of the parts."""

_FLAT = 3.0
"""Definition: scatter about a plane, in units of that about the part, below which a plane explains the readings."""

_INSIDE, _DRAWN = 0.03, 400
"""Numerical: fraction of the points inside one part up to which another touches it; number of points drawn."""


def equal_parts(
    answer: Answer, readings: Readings, parts: Sequence[Part], question: Query, count: int | None = None
) -> Answer | None:
    """Return the answer that several equal parts were sensed; None if they do not explain the readings.

    Args:
        answer: answer for one part, from all readings.
        readings: the readings.
        parts: the candidates.
        question: options of the inference that gave the answer.
        count: number of equal parts; None if it is not known. Without it, several parts are considered only where one
            leaves many readings unexplained.
    """
    best = answer.hypotheses[0] if answer.hypotheses else None
    if count == 1 or len(readings) < 2 * FEWEST or (best is None and len(parts) > 1):
        return None
    if count is None and answer.status != "unknown" and len(best.outliers if best else ()) < FEWEST:
        return None
    named = parts[0] if best is None else part_named(parts, best.part)
    part = getattr(named, "part", named)
    groups = _by_place(readings, part, count)
    found = _several(readings, groups, part, question, count)
    divided = best is not None and FEWEST <= len(best.outliers) <= len(readings) - FEWEST
    if found is None and (divided or count is not None):
        groups = _one_by_one(readings, part, question, count)
        found = _several(readings, groups, part, question, count)
        # without a place of their own, readings that leave the pose open fit any part: they may be outliers
        if found is not None and count is None and found.status == "insufficient":
            return None
    return found


def _several(
    readings: Readings, groups: list[BoolArray], part: Part, question: Query, count: int | None
) -> Answer | None:
    """Return the answer for groups of readings, each on one part; None if these do not explain the readings."""
    if len(groups) < 2:
        return None
    left = ~np.any(groups, axis=0)
    if (count is not None and len(groups) != count) or left.mean() > _LEFT:
        return None
    order = sorted(range(len(groups)), key=lambda k: int(np.argmax(groups[k])))
    groups = [groups[k] for k in order]
    answers, prepared = list[Answer](), prepare(part)
    for k, rows in enumerate(groups):
        one = _answer(question, readings.take(rows), part, first=k == 0)
        if one is None or one.status == "unknown" or one.unknown_probability > NOTABLE:
            return None
        if len(one.hypotheses[0].outliers) > _LEFT * rows.sum():
            return None
        if count is None and _on_a_plane(readings.take(rows), one.hypotheses[0], prepared):
            return None
        answers.append(one)
    best = [one.hypotheses[0] for one in answers]
    statuses = tuple(one.status for one in answers)
    if "recognized" not in statuses or any(_overlap(prepared, one, other) for one, other in combinations(best, 2)):
        return None
    names = tuple(tuple(str(readings.ids[k]) for k in np.flatnonzero(rows)) for rows in groups)
    verdict = SeveralEqual(
        part.name, names, tuple(tuple(map(float, h.T_world_part[:3, 3])) for h in best),
        tuple(h.corner_sd for h in best), statuses, tuple(str(readings.ids[k]) for k in np.flatnonzero(left)),
    )  # fmt: skip
    worst = next(one for one in ("insufficient", "ambiguous", "recognized") if one in statuses)
    undecided = [v for one in answers if one.status != "recognized" for v in one.findings if v.role == "verdict"]
    kept = [one for one in answers[0].findings if one.role != "verdict"]
    return replace(answers[0], status=worst, findings=(verdict, *undecided, *kept), equal=tuple(answers[1:]))


def _on_a_plane(readings: Readings, best: Hypothesis, prepared: PreparedPart) -> bool:
    """Return whether one plane explains the readings as well as the part does; it may be a table."""
    points = readings.points.filled(0.0)
    gaps = prepared.surface.closest(SE3.apply(SE3.inverse(best.T_world_part), points)).distances
    part = np.sqrt(np.mean((gaps - readings.radii) ** 2))
    plane = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[2] / np.sqrt(len(points))
    return bool(plane < _FLAT * max(part, float(np.max(readings.sds.filled(0.0)))))


def _by_place(readings: Readings, part: Part, count: int | None) -> list[BoolArray]:
    """Return the readings of clusters in the world as masks, as few as fit the size of the part; none if one does."""
    from scipy.cluster.hierarchy import fcluster, linkage  # slow to import
    from scipy.spatial.distance import pdist

    points = readings.points.filled(0.0)
    if not readings.points.given.all() or pdist(points).max() < part.diagonal:
        return []
    for number in range(count or 2, (count or MOST) + 1):
        for method in ("ward", "average", "complete"):
            owner = fcluster(linkage(points, method), number, "maxclust")
            groups = [owner == k for k in range(1, number + 1)]
            many = min(int(rows.sum()) for rows in groups) >= FEWEST
            if many and max(pdist(points[rows]).max() for rows in groups) < part.diagonal:
                return groups
    return []


def _one_by_one(readings: Readings, part: Part, question: Query, count: int | None) -> list[BoolArray]:
    """Return the readings of each part as masks, found one part after the other."""
    ids = np.array(readings.ids, dtype=object)
    left = np.ones(len(readings), dtype=np.bool_)
    groups = list[BoolArray]()
    while left.sum() >= FEWEST and len(groups) < (count or MOST):
        found = _answer(
            question, readings.take(left), part, first=not groups, outlier_rate=_HALF, settings=DEFAULTS.brief
        )
        best = found.hypotheses[0] if found is not None and found.hypotheses else None
        own = left & ~np.isin(ids, list(best.outliers)) if best is not None else ~left
        if own.sum() < FEWEST:
            break
        groups.append(own)
        left = left & ~own
    return groups


def _answer(
    question: Query,
    readings: Readings,
    part: Part,
    *,
    first: bool,
    outlier_rate: float | None = None,
    settings: Settings | None = None,
) -> Answer | None:
    """Return the answer for some of the readings; a prior of the pose is that of the first part only."""
    try:
        return question.answer(readings, [part], outlier_rate=outlier_rate, anywhere=not first, settings=settings)
    except TanteoError:
        return None


def _overlap(prepared: PreparedPart, one: Hypothesis, other: Hypothesis) -> bool:
    """Return whether two equal parts overlap; parts without an inside overlap if their centroids are near."""
    T_one_other = SE3.inverse(one.T_world_part) @ other.T_world_part
    part, surface = prepared.part, prepared.surface
    if not part.closed:
        apart = SE3.apply(T_one_other, part.centroid) - part.centroid
        return bool(np.linalg.norm(apart) < 0.1 * part.diagonal)
    rng = np.random.default_rng(0)
    low, high = part.box
    points = rng.uniform(low, high, (_DRAWN, 3))
    points = points[surface.inside(points)]
    return bool(surface.inside(SE3.apply(T_one_other, points)).mean() > _INSIDE) if len(points) else False
