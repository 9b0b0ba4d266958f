"""The pose that a part's edges agree on, when any of them may have met an edge that is another's.

Errors of an edge point are discriminated. Noise is its own. Neighbours in the image (a shadow's border, a second edge
of the part) pull it aside; how much is seen by how far it moves when the image is smoothed more
(``EdgePoints.drifts``). A lens that is not exact shifts all edges alike, which is a state with a prior, and each one
besides. And all that an edge of the part met may belong to something else: to the border of the shadow that runs beside
it, to a thing in the way. Which did is not known, so the pose is the mean of a mixture over the possible choices, with
the covariance of the whole (Gaussian sum, Alspach and Sorenson 1972).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo import _core
from tanteo.lie import SE3
from tanteo.special import softmax
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera
from tanteo.vision.choices import EdgeErrors, log_evidence, mixture, numbered, terms_of
from tanteo.vision.edges import CORRELATION, EdgeMap
from tanteo.vision.fit import EdgeMatches, meet
from tanteo.vision.models import VisionModel
from tanteo.vision.wireframe import see_edges

REACH = 1.0
"""An edge point farther off than this is not looked at [px]."""

SHARED, BEFOREHAND = (0.0, 0.15, 0.4, 0.8), (0.95, 1 / 60, 1 / 60, 1 / 60)
"""What may move whole edges besides what is stated of the camera [px], and how likely that is beforehand: one part in
twenty, or its lens, is not as it is said to be."""

_HALF, _EXACT = np.sqrt(0.5), 1e-4
"""Of a lens's error, half of the variance shifts all edges alike, half each by itself. Below the other: none [px]."""

_COUNTS = 0.003
"""Those that are less probable than this, given the image, are left out."""

_TOGETHER = 0.1
"""Points of one edge are within four standard deviations of their median, of these and their own errors [px]."""

_TURNED = 0.95
"""An edge is beside itself where it has turned so far [cosine]."""

_ROUNDS = 5
_HOLD = 1.0
"""Information that keeps a step small along what nothing observes [1/diagonals, 1/rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """A pose on which edges agree.

    Attributes:
        T_camera_part: mean ``(4, 4)``.
        information: of the pose, right, with that of the prior: inverse of the mixture's covariance ``(6, 6)``.
        chi2: of the offsets under the most probable choice.
        equations: how many independent offsets there are.
        met: what the edges met there.
    """

    T_camera_part: Transforms
    information: FloatArray
    chi2: float
    equations: float
    met: EdgeMatches


def settle(
    model: VisionModel,
    camera: Camera,
    edges: EdgeMap,
    T_camera_part: Transforms,
    *,
    start: Transforms | None = None,
    prior: FloatArray | None = None,
    errors: EdgeErrors | None = None,
) -> Settled:
    """Mean and information of the pose near one at which the edges about meet.

    Args:
        model: of the part.
        camera: that took the image.
        edges: of the image.
        T_camera_part: refined pose ``(4, 4)``.
        start: where the prior puts the part; where it is now if not given.
        prior: information on ``Log(T_start^-1 T)`` ``(6, 6)``; none if not given.
        errors: of edge points besides noise.
    """
    errors = errors or EdgeErrors()
    frame, T = model.frame, np.asarray(T_camera_part)
    start = T if start is None else start
    prior = np.zeros((6, 6)) if prior is None else prior
    met = _shifting(clear_edges(model, meet(frame, camera, edges, T, REACH)))
    before = _beforehand(model, camera, prior, start, T)
    cases = [replace(errors, shared=float(np.hypot(_HALF * camera.edge_sd, sd))) for sd in SHARED]
    evidence = [
        log_evidence(terms_of(met, frame.groups, _misplaced(met, edges, case), case), *before) for case in cases
    ]
    share = softmax(np.array(evidence) + np.log(BEFOREHAND))
    found = [_settled(model, camera, edges, T, start, prior, cases[k]) for k in np.flatnonzero(share > _COUNTS)]
    return as_one(model, found, share[share > _COUNTS])


def _settled(
    model: VisionModel,
    camera: Camera,
    edges: EdgeMap,
    T: Transforms,
    start: Transforms,
    prior: FloatArray,
    errors: EdgeErrors,
) -> Settled:
    """The same under one choice of what moves whole edges."""
    frame, seen = model.frame, see_edges(model.frame, T)
    for _ in range(_ROUNDS):
        met = clear_edges(model, meet(frame, camera, edges, T, REACH, seen))
        met = own_points(met, frame.groups, _misplaced(met, edges, errors))
        terms = terms_of(_shifting(met), frame.groups, _misplaced(met, edges, errors), errors)
        mean, covariance, wrong = mixture(terms, *_beforehand(model, camera, prior, start, T))
        mean, covariance = mean[:6], covariance[:6, :6]
        T = T @ SE3.exp(mean * min(1.0, 0.3 / max(float(np.linalg.norm(frame.to_unit @ mean)), 1e-12)))
    chi2 = float(terms.chi2[np.arange(len(wrong)), wrong.astype(np.int64)].sum())
    shares = np.minimum(met.spans[met.hits] / CORRELATION, 1.0)
    return Settled(T, information_of(model, covariance), chi2, float(shares.sum()), met)


def _shifting(met: EdgeMatches) -> EdgeMatches:
    """The same, with two more unknowns: a shift of all edges in the image."""
    return replace(met, jacobian=np.concatenate([met.jacobian, np.nan_to_num(met.normals)], axis=-1))


def _beforehand(
    model: VisionModel, camera: Camera, prior: FloatArray, start: Transforms, T: Transforms
) -> tuple[FloatArray, FloatArray]:
    """Information on step and shift, and its gradient: of the prior, of what keeps steps small, of the lens."""
    A, g = np.zeros((8, 8)), np.zeros(8)
    A[:6, :6] = prior + _hold(model)
    A[6:, 6:] = np.eye(2) / (_HALF * max(camera.edge_sd, _EXACT)) ** 2
    g[:6] = -prior @ SE3.log(SE3.inverse(start) @ T)
    return A, g


def as_one(model: VisionModel, found: list[Settled], share: FloatArray) -> Settled:
    """Poses of some probabilities, told as one normal: the mean, and the covariance of them all.

    They differ by so little that their covariances are told in one frame.
    """
    best, share = found[int(np.argmax(share))], share / share.sum()
    if len(found) == 1:
        return best
    off = SE3.log(SE3.inverse(best.T_camera_part) @ np.stack([each.T_camera_part for each in found]))
    mean = share @ off
    covariances = np.stack([covariance_of(model, each.information) for each in found])
    spread = np.einsum("m,mi,mj->ij", share, off - mean, off - mean)
    information = information_of(model, np.einsum("m,mij->ij", share, covariances) + spread)
    return replace(best, T_camera_part=best.T_camera_part @ SE3.exp(mean), information=information)


def information_of(model: VisionModel, covariance: FloatArray) -> FloatArray:
    """What a covariance ``(6, 6)`` says, without what only kept the steps small."""
    to_unit = model.frame.to_unit
    return np.asarray(to_unit.T @ _inverse(to_unit @ covariance @ to_unit.T) @ to_unit - _hold(model))


def covariance_of(model: VisionModel, information: FloatArray) -> FloatArray:
    """The covariance ``(6, 6)`` behind an information: the part's size and a radian where nothing is known."""
    scale = model.frame.scale
    return np.asarray(scale @ _inverse(scale.T @ (information + _hold(model)) @ scale) @ scale.T)


