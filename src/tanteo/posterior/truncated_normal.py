"""Moments of normal densities of a pose that a box truncates."""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms, Vectors
from tanteo.posterior.sampling.peaks import Objective
from tanteo.posterior.settings import Settings

_SWEEPS = 50
"""Numerical: sweeps of coordinate descent in three coordinates, which converges long before unless nearly singular."""


def truncate_by_box(
    objective: Objective, Ts: Transforms, covariances: Covariances
) -> tuple[FloatArray, Covariances, BoolArray]:
    """Return means and covariances of normal densities about poses, truncated by the box of the prior.

    The box bounds the part's centroid. Its three coordinates have a truncated normal density, whose moments are summed
    over a grid. The pose follows by regression.

    Args:
        objective: the part and the problem.
        Ts: poses ``(m, 4, 4)``.
        covariances: covariances of motions about the part's centre ``(m, 6, 6)`` [m, rad].

    Returns:
        Mean motions ``(m, 6)``, covariances ``(m, 6, 6)``, and whether the box truncates each density ``(m,)``.
    """
    means, cut = np.zeros((len(Ts), 6)), np.zeros(len(Ts), dtype=bool)
    pose, part = objective.problem.priors.pose, objective.prepared.part
    if pose is None or pose.box is None:
        return means, covariances, cut
    covariances, own = covariances.copy(), objective.problem.settings
    for k, (T, P) in enumerate(zip(Ts, covariances, strict=True)):
        J = T[:3, :3] @ np.hstack([np.eye(3), -SO3.hat(part.centroid - objective.prepared.shape.centre)])
        at, S = SE3.apply(T, part.centroid), J @ P @ J.T
        reach = own.search.reach_sds * np.sqrt(np.diag(S))
        cut[k] = bool(((at - reach < pose.box[0]) | (at + reach > pose.box[1])).any())
        if cut[k]:
            mean, C = _moments(at, S, pose.box, own)
            gain = np.linalg.solve(S, J @ P).T
            # Joseph form: P + gain (C - S) gain^T cancels to noise where the box is far away and C tiny
            rest = np.eye(6) - gain @ J
            means[k], covariances[k] = gain @ (mean - at), rest @ P @ rest.T + gain @ C @ gain.T
    return means, covariances, cut


def _moments(at: Vectors, S: Covariances, box: Vectors, own: Settings) -> tuple[Vectors, Covariances]:
    """Return mean ``(3,)`` and covariance ``(3, 3)`` of a normal density inside a box."""
    gate = own.search.gate
    Q = np.asarray(np.linalg.inv(S), dtype=np.float64)
    top = _likeliest(at, Q, box)
    slope = Q @ (top - at)
    with np.errstate(divide="ignore"):
        end = np.where((top <= box[0]) | (top >= box[1]), 0.5 * gate**2 / np.abs(slope), np.inf)
    reach = np.minimum(gate * np.sqrt(np.diag(S)), end)  # where the log density has fallen by half of the square
    low, high = np.maximum(top - reach, box[0]), np.minimum(top + reach, box[1])
    nodes = round(4 * gate)  # steps of half a standard deviation
    shares = (np.arange(nodes) + 0.5) / nodes
    x = np.stack(np.meshgrid(*(low + shares[:, None] * (high - low)).T, indexing="ij"), axis=-1).reshape(-1, 3)
    log = -0.5 * np.einsum("ni,ij,nj->n", x - at, Q, x - at)
    w = np.exp(log - log.max())
    mean = w @ x / w.sum()
    return mean, ((w[:, None] * (x - mean)).T @ (x - mean)) / w.sum()


def _likeliest(at: Vectors, Q: FloatArray, box: Vectors) -> Vectors:
    """Return the point of a box that is nearest to another point in the metric ``Q`` ``(3,)``."""
    x = np.clip(at, *box)
    for _ in range(_SWEEPS):  # of coordinate descent, which is slow where the information is nearly singular
        for i in range(3):
            rest = Q[i] @ (x - at) - Q[i, i] * (x[i] - at[i])
            x[i] = np.clip(at[i] - rest / Q[i, i], box[0, i], box[1, i])
    return x
