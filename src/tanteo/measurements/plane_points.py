"""Points that say of a plane what is known of it."""

from __future__ import annotations

import numpy as np

from tanteo.typing import Covariances, FloatArray, IntArray

_SLIGHT, _CLOSE = 1e-6, 0.05
"""Points that say less than this share of what the one that says most does are left out; so closely, in proportion, the
points have to say what the plane does."""


def as_good(levers: FloatArray, P: Covariances) -> tuple[IntArray, FloatArray]:
    """Rows of points, and variances of their heights, that give a plane of covariance ``P``; none where none do.

    A plane's height at a point is ``lever . (z, wx, wy)``, so that points say the sum of ``lever lever' / variance``.
    """
    from scipy.optimize import nnls  # slow to import

    if len(levers) < 3:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    units = np.sqrt(np.diag(P))
    wanted, a, b = np.linalg.inv(P / np.outer(units, units)), *np.triu_indices(3)
    A = levers * units / np.abs(levers * units).max()
    try:
        weights, miss = nnls((A[:, a] * A[:, b]).T, wanted[a, b])
    except RuntimeError:  # it does not settle, which is as if there were none
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    rows = np.flatnonzero(weights > _SLIGHT * weights.max())
    if miss > _CLOSE * np.linalg.norm(wanted) or np.linalg.matrix_rank(A[rows]) < 3:
        return rows[:0], weights[:0]
    return rows, np.abs(levers * units).max() ** 2 / weights[rows]


def scatter(A: FloatArray) -> FloatArray:
    """By how many standard deviations points are off the plane that they give, as such points are on average.

    Points are never exactly in a plane: from none that is off, the joint test would think the noise smaller.
    """
    free = np.linalg.svd(A)[0][:, 3:]
    off = free @ free.T @ np.where(np.arange(len(A)) % 2, -1.0, 1.0) if free.size else np.zeros(len(A))
    size = np.linalg.norm(off)
    return off * np.sqrt(free.shape[1]) / size if size > 1e-9 else off
