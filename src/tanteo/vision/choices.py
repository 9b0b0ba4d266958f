"""What each edge of a part says about its pose if it met its own edge or another's, and the mixture over which did."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.special import log_sum
from tanteo.typing import BoolArray, FloatArray, IntArray
from tanteo.vision.edges import CORRELATION, FLOOR
from tanteo.vision.fit import EdgeMatches

FAR, ROUGH = 1.0, 0.2
"""An edge that is another's: standard deviation of its distance, and of its points about that if it is not as straight
as the part's own [px]."""

_PAIRED = 24
"""Edges about which one may be mistaken together with another: those whose own mistake costs least."""


@dataclass(frozen=True, slots=True)
class EdgeErrors:
    """What misplaces edge points besides noise, fitted on rendered scenes of random parts.

    The fit is in ``benchmarks/vision_fit.py``; within a factor of two others do about as well.

    Attributes:
        own: standard deviation of a point that stands alone [px].
        pulled: what is added to that for each pixel that the point drifts. Half of the variance of both is common to
            the edge, half the point's own.
        wrong: probability that what an edge of the part meets is another's.
        straight: how often such an edge runs as straight along the part's as its own would: the border of a thing in
            the way or of its shadow, another edge of the part.
        shared: what moves a whole edge besides [px].
    """

    own: float = 0.01
    pulled: float = 0.25
    wrong: float = 0.3
    straight: float = 0.3
    shared: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """What each edge says about ``n`` unknowns, if it is the part's own (first) and if it is another's (second).

    Attributes:
        A: information ``(G, 2, n, n)``.
        g: its gradient ``(G, 2, n)``.
        chi2: of the offsets ``(G, 2)``.
        log: log density of the offsets at the present pose ``(G, 2)``, with the probability of the case.
    """

    A: FloatArray
    g: FloatArray
    chi2: FloatArray
    log: FloatArray


def terms_of(met: EdgeMatches, groups: IntArray, misplaced: FloatArray, errors: EdgeErrors) -> Terms:
    """What each edge says.

    Noise is one draw over a correlation length; with independent variances ``W^-1`` and a common error of deviations
    ``b`` the inverse of ``W^-1 + b b'`` is by Woodbury.

    Args:
        met: at one pose, no batch axes; derivatives by ``n`` unknowns.
        groups: which edge each sample belongs to ``(N,)``.
        misplaced: standard deviation of what misplaces each sample's edge point besides noise ``(N,)`` [px].
        errors: what is common to whole edges, and how often they are another's.
    """
    which, count = numbered(groups[met.hits])
    rows = np.concatenate([met.jacobian[met.hits], met.offsets[met.hits, None]], axis=1)
    share = np.minimum(met.spans[met.hits] / CORRELATION, 1.0)
    half = 0.5 * misplaced[met.hits] ** 2
    alone, whole = met.sds[met.hits] ** 2 + FLOOR**2 + half, half + errors.shared**2
    own, rough, straight = (
        _as_one(rows, which, count, (alone + more) / share, np.sqrt(common), probability)
        for common, more, probability in (
            (whole, 0.0, 1 - errors.wrong),
            (whole + FAR**2, ROUGH**2, errors.wrong * (1 - errors.straight)),
            (whole + FAR**2, 0.0, errors.wrong * errors.straight),
        )
    )
    other = [  # rough or straight, whichever is likelier
        np.where((straight[3] > rough[3]).reshape(-1, *(1,) * (a.ndim - 1)), b, a)
        for a, b in zip(rough, straight, strict=True)
    ]
    return Terms(*(np.stack(pair, axis=1) for pair in zip(own, other, strict=True)))


def numbered(groups: IntArray) -> tuple[IntArray, int]:
    """Groups ``(N,)`` counted from 0 without gaps, in their order, and how many there are."""
    there = np.bincount(groups) > 0
    return (np.cumsum(there) - 1)[groups], int(np.count_nonzero(there))


def _as_one(
    rows: FloatArray, which: IntArray, count: int, variance: FloatArray, common: FloatArray, probability: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Information, gradient, chi-square and log density of each edge under one case.

    Of rows of derivatives and offset ``(N, n + 1)`` with independent variances ``(N,)`` [px^2], and deviations ``(N,)``
    by what moves the whole edge [px].
    """
    w = (which == np.arange(count)[:, None]) / variance
    columns = rows.shape[1]
    squares = (rows[:, :, None] * rows[:, None, :]).reshape(len(rows), columns * columns)
    along, total = (w * common) @ rows, 1 + w @ (common * common)
    outer = (w @ squares).reshape(count, columns, columns)
    outer -= along[:, :, None] * along[:, None, :] / total[:, None, None]
    spread = np.bincount(which, weights=np.log(variance), minlength=count) + np.log(total)
    log = np.log(max(probability, 1e-300)) - 0.5 * (outer[:, -1, -1] + spread)
    return outer[:, :-1, :-1], outer[:, :-1, -1], outer[:, -1, -1], log


def mixture(terms: Terms, A: FloatArray, g: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Mean and covariance of the unknowns over the choices of edges that are another's.

    The most probable choice is found edge by edge; it and those that differ in one or two edges are summed.

    Args:
        terms: of the edges.
        A: information beforehand ``(n, n)``, of full rank.
        g: its gradient ``(n,)``.

    Returns:
        Mean ``(n,)``, covariance ``(n, n)``, and which edges are another's in the most probable choice ``(G,)``.
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
    return float(log_sum(_choices(terms, A, g)[0]))


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
    """Log weights ``(m,)``, means ``(m, n)`` and covariances ``(m, n, n)`` of choices ``(m, G)``."""
    return _core.weigh_choices(A, g, terms.A, terms.g, terms.log, wrong)
