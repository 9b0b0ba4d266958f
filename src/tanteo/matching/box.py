"""What a box leaves of a pose: the share of its distribution that has the part's centroid inside, and its moments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.inference.unknown_place import log_between
from tanteo.lie import SE3, SO3
from tanteo.parts import Part
from tanteo.typing import Covariances, FloatArray, Tangents, Transforms

SURE = 0.99
"""A distribution of which the box holds this share, or more, is taken as it is."""

_DRAWS = 256
"""Of the centroid, in each distribution."""

_STEP = 1.2207440846057596 ** -np.arange(1.0, 4.0)
"""Steps of draws that are spread evenly over the unit cube: powers of the root of ``x^4 = x + 1``."""


@dataclass(frozen=True, slots=True, eq=False)
class Left:
    """What a box leaves of normal distributions of the pose.

    Attributes:
        log_share: of each, inside ``(S,)``.
        means: of what is inside, as right perturbations ``(S, 6)`` [m, rad].
        covariances: about these ``(S, 6, 6)``.
    """

    log_share: FloatArray
    means: Tangents
    covariances: Covariances


def left_by(
    box: FloatArray, part: Part, Ts: Transforms, covariances: Covariances, means: Tangents | None = None
) -> Left:
    """What a box leaves of some distributions of the pose.

    The centroid is drawn one world axis after another, within the box each (Geweke, Hajivassiliou and Keane); what of
    the pose goes with it follows.

    Args:
        box: lowest and highest world coordinates of the centroid ``(2, 3)`` [m].
        part: the part.
        Ts: poses ``(S, 4, 4)``.
        covariances: about their means, right perturbation ``(S, 6, 6)``.
        means: of the perturbations ``(S, 6)``; zero if not given.
    """
    means = np.zeros((len(Ts), 6)) if means is None else means
    G = Ts[:, :3, :3] @ np.concatenate([np.eye(3), -SO3.hat(part.centroid)], axis=1)
    C = G @ covariances @ np.swapaxes(G, 1, 2)
    L = np.linalg.cholesky(C + 1e-12 * np.trace(C, axis1=1, axis2=2)[:, None, None] * np.eye(3))
    middles = SE3.apply(Ts, part.centroid) + (G @ means[..., None])[..., 0]
    log, e = _inside(box, middles, L)
    top = log.max(axis=1, initial=-np.inf)
    w = np.exp(log - top[:, None])
    log_share = top + np.log(w.mean(axis=1))
    moved, w = e @ np.swapaxes(L, 1, 2), w / w.sum(axis=1, keepdims=True)
    mean = np.einsum("sk,ski->si", w, moved)
    gap = moved - mean[:, None]
    gain = np.swapaxes(np.linalg.solve(C, G @ covariances), 1, 2)
    less = gain @ (C - np.einsum("sk,ski,skj->sij", w, gap, gap)) @ np.swapaxes(gain, 1, 2)
    return Left(log_share, means + (gain @ mean[..., None])[..., 0], covariances - less)


def _inside(box: FloatArray, middles: FloatArray, L: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log weights ``(S, K)`` of standard normal draws ``(S, K, 3)`` with which the centroids are in the box."""
    from scipy.special import log_ndtr, ndtri_exp  # slow to import, and needed with a box only

    u = (0.5 + np.arange(1, _DRAWS + 1)[:, None] * _STEP) % 1.0
    log, e = np.zeros((len(L), _DRAWS)), np.zeros((len(L), _DRAWS, 3))
    for i in range(3):
        at = middles[:, i, None] + (e[..., :i] @ L[:, i, :i, None])[..., 0]
        low, high = ((end - at) / L[:, i, i, None] for end in box[:, i])
        between = log_between(low, high)
        upper = low > 0
        least = log_ndtr(np.where(upper, -high, low))
        draw = ndtri_exp(np.logaddexp(least, np.log(u[:, i]) + between))
        e[..., i] = np.clip(np.where(upper, -draw, draw), low, high)
        log += between
    return log, e
