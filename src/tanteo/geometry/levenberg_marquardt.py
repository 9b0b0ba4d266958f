"""Maximize log densities by Gauss-Newton on a manifold, in NumPy, for one pose or a batch.

The compiled core has its counterpart in ``_core/solve/maximize.hpp``, for factors of a part at a pose. States here
have no factors in the core: averages of frames, sensed features under constraints, planes and edges of points, time
offsets, calibrated beams. Their equations are arrays over a batch, so a compiled loop would call back to Python at
each step. A single fit from a distant start uses SciPy instead.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from tanteo.geometry.typing import FloatArray

State = TypeVar("State")

_RIDGE = 1e-11
"""Ridge added to an information matrix of unit diagonal, far above rounding and far below measurements."""


def maximize(
    state: State,
    linearize: Callable[[State], tuple[FloatArray, FloatArray]],
    moved: Callable[[State, FloatArray], State],
    passes: int,
    tolerance: float = 0.0,
) -> tuple[State, FloatArray]:
    """Return the state after Gauss-Newton steps ``H step = g``, and the squared length of the last step.

    Lengths are ``step' H step``, in standard deviations of the state.

    Args:
        state: start of the iteration.
        linearize: information ``H`` ``(*batch, n, n)`` and gradient ``g`` ``(*batch, n)`` of the log density at a
            state; a prior in ``H`` alone damps the steps and does not move the maximum.
        moved: the state after a step ``(*batch, n)``, which it may shorten.
        passes: largest number of steps, at least one.
        tolerance: the iteration ends when all squared lengths are below it.
    """
    for _ in range(passes):
        H, g = linearize(state)
        step = scaled_solve(H, g)
        state = moved(state, step)
        squared = np.asarray(np.einsum("...i,...ij,...j->...", step, H, step))
        if np.all(squared < tolerance):
            break
    return state, squared


def scaled_solve(A: FloatArray, b: FloatArray) -> FloatArray:
    """Solve ``A x = b`` for positive semidefinite ``A``; ``x`` is about 0 along the null space of ``A``.

    Args:
        A: matrices ``(*batch, n, n)``.
        b: right-hand sides ``(*batch, n)``.
    """
    d = np.diagonal(A, axis1=-2, axis2=-1)
    s = 1 / np.sqrt(np.where(d > 0, d, 1.0))
    scaled = A * s[..., :, None] * s[..., None, :] + _RIDGE * np.eye(A.shape[-1])
    return s * np.linalg.solve(scaled, (s * b)[..., None])[..., 0]
