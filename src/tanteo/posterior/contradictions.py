"""Readings that contradict the best part: an outlier or an object that differs there, or a plane that is not the part.

One reading off a face is an outlier of the sensor, or the object is a variant whose face is elsewhere. The other
readings decide only if a reading near it is on the same face.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tanteo.geometry import SE3, SO3
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
"""Numerical: least cosine between an approach and the normal of its face; adjacent faces of a box are perpendicular."""

_ALONG = 0.9
"""Numerical: least cosine between the way to a displaced face and its normal; it is 1 but for noise and facets."""


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
    numbers = [_displaced_face(one, int(k)) for k in order]
    return OutlierOrVariant(part.name, named, off, places, tuple(part.faces[k].name if k >= 0 else "" for k in numbers))


def _displaced_face(one: GoodnessOfFit, k: int) -> int:
    """Return the face that would pass through an outlier if it were displaced; -1 if there is none.

    It is the face that the approach meets. Without one it is the face on the way to the nearest place of the surface,
    if that way is along its normal. Beyond the end of a face, it is the face at the end.
    """
    points, at = one.mode.objective.problem.points, one.at
    x, T = at.in_part[0, k], one.mode.T_peak
    if points.directed[k]:
        into = T[:3, :3].T @ points.directions[k]
        faces, _ = _faces_hit(one, x - 2 * abs(float(at.distances[0, k])) * into, into, 0.0)
        if faces[0] >= 0:
            return int(faces[0])
    near = one.mode.prepared.surface.closest(x)
    way = near.points - x
    if not near.distances > 0:
        return int(at.faces[0, k])
    faces, normals = _faces_hit(one, x, way / near.distances, _reach(one, k))
    along = np.flatnonzero((faces >= 0) & (np.abs(normals @ way) > _ALONG * near.distances))
    return int(faces[along[0]]) if len(along) else -1


def _faces_hit(one: GoodnessOfFit, start: Vectors, way: Vectors, spread: float) -> tuple[IntArray, Vectors]:
    """Return faces and normals that a ray and four rays beside it hit ``(5,)``, ``(5, 3)``; -1 where one misses."""
    prepared, (u, v) = one.mode.prepared, SO3.frame_from_axis(way, 2)[:, :2].T
    beside = spread * np.stack([np.zeros(3), u, -u, v, -v])
    triangles = prepared.surface.cast(start + beside, np.broadcast_to(way, beside.shape)).triangles
    faces = np.where(triangles >= 0, prepared.part.triangle_face[triangles], -1)
    return faces, prepared.surface.normals[triangles]


def _reach(one: GoodnessOfFit, k: int) -> float:
    """Return the largest error of the place of a reading [m]."""
    return float(one.mode.objective.problem.settings.search.gate / one.at.per_sd[0, k])


def _is_refuted(one: GoodnessOfFit, k: int) -> bool:
    """Return whether a reading on the part shows that the face through an outlier is where the part has it.

    The reading is near the outlier and on this face for sure: a reading on a neighbouring face shows nothing.
    """
    at, edges = one.at, one.mode.prepared.part.edges
    face = _displaced_face(one, k)
    if face < 0:
        return False
    away = np.linalg.norm(at.in_part[0] - at.in_part[0, k], axis=1)
    near = one.inliers & (away < NEAR * one.mode.prepared.part.diagonal)
    for row in np.flatnonzero(near & (at.faces[0] < -1)):
        edge = -2 - int(at.faces[0, row])
        if edge < len(edges) and face in edges.faces[edge]:
            return True
    return any(_is_on(one, int(row), face) for row in np.flatnonzero(near & (at.faces[0] == face)))


def _is_on(one: GoodnessOfFit, row: int, face: int) -> bool:
    """Return whether a reading is on its face for sure: by its approach, or because no other face is near."""
    points, at = one.mode.objective.problem.points, one.at
    normal, reach = at.normals[0, row], _reach(one, row)
    if points.directed[row]:
        return bool(one.mode.T_peak[:3, :3] @ normal @ points.directions[row] < -_SIMILAR)
    return bool(np.all(_faces_hit(one, at.in_part[0, row] + reach * normal, -normal, reach)[0] == face))
