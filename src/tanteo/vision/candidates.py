"""Poses of every part in a region of the image, the first look refined to the end, with what speaks for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from tanteo import _core
from tanteo.lie import SE3
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera, opencv
from tanteo.vision.edges import EdgeMap
from tanteo.vision.evidence import REACH, STRETCH, Evidence, Weights, chance_hits, log_weight, weigh
from tanteo.vision.fit import REACHES, beside, meet, pixel_length, refine
from tanteo.vision.models import VisionModel, lay
from tanteo.vision.propose import propose, slides, small_distances
from tanteo.vision.regions import Region, bare_share, bare_table, spilled
from tanteo.vision.table import TableErrors, lying_information
from tanteo.vision.wireframe import in_camera

KEPT = 144
"""Poses that are refined to the end."""

_QUICK = (12.0, 12.0, 9.0, 7.0, 5.0)

_SAME = 0.02
"""Poses are about one if no point of the part moves by more between them [diagonals]."""

LIKELY = 6.0
"""Poses whose log weight is less than this below the best are looked about for better ones."""

_NEAR = (1.5, 1.0, 0.8, 0.8)
"""How far the refinement looks that starts beside a pose [px]."""

_ONE = 0.2
"""Poses beside each other are one if no point of the part moves by more between them [px]."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseCandidates:
    """Refined poses of one part with their evidence."""

    model: VisionModel
    T_camera_part: Transforms
    rests: IntArray
    priors: FloatArray
    evidence: Evidence


def own_edges(region: Region, edges: EdgeMap) -> BoolArray:
    """Edge points that belong to a region ``(n,)``: in it or at its border."""
    mask = opencv().dilate(region.mask.astype(np.uint8), np.ones((5, 5), np.uint8))
    at = np.rint(edges.points.pixels).astype(np.int64)
    return np.asarray(mask[at[:, 1].clip(0, mask.shape[0] - 1), at[:, 0].clip(0, mask.shape[1] - 1)] > 0)


def candidates_in(
    models: Sequence[VisionModel],
    camera: Camera,
    T_camera_table: Transforms,
    edges: EdgeMap,
    region: Region,
    table: TableErrors,
    weights: Weights,
    ways: Sequence[IntArray] = (),
) -> tuple[list[PoseCandidates], float]:
    """Poses of every part in a region with their evidence, and the stretches of edge that the region has.

    Of each part those stable poses are tried whose numbers ``ways`` has; all of them without. The weights choose which
    poses of the first look are refined to the end, and beside which others are looked for.
    """
    used = own_edges(region, edges)
    chance = chance_hits(edges.points, used)
    ways = ways or [np.arange(len(model.rests)) for model in models]
    looks = _first_looks(models, ways, camera, T_camera_table, edges, region, table, weights, chance)
    scores = np.concatenate([score for _, _, score in looks])
    least = max(np.sort(scores)[-KEPT:][0], -1e9) if len(scores) else 0.0
    out = []
    for model, (T, rests, score) in zip(models, looks, strict=True):
        # the best of each part stays, so that every part has an evidence
        keep = (score >= least) | (score >= score.max(initial=-np.inf))
        if not keep.any():
            continue
        start = lie_down(model, rests[keep], T[keep], T_camera_table)
        prior = _lying(model, T_camera_table, start, table)
        found = refine(model.frame, camera, edges, start, prior=prior, reaches=REACHES[3:])
        evidence = evidence_at(model, camera, edges, found, region, chance)
        out.append(PoseCandidates(model, found, rests[keep], _priors(model, rests[keep]), evidence))
    logs = [c.priors + log_weight(c.evidence, weights) for c in out]
    least = max((float(log.max()) for log in logs), default=0.0) - LIKELY
    for i, log in enumerate(logs):
        for k in np.flatnonzero(log > least):
            c = out[i]
            Ts = poses_beside(c.model, int(c.rests[k]), camera, T_camera_table, edges, c.T_camera_part[k], table)
            evidence = evidence_at(c.model, camera, edges, Ts, region, chance)
            out[i] = _with_best(c, int(k), Ts, evidence, weights)
    return out, float(used.sum()) / STRETCH


