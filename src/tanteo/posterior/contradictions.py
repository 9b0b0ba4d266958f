"""Readings that contradict the best part: an outlier or an object that differs there, or a plane that is not the part.

One reading off a face is an outlier of the sensor, or the object is a variant whose face is elsewhere. The other
readings decide only if a reading near it is on the same face.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors
from tanteo.posterior.answers.pose_prior import Table
from tanteo.posterior.fit_at_mode import GoodnessOfFit
from tanteo.posterior.outliers import beta_binomial_tail
from tanteo.words.findings import OutlierOrVariant

NEAR = 0.2
"""Extent of a small patch over the part's size: readings that cover less may fit several places. A reading on the part
within this distance of an outlier shows that the surface is there."""

_MOST = 12
"""Numerical: number of outliers whose planes are tried."""

_SIMILAR = 0.5
"""Numerical: cosine between approaches to one face; those to adjacent faces of a box are perpendicular."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaneBeside:
    """Plane beside the part on which outliers lie.

    Attributes:
        table: the plane; its normal points to the part.
        rows: mask of the outliers on it ``(n,)``.
        is_certain: whether it cannot be a face of the object: the part touches it, and all approaches are known.
    """

    table: Table
    rows: BoolArray
    is_certain: bool


def plane_of_outliers(one: GoodnessOfFit, corner_sd: float) -> PlaneBeside | None:
    """Return the plane of outliers that the part touches from one side; None if there is none.

    Three points lie on a plane always. It is a table or a jaw if the whole part is on one side of it and touches it,
    and all known approaches come from that side. With four points or more the part need not touch it.

    Args:
        one: the most probable mode.
        corner_sd: largest standard deviation of a corner of the part [m].
    """
    problem, rows = one.mode.objective.problem, np.flatnonzero(one.outliers)
    best: PlaneBeside | None = None
    if len(rows) < 3:
        return None
    points, gate = problem.points, problem.settings.search.gate
    places = points.points[rows] + points.radii[rows, None] * points.inward[rows]
    vertices = SE3.apply(one.mode.T_peak, one.mode.prepared.part.vertices)
    slack = gate * (points.sd[rows] + corner_sd)
    for triple in combinations(range(min(len(rows), _MOST)), 3):
        normal = _normal(places[list(triple)], slack[list(triple)])
        if normal is None:
            continue
        middle = places[list(triple)].mean(axis=0)
        heights = (vertices - middle) @ normal
        normal, heights = (normal, heights) if heights.mean() > 0 else (-normal, -heights)
        on = np.abs((places - middle) @ normal) < slack
        from_above = ~points.directed[rows] | (points.directions[rows] @ normal < 0)
        limit = float(slack.max())
        is_beside = heights.min() > -limit and bool(from_above[on].all())
        touches = bool(heights.min() < limit)
        if is_beside and (touches or on.sum() > 3) and (best is None or on.sum() > best.rows.sum()):
            found = np.zeros(len(one.outliers), dtype=np.bool_)
            found[rows[on]] = True
            table = Table(middle, normal, float(np.median(points.sd[rows[on]])))
            best = PlaneBeside(table, found, touches and bool(points.directed[rows[on]].all()))
    return best


def _normal(places: Vectors, slack: FloatArray) -> Vectors | None:
    """Return the unit normal of three places; None if they are nearly on a line."""
    cross = np.cross(places[1] - places[0], places[2] - places[0])
    longest = max(float(np.linalg.norm(places[i] - places[j])) for i, j in ((0, 1), (0, 2), (1, 2)))
    height = float(np.linalg.norm(cross)) / max(longest, 1e-300)
    return None if height <= 2 * slack.max() else np.asarray(cross / np.linalg.norm(cross))


def outlier_or_variant(one: GoodnessOfFit, explained: BoolArray) -> OutlierOrVariant | None:
    """Return the finding that readings off the part may be outliers, or show a variant; None if there is no doubt.

    There is none where another reading on the same face near it is on the part, or where the reading is too far away
    for any object of the size of the parts. Nor is there if the stated rate
    predicts an outlier or more among so many readings, and not too many are off.

    Args:
        one: the most probable mode.
        explained: outliers that something else explains ``(n,)``, such as a table.
    """
    problem, at = one.mode.objective.problem, one.at
    residuals = np.abs(at.distances[0] * one.per_stated_sd)
    far = np.flatnonzero(one.outliers & ~explained & ~problem.distant.rows & (residuals > problem.settings.search.gate))
    n, rate = len(one.outliers), problem.priors.outlier_rate
    if n * rate >= 1 and beta_binomial_tail(len(far), n, rate) > NOTABLE:
        return None
    doubtful = far[[not _is_refuted(one, int(k)) for k in far]] if len(far) else far
    if not len(doubtful):
        return None
    ids, distances, part = problem.points.ids, at.distances[0], one.mode.prepared.part
    order: IntArray = doubtful[np.argsort(-residuals[doubtful], kind="stable")]
    named, off = tuple(ids[k] for k in order), tuple(float(distances[k]) for k in order)
    places = tuple((float(x), float(y), float(z)) for x, y, z in problem.points.points[order])
    numbers = [_approached_face(one, int(k)) for k in order]
    return OutlierOrVariant(part.name, named, off, places, tuple(part.faces[k].name if k >= 0 else "" for k in numbers))


def _approached_face(one: GoodnessOfFit, k: int) -> int:
    """Return the face that the approach to an outlier meets; that nearest to it if no approach is known."""
    points, at, part = one.mode.objective.problem.points, one.at, one.mode.prepared.part
    nearest = int(at.faces[0, k])
    if not points.directed[k]:
        return nearest
    into = one.mode.T_peak[:3, :3].T @ points.directions[k]
    start = SE3.apply(SE3.inverse(one.mode.T_peak), points.points[k]) - 2 * abs(float(at.distances[0, k])) * into
    hit = one.mode.prepared.surface.cast(start, into)
    return int(part.triangle_face[int(hit.triangles)]) if np.isfinite(hit.distances) else nearest


def _is_refuted(one: GoodnessOfFit, k: int) -> bool:
    """Return whether a reading near an outlier is on the part, on the face nearest to the outlier or to its approach.

    A reading that is some millimetres off a face near its border is nearest to another face.
    """
    points, at, edges = one.mode.objective.problem.points, one.at, one.mode.prepared.part.edges
    faces = {int(at.faces[0, k]), _approached_face(one, k)}
    same = np.isin(at.faces[0], list(faces)) & one.inliers
    for row in np.flatnonzero(one.inliers & (at.faces[0] < -1)):
        edge = -2 - int(at.faces[0, row])
        same[row] |= edge < len(edges) and bool(faces & set(edges.faces[edge].tolist()))
    same &= np.linalg.norm(points.points - points.points[k], axis=1) < NEAR * one.mode.prepared.part.diagonal
    if points.directed[k]:
        same &= ~points.directed | (points.directions @ points.directions[k] > _SIMILAR)
    return bool(same.any())
