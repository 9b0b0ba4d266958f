"""The pose that a part's edges agree on, when any of them may have met an edge that is another's.

Three errors of an edge point are told apart. Noise is its own. Neighbours in the image (a shadow's border, a second
edge of the part) pull it aside; how much is seen by how far it moves when the image is smoothed more
(``EdgePoints.drifts``). And all that an edge of the part met may belong to something else: to the border of the
shadow that runs beside it, to a thing in the way. Which did is not known, so the pose is the mean of a mixture over the
possible choices, with the covariance of the whole (Gaussian sum, Alspach and Sorenson 1972).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from tanteo.lie import SE3
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera
from tanteo.vision.edge_map import EdgeMap
from tanteo.vision.edges import CORRELATION, FLOOR
from tanteo.vision.fit import Met, meet
from tanteo.vision.models import VisionModel
from tanteo.vision.wireframe import see_edges

FAR, ROUGH = 1.0, 0.2
"""An edge that is another's: standard deviation of its distance, and of its points about that [px]."""

REACH = 1.5
"""An edge point farther off than this is not looked at [px]."""

SHARED = (0.0, 0.15, 0.4, 0.8)
"""What may move whole edges besides [px]: lenses, models and places of cameras are less exact than rendered ones. The
one is taken under which the offsets are most probable."""

_TOGETHER = 0.1
"""Points of one edge are within four standard deviations of their median, of these and their own errors [px]."""

_PAIRED = 24
"""Edges about which one may be mistaken together with another: those whose own mistake costs least."""

_ROUNDS = 5
_HOLD = 1.0
"""Information that keeps a step small along what nothing observes [1/diagonals, 1/rad]."""


@dataclass(frozen=True, slots=True)
class EdgeErrors:
    """What misplaces edge points besides noise, fitted on rendered scenes of random parts.

    The fit is in ``benchmarks/vision_fit.py``; within a factor of two others do about as well.

    Attributes:
        own: standard deviation of a point that stands alone [px].
        pulled: what is added to that for each pixel that the point drifts. Half of the variance of both is common to
            the edge, half the point's own.
        wrong: probability that what an edge of the part meets is another's.
        shared: what moves a whole edge besides [px].
    """

    own: float = 0.04
    pulled: float = 0.25
    wrong: float = 0.3
    shared: float = 0.0


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
    met: Met


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """What each edge says about the pose, if it is the part's own (first) and if it is another's (second).

    Attributes:
        A: information ``(G, 2, 6, 6)``.
        g: its gradient ``(G, 2, 6)``.
        chi2: of the offsets ``(G, 2)``.
        log: log density of the offsets at the present pose ``(G, 2)``, with the probability of the case.
    """

    A: FloatArray
    g: FloatArray
    chi2: FloatArray
    log: FloatArray


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
    scale = np.r_[np.full(3, frame.diagonal), np.ones(3)]
    hold = np.diag(_HOLD / scale**2)
    seen = see_edges(frame, T)
    met = clear_edges(model, meet(frame, camera, edges, T, REACH, seen))
    pull = -prior @ SE3.log(SE3.inverse(start) @ T)
    cases = [replace(errors, shared=sd) for sd in SHARED]
    evidence = [
        log_evidence(terms_of(met, frame.groups, _misplaced(met, edges, case), case), prior + hold, pull)
        for case in cases
    ]
    errors = cases[int(np.argmax(evidence))]
    for _ in range(_ROUNDS):
        met = clear_edges(model, meet(frame, camera, edges, T, REACH, seen))
        met = own_points(met, frame.groups, _misplaced(met, edges, errors))
        terms = terms_of(met, frame.groups, _misplaced(met, edges, errors), errors)
        pull = -prior @ SE3.log(SE3.inverse(start) @ T)
        mean, covariance, wrong = mixture(terms, prior + hold, pull)
        T = T @ SE3.exp(mean * min(1.0, 0.3 / max(float(np.linalg.norm(mean / scale)), 1e-12)))
    chi2 = float(terms.chi2[np.arange(len(wrong)), wrong.astype(np.int64)].sum())
    scaled = np.linalg.inv(covariance / np.outer(scale, scale)) / np.outer(scale, scale)
    shares = np.minimum(met.spans[met.hits] / CORRELATION, 1.0)
    return Settled(T, 0.5 * (scaled + scaled.T) - hold, chi2, float(shares.sum()), met)


def _misplaced(met: Met, edges: EdgeMap, errors: EdgeErrors) -> FloatArray:
    """Standard deviation of what misplaces each sample's edge point besides noise ``(N,)`` [px]."""
    drifts = edges.points.drifts[met.points] if len(edges.points) else np.zeros(met.points.shape)
    return np.asarray(np.hypot(errors.own, errors.pulled * drifts))


def clear_edges(model: VisionModel, met: Met, gap: float = 4.0) -> Met:
    """Only those samples met at one pose that have no other edge of the part within ``gap`` px, to pull them aside."""
    from scipy.spatial import cKDTree

    shown = np.flatnonzero(met.inside)
    if not len(shown):
        return met
    at, normals, half = met.pixels[shown], met.normals[shown], 0.5 * met.spans[shown]
    pairs = cKDTree(at).query_pairs(gap + float(half.max()), output_type="ndarray")
    one, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    way = at[one] - at[other]
    across = np.sum(way * normals[other], axis=1)
    beyond = np.sqrt(np.maximum(np.sum(way**2, axis=1) - across**2, 0.0)) - half[other]
    near = np.hypot(across, np.maximum(beyond, 0.0)) < gap
    groups = model.frame.groups[shown]
    turned = np.abs(np.sum(normals[one] * normals[other], axis=1)) < 0.95
    near &= (groups[one] != groups[other]) | turned
    crowded = np.zeros(len(met.inside), dtype=np.bool_)
    crowded[shown[one[near]]] = True
    return _only(met, met.hits & ~crowded)