def _inverse(matrix: FloatArray) -> FloatArray:
    """Of a symmetric matrix, by way of one with ones on its diagonal."""
    power = np.sqrt(np.diagonal(matrix))
    scaled = np.linalg.inv(matrix / np.outer(power, power)) / np.outer(power, power)
    return np.asarray(0.5 * (scaled + scaled.T))


def _hold(model: VisionModel) -> FloatArray:
    """Information that keeps steps small, in units of the part ``(6, 6)``."""
    to_unit = model.frame.to_unit
    return np.asarray(_HOLD * to_unit.T @ to_unit)


def _misplaced(met: EdgeMatches, edges: EdgeMap, errors: EdgeErrors) -> FloatArray:
    """Standard deviation of what misplaces each sample's edge point besides noise ``(N,)`` [px]."""
    drifts = edges.points.drifts[met.points] if len(edges.points) else np.zeros(met.points.shape)
    return np.asarray(np.hypot(errors.own, errors.pulled * drifts))


def clear_edges(model: VisionModel, met: EdgeMatches, gap: float = 4.0) -> EdgeMatches:
    """Only those samples met at one pose that have no other edge of the part within ``gap`` px, to pull them aside."""
    pixels, normals, spans = (np.ascontiguousarray(a) for a in (met.pixels, met.normals, met.spans[None]))
    crowded = _core.crowded_edges(model.frame.groups, met.inside[None], pixels, normals, spans, gap, _TURNED)[0]
    return _only(met, met.hits & ~crowded)


def own_points(met: EdgeMatches, groups: IntArray, misplaced: FloatArray) -> EdgeMatches:
    """Only those edge points met at one pose that run with the rest of their edge."""
    sd = np.sqrt(met.sds**2 + misplaced**2 + _TOGETHER**2)
    k = np.flatnonzero(met.hits)
    k = k[np.lexsort((met.offsets[k], groups[k]))]
    edge, _ = numbered(groups[k])
    count, off = np.bincount(edge), met.offsets[k]
    first = np.cumsum(count) - count
    median = 0.5 * (off[first + (count - 1) // 2] + off[first + count // 2])
    hits = met.hits.copy()
    hits[k] = np.abs(off - median[edge]) < 4 * sd[k]
    return _only(met, hits)


def _only(met: EdgeMatches, hits: BoolArray) -> EdgeMatches:
    return replace(met, hits=hits, offsets=np.where(hits, met.offsets, 0.0))
