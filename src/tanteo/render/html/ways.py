"""Principal errors of a pose, and overlays that show them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, Tangents, Transforms
from tanteo.parts import Part
from tanteo.posterior.answers import corner_moves, motion_of, principal_errors
from tanteo.words import Motion

_LEVELS = (1, 2, 3)
"""Standard deviations of the drawn overlays."""

_NOTABLE = 0.01
"""Fraction of the largest principal error below which a principal error is not shown."""

_SHOWN = 0.16
"""Largest displacement of the farthest overlay, as a fraction of the part's size."""


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Principal error of a pose, independent of the others.

    Attributes:
        motion: motion of the part.
        moves: largest displacement of a corner of the box for one standard deviation [m].
        rms: root mean square displacement of all corners [m].
        xi: one standard deviation as a right perturbation of the pose ``(6,)`` [m, rad].
        Ts_world_part: magnified overlays at 1, 2 and 3 standard deviations with both signs ``(3, 2, 4, 4)``.
    """

    motion: Motion
    moves: float
    rms: float
    xi: Tangents
    Ts_world_part: Transforms


def find_ways(part: Part, T_world_part: Transforms, covariance: Covariances) -> tuple[tuple[Way, ...], int]:
    """Return the principal errors of a pose, and the magnification of their overlays.

    They are the first ones of :func:`tanteo.posterior.answers.principal_errors`; those that hardly move the part are
    excluded.

    Args:
        part: part at the pose.
        T_world_part: pose ``(4, 4)``.
        covariance: covariance of the pose, part frame, right perturbation ``(6, 6)`` [m, rad].
    """
    T, J, xis = T_world_part, corner_moves(part), principal_errors(part, covariance)
    far = np.linalg.norm(xis @ np.swapaxes(J, 1, 2), axis=-1)
    moves, rms = far.max(axis=0), np.sqrt(np.mean(far**2, axis=0))
    kept = rms > _NOTABLE * rms.max()
    enlarged = _enlarged(float(moves.max()), part.diagonal)
    steps = np.array([[-level, level] for level in _LEVELS], dtype=np.float64) * enlarged
    ways = []
    for xi, max_measurements, all_ in zip(xis[kept], moves[kept], rms[kept], strict=True):
        motion = motion_of(part, xi, T)
        ways.append(Way(motion, float(max_measurements), float(all_), xi, T @ SE3.exp(steps[..., None] * xi)))
    return tuple(ways), enlarged


def _enlarged(moves: float, diagonal: float) -> int:
    """Return a magnification 1, 2, 5, 10, ... at which three standard deviations are visible."""
    if moves <= 0:
        return 1
    wanted = _SHOWN * diagonal / (_LEVELS[-1] * moves)
    steps = [m * 10**e for e in range(7) for m in (1, 2, 5)]
    return max((s for s in steps if s <= wanted), default=1)
