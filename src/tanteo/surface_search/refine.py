"""Polish poses of readings on a surface, hundreds at once: robust Gauss-Newton on point-to-surface distances."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tanteo.lie import SO3
from tanteo.localization import motions_about
from tanteo.surface_search.sensed_normals import tilts
from tanteo.surface_search.starts import both_ways, to_part
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import FloatArray, Transforms, Vectors

SETTLING = np.array([1.0, 1.0, 0.7, 0.5, 0.4])
"""Scales of the first steps, in units of the error of the first poses."""

_FIX = 6
"""So many readings it takes to fix a pose; of more, one may be left out."""

Known = Callable[[Transforms], tuple[FloatArray, FloatArray]]
"""What is known of the pose beforehand, as standardised residuals ``(S, m)`` and derivatives ``(S, m, 6)``."""


def refine(
    touches: Touches,
    Ts: Transforms,
    target: Target,
    scales: FloatArray,
    extra_sd: float = 0.0,
    known: Known | None = None,
    trimmed: bool = False,
) -> tuple[Transforms, FloatArray]:
    """Robust Gauss-Newton from every pose, one step a scale.

    Args:
        touches: the readings.
        Ts: poses ``(S, 4, 4)``.
        target: the part.
        scales: residuals beyond about this many standard deviations lose their weight, one for each step.
        extra_sd: of the distance itself, for the grid [m].
        known: what is known of the pose; widened by the scale of the step.
        trimmed: of more than six readings the one that is farthest off does not move its pose: where it is astray, but
            not so far that it has no weight, it pulls a pose that is right for all others to where it fits none.

    Returns:
        Poses, and the robust cost of each at the last step but one, as :func:`both_ways` ``(S, 2)``.
    """
    cost, M = np.zeros((len(Ts), 2)), motions_about(target.part.centroid)
    for scale in scales:
        r, J = residuals(touches, Ts, target, extra_sd)
        w = 1 / (1 + (r / scale) ** 2)
        cost = both_ways(w * r * r)
        if trimmed and len(touches) > _FIX:
            w[np.arange(len(w)), np.abs(r[:, : len(touches)]).argmax(axis=1)] = 0.0
        JtW = np.swapaxes(J, 1, 2) * (w * w)[:, None, :]
        A, b = JtW @ J, -(JtW @ r[..., None])[..., 0]
        if known is not None:
            r0, J0 = known(Ts)
            pull = np.swapaxes(J0, 1, 2) / scale**2
            A, b = A + pull @ J0, b - (pull @ r0[..., None])[..., 0]
            cost += np.log1p((r0 / scale) ** 2).sum(axis=1, keepdims=True) * scale**2 / r.shape[1]
        step = damped(M.T @ A @ M, b @ M)
        Ts = moved(Ts, step, target.part.centroid)
    return Ts, cost


def residuals(touches: Touches, Ts: Transforms, target: Target, extra_sd: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Distances in standard deviations ``(S, n)`` and derivatives by the pose ``(S, n, 6)``; normals add rows."""
    p = to_part(Ts, touches.points)
    phi, g, met = target.nearest(p)
    variance = _along(touches, Ts, g) + extra_sd**2
    s = 1 / np.sqrt(variance)
    r = (phi - touches.radii) * s
    J = -np.concatenate([g, SO3.cross(p, g)], axis=-1) * s[..., None]
    if not touches.oriented.any():
        return r, J
    rows = np.flatnonzero(touches.oriented)
    R, shape = Ts[:, :3, :3], (len(Ts), len(rows))
    turn, which = np.broadcast_to(R[:, None], (*shape, 3, 3)), np.broadcast_to(rows, shape)
    tilt = tilts(touches, target, turn, which, touches.normals[rows] @ R, p[:, rows], g[:, rows], met[:, rows])
    more = tilt.rows(p[:, rows], np.zeros((*shape, 3, 0)))
    return (
        np.concatenate([r, tilt.gap.reshape(len(Ts), 3 * len(rows))], axis=1),
        np.concatenate([J, more.reshape(len(Ts), 3 * len(rows), 6)], axis=1),
    )


def _along(touches: Touches, Ts: Transforms, g: Vectors) -> FloatArray:
    """Variance of each point along the gradient ``(S, n)``."""
    if not np.isnan(touches.variance):
        return np.full(g.shape[:2], touches.variance)
    world = g @ np.swapaxes(Ts[:, :3, :3], 1, 2)
    return np.asarray(np.sum((world[:, :, None] @ touches.covs)[:, :, 0] * world, axis=-1))


def damped(A: FloatArray, b: FloatArray) -> FloatArray:
    """Levenberg-Marquardt steps with a little damping, at most a fifth of a radian each."""
    A = np.array(A)
    d = np.einsum("sii->si", A)  # a view
    d += 1e-3 * d + 1e-9 * d.max(axis=1, keepdims=True) + 1e-12
    step = np.linalg.solve(A, b[..., None])[..., 0]
    turn = np.sqrt(np.sum(step[:, 3:] ** 2, axis=1))
    return step * np.minimum(1.0, 0.35 / np.maximum(turn, 1e-12))[:, None]


def step_to(A: FloatArray, b: FloatArray, damping: FloatArray) -> FloatArray:
    """Steps over pose and shared errors that stay put along directions that nothing resists, and follow weak ones.

    Args:
        A: information ``(S, 6 + D, 6 + D)``.
        b: gradient ``(S, 6 + D)``.
        damping: share of the information that is added to it ``(S,)``.
    """
    d = np.array(np.einsum("sii->si", A))
    for block in (slice(0, 3), slice(3, 6)):  # what only rounding resists is not known a million million times worse
        d[:, block] = np.maximum(d[:, block], 1e-6 * d[:, block].max(axis=1, keepdims=True))
    scale = 1 / np.sqrt(np.where(d > 0, d, 1.0))
    unit = A * scale[:, :, None] * scale[:, None, :] + damping[:, None, None] * np.eye(A.shape[1])
    step = scale * np.linalg.solve(unit, (scale * b)[..., None])[..., 0]
    turn = np.linalg.norm(step[:, 3:6], axis=1)
    return step * np.minimum(1.0, 0.2 / np.maximum(turn, 1e-12))[:, None]


def moved(Ts: Transforms, step: FloatArray, middle: Vectors) -> Transforms:
    """Poses ``(S, 4, 4)`` after steps ``(S, 6)`` of a frame at ``middle`` of the part ``(3,)``.

    As by the exponential to first order, and again rigid motions.
    """
    half = 0.5 * step[:, 3:, None]
    squared = np.sum(half * half, axis=1, keepdims=True)
    W = SO3.hat(half[..., 0])
    D = np.zeros((len(Ts), 4, 4))
    D[:, :3, :3] = ((1 - squared) * np.eye(3) + 2 * (half * half.swapaxes(1, 2) + W)) / (1 + squared)
    D[:, :3, 3], D[:, 3, 3] = step[:, :3] + middle - D[:, :3, :3] @ middle, 1.0
    return np.asarray(Ts @ D)
