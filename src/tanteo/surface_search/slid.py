"""Other poses beside one: the part slid along a motion that few readings hold, until these meet other faces.

Between the two walls of a housing, or from a step to the next, all other readings stay where they are. Both poses may
explain everything, and they are nearer to each other than first poses are.
"""

from __future__ import annotations

import numpy as np

from tanteo.lie import SE3
from tanteo.matching.part_motions import part_scale
from tanteo.parts import Part
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.refine import refine
from tanteo.surface_search.starts import score
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import FloatArray, IntArray, Tangents, Transforms

_FROM = 4
"""Maxima from which the part is slid."""

_MOST, _FEW = 40, 4
"""Readings with which it is tried, and those that hold a motion, at most; more of these hardly all meet other faces."""

_ALONE = 0.9
"""Share of what holds a motion that they have."""

_COUNTS = 0.5
"""Probability of being on the surface from which a reading does."""

_REACH, _STEP = 3.0, 0.25
"""How far they move each way and in which steps, in spacings of first poses."""

_FITS = 4.0
"""Sum of squared distances in steps, those of each reading clipped at nine, up to which a slide is followed."""

_NEXT = 2
"""Slides along each motion that are followed, those that fit best."""


def slid_beside(
    touches: Touches, maxima: Polished, target: Target, narrowing: FloatArray
) -> tuple[Transforms, IntArray]:
    """Poses beside the best maxima after slides that bring all readings near the surface again.

    Args:
        touches: the readings, or some of them.
        maxima: found so far, best first.
        target: the part.
        narrowing: scales of the last steps.

    Returns:
        Poses ``(P, 4, 4)``, and the groups of readings that led to their places ``(P,)``.
    """
    best = maxima.take(np.arange(min(_FROM, len(maxima.Ts))))
    blurred = np.median(touches.sd) > _STEP * target.spacing  # what is so near is one to such noise
    if blurred or best.rows.shape[1] > _MOST:
        return best.Ts[:0], best.groups[:0]
    of, motions = _held_by_few(best, target.part)
    if not len(of):
        return best.Ts[:0], best.groups[:0]
    Ts, line = _slides(touches, best.Ts[of], motions, target)
    return refine(touches, Ts, target, narrowing)[0], best.groups[of[line]]


def _slides(touches: Touches, Ts: Transforms, motions: Tangents, target: Target) -> tuple[Transforms, IntArray]:
    """From each pose along its motion ``(L, 6)``: poses that fit best, and the row of the motion of each."""
    count = int(_REACH / _STEP)
    t = _STEP * target.spacing * np.arange(-count, count + 1)
    Ts = Ts[:, None] @ SE3.exp(t[:, None] * motions[:, None])
    wide = float(np.hypot(_STEP * target.spacing, np.median(touches.sd)))
    misfit = len(touches) * score(touches, Ts.reshape(-1, 4, 4), target, wide)[:, 0].reshape(Ts.shape[:2])
    beside = np.pad(misfit, ((0, 0), (1, 1)), constant_values=np.inf)
    low = (misfit <= beside[:, :-2]) & (misfit < beside[:, 2:]) & (misfit < _FITS) & (t != 0)
    order = np.argsort(np.where(low, misfit, np.inf), axis=1)[:, :_NEXT]
    line, rank = np.nonzero(np.take_along_axis(low, order, axis=1))
    return Ts[line, order[line, rank]], line


def _held_by_few(maxima: Polished, part: Part) -> tuple[IntArray, Tangents]:
    """Motions that few readings hold: shifts along the normals that were met, and what one reading holds alone.

    Returns:
        The maximum of each ``(L,)``; motions that shift the readings by a metre along their normals ``(L, 6)``.
    """
    J = maxima.rows * np.sqrt(maxima.belongs)[..., None]
    weight = np.linalg.norm(J[..., :3], axis=-1)
    normals = J[..., :3] / np.maximum(weight, 1e-300)[..., None]
    parallel = (normals @ np.swapaxes(normals, -1, -2)) ** 2 > _ALONE
    held = (J[..., :3] @ np.swapaxes(normals, -1, -2)) ** 2  # what each reading (rows) has of a shift along each normal
    few = (parallel.sum(axis=-1) <= _FEW) & (np.sum(held * parallel, axis=1) > _ALONE * held.sum(axis=1))
    first = np.argmax(parallel, axis=-1) == np.arange(J.shape[1])
    k, i = np.nonzero(few & first & (maxima.belongs > _COUNTS))
    shifts = np.concatenate([normals[k, i], np.zeros((len(k), 3))], axis=1)
    scale = part_scale(part)
    unit = J @ scale
    follows = unit @ np.linalg.pinv(np.swapaxes(unit, -1, -2) @ unit, rcond=1e-9, hermitian=True)
    own, one = np.nonzero(np.sum(follows * unit, axis=-1) > _ALONE)
    alone = follows[own, one] @ scale.T * weight[own, one, None]
    return np.concatenate([k, own]), np.concatenate([shifts, alone])
