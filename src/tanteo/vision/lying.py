"""The pose of a part that lies on the table, when its edges would meet others of the image a millimetre away as well.

Where a shadow or a second edge runs beside an edge, or the only edges across a direction are hidden, the pose at which
edges meet best is one of a few. All that are near are looked for, settled each by itself and weighed as different parts
are weighed; what is told is the mean and the covariance of them all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.lie import SE3
from tanteo.localization import motions_about
from tanteo.special import softmax
from tanteo.typing import FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera
from tanteo.vision.candidates import LIKELY, evidence_at, lie_down, own_edges, poses_beside
from tanteo.vision.choices import EdgeErrors
from tanteo.vision.edge_map import EdgeMap
from tanteo.vision.evidence import Weights, chance_hits, log_weight
from tanteo.vision.fit import BESIDE, pixel_length, refine
from tanteo.vision.models import VisionModel
from tanteo.vision.posterior import ImageMode
from tanteo.vision.regions import Region
from tanteo.vision.settle import Settled, as_one, covariance_of, information_of, settle
from tanteo.vision.table import TableErrors, lying_information

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
    """Mean and information of the pose of a part that lies on a table.

    Args:
        mode: the part, how it lies and about where, how probable that is.
        camera: that took the image.
        edges: of the image.
        region: of the image, that the part is seen in.
        T_camera_table: the table, z = 0 of its frame.
        table: how well that is known.
        weights: of the evidence.
        errors: of edge points besides noise.
    """
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
