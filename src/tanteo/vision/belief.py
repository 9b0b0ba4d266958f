"""Which part lies in a region, in which stable pose, where: posterior over all of them and "none of these"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from tanteo.lie import SE3
from tanteo.parts import Part
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera
from tanteo.vision.edge_map import EdgeMap
from tanteo.vision.evidence import REACH, STRETCH, Evidence, chance_hits, weigh
from tanteo.vision.fit import REACHES, meet, refine
from tanteo.vision.models import VisionModel
from tanteo.vision.propose import propose, slides, small_distances
from tanteo.vision.regions import Region
from tanteo.vision.resting import lay
from tanteo.vision.silhouettes import bare_share, bare_table, spilled
from tanteo.vision.table import TableErrors, lying_information
from tanteo.vision.wireframe import in_camera

UNKNOWN = 0.1
"""Probability beforehand that the object is none of the parts."""

MISSED = 0.04
"""How often the true pose is not among those found: 3 of 74 times in the scenes that weights are fitted on."""

KEPT = 144
"""Poses that are refined to the end."""

_QUICK = (12.0, 12.0, 9.0, 7.0, 5.0)
_MERGE_TURN, _MERGE_SHIFT = 0.04, 0.02
"""Poses nearer than this are one [rad, diagonals]."""


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """How much each kind of evidence counts, fitted on rendered scenes of random parts (``benchmarks/vision_fit.py``).

    Edges are not independent of each other, shadows and occluders make edges of their own: what that does to the sums
    of :class:`Evidence` is measured, not derived.

    Attributes:
        hits: of edges of the part that meet edges of the image.
        misses: of those that do not.
        unknown: for each stretch of the image's edges, if none of the poses holds.
        base: log odds of that without edges, besides the prior.
        spilled: for each square of a stretch that the silhouette covers where bare table is seen.
    """

    hits: float = 0.461
    misses: float = 0.174
    unknown: float = 0.177
    base: float = -0.487
    spilled: float = -0.61


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A part at a pose.

    Attributes:
        model: the part.
        rest: which stable pose; -1 where none was assumed.
        T_camera_part: ``(4, 4)``.
        log: log weight, up to a constant that all modes of the object share.
        probability: posterior.
    """

    model: VisionModel
    rest: int
    T_camera_part: Transforms
    log: float
    probability: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """Posterior of one object.

    Attributes:
        modes: best first.
        unknown: probability of "none of these". What is missing to 1 belongs to the parts in poses that were not found.
    """

    modes: tuple[Mode, ...]
    unknown: float


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Refined poses of one part with their evidence."""

    model: VisionModel
    T_camera_part: Transforms
    rests: IntArray
    priors: FloatArray
    evidence: Evidence


def own_edges(region: Region, edges: EdgeMap) -> BoolArray:
    """Edge points that belong to a region ``(n,)``: in it or at its border."""
    from tanteo.vision.opencv import opencv

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
) -> tuple[list[Candidates], float]:
    """Poses of every part in a region with their evidence, and the stretches of edge that the region has.

    The weights choose which poses of the first look are refined to the end.
    """
    used = own_edges(region, edges)
    chance = chance_hits(edges.points, used)
    distances, bare = small_distances(edges), bare_table(region.mask)
    places = slides(region, camera)
    proposals = [propose(model, camera, T_camera_table, distances, places) for model in models]
    quick = []
    for model, proposal in zip(models, proposals, strict=True):
        prior = _lying(model, T_camera_table, proposal.T_camera_part, table)
        T = refine(model.coarse, camera, edges, proposal.T_camera_part, prior=prior, reaches=_QUICK)
        met = meet(model.coarse, camera, edges, T, 2 * REACH)
        off = bare_share(model.inner, camera, T, bare) * _areas(model, camera, T)
        rests = np.log([model.rests[k].probability for k in proposal.rests])
        score = log_weight(replace(weigh(model.coarse, met, chance), spilled=off), weights) + rests
        quick.append((T, np.where(_distinct(model, T, score), score, -np.inf)))
    scores = np.concatenate([score for _, score in quick])
    least = max(np.sort(scores)[-KEPT:][0], -1e9) if len(scores) else 0.0
    out = []
    for model, proposal, (T, score) in zip(models, proposals, quick, strict=True):
        # the best of each part stays, so that every part has an evidence
        keep = (score >= least) | (score >= score.max(initial=-np.inf))
        if not keep.any():
            continue
        which = proposal.rests[keep]
        start = lie_down(model, which, T[keep], T_camera_table)
        prior = _lying(model, T_camera_table, start, table)
        found = refine(model.frame, camera, edges, start, prior=prior, reaches=REACHES[3:])
        evidence = weigh(model.frame, meet(model.frame, camera, edges, found, REACH), chance)
        evidence = replace(evidence, spilled=spilled(model.frame.surface, camera, found, region.mask))
        priors = np.log([model.rests[k].probability for k in which])
        out.append(Candidates(model, found, which, priors, evidence))
    return out, float(used.sum()) / STRETCH


def _areas(model: VisionModel, camera: Camera, Ts: Transforms) -> FloatArray:
    """About how large a part looks ``(B,)`` [px of area]: as the middle one of its outlines from above."""
    depth = SE3.apply(Ts, model.part.centroid)[..., 2]
    area = float(np.median([outline["area"] for outline in model.outlines]))
    return np.asarray(area * float(camera.focal.mean()) ** 2 / depth**2)


def _distinct(model: VisionModel, Ts: Transforms, scores: FloatArray) -> BoolArray:
    """Those poses ``(B,)`` that are not about one with a better one; symmetries are not asked."""
    points = in_camera(Ts, model.inner)
    kept: list[int] = []
    for k in np.argsort(-scores, kind="stable"):
        moved = np.linalg.norm(points[kept] - points[k], axis=-1).max(axis=-1)
        if not np.any(moved < _MERGE_SHIFT * model.part.diagonal):
            kept.append(int(k))
    return np.isin(np.arange(len(Ts)), kept)


def lie_down(model: VisionModel, which: IntArray, T: Transforms, T_camera_table: Transforms) -> Transforms:
    """Poses at which the part lies exactly in its stable poses ``which``, nearest to the given ones."""
    T_table = SE3.inverse(T_camera_table) @ T
    Ts = np.stack([lay(model.part, model.rests[k], T_table[i]) for i, k in enumerate(which)])
    return np.asarray(T_camera_table @ Ts)


def _lying(model: VisionModel, T_camera_table: Transforms, Ts: Transforms, table: TableErrors) -> FloatArray:
    return lying_information(SE3.inverse(T_camera_table) @ Ts, model.part.centroid, table)


def believe(candidates: Sequence[Candidates], stretches: float, weights: Weights, parts: int) -> Belief:
    """Posterior from candidates; poses that are one by symmetry or by convergence are merged, the best stands for them.

    Args:
        candidates: of every part.
        stretches: of edge in the region.
        weights: of the evidence.
        parts: how many there are in the catalogue.
    """
    modes: list[Mode] = []
    for c in candidates:
        log = np.log((1 - UNKNOWN) / parts) + c.priors + log_weight(c.evidence, weights)
        kept = distinct_poses(c.model.part, c.T_camera_part, log)
        modes += [Mode(c.model, int(c.rests[k]), c.T_camera_part[k], float(log[k])) for k in kept]
    none = np.log(UNKNOWN) + weights.unknown * stretches + weights.base
    total = float(logsumexp([m.log for m in modes] + [none]))
    # that none of the poses holds is a strange part's doing, or the search's that missed the true one
    strange = UNKNOWN / (UNKNOWN + (1 - UNKNOWN) * MISSED)
    modes.sort(key=lambda m: -m.log)
    scored = tuple(Mode(m.model, m.rest, m.T_camera_part, m.log, float(np.exp(m.log - total))) for m in modes)
    return Belief(scored, strange * float(np.exp(none - total)))


def log_weight(evidence: Evidence, weights: Weights) -> FloatArray:
    """Log weight of poses, without prior."""
    spilled = weights.spilled * evidence.spilled / STRETCH**2
    return np.asarray(weights.hits * evidence.hits + weights.misses * evidence.misses + spilled)


def distinct_poses(part: Part, Ts: Transforms, log: FloatArray) -> list[int]:
    """Which of the poses ``(B, 4, 4)`` are not one with a more probable one: their numbers, the most probable first."""
    kept: list[int] = []
    for k in np.argsort(-log, kind="stable"):
        if not np.any(one_pose(part, Ts[kept], Ts[k])):
            kept.append(int(k))
    return kept


def one_pose(part: Part, first: Transforms, second: Transforms) -> BoolArray:
    """Whether poses ``(*batch, 4, 4)`` and a second one are one, or one by the part's symmetry ``(*batch,)``."""
    gap = SE3.inverse(first) @ second
    if part.symmetry.spherical or part.symmetry.axis is not None:
        return _one_axis(part, gap)
    between = part.symmetry.Ts @ SE3.inverse(gap)[..., None, :, :]
    # the norm of R - 1 is 2 sqrt(2) times the sine of half the turn
    turn = np.linalg.norm(between[..., :3, :3] - np.eye(3), axis=(-2, -1))
    shift = np.linalg.norm(SE3.apply(between, part.centroid) - part.centroid, axis=-1)
    near = (turn < np.sqrt(8) * np.sin(_MERGE_TURN / 2)) & (shift < _MERGE_SHIFT * part.diagonal)
    return np.asarray(np.any(near, axis=-1))


def _one_axis(part: Part, gap: Transforms) -> BoolArray:
    near = np.linalg.norm(SE3.apply(gap, part.centroid) - part.centroid, axis=-1) < _MERGE_SHIFT * part.diagonal
    if part.symmetry.axis is None:
        return np.asarray(near)
    axis = part.symmetry.axis[1]
    turned = np.einsum("kij,j->ki", part.symmetry.Ts[:, :3, :3], axis)
    along = turned @ (gap[..., :3, :3] @ axis)[..., None]
    return np.asarray(near & np.any(along[..., 0] > np.cos(_MERGE_TURN), axis=-1))
