"""The independent ways in which a pose may be off, and how far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, Tangents, Transforms
from tanteo.parts import Part
from tanteo.posterior import corner_moves, motion_of
from tanteo.words import Motion

_LEVELS = (1, 2, 3)
"""Standard deviations of which overlays are drawn."""

_NOTABLE = 0.01
"""Ways that move the part less than this share of the largest are not shown."""

_SHOWN = 0.16
"""The farthest overlay is drawn about this share of the part's size away."""


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """One way in which the pose may be off, independent of the others.

    Attributes:
        motion: The motion.
        moves: How far one standard deviation of it moves the farthest corner of the box [m].
        rms: How far it moves all corners, root mean square [m].
        xi: One standard deviation of it, right perturbation of the pose ``(6,)`` [m, rad].
        Ts_world_part: Overlays ``(3, 2, 4, 4)``: at 1, 2 and 3 standard deviations, backwards and forwards, enlarged.
    """

    motion: Motion
    moves: float
    rms: float
    xi: Tangents
    Ts_world_part: Transforms


def find_ways(part: Part, T_world_part: Transforms, covariance: Covariances) -> tuple[tuple[Way, ...], int]:
    """The ways, and how many times their overlays are enlarged.

    The covariance is split so that each way moves the corners of the box independently of the others, as much as
    possible in the first.

    Args:
        part: The part.
        T_world_part: Where it is.
        covariance: Of that pose ``(6, 6)`` [m, rad].
    """
    T, J = T_world_part, corner_moves(part)
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(values.clip(0.0))
    moved = (J @ root).reshape(24, 6)
    order = np.linalg.eigh(moved.T @ moved)[1][:, ::-1]
    xis = (root @ order).T
    far = np.linalg.norm(xis @ np.swapaxes(J, 1, 2), axis=-1)
    moves, rms = far.max(axis=0), np.sqrt(np.mean(far**2, axis=0))
    kept = moves > _NOTABLE * moves.max()
    enlarged = _enlarged(float(moves.max()), part.diagonal)
    steps = np.array([[-level, level] for level in _LEVELS], dtype=np.float64) * enlarged
    ways = []
    for xi, max_measurements, all_ in zip(xis[kept], moves[kept], rms[kept], strict=True):
        motion = motion_of(part, xi, T)
        ways.append(Way(motion, float(max_measurements), float(all_), xi, T @ SE3.exp(steps[..., None] * xi)))
    return tuple(ways), enlarged


def _enlarged(moves: float, diagonal: float) -> int:
    """1, 2, 5, 10, 20 ...: so that three standard deviations can be seen."""
    if moves <= 0:
        return 1
    wanted = _SHOWN * diagonal / (_LEVELS[-1] * moves)
    steps = [m * 10**e for e in range(7) for m in (1, 2, 5)]
    return max((s for s in steps if s <= wanted), default=1)
