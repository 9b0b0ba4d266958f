"""Where a climb starts in the errors that readings share, if these are large beside the noise.

With no shared error every reading is then far off the right pose, looks astray, and says nothing of the error. So
pose and shared errors first settle together while readings lose their weight slowly: from as far off as the shared
errors may put them, down to the noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tanteo.lie import SO3
from tanteo.localization import motions_about
from tanteo.matching.prior import add_prior
from tanteo.matching.priors import Priors
from tanteo.surface_search.refine import moved, step_to
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import FloatArray, Transforms

_HARMLESS = 1.0
"""Shared errors that put no reading farther off than this many standard deviations of its noise need no start."""

_RANK, _MOST = 1e-6, 100.0
"""Share below which a motion, or a reading, is taken as of no weight; standard deviations that are far enough."""

_DAMPING = 1e-7
"""Share of the information that is added to it: shared errors and pose move together along weak valleys."""

_FAR, _NEAR = 2.0, 3.0
"""Readings keep half their weight up to this many times the shared errors at first; up to this many sd at last."""


def bend(touches: Touches) -> float:
    """How far shared errors put a reading off, in standard deviations of its noise: the largest, root mean square.

    Only as far as they bend the readings among themselves; what moves all of them as a whole the pose takes up.
    """
    if not touches.gains.shape[-1] or not len(touches):
        return 0.0
    x = touches.points - touches.points.mean(axis=0)
    length = max(float(np.linalg.norm(x, axis=1).max()), 1e-12)
    motions = np.concatenate([np.broadcast_to(np.eye(3), (len(x), 3, 3)), SO3.hat(x) / length], axis=2).reshape(-1, 6)
    gains = touches.gains.reshape(len(motions), -1)
    apart = gains - motions @ np.linalg.lstsq(motions, gains, rcond=1e-9)[0]
    off = np.sqrt(np.sum(apart.reshape(len(x), -1) ** 2, axis=1))
    return float((off / touches.sd).max())


def starts_of(touches: Touches, Ts: Transforms, target: Target, priors: Priors) -> list[tuple[Transforms, FloatArray]]:
    """Poses ``(S, 4, 4)`` and whitened shared errors ``(S, D)`` to climb from: settled together; and as they are.

    Where few readings hold a pose, settling may lead it far away though it was right.

    Args:
        touches: the readings.
        Ts: poses near maxima, up to the shared errors ``(S, 4, 4)``.
        target: the part.
        priors: what is known of the pose: of each, if it says so.
    """
    D = touches.gains.shape[-1]
    z = np.zeros((len(Ts), D))
    if not D or not len(Ts) or not len(touches):
        return [(Ts, z)]
    far = _FAR * np.maximum(bend(touches), _alone(_residuals(touches, Ts, z, target)[1]))
    if far.max() <= _FAR * _HARMLESS:
        return [(Ts, z)]
    far = far.clip(_NEAR)[:, None]
    widths = [far * (_NEAR / far) ** share for share in np.linspace(0, 1, 3 + int(np.ceil(np.log2(far.max() / _NEAR))))]
    return [_settled(touches, Ts, z, target, priors, widths), (Ts, _there(touches, Ts, z, target, widths))]


def start_of(touches: Touches, Ts: Transforms, target: Target, priors: Priors) -> tuple[Transforms, FloatArray]:
    """The first of :func:`starts_of`: poses and shared errors settled together."""
    return starts_of(touches, Ts, target, priors)[0]


def _settled(
    touches: Touches, Ts: Transforms, z: FloatArray, target: Target, priors: Priors, widths: Sequence[FloatArray]
) -> tuple[Transforms, FloatArray]:
    """Poses and shared errors after a step together at each width."""
    M = motions_about(target.part.centroid, 6 + z.shape[1])
    for width in widths:
        A, b = equations_within(touches, Ts, z, target, width)
        A[:, 6:, 6:] += np.eye(z.shape[1])
        b[:, 6:] -= z
        add_prior(priors.pose, target.part, Ts, A, b)
        step = step_to(M.T @ A @ M, b @ M, np.full(len(Ts), _DAMPING))
        Ts, z = moved(Ts, step[:, :6], target.part.centroid), z + step[:, 6:]
    return Ts, z


def _there(touches: Touches, Ts: Transforms, z: FloatArray, target: Target, widths: Sequence[FloatArray]) -> FloatArray:
    """Shared errors after a step at each width, the poses as they are."""
    for width in widths:
        A, b = (x[:, 6:] for x in equations_within(touches, Ts, z, target, width))
        z = z + np.linalg.solve(A[..., 6:] + np.eye(z.shape[1]), (b - z)[..., None])[..., 0]
    return z


def equations_within(
    touches: Touches, Ts: Transforms, z: FloatArray, target: Target, width: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Information ``(S, 6 + D, 6 + D)`` and gradient of readings that keep half their weight up to ``width`` sd."""
    r, J = _residuals(touches, Ts, z, target)
    w = 1 / (1 + (r / np.asarray(width)) ** 2)
    JtW = np.swapaxes(J, 1, 2) * (w * w)[:, None, :]
    return JtW @ J, -(JtW @ r[..., None])[..., 0]


def _alone(J: FloatArray) -> FloatArray:
    """How far shared errors put one reading off, in standard deviations, once all others are met: the most ``(S,)``.

    Where the others just fix the pose, errors that hardly bend the readings are all the more in the one that is left.
    """
    motions, gains = J[..., :6], J[..., 6:]
    U, s, _ = np.linalg.svd(motions, full_matrices=False)
    U = np.where((s > _RANK * s[:, :1])[:, None], U, 0.0)
    left = np.linalg.norm(gains - U @ (np.swapaxes(U, 1, 2) @ gains), axis=2)
    own = 1 - np.sum(U * U, axis=2)
    alone = np.where(own > _RANK, left / np.maximum(own, _RANK), 0.0)
    return np.asarray(alone.max(axis=1).clip(max=_MOST))


def _residuals(touches: Touches, Ts: Transforms, z: FloatArray, target: Target) -> tuple[FloatArray, FloatArray]:
    """Distances in standard deviations ``(S, n)`` and derivatives by pose and shared errors ``(S, n, 6 + D)``."""
    R = Ts[:, :3, :3]
    p = (touches.points + np.einsum("nid,sd->sni", touches.gains, z) - Ts[:, None, :3, 3]) @ R
    phi, g = target.distance(p)
    world = g @ np.swapaxes(R, 1, 2)
    s = 1 / np.sqrt(np.einsum("sni,nij,snj->sn", world, touches.covs, world))
    J = np.concatenate([-g, SO3.cross(g, p), np.einsum("sni,nid->snd", world, touches.gains)], axis=-1)
    return (phi - touches.radii) * s, J * s[..., None]
