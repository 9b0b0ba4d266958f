"""Initial poses of every part in a region of the image, from which the posterior is searched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.posterior import DEFAULTS
from tanteo.vision.camera import on_plane
from tanteo.vision.fit import beside, pixel_length, refine
from tanteo.vision.image_edges import ImageEdges
from tanteo.vision.models import VisionModel, lay
from tanteo.vision.propose import propose, slides
from tanteo.vision.regions import Region, dilated, hull_area
from tanteo.vision.settings import EVIDENCE, SEARCH
from tanteo.vision.table import TableErrors, lying_information
from tanteo.vision.wireframe import in_camera


@dataclass(frozen=True, slots=True, eq=False)
class PoseCandidates:
    """Refined poses of one part.

    Attributes:
        model: the part.
        T_camera_part: poses ``(k, 4, 4)``.
        rests: number of the stable pose of each ``(k,)``.
        log: log density of the image at each, with the probability of the stable pose ``(k,)``.
    """

    model: VisionModel
    T_camera_part: Transforms
    rests: IntArray
    log: FloatArray


def candidates_in(
    models: Sequence[VisionModel],
    image: ImageEdges,
    T_camera_table: Transforms,
    region: Region,
    costs: np.ndarray,
    table: TableErrors,
    ways: Sequence[IntArray] = (),
) -> tuple[ImageEdges, list[PoseCandidates]]:
    """Return the edges with the log density of an unknown object, and refined poses of every part in a region.

    Args:
        models: parts.
        image: edges of the image in the region.
        T_camera_table: frame of the table ``(4, 4)``.
        region: region of the object.
        costs: costs of edge samples, of :func:`tanteo.vision.propose.edge_costs`.
        table: errors of the table, those of the camera's pose included.
        ways: numbers of the stable poses of each part that are tried; all of them if not given.
    """
    camera, edges = image.camera, image.edges
    ways = ways or [np.arange(len(model.rests)) for model in models]
    # of a part whose edges show, a region covers most; texture makes many small regions
    most = hull_area(on_plane(camera, region.contour, T_camera_table)[:, :2]) / EVIDENCE.least_share
    tried = [(model, own[model.areas[own] < most]) for model, own in zip(models, ways, strict=True)]
    tried = [(model, own) for model, own in tried if len(own)]
    proposals = _first_poses(tried, image, T_camera_table, region, costs, table)
    scores = np.concatenate([np.zeros(0), *(score for _, _, score in proposals)])
    least = max(np.sort(scores)[-3 * SEARCH.kept :][0], -1e9) if len(scores) else 0.0
    out = []
    for (model, _), (T, rests, score) in zip(tried, proposals, strict=True):
        # the best pose of each part is kept, so that every part has an evidence
        keep = (score >= least) | (score >= score.max(initial=-np.inf))
        if not keep.any():
            continue
        start = lie_down(model, rests[keep], T[keep], T_camera_table)
        prior = _lying(model, T_camera_table, start, table)
        found = refine(model.frame, camera, edges, start, prior=prior, reaches=SEARCH.last_reaches)
        log = image.sums(model, found).there + _log_priors(model, rests[keep])
        out.append(PoseCandidates(model, found, rests[keep], log))
    image = with_unknown(image, region, out)
    # poses far less probable than an unknown object do not count
    best = max(image.log_unknown, *(float(c.log.max()) for c in out)) if out else 0.0
    return image, [_with_beside(c, image, T_camera_table, table, best) for c in out]


def with_unknown(image: ImageEdges, region: Region, found: Sequence[PoseCandidates]) -> ImageEdges:
    """Return the edges of an image with the log density of an unknown object in the place of the best candidate.

    Args:
        image: edges of the image.
        region: region of the object, whose edges an unknown object has if there is no candidate.
        found: candidates.
    """
    if not any(len(one.log) for one in found):
        return image.with_unknown_in(dilated(region.mask))
    best = max(found, key=lambda one: float(one.log.max(initial=-np.inf)))
    return image.with_unknown(best.model, best.T_camera_part[int(np.argmax(best.log))])


def _first_poses(
    tried: Sequence[tuple[VisionModel, IntArray]],
    image: ImageEdges,
    T_camera_table: Transforms,
    region: Region,
    costs: np.ndarray,
    table: TableErrors,
) -> list[tuple[Transforms, IntArray, FloatArray]]:
    """Return poses, stable poses and log densities of each part after a few rounds; of equal poses the best counts."""
    camera, edges = image.camera, image.edges
    places = slides(region, camera)
    out = []
    for model, own in tried:
        proposal = propose(model, own, camera, T_camera_table, costs, places)
        prior = _lying(model, T_camera_table, proposal.T_camera_part, table)
        T = refine(
            model.coarse,
            camera,
            edges,
            proposal.T_camera_part,
            prior=prior,
            reaches=SEARCH.first_reaches,
        )
        score = image.sums(model, T, coarse=True).there + _log_priors(model, proposal.rests)
        out.append((T, proposal.rests, np.where(distinct(model, T, score), score, -np.inf)))
    return out


def _log_priors(model: VisionModel, which: IntArray) -> FloatArray:
    """Return the log probability of stable poses."""
    return np.log([model.rests[k].probability for k in which])


def _with_beside(
    c: PoseCandidates, image: ImageEdges, T_camera_table: Transforms, table: TableErrors, best: float
) -> PoseCandidates:
    """Return the likely candidates, and poses next to those that may be the best.

    Where a shadow or a second edge is next to an edge, edges match at several poses a millimetre apart.
    """
    keep = np.flatnonzero((c.log > best - DEFAULTS.search.drop_gap) | (c.log == c.log.max()))
    Ts, rests = [c.T_camera_part[keep]], [c.rests[keep]]
    for k in np.flatnonzero(c.log > best - SEARCH.likely):
        near = poses_beside(c.model, int(c.rests[k]), image, T_camera_table, c.T_camera_part[k], table)
        Ts.append(near)
        rests.append(np.full(len(near), c.rests[k]))
    T, rest = np.concatenate(Ts), np.concatenate(rests)
    return PoseCandidates(c.model, T, rest, image.sums(c.model, T).there + _log_priors(c.model, rest))


def poses_beside(
    model: VisionModel,
    rest: int,
    image: ImageEdges,
    T_camera_table: Transforms,
    T_camera_part: Transforms,
    table: TableErrors,
) -> Transforms:
    """Return a pose of a part on the table and distinct poses next to it, each refined ``(k, 4, 4)``."""
    camera = image.camera
    start = lie_down(model, np.array([rest]), T_camera_part[None], T_camera_table)
    prior = _lying(model, T_camera_table, start, table)
    Ts = beside(camera, T_camera_part, T_camera_table, model.part.centroid)
    Ts = refine(model.frame, camera, image.edges, Ts, prior=prior, start=start, reaches=SEARCH.reaches(SEARCH.beside))
    slack = EVIDENCE.spread * pixel_length(camera, T_camera_part, model.part.centroid)
    return np.asarray(Ts[distinct(model, Ts, np.zeros(len(Ts)), slack)])


def distinct(model: VisionModel, Ts: Transforms, scores: FloatArray, slack: float | None = None) -> BoolArray:
    """Return which poses ``(B,)`` are not equal to a better one; symmetries are not considered.

    Args:
        model: the part.
        Ts: poses ``(B, 4, 4)``.
        scores: score of each ``(B,)``.
        slack: distance between places of equal poses [m]; that of poses that are one if not given.
    """
    slack = EVIDENCE.same_pose * model.part.diagonal if slack is None else slack
    kept = _core.far_apart(in_camera(Ts, model.inner), np.argsort(-scores, kind="stable"), slack)
    return np.isin(np.arange(len(Ts)), kept)


def lie_down(model: VisionModel, which: IntArray, T: Transforms, T_camera_table: Transforms) -> Transforms:
    """Return poses at which the part lies exactly in its stable poses ``which``, nearest to the given ones."""
    T_table = SE3.inverse(T_camera_table) @ T
    Ts = np.empty_like(T_table)
    for k in set(which.tolist()):
        Ts[which == k] = lay(model.part, model.rests[k], T_table[which == k])
    return np.asarray(T_camera_table @ Ts)


def _lying(model: VisionModel, T_camera_table: Transforms, Ts: Transforms, table: TableErrors) -> FloatArray:
    return lying_information(SE3.inverse(T_camera_table) @ Ts, model.part.centroid, table)
