"""Sensed planes against the faces of very many parts: distances and angles of pairs vote, then poses are tried.

Two planes that are sensed have an angle, and where they are parallel a distance. A part of which no two faces have it
has to call one of the two an outlier. The sorted columns of a catalogue say at once which parts have it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.inference.around import outlier_log_density
from tanteo.inference.candidates import Candidates
from tanteo.inference.label_tuples import Planes, labelled_planes
from tanteo.inference.problem import Problem
from tanteo.measurements import ContactPoints
from tanteo.typing import BoolArray, FloatArray, Indices, IntArray, Transforms

_WIDER = 0.6
"""Of the log of the factor to which the noise is known: so much larger it is taken to be."""

_SDS, _MADE, _TILT = 4.0, 1e-4, 0.004
"""Distances and angles agree within so many standard deviations and so much more [m, rad]."""

_MOST, _CURVED, _LEAST = 13.0, 8.0, 2.0
"""Nats that a labelled plane of no face costs: what it does by the outlier rate, but between the first and the last;
one sensed normal may be of a curved face."""

LIMIT = 60.0
"""Nats that a part costs at most: beyond, none is better than another."""

_TRIPLES, _MORE, _INDEPENDENT = 2, 6, 0.25
"""Triples of planes that poses are made of, and where these lead to nothing; the least product of their normals."""

_KNOWN = 0.01
"""Tilt below which it hardly matters how well a normal is known [rad]."""

_COMPARED = 16
"""Planes that are compared, those known best."""

_LOOSE = 1.5
"""Nats that a sensed normal on a face that is no plane costs, beside those of its share of the part."""

_SHARE = 0.3
"""Share of all parts up to which the vote of a pair is worth taking."""

_KEPT = 8
"""Poses of a part."""

BEHIND = 10.0
"""Nats behind the best up to which a part is in: less than a labelled plane of no face."""


@dataclass(frozen=True, slots=True, eq=False)
class SensedPlanes:
    """Planes as the core compares them.

    Attributes:
        rows: normal, a point of each, sd of its height [m], tilt [rad], span [m], nats without a face, whether its
            side is known, and whether it is one point, which may be of a face that is no plane ``(k, 12)``.
        triples: of them, that fix a pose, or two and -1 ``(3 m,)``.
        certain: whether some triple fixes one although each normal without a parallel is of a curved face.
    """

    rows: FloatArray
    triples: Indices
    certain: bool = True

    @property
    def doubtful(self) -> float:
        """Nats of the best part from which other triples are tried: more than those of one plane without a face."""
        return 1.2 * float(self.rows[:, 9].max())

    @property
    def hopeless(self) -> float:
        """Nats of the best part from which planes are not what was sensed: more than those of two of them."""
        return 2.2 * float(self.rows[:, 9].max())


def sensed_planes(problem: Problem, points: ContactPoints) -> SensedPlanes:
    """The planes that labels and normals show, with their noise as large as it may be."""
    planes = labelled_planes(points)
    factor = float(np.exp(_WIDER * problem.scale_sd))
    some = np.argsort(planes.tilts, kind="stable")[:_COMPARED]
    normals = planes.normals[some]
    at = planes.middles[some] - planes.radii[some, None] * normals
    shared = float(np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1)))
    sds = np.hypot(factor * planes.sds[some], shared)
    alone = np.array([len(planes.rows[k]) == 1 for k in some], dtype=bool)
    most = _without_face(problem, points, planes, factor)[some].clip(_LEAST, np.where(alone, _CURVED, _MOST))
    rows = np.column_stack(
        [
            normals,
            at,
            np.hypot(sds, _MADE),
            factor * planes.tilts[some],
            planes.spans[some],
            most,
            planes.sided[some],
            alone,
        ]
    )
    lonely = _lonely(normals, planes.tilts[some], alone)
    triples = _triples(normals, planes.tilts[some], lonely)
    doubtful = lonely[triples.reshape(-1, 3)].sum(axis=1) > (triples[2::3] >= 0)
    return SensedPlanes(np.ascontiguousarray(rows), triples, bool(np.any(~doubtful)))


def _without_face(problem: Problem, points: ContactPoints, planes: Planes, factor: float) -> FloatArray:
    """Nats that a plane costs if it is of no face ``(k,)``."""
    rate = problem.priors.outlier_rate
    out = []
    for rows in planes.rows:
        peak = -np.log(np.sqrt(2 * np.pi) * factor * points.sd[rows])
        elsewhere = outlier_log_density(points.take(rows), problem.priors)
        out.append(float(np.sum(np.minimum(peak - elsewhere, 12.0))) + float(np.log1p(-rate) - np.log(rate)))
    return np.array(out)


def _lonely(normals: FloatArray, tilts: FloatArray, alone: BoolArray) -> BoolArray:
    """Which are one sensed normal that no other one is parallel to: they may be of a curved face ``(k,)``."""
    sines = np.linalg.norm(np.cross(normals[:, None], normals), axis=-1)
    near: BoolArray = sines < _SDS * np.hypot(tilts[:, None], tilts) + _TILT
    return np.asarray(alone & (near.sum(axis=1) < 2))


def _triples(normals: FloatArray, tilts: FloatArray, lonely: BoolArray) -> Indices:
    """Triples that fix a pose, as different as can be: one outlier does not spoil them all.

    What may be of a curved face comes last, in a triple, too. Where all normals lie in one plane, the third is -1:
    poses slide along what two planes leave free.
    """
    if len(normals) < 2:
        return np.zeros(0, dtype=np.int32)
    sines = np.linalg.norm(np.cross(normals[:, None], normals), axis=-1)
    order = np.argsort(lonely, kind="stable")
    triples = np.array([order[list(k)] for k in combinations(range(len(order)), 3)], dtype=np.int64).reshape(-1, 3)
    chosen = _as_different(triples, np.abs(np.linalg.det(normals[triples])), lonely, tilts)
    if not chosen:
        pairs = np.array([order[list(k)] for k in combinations(range(len(order)), 2)], dtype=np.int64).reshape(-1, 2)
        found = _as_different(pairs, sines[pairs[:, 0], pairs[:, 1]], lonely, tilts)
        chosen = [np.append(pair, -1) for pair in found]
    return np.array(chosen, dtype=np.int32).ravel()


def _as_different(tuples: IntArray, sizes: FloatArray, lonely: BoolArray, tilts: FloatArray) -> list[IntArray]:
    """The most telling tuples of planes, as few planes in two of them as can be; none that are nearly dependent."""
    if not len(tuples):
        return []
    good = sizes * 0.5 ** lonely[tuples].sum(axis=1) / (_KNOWN + tilts[tuples].max(axis=1))
    chosen = list[IntArray]()
    for shared in range(tuples.shape[1]):
        for k in np.argsort(-good, kind="stable"):
            if len(chosen) == _MORE:
                break
            new = all(len(set(tuples[k].tolist()) & set(other.tolist())) <= shared for other in chosen)
            if new and sizes[k] >= _INDEPENDENT:
                chosen.append(tuples[k])
    return chosen


def on_planes(
    sensed: SensedPlanes, candidates: Candidates, rows: IntArray, far: float
) -> tuple[FloatArray, dict[int, Transforms]]:
    """Nats that the planes cost on each part ``(m,)``, and poses of those where it is little, by row.

    What is so far behind the best costs at least as much, as far as is known.
    """
    lacking, hints = voted(sensed, candidates, rows), dict[int, Transforms]()
    first = replace(sensed, triples=sensed.triples[: 3 * _TRIPLES])
    costs = _by_triples(first, candidates, rows, lacking, far, hints)
    if costs.min(initial=LIMIT) > sensed.doubtful and len(sensed.triples) > 3 * _TRIPLES:
        more = replace(sensed, triples=sensed.triples[3 * _TRIPLES :])
        costs = np.minimum(costs, _by_triples(more, candidates, rows, lacking, far, hints))
    return costs, hints


def _by_triples(
    sensed: SensedPlanes,
    candidates: Candidates,
    rows: IntArray,
    lacking: FloatArray,
    far: float,
    hints: dict[int, Transforms],
) -> FloatArray:
    """Nats of parts that lack so many by votes, by poses.

    These are tried up to a limit of nats, as each nat more takes longer. It is raised until a part is found, or no
    plane would be of a face any more.
    """
    costs, lowest, limit = lacking, LIMIT, float(len(sensed.rows))
    while True:
        costs, lowest = _tried(sensed, candidates, rows, lacking, limit, far, hints)
        if lowest < limit or limit >= sensed.hopeless:
            break
        limit = min(2 * limit, sensed.hopeless)
    if limit < lowest + far < LIMIT:
        costs, _ = _tried(sensed, candidates, rows, lacking, lowest + far, far, hints)
    return costs


def voted(sensed: SensedPlanes, candidates: Candidates, rows: IntArray) -> FloatArray:
    """Nats of some parts by pairs alone ``(m,)``."""
    costs = np.zeros(len(rows))
    for start, table in candidates.tables:
        here = np.flatnonzero((rows >= start) & (rows < start + len(table["numbers"])))
        costs[here] = np.minimum(votes(sensed, table)[rows[here] - start], LIMIT)
    return costs


def _tried(
    sensed: SensedPlanes,
    candidates: Candidates,
    rows: IntArray,
    lacking: FloatArray,
    limit: float,
    far: float,
    hints: dict[int, Transforms],
) -> tuple[FloatArray, float]:
    """Nats of parts by poses that cost less than a limit, else the limit, and the least; hints are set."""
    costs, lowest = np.maximum(lacking, limit), LIMIT
    for start, table in candidates.tables:
        here = np.flatnonzero((lacking < limit) & (rows >= start) & (rows < start + len(table["numbers"])))
        local, upto = (rows[here] - start).astype(np.int32), min(limit, lowest + far)
        found, Ts = _core.on_planes(
            np.asarray(table["planes"]).ravel(), np.asarray(table["planes_start"]), np.asarray(table["rounds"]).ravel(),
            np.asarray(table["rounds_start"]), np.ascontiguousarray(table["numbers"][:, 16]), local, sensed.rows,
            sensed.triples, upto, far, _KEPT,
        )  # fmt: skip
        costs[here] = np.maximum(found[:, 0], lacking[here])
        some = np.flatnonzero(found[:, 0] < upto)
        lowest = min(lowest, float(found[some, 0].min(initial=LIMIT)))
        for k in some:
            hints[int(rows[here[k]])] = Ts[k][found[k] < upto]
    return costs, lowest


def votes(sensed: SensedPlanes, table: Mapping[str, Any]) -> FloatArray:
    """Nats by pairs alone ``(n,)``: the planes that have to be of no face, each counted once."""
    n, k = len(table["numbers"]), len(sensed.rows)
    share = np.asarray(table["numbers"])[:, 16]
    loose = np.where(share > 0, _LOOSE - np.log(np.maximum(share, 1e-300)), np.inf)
    costs, used = np.zeros(n), np.zeros((n, k), dtype=bool)
    loose = np.where(np.diff(np.asarray(table["rounds_start"])) > 0, 0.0, loose)  # or it is of a cylinder
    most = [np.minimum(row[9], loose) if row[11] > 0 else np.full(n, row[9]) for row in sensed.rows]
    for i, j in combinations(range(k), 2):
        has = _having(sensed.rows[i], sensed.rows[j], table, n)
        if has is None:
            continue
        free = ~has & ~used[:, i] & ~used[:, j]  # pairs that share no plane each cost one
        costs[free] += np.minimum(most[i], most[j])[free]
        used[free, i] = used[free, j] = True
    return costs


def _having(first: FloatArray, second: FloatArray, table: Mapping[str, Any], n: int) -> BoolArray | None:
    """Which parts have two faces like two planes ``(n,)``; None where most do."""
    cosine = float(np.clip(first[:3] @ second[:3], -1, 1))
    within = _SDS * float(np.hypot(first[7], second[7])) + _TILT
    angle = float(np.arccos(cosine))
    sided = first[10] > 0 and second[10] > 0
    angles = (angle,) if sided else (angle, np.pi - angle)
    found = list[np.ndarray]()
    for one in angles:
        found.append(_between(table, "angles", one - within, one + within))
        if one < within and abs(_height(first, second)[0]) < _height(first, second)[1]:
            return None  # both may be of one face
        if one < within:
            found.append(_distances(table, "same", first, second, signed=False))
        if one > np.pi - within:
            found.append(_distances(table, "opposite", first, second, signed=sided))
    rows = np.concatenate(found)
    if len(rows) > _SHARE * n and len(np.unique(rows)) > _SHARE * n:
        return None
    has = np.zeros(n, dtype=bool)
    has[rows] = True
    return has


def _height(first: FloatArray, second: FloatArray) -> tuple[float, float]:
    """How far apart two parallel planes are, and within how much that is known [m]."""
    way = second[3:6] - first[3:6]
    normal = first[:3] + (1.0 if first[:3] @ second[:3] > 0 else -1.0) * second[:3]
    normal /= np.linalg.norm(normal)
    height = float(way @ normal)
    lever = float(np.linalg.norm(way - height * normal))
    tilt = float(np.hypot(first[7], second[7])) / 2
    return height, _SDS * float(np.sqrt(first[6] ** 2 + second[6] ** 2 + (lever * tilt) ** 2)) + _MADE


def _distances(
    table: Mapping[str, Any], name: str, first: FloatArray, second: FloatArray, *, signed: bool
) -> np.ndarray:
    """Parts with two parallel faces as far apart as two planes are."""
    height, within = _height(first, second)
    if signed:
        return _between(table, name, height - within, height + within)
    rows, far = _between(table, name, abs(height) - within, abs(height) + within), abs(height)
    return rows if name == "same" else np.concatenate([rows, _between(table, name, -far - within, within - far)])


def _between(table: Mapping[str, Any], name: str, low: float, high: float) -> np.ndarray:
    """Rows of the parts of a sorted column between two numbers."""
    keys = table[f"{name}_key"]
    a, b = np.searchsorted(keys, [low, high])
    return np.asarray(table[f"{name}_row"][a:b])
