"""Which part lies in a region, in which stable pose, where: posterior over all of them and the unknown object.

Where a shadow or a second edge runs beside an edge, or the only edges across a direction are hidden, the pose at which
edges meet best is one of a few. All that are near are looked for, settled each by itself and weighed as different parts
are weighed; what is told is the mean and the covariance of them all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.lie import SE3
from tanteo.localization import motions_about
from tanteo.parts import Part
from tanteo.special import log_sum, softmax
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera
from tanteo.vision.candidates import LIKELY, PoseCandidates, evidence_at, lie_down, own_edges, poses_beside
from tanteo.vision.choices import EdgeErrors
from tanteo.vision.edges import EdgeMap
from tanteo.vision.evidence import Weights, chance_hits, log_weight
from tanteo.vision.fit import BESIDE, pixel_length, refine
from tanteo.vision.models import VisionModel
from tanteo.vision.outlines import Narrowed
from tanteo.vision.regions import Region
from tanteo.vision.settle import Settled, as_one, covariance_of, information_of, settle
from tanteo.vision.table import TableErrors, lying_information

UNKNOWN = 0.1
"""Probability beforehand that the object is none of the parts."""

MISSED = 0.04
"""How often the true pose is not among those found: 3 of 74 times in the scenes that weights are fitted on."""

_MERGE_TURN, _MERGE_SHIFT = 0.04, 0.02
"""Poses nearer than this are one [rad, diagonals]."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageMode:
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
class ImagePosterior:
    """Posterior of one object.

    Attributes:
        modes: best first.
        unknown: probability of the unknown object, and of parts that were not looked for. What is missing to 1 belongs
            to the parts in poses that were not found.
        left_out: probability of the parts that were not looked for, at most.
        count: how many these are.
    """

    modes: tuple[ImageMode, ...]
    unknown: float
    left_out: float = 0.0
    count: int = 0


def infer(
    candidates: Sequence[PoseCandidates],
    stretches: float,
    weights: Weights,
    models: Sequence[VisionModel],
    chosen: Narrowed,
) -> ImagePosterior:
    """Posterior from candidates; poses that are one by symmetry or by convergence are merged, the best remain.

    Args:
        candidates: poses of parts that were looked for.
        stretches: of edge that the region has.
        weights: of the evidence.
        models: all that were looked for, in the order of the rows that were chosen.
        chosen: which of the parts these are.
    """
    parts = len(models) + chosen.left_out
    modes: list[ImageMode] = []
    own = {id(model): -np.inf for model in models}
    for c in candidates:
        log = np.log((1 - UNKNOWN) / parts) + c.priors + log_weight(c.evidence, weights)
        kept = distinct_poses(c.model.part, c.T_camera_part, log)
        modes += [ImageMode(c.model, int(c.rests[k]), c.T_camera_part[k], float(log[k])) for k in kept]
        own[id(c.model)] = float(log_sum(log[kept]))
    none = np.log(UNKNOWN) + weights.unknown * stretches + weights.base
    left = chosen.log_left_out(np.array(list(own.values())), none + np.log(1 / UNKNOWN - 1))
    total = float(log_sum([m.log for m in modes] + [none, left]))
    # that none of the poses holds is a strange part's doing, or the search's that missed the true one
    strange = UNKNOWN / (UNKNOWN + (1 - UNKNOWN) * MISSED)
    modes.sort(key=lambda m: -m.log)
    scored = tuple(ImageMode(m.model, m.rest, m.T_camera_part, m.log, float(np.exp(m.log - total))) for m in modes)
    out = float(np.exp(left - total))
    unknown = strange * float(np.exp(none - total)) + out
    return ImagePosterior(scored, unknown, out, chosen.left_out)


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


_LAST = (2.5, 1.5, 1.0, 0.8, 0.8)
"""How far the refinement looks [px]."""

POSSIBLE = 0.01
"""Answers less probable than this raise no question, and nothing is looked for beside their poses."""

_ONE = 4.0
"""Settled poses are one if they are nearer than this: squared distance under both their covariances."""


def settle_lying(
    mode: ImageMode,
    camera: Camera,
    edges: EdgeMap,
    region: Region,
    T_camera_table: Transforms,
    table: TableErrors,
    weights: Weights,
    *,
    errors: EdgeErrors | None = None,
) -> Settled:
    """Mean and information of the pose of a part that lies on a table."""
    model, chance = mode.model, chance_hits(edges.points, own_edges(region, edges))
    start = lie_down(model, np.array([mode.rest]), mode.T_camera_part[None], T_camera_table)
    prior = lying_information(SE3.inverse(T_camera_table) @ start, model.part.centroid, table)
    T = refine(model.frame, camera, edges, start, prior=prior, reaches=_LAST)[0]
    Ts = T[None]
    if mode.probability >= POSSIBLE:
        Ts = poses_beside(model, mode.rest, camera, T_camera_table, edges, T, table)
        log = log_weight(evidence_at(model, camera, edges, Ts, region, chance), weights)
        Ts = Ts[log > log.max() - LIKELY]
    found = [settle(model, camera, edges, T, start=start[0], prior=prior[0], errors=errors) for T in Ts]
    at = np.stack([each.T_camera_part for each in found])
    off = SE3.log(SE3.inverse(start) @ at)
    log = log_weight(evidence_at(model, camera, edges, at, region, chance), weights)
    log = log - 0.5 * np.sum(off @ prior[0] * off, axis=-1)
    return mixed(model, found, log, BESIDE * pixel_length(camera, T, model.part.centroid))


def mixed(model: VisionModel, found: list[Settled], log: FloatArray, width: float) -> Settled:
    """The mixture of settled poses as one.

    Each counts with the weight at its mean, as poses of different parts do; of those that are one the most probable
    stands for all. A pose beside the best stands for what is about it: what its edges leave open is open no farther
    than ``width``.

    Args:
        model: of the part.
        found: poses, one at least.
        log: log weights at their means, prior included ``(B,)``.
        width: how far a pose may be moved until its edges meet others [m].
    """
    size = 0.5 * model.part.diagonal
    to_middle = motions_about(-model.part.centroid)
    about = to_middle.T @ np.diag(np.r_[np.full(3, width**-2), np.full(3, (size / width) ** 2)]) @ to_middle
    covariances = np.stack([covariance_of(model, each.information + about) for each in found])
    order = np.argsort(-log, kind="stable")
    best = found[order[0]]
    covariances[order[0]] = covariance_of(model, best.information)
    off = SE3.log(SE3.inverse(best.T_camera_part) @ np.stack([each.T_camera_part for each in found]))
    kept = _apart(order, off, covariances)
    some = [replace(found[k], information=information_of(model, covariances[k])) for k in kept]
    return as_one(model, some, softmax(log[kept]))


def _apart(order: IntArray, off: FloatArray, covariances: FloatArray) -> list[int]:
    """Those poses, in order, that are not one with an earlier one."""
    kept: list[int] = []
    for k in order:
        gaps, both = off[kept] - off[k], covariances[kept] + covariances[k]
        if not np.any(np.sum(gaps * np.linalg.solve(both, gaps[..., None])[..., 0], axis=-1) < _ONE):
            kept.append(int(k))
    return kept