def _first_looks(
    models: Sequence[VisionModel],
    ways: Sequence[IntArray],
    camera: Camera,
    T_camera_table: Transforms,
    edges: EdgeMap,
    region: Region,
    table: TableErrors,
    weights: Weights,
    chance: float,
) -> list[tuple[Transforms, IntArray, FloatArray]]:
    """Poses, stable poses and log weights of each part after a few rounds; of those that are about one the best."""
    distances, bare = small_distances(edges), bare_table(region.mask)
    places = slides(region, camera)
    out = []
    for model, own in zip(models, ways, strict=True):
        proposal = propose(model, own, camera, T_camera_table, distances, places)
        prior = _lying(model, T_camera_table, proposal.T_camera_part, table)
        T = refine(model.coarse, camera, edges, proposal.T_camera_part, prior=prior, reaches=_QUICK)
        met = meet(model.coarse, camera, edges, T, 2 * REACH)
        off = bare_share(model.inner, camera, T, bare) * _areas(model, camera, T)
        score = log_weight(replace(weigh(model.coarse, met, chance), spilled=off), weights)
        score = score + _priors(model, proposal.rests)
        out.append((T, proposal.rests, np.where(_distinct(model, T, score), score, -np.inf)))
    return out


def _priors(model: VisionModel, which: IntArray) -> FloatArray:
    """Log probability of the stable poses."""
    return np.log([model.rests[k].probability for k in which])


def poses_beside(
    model: VisionModel,
    rest: int,
    camera: Camera,
    T_camera_table: Transforms,
    edges: EdgeMap,
    T_camera_part: Transforms,
    table: TableErrors,
) -> Transforms:
    """A pose of a part on the table and others near it, each at its own best ``(k, 4, 4)``; those that are one are one.

    Where a shadow or a second edge runs beside an edge, edges meet at several poses a millimetre apart.
    """
    start = lie_down(model, np.array([rest]), T_camera_part[None], T_camera_table)
    prior = _lying(model, T_camera_table, start, table)
    Ts = beside(camera, T_camera_part, T_camera_table, model.part.centroid)
    Ts = refine(model.frame, camera, edges, Ts, prior=prior, start=start, reaches=_NEAR)
    points = in_camera(Ts, model.inner)
    slack = _ONE * pixel_length(camera, T_camera_part, model.part.centroid)
    return np.asarray(Ts[_core.far_apart(points, np.arange(len(Ts)), slack)])


def _with_best(c: PoseCandidates, k: int, Ts: Transforms, evidence: Evidence, weights: Weights) -> PoseCandidates:
    """The candidates with the most probable of some poses, if it is better, instead of their own ``k``."""
    log = log_weight(evidence, weights)
    best = int(np.argmax(log))
    if log[best] <= log_weight(c.evidence, weights)[k]:
        return c
    T, values = c.T_camera_part.copy(), {}
    T[k] = Ts[best]
    for field in fields(Evidence):
        values[field.name] = getattr(c.evidence, field.name).copy()
        values[field.name][k] = getattr(evidence, field.name)[best]
    return replace(c, T_camera_part=T, evidence=Evidence(**values))


def evidence_at(
    model: VisionModel, camera: Camera, edges: EdgeMap, Ts: Transforms, region: Region, chance: float
) -> Evidence:
    """Evidence of poses ``(B, 4, 4)`` of a part in a region; ``chance`` is that of the region's edges."""
    evidence = weigh(model.frame, meet(model.frame, camera, edges, Ts, REACH), chance)
    return replace(evidence, spilled=spilled(model.frame.surface, camera, Ts, region.mask))


def _areas(model: VisionModel, camera: Camera, Ts: Transforms) -> FloatArray:
    """About how large a part looks ``(B,)`` [px of area]: as the middle one of its outlines from above."""
    depth = SE3.apply(Ts, model.part.centroid)[..., 2]
    return np.asarray(model.area * float(camera.focal.mean()) ** 2 / depth**2)


def _distinct(model: VisionModel, Ts: Transforms, scores: FloatArray) -> BoolArray:
    """Those poses ``(B,)`` that are not about one with a better one; symmetries are not asked."""
    points = in_camera(Ts, model.inner)
    kept = _core.far_apart(points, np.argsort(-scores, kind="stable"), _SAME * model.part.diagonal)
    return np.isin(np.arange(len(Ts)), kept)


def lie_down(model: VisionModel, which: IntArray, T: Transforms, T_camera_table: Transforms) -> Transforms:
    """Poses at which the part lies exactly in its stable poses ``which``, nearest to the given ones."""
    T_table = SE3.inverse(T_camera_table) @ T
    Ts = np.empty_like(T_table)
    for k in set(which.tolist()):
        Ts[which == k] = lay(model.part, model.rests[k], T_table[which == k])
    return np.asarray(T_camera_table @ Ts)


def _lying(model: VisionModel, T_camera_table: Transforms, Ts: Transforms, table: TableErrors) -> FloatArray:
    return lying_information(SE3.inverse(T_camera_table) @ Ts, model.part.centroid, table)
