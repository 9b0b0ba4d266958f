"""Bounds and poses of very many parts from sensed planes: votes of pairs, then poses of triples.

Two sensed planes have an angle, and a distance if they are parallel. If no two faces of a part have these, one of the
two planes is an outlier on this part. Sorted columns of a catalogue list the parts that have them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.proposals.sensed_planes import SensedPlanes
from tanteo.posterior.settings import SearchSettings, Settings


def cost_margin(settings: Settings) -> float:
    """Return the cost gap to the best part at which tables prune a part [nats]."""
    return settings.search.negligible / settings.pruning.table_weight


def on_planes(
    sensed: SensedPlanes, candidates: Candidates, rows: IntArray, far: float
) -> tuple[FloatArray, dict[int, Transforms]]:
    """Return the cost of each part by its planes ``(m,)`` [nats], and poses of cheap parts by row.

    Args:
        sensed: sensed planes.
        candidates: all parts.
        rows: rows of the parts ``(m,)``.
        far: cost gap to the best part up to which poses are tried [nats]; the cost of a part beyond is a lower bound.
    """
    lacking, poses = voted(sensed, candidates, rows), dict[int, Transforms]()
    costs = _by_poses(_Faces(candidates.tables, rows, far, sensed.settings.kept), sensed, lacking, poses)
    return costs, poses


def plane_poses(sensed: SensedPlanes, prepared: PreparedPart, settings: Settings) -> Transforms:
    """Return poses of one part with the planes on its faces ``(S, 4, 4)``; empty if they leave a motion free."""
    return _of_parts(sensed, [prepared], settings, settings.search.max_tuples)[1].get(0, np.zeros((0, 4, 4)))


def competing(sensed: SensedPlanes, parts: Sequence[PreparedPart], settings: Settings) -> SensedPlanes:
    """Return the planes with a limit of the cost: a pose of more does not compete with the best of some parts.

    Args:
        sensed: sensed planes.
        parts: the parts.
        settings: settings of the inference.
    """
    costs, poses = _of_parts(sensed, parts, settings, 1)
    return replace(sensed, limit=float(costs.min()) + cost_margin(settings)) if poses else sensed


def _of_parts(
    sensed: SensedPlanes, parts: Sequence[PreparedPart], settings: Settings, keep: int
) -> tuple[FloatArray, dict[int, Transforms]]:
    """Return the costs of some parts ``(m,)`` [nats], and the poses of cheap ones with the planes on their faces."""
    costs, poses = np.zeros(len(parts)), dict[int, Transforms]()
    if len(sensed.triples) and sensed.triples[2] >= 0:
        tables = [(k, part.faces) for k, part in enumerate(parts)]
        faces = _Faces(tables, np.arange(len(parts)), cost_margin(settings), keep)
        costs = _by_poses(faces, sensed, costs, poses)
    return costs, poses


@dataclass(frozen=True, slots=True, eq=False)
class _Faces:
    """Faces of some parts.

    Attributes:
        tables: first row and arrays of each table of parts.
        rows: rows of the parts ``(m,)``.
        far: cost gap to the best part at which poses are dropped [nats].
        keep: number of poses of each part.
    """

    tables: Sequence[tuple[int, Mapping[str, Any]]]
    rows: IntArray
    far: float
    keep: int


def _by_poses(faces: _Faces, sensed: SensedPlanes, lacking: FloatArray, poses: dict[int, Transforms]) -> FloatArray:
    """Return the costs of parts by poses that place triples of sensed planes on faces.

    The further triples (with other planes) are tried only if the first fit no part, because they take longer.
    """
    costs, more = _by_triples(faces, sensed.first, lacking, poses), sensed.more
    if costs.min(initial=sensed.settings.cost_limit) > sensed.doubtful and len(more.triples) + len(more.walls):
        costs = np.minimum(costs, _by_triples(faces, more, lacking, poses))
    return costs


def _by_triples(faces: _Faces, sensed: SensedPlanes, lacking: FloatArray, poses: dict[int, Transforms]) -> FloatArray:
    """Return the costs of parts by poses of some triples.

    Poses are tried up to a limit of their cost, because a larger limit takes longer. It is raised until a part is
    found, or until every plane would be an outlier.
    """
    costs, limit = lacking, min(float(len(sensed.rows)), sensed.limit)
    while True:
        costs, lowest = _tried(faces, sensed, lacking, limit, poses)
        if lowest < limit or limit >= sensed.hopeless:
            break
        limit = min(2 * limit, sensed.hopeless)
    highest = min(lowest + faces.far, sensed.limit)
    if limit < highest < sensed.settings.cost_limit:
        costs, _ = _tried(faces, sensed, lacking, highest, poses)
    return costs


def voted(sensed: SensedPlanes, candidates: Candidates, rows: IntArray) -> FloatArray:
    """Return the costs of some parts by pairs alone ``(m,)`` [nats]."""
    costs = np.zeros(len(rows))
    for start, table in candidates.tables:
        here = np.flatnonzero((rows >= start) & (rows < start + len(table["numbers"])))
        costs[here] = np.minimum(votes(sensed, table)[rows[here] - start], sensed.settings.cost_limit)
    return costs


def _tried(
    faces: _Faces, sensed: SensedPlanes, lacking: FloatArray, limit: float, poses: dict[int, Transforms]
) -> tuple[FloatArray, float]:
    """Return the costs of parts by poses below a limit, else the limit, and the least cost; set the poses."""
    none = sensed.settings.cost_limit
    costs, lowest, rows = np.maximum(lacking, limit), none, faces.rows
    for start, table in faces.tables:
        here = np.flatnonzero((lacking < limit) & (rows >= start) & (rows < start + len(table["numbers"])))
        local, upto = (rows[here] - start).astype(np.int32), min(limit, lowest + faces.far)
        found, Ts = _core.on_planes(
            np.asarray(table["planes"]).ravel(), np.asarray(table["planes_start"]), np.asarray(table["rounds"]).ravel(),
            np.asarray(table["rounds_start"]), np.ascontiguousarray(table["numbers"][:, 16]), local, sensed.rows,
            sensed.triples, sensed.walls, upto, faces.far, faces.keep,
        )  # fmt: skip
        costs[here] = np.maximum(found[:, 0], lacking[here])
        some = np.flatnonzero(found[:, 0] < upto)
        lowest = min(lowest, float(found[some, 0].min(initial=none)))
        for k in some:
            poses[int(rows[here[k]])] = Ts[k][found[k] < upto]
    return costs, lowest


def votes(sensed: SensedPlanes, table: Mapping[str, Any]) -> FloatArray:
    """Return costs by pairs alone ``(n,)`` [nats]: a pair that no two faces match costs one plane, each plane once."""
    n, k = len(table["numbers"]), len(sensed.rows)
    share = np.asarray(table["numbers"])[:, 16]
    loose = np.where(share > 0, sensed.settings.curved_face_cost - np.log(np.maximum(share, 1e-300)), np.inf)
    costs, used = np.zeros(n), np.zeros((n, k), dtype=bool)
    loose = np.where(np.diff(np.asarray(table["rounds_start"])) > 0, 0.0, loose)  # or it is on a cylinder
    most = [np.minimum(row[9], loose) if row[11] > 0 else np.full(n, row[9]) for row in sensed.rows]
    for i, j in combinations(range(k), 2):
        has = _having(sensed.settings, sensed.rows[i], sensed.rows[j], table, n)
        if has is None:
            continue
        free = ~has & ~used[:, i] & ~used[:, j]  # pairs that share no plane each cost one
        costs[free] += np.minimum(most[i], most[j])[free]
        used[free, i] = used[free, j] = True
    return costs


def _having(
    own: SearchSettings, first: FloatArray, second: FloatArray, table: Mapping[str, Any], n: int
) -> BoolArray | None:
    """Return which parts have two faces that match two planes ``(n,)``; None if most parts have."""
    cosine = float(np.clip(first[:3] @ second[:3], -1, 1))
    within = own.gate * float(np.hypot(first[7], second[7])) + own.tilt_as_made
    angle = float(np.arccos(cosine))
    sided = first[10] > 0 and second[10] > 0
    angles = (angle,) if sided else (angle, np.pi - angle)
    found = list[np.ndarray]()
    for one in angles:
        found.append(_between(table, "angles", one - within, one + within))
        if one < within and abs(_height(own, first, second)[0]) < _height(own, first, second)[1]:
            return None  # both may be on one face
        if one < within:
            found.append(_distances(own, table, "same", first, second, signed=False))
        if one > np.pi - within:
            found.append(_distances(own, table, "opposite", first, second, signed=sided))
    rows = np.concatenate(found)
    has = np.zeros(n, dtype=bool)
    has[rows] = True
    return None if 2 * np.count_nonzero(has) > n else has


def _height(own: SearchSettings, first: FloatArray, second: FloatArray) -> tuple[float, float]:
    """Return the distance of two parallel planes and its tolerance [m]."""
    offset = second[3:6] - first[3:6]
    normal = first[:3] + (1.0 if first[:3] @ second[:3] > 0 else -1.0) * second[:3]
    normal /= np.linalg.norm(normal)
    height = float(offset @ normal)
    lever = float(np.linalg.norm(offset - height * normal))
    tilt = float(np.hypot(first[7], second[7])) / 2
    return height, own.gate * float(np.sqrt(first[6] ** 2 + second[6] ** 2 + (lever * tilt) ** 2)) + own.as_made


def _distances(
    own: SearchSettings, table: Mapping[str, Any], name: str, first: FloatArray, second: FloatArray, *, signed: bool
) -> np.ndarray:
    """Return rows of parts with two parallel faces at the distance of two planes."""
    height, within = _height(own, first, second)
    if signed:
        return _between(table, name, height - within, height + within)
    rows, far = _between(table, name, abs(height) - within, abs(height) + within), abs(height)
    return rows if name == "same" else np.concatenate([rows, _between(table, name, -far - within, within - far)])


def _between(table: Mapping[str, Any], name: str, low: float, high: float) -> np.ndarray:
    """Return the rows of parts with values between two numbers in a sorted column."""
    keys = table[f"{name}_key"]
    a, b = np.searchsorted(keys, [low, high])
    return np.asarray(table[f"{name}_row"][a:b])