def own_points(met: Met, groups: IntArray, misplaced: FloatArray) -> Met:
    """Only those edge points met at one pose that run with the rest of their edge."""
    sd = np.sqrt(met.sds**2 + misplaced**2 + _TOGETHER**2)
    hits = met.hits.copy()
    for group in np.unique(groups[hits]):
        k = met.hits & (groups == group)
        hits[k] = np.abs(met.offsets[k] - np.median(met.offsets[k])) < 4 * sd[k]
    return _only(met, hits)


def _only(met: Met, hits: BoolArray) -> Met:
    return replace(met, hits=hits, offsets=np.where(hits, met.offsets, 0.0))


def terms_of(met: Met, groups: IntArray, misplaced: FloatArray, errors: EdgeErrors) -> Terms:
    """What each edge says.

    Noise is one draw over a correlation length; with independent variances ``W^-1`` and a common error of deviations
    ``b`` the inverse of ``W^-1 + b b'`` is by Woodbury.

    Args:
        met: at one pose, no batch axes.
        groups: which edge each sample belongs to ``(N,)``.
        misplaced: standard deviation of what misplaces each sample's edge point besides noise ``(N,)`` [px].
        errors: what is common to whole edges, and how often they are another's.
    """
    names, which = np.unique(groups[met.hits], return_inverse=True)
    J, d = met.jacobian[met.hits], met.offsets[met.hits]
    share = np.minimum(met.spans[met.hits] / CORRELATION, 1.0)
    half = 0.5 * misplaced[met.hits] ** 2
    noise = met.sds[met.hits] ** 2 + FLOOR**2 + half
    rows = np.concatenate([J, d[:, None]], axis=1)
    cases, whole = [], half + errors.shared**2
    for common, more, probability in ((whole, 0.0, 1 - errors.wrong), (whole + FAR**2, ROUGH**2, errors.wrong)):
        variance, b = (noise + more) / share, np.sqrt(common)
        w = 1 / variance
        outer = np.zeros((len(names), 7, 7))
        np.add.at(outer, which, w[:, None, None] * rows[:, :, None] * rows[:, None, :])
        along = np.zeros((len(names), 7))
        np.add.at(along, which, (w * b)[:, None] * rows)
        total = 1 + np.bincount(which, weights=w * b * b, minlength=len(names))
        outer -= along[:, :, None] * along[:, None, :] / total[:, None, None]
        spread = np.bincount(which, weights=np.log(variance), minlength=len(names)) + np.log(total)
        log = np.log(probability) - 0.5 * (outer[:, 6, 6] + spread)
        cases.append((outer[:, :6, :6], outer[:, :6, 6], outer[:, 6, 6], log))
    return Terms(*(np.stack(column, axis=1) for column in zip(*cases, strict=True)))


def mixture(terms: Terms, A: FloatArray, g: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Mean and covariance of a step ``xi`` over the choices of edges that are another's.

    The most probable choice is climbed to edge by edge; it and those that differ in one or two edges are summed.

    Args:
        terms: of the edges.
        A: information beforehand ``(6, 6)``, of full rank.
        g: its gradient ``(6,)``.

    Returns:
        Mean ``(6,)``, covariance ``(6, 6)``, and which edges are another's in the most probable choice ``(G,)``.
    """
    log, means, covariances, wrong = _choices(terms, A, g)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    mean = weight @ means
    off = means - mean
    spread = np.einsum("m,mi,mj->ij", weight, off, off)
    return mean, np.einsum("m,mij->ij", weight, covariances) + spread, wrong


def log_evidence(terms: Terms, A: FloatArray, g: FloatArray) -> float:
    """Log density of the offsets over the same choices, up to what does not depend on the errors."""
    return float(logsumexp(_choices(terms, A, g)[0]))


def _choices(terms: Terms, A: FloatArray, g: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Log weights, means and covariances of the choices that are summed, and the most probable one."""
    one = np.eye(len(terms.log), dtype=np.bool_)
    wrong = np.zeros((1, len(one)), dtype=np.bool_)
    while True:
        near = np.concatenate([wrong, wrong ^ one])
        log = _weighed(terms, A, g, near)[0]
        best = int(np.argmax(log))
        if best == 0:
            break
        wrong = near[best : best + 1]
    doubtful = one[np.argsort(-log[1:], kind="stable")[:_PAIRED]]
    first, second = np.triu_indices(len(doubtful), 1)
    two = wrong ^ doubtful[first] ^ doubtful[second]
    return *_weighed(terms, A, g, np.concatenate([near, two])), wrong[0]


def _weighed(terms: Terms, A: FloatArray, g: FloatArray, wrong: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log weights ``(m,)``, means ``(m, 6)`` and covariances ``(m, 6, 6)`` of choices ``(m, G)``."""
    chosen = np.stack([~wrong, wrong], axis=-1).astype(np.float64)
    A = A + np.einsum("mgc,gcij->mij", chosen, terms.A)
    g = g + np.einsum("mgc,gci->mi", chosen, terms.g)
    scale = np.sqrt(np.diagonal(A, axis1=-2, axis2=-1))
    scaled = A / (scale[:, :, None] * scale[:, None, :])
    covariance = np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :])
    mean = (covariance @ g[..., None])[..., 0]
    volume = np.linalg.slogdet(scaled)[1] + 2 * np.log(scale).sum(axis=-1)
    log = np.einsum("mgc,gc->m", chosen, terms.log) - 0.5 * volume + 0.5 * np.sum(g * mean, axis=-1)
    return log, mean, covariance
