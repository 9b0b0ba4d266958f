"""Points of a plane that together have the covariance of the plane."""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import Covariances, FloatArray, IntArray

_SLIGHT, _CLOSE = 1e-6, 0.05
"""Points whose weight is below the first fraction of the largest are excluded; the second is the largest relative
misfit of the information of the points to that of the plane."""


def equivalent_points(levers: FloatArray, P: Covariances) -> tuple[IntArray, FloatArray]:
    """Return rows of points, and variances of their heights [m^2], that together determine a plane of covariance ``P``.

    A plane's height at a point is ``lever . (z, wx, wy)``, so the points' information is the sum of
    ``lever lever' / variance``, which non-negative least squares fits to the inverse of ``P``.

    Args:
        levers: one row ``(1, y, -x)`` for each point, in the frame of the plane ``(n, 3)``.
        P: covariance of height and the two tilts of the plane ``(3, 3)``.

    Returns:
        Rows and variances; both empty if no choice of points has that covariance.
    """
    from scipy.optimize import nnls  # slow to import

    if len(levers) < 3:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    units = np.sqrt(np.diag(P))
    wanted, a, b = np.linalg.inv(P / np.outer(units, units)), *np.triu_indices(3)
    A = levers * units / np.abs(levers * units).max()
    try:
        weights, miss = nnls((A[:, a] * A[:, b]).T, wanted[a, b])
    except RuntimeError:  # no convergence is treated as no solution
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    rows = np.flatnonzero(weights > _SLIGHT * weights.max())
    if miss > _CLOSE * np.linalg.norm(wanted) or np.linalg.matrix_rank(A[rows]) < 3:
        return rows[:0], weights[:0]
    return rows, np.abs(levers * units).max() ** 2 / weights[rows]


def typical_residuals(A: FloatArray) -> FloatArray:
    """Return typical residuals ``(n,)`` of points from the plane that they determine, in standard deviations.

    Sensed points are never exactly in a plane: without residuals the joint test would estimate too small a noise.

    Args:
        A: derivatives of the points' heights by the plane, divided by their standard deviations ``(n, 3)``.
    """
    free = np.linalg.svd(A)[0][:, 3:]
    off = free @ free.T @ np.where(np.arange(len(A)) % 2, -1.0, 1.0) if free.size else np.zeros(len(A))
    size = np.linalg.norm(off)
    return off * np.sqrt(free.shape[1]) / size if size > 1e-9 else off
